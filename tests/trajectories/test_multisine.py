"""The multisine trajectory: within its limits, smooth, different in every axis; and the missions that fly it."""

import itertools
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from quadctl.errors import SettingsError
from quadctl.missions import load_mission
from quadctl.settings import validate
from quadctl.trajectories.multisine import Multisine
from tests.support.places import ROOT

MISSIONS = ROOT / "missions"
START = (1.0, 2.0, 1.5)
SHORT = {"duration_s": 20.0, "slowest_hz": 0.2, "fastest_hz": 0.8}


def waves(**keys: Any) -> Multisine:
    return validate({**SHORT, **keys}, Multisine, "test")


def flown(trajectory: Multisine, step_s: float = 0.01) -> tuple[Any, Any, Any, Any]:
    """Time, and position from the start, velocity, acceleration, shape (n, 3)."""
    t = np.arange(0.0, trajectory.duration_s(START) + step_s, step_s)
    references = [trajectory.reference(float(at), START) for at in t]
    position, velocity, acceleration = (np.array([r[i] for r in references]) for i in range(3))
    return t, position - START, velocity, acceleration


@given(
    st.tuples(st.floats(0.0, 5.0), st.floats(0.0, 5.0), st.floats(0.0, 2.0)),
    st.floats(0.2, 5.0),
    st.floats(0.2, 5.0),
    st.integers(1, 8),
)
@settings(max_examples=25)
def test_it_stays_within_amplitude_speed_and_acceleration(
    amplitude: tuple[float, float, float], speed: float, push: float, count: int
) -> None:
    _, position, velocity, acceleration = flown(
        waves(amplitude_m=amplitude, speed_m_s=speed, acceleration_m_s2=push, waves=count), 0.05
    )
    assert (np.abs(position).max(axis=0) <= np.array(amplitude) * 1.005 + 1e-9).all()
    assert np.linalg.norm(velocity, axis=1).max() <= speed * 1.005
    assert np.linalg.norm(acceleration, axis=1).max() <= push * 1.005


def test_it_reaches_the_amplitude_where_no_limit_is_in_the_way() -> None:
    _, position, _, _ = flown(waves(amplitude_m=[0.5, 0.4, 0.1], speed_m_s=20, acceleration_m_s2=8))
    assert np.abs(position).max(axis=0) == pytest.approx([0.5, 0.4, 0.1], rel=0.01)


def test_limits_shrink_all_axes_alike() -> None:
    free, held = (flown(waves(amplitude_m=[2, 2, 0.5], speed_m_s=v, acceleration_m_s2=8))[1] for v in (20.0, 0.5))
    shares = np.abs(held).max(axis=0) / np.abs(free).max(axis=0)
    assert shares == pytest.approx([shares[0]] * 3)
    assert shares[0] < 0.5


@given(st.floats(0.01, 19.99))
def test_velocity_and_acceleration_are_derivatives(t: float) -> None:
    h = 1e-5
    before, here, after = (waves().reference(t + dt, START) for dt in (-h, 0.0, h))
    for axis in range(3):
        climbed = (after.position_m[axis] - before.position_m[axis]) / (2 * h)
        pushed = (after.velocity_m_s[axis] - before.velocity_m_s[axis]) / (2 * h)
        assert here.velocity_m_s[axis] == pytest.approx(climbed, abs=1e-6)
        assert here.acceleration_m_s2[axis] == pytest.approx(pushed, abs=1e-4)


def test_it_begins_and_ends_at_rest_where_it_began() -> None:
    for t in (0.0, 1e-4, 20.0 - 1e-4, 20.0, 99.0):
        reference = waves().reference(t, START)
        assert reference.position_m == pytest.approx(START, abs=1e-6)
        assert reference.velocity_m_s == pytest.approx((0, 0, 0), abs=1e-5)
        assert reference.acceleration_m_s2 == pytest.approx((0, 0, 0), abs=1e-2)
    assert waves().end_m(START) == START


def test_no_axis_can_be_mistaken_for_another() -> None:
    _, _, velocity, acceleration = flown(waves(duration_s=60))
    for motion in (velocity, acceleration):
        alike = np.corrcoef(motion.T)
        assert np.abs(alike[~np.eye(3, dtype=bool)]).max() < 0.25


def test_frequencies_are_those_asked_for() -> None:
    """Outside the band from the slowest to the fastest wave there is next to nothing."""
    t, _, velocity, _ = flown(waves(duration_s=100))
    power = np.abs(np.fft.rfft(velocity, axis=0)) ** 2
    hz = np.fft.rfftfreq(len(t), 0.01)
    inside = (hz > 0.15) & (hz < 0.85)
    assert (power[inside].sum(axis=0) > 0.99 * power.sum(axis=0)).all()


def test_an_axis_of_no_amplitude_rests() -> None:
    _, position, _, _ = flown(waves(amplitude_m=[0.5, 0, 0]))
    assert np.abs(position[:, 0]).max() > 0.4
    assert not position[:, 1:].any()
    assert not flown(waves(amplitude_m=[0, 0, 0]))[1].any()


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        ({"slowest_hz": 2.0, "fastest_hz": 1.0}, "fastest_hz is 1, expected at least slowest_hz = 2"),
        ({"duration_s": 4.0}, "fade_s is 3, expected at most half of duration_s = 4"),
        ({"amplitude_m": [-1, 1, 1]}, "amplitude_m"),
        ({"waves": 0}, "waves is 0"),
        ({"acceleration_m_s2": 9.0}, "acceleration_m_s2 is 9"),
    ],
    ids=str,
)
def test_what_cannot_be_flown_is_one_sentence(keys: dict[str, Any], expected: str) -> None:
    with pytest.raises(SettingsError, match=expected):
        waves(**keys)


def test_the_excitation_leans_little_and_has_several_speeds() -> None:
    mission = load_mission(MISSIONS / "excitation.yaml")
    wave = mission.phases[1]
    assert (wave.name, wave.end_s - wave.start_s) == ("multisine", 60)
    _, position, velocity, acceleration = flown(waves(**wave.trajectory.model_dump(by_alias=True)), 0.05)
    assert np.abs(position).max(axis=0) == pytest.approx([2, 2, 0.3], rel=0.02)
    assert math.degrees(math.atan(np.linalg.norm(acceleration, axis=1).max() / 9.8)) < 18
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    assert [(speed > v).mean() > 0.1 for v in (0.4, 0.8, 1.2)] == [True] * 3


def test_the_twins_differ_in_height_or_heading_alone() -> None:
    names = ("excitation", "excitation_high", "excitation_low", "excitation_east", "excitation_west")
    plain, high, low, east, west = (load_mission(MISSIONS / f"{name}.yaml") for name in names)
    assert [m.offset_up_m for m in (plain, high, low, east, west)] == [0, 0.8, -0.5, 0, 0]
    headings = [m.yaw_rad(m.duration_s, 0.3) for m in (plain, high, low, east, west)]
    assert headings == pytest.approx([0.3, 0.3, 0.3, math.pi / 2, -math.pi / 2])
    for a, b in itertools.pairwise((plain, high, low, east, west)):
        assert a.phases[1].trajectory == b.phases[1].trajectory
