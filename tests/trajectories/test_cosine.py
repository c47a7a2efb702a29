"""The cosine trajectory against its formula, and the missions that fly it."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from quadctl.missions import load_mission
from quadctl.settings import validate
from quadctl.trajectories.cosine import Cosine
from tests.support.places import ROOT

MISSIONS = ROOT / "missions"
TOP = (1.0, 2.0, 1.0)
KEYS = {"centre_z_m": 0.55, "amplitude_m": 0.45, "period_s": 5.0, "cycles": 2}


def wave() -> Cosine:
    return validate(KEYS, Cosine, "test")


def test_quarters_of_a_period() -> None:
    """Top, down through the middle at 2 pi / 5 * 0.45 m/s, bottom, up through the middle."""
    top, down, bottom, up = (wave().reference(t, TOP) for t in (0.0, 1.25, 2.5, 3.75))
    assert [r.position_m for r in (top, down, bottom, up)] == [
        pytest.approx((1.0, 2.0, z)) for z in (1.0, 0.55, 0.1, 0.55)
    ]
    speed, pull = 0.4 * math.pi * 0.45, (0.4 * math.pi) ** 2 * 0.45
    assert [r.velocity_m_s[2] for r in (top, down, bottom, up)] == pytest.approx([0.0, -speed, 0.0, speed])
    assert [r.acceleration_m_s2[2] for r in (top, down, bottom, up)] == pytest.approx([-pull, 0.0, pull, 0.0])


def test_it_ends_at_rest_at_the_top_after_whole_cycles() -> None:
    assert wave().duration_s(TOP) == 10.0
    assert wave().end_m(TOP) == pytest.approx((1.0, 2.0, 1.0))
    assert wave().reference(99.0, TOP)[:3] == ((1.0, 2.0, pytest.approx(1.0)), (0, 0, 0), (0, 0, 0))


def test_lifting_raises_the_middle_alone() -> None:
    lifted = wave().lifted(1.0)
    assert lifted.reference(2.5, TOP).position_m[2] == pytest.approx(1.1)
    assert lifted.reference(0.0, TOP).position_m[2] == pytest.approx(2.0)


@given(st.floats(0.01, 9.99))
def test_velocity_and_acceleration_are_derivatives(t: float) -> None:
    h = 1e-5
    before, here, after = (wave().reference(t + dt, TOP) for dt in (-h, 0.0, h))
    assert here.velocity_m_s[2] == pytest.approx((after.position_m[2] - before.position_m[2]) / (2 * h), abs=1e-6)
    assert here.acceleration_m_s2[2] == pytest.approx(
        (after.velocity_m_s[2] - before.velocity_m_s[2]) / (2 * h), abs=1e-6
    )


def test_the_mission_is_that_of_the_paper() -> None:
    mission = load_mission(MISSIONS / "garofano_cosine.yaml")
    phase = mission.phases[-1]
    assert phase.name == "cosine"
    for t in (0.0, 0.7, 2.5, 31.0):
        expected = 0.55 + 0.45 * math.cos(2.0 * math.pi * t / 5.0)
        assert mission.reference(phase.start_s + t).position_m == pytest.approx((0.0, 0.0, expected))


def test_the_reference_does_not_jump_into_the_phase() -> None:
    mission = load_mission(MISSIONS / "garofano_cosine.yaml")
    begin = mission.phases[-1].start_s
    assert mission.reference(begin - 1e-9).position_m == pytest.approx(mission.reference(begin).position_m)


def test_the_high_twin_differs_in_height_alone() -> None:
    low, high = (load_mission(MISSIONS / f"garofano_cosine{twin}.yaml") for twin in ("", "_high"))
    for t in (0.0, 1.0, 2.5, 17.3):
        z, high_z = (m.reference(m.phases[-1].start_s + t).position_m[2] for m in (low, high))
        assert high_z == pytest.approx(z + 1.0)
