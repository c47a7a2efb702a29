"""A mission in more time: the same places and headings, velocities over the factor, accelerations over its square."""

import math
from pathlib import Path

import pytest
import yaml

from quadctl.missions import Mission, load_mission
from quadctl.missions.profile import sampled

PHASES = [
    {"name": "up", "kind": "move", "to_m": [0.5, -0.3, 1.0], "speed_m_s": 0.5, "hold_s": 1.0},
    {"name": "loop", "kind": "figure8", "north_m": 1.0, "east_m": 0.6, "lap_s": 4, "yaw_deg": 130},
    {"name": "jump", "kind": "step", "to_m": [1.0, 1.0, 1.2], "duration_s": 2.0, "yaw_deg": -70},
]


@pytest.fixture
def mission(tmp_path: Path) -> Mission:
    path = tmp_path / "m.yaml"
    path.write_text(yaml.safe_dump({"phases": PHASES, "limits": {"max_z_m": 2.0}, "yaw_rate_deg_s": 60}))
    return load_mission(path)


@pytest.mark.parametrize("factor", [1.6, 0.5])
def test_places_stay_and_derivatives_fall(mission: Mission, factor: float) -> None:
    slow = mission.slowed(factor)
    assert slow.duration_s == pytest.approx(factor * mission.duration_s)
    for k in range(200):
        t = mission.duration_s * (k + 0.31) / 200
        a, b = mission.reference(t), slow.reference(factor * t)
        assert b.position_m == pytest.approx(a.position_m, abs=1e-9)
        assert b.velocity_m_s == pytest.approx([v / factor for v in a.velocity_m_s], abs=1e-9)
        assert b.acceleration_m_s2 == pytest.approx([x / factor**2 for x in a.acceleration_m_s2], abs=1e-9)
        heading = slow.yaw_rad(factor * t, 0.7) - mission.yaw_rad(t, 0.7)
        assert math.remainder(heading, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)


def test_velocity_is_the_derivative_of_the_slowed_position(mission: Mission) -> None:
    slow, h = mission.slowed(1.7), 1e-4
    for t in (2.9, 8.3, 10.1):
        before, here, after = (slow.reference(t + dt) for dt in (-h, 0.0, h))
        for axis in range(3):
            by_difference = (after.position_m[axis] - before.position_m[axis]) / (2.0 * h)
            assert here.velocity_m_s[axis] == pytest.approx(by_difference, abs=1e-5)


def test_two_factors_are_one(mission: Mission) -> None:
    twice = mission.slowed(1.5).slowed(2.0)
    assert twice.time_scale == 3.0
    assert twice.reference(9.0) == mission.slowed(3.0).reference(9.0)


def test_a_jump_stays_a_jump(mission: Mission) -> None:
    """Demand of the last phase's first sample: a slower mission does not ask for less there."""

    def jump(of: Mission) -> tuple[float, float, float]:
        return sampled(of)[-1][0].jump_m

    assert jump(mission.slowed(2.0)) == pytest.approx(jump(mission), abs=0.02)
    assert math.hypot(*jump(mission)) > 0.5
