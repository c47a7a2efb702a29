"""Margins of the loop agree with what is worked out by hand, and the gains that are proposed keep them."""

import math

import pytest

from quadctl.control import ControllerSettings
from quadctl.control.margins import LoopGains, LoopLags, margins
from quadctl.control.tuning import LagsFound, horizontal_loop, tuned, vertical_loop
from quadctl.vehicle import AttitudeResponse, AxisResponse


def lagging(roll_rad_s: float, pitch_rad_s: float, age_s: float = 0.0, rotors_s: float = 0.04) -> LagsFound:
    roll, pitch = AxisResponse(frequency_rad_s=roll_rad_s), AxisResponse(frequency_rad_s=pitch_rad_s)
    return LagsFound(age_s, AttitudeResponse(roll=roll, pitch=pitch), rotors_s)


def test_an_integrator_behind_a_delay_has_its_textbook_margins() -> None:
    """L = e^(-s d) / s: phase 90 deg - d at 1 rad/s, gain pi / (2 d), delay pi / 2 - d."""
    found = margins(LoopGains(0.0, 1.0), LoopLags(delay_s=0.5))
    assert found.stable
    assert found.phase_deg == pytest.approx(90.0 - math.degrees(0.5), rel=1e-3)
    assert found.gain == pytest.approx(math.pi, rel=1e-3)
    assert found.delay_s == pytest.approx(0.5 * math.pi - 0.5, rel=1e-3)


def test_two_poles_without_delay_never_swing() -> None:
    """L = p / (s (tau s + 1)) with p tau = 1 / 4, whose two poles of 1 + L coincide: S peaks at 2 / sqrt(3)."""
    found = margins(LoopGains(0.0, 2.5), LoopLags(time_constant_s=0.1))
    assert found.gain == math.inf
    assert found.sensitivity_peak == pytest.approx(2.0 / math.sqrt(3.0), rel=1e-3)


@pytest.mark.parametrize(("delay_s", "stable"), [(1.55, True), (1.60, False)])
def test_a_loop_beyond_its_delay_margin_is_not_stable(delay_s: float, stable: bool) -> None:
    """L = e^(-s d) / s swings from d = pi / 2 = 1.571 s on."""
    found = margins(LoopGains(0.0, 1.0), LoopLags(delay_s=delay_s))
    assert found.stable is stable
    assert (found.delay_s > 0.0) is stable


def test_the_margin_of_delay_is_the_delay_that_makes_the_whole_loop_swing() -> None:
    gains, lags = LoopGains(0.8, 2.0, 0.4, 0.2), LoopLags(0.06, 10.0, 0.9, 0.03)
    left_s = margins(gains, lags).delay_s
    assert margins(gains, lags._replace(delay_s=0.06 + 0.98 * left_s)).stable
    assert not margins(gains, lags._replace(delay_s=0.06 + 1.02 * left_s)).stable


def test_gains_follow_from_all_lags_together() -> None:
    """Attitude (2 / 8 + 2 / 10) / 2 = 0.225 s, state 0.025 s old: Kv = 0.5 / 0.25 = 2, Kp = 0.8, as by default."""
    new = tuned(ControllerSettings(position_p=3.0), lagging(8.0, 10.0, 0.025))
    assert new.velocity_horizontal == ControllerSettings().velocity_horizontal
    assert new.position_p == pytest.approx(0.8)
    # Kv of the rotors' lag, 0.5 / 0.065 = 7.7, is more than today's 4
    assert (new.velocity_vertical, new.position_p_vertical) == (ControllerSettings().velocity_vertical, 0.95)


def test_slow_rotors_lower_the_vertical_gains() -> None:
    new = tuned(ControllerSettings(), lagging(12.0, 12.0, rotors_s=0.25))
    assert (new.velocity_vertical.p, new.velocity_vertical.i, new.position_p_vertical) == (2.0, 0.5, 0.8)


def test_a_force_without_leaning_does_not_wait_for_the_attitude() -> None:
    full = ControllerSettings(actuation="full")
    new = tuned(full, lagging(2.0, 2.0, rotors_s=0.2))
    assert new.velocity_horizontal.p == 2.5
    assert horizontal_loop(new, lagging(2.0, 2.0, rotors_s=0.2))[1].frequency_rad_s is None


@pytest.mark.parametrize("found", [lagging(4.0, 5.0), lagging(10.0, 8.0, 0.1), lagging(30.0, 40.0, 0.02)])
def test_proposed_gains_are_robust_for_slow_and_quick_vehicles(found: LagsFound) -> None:
    new = tuned(ControllerSettings(), found)
    for of_axis in (horizontal_loop(new, found), vertical_loop(new, found)):
        loop = margins(*of_axis)
        assert loop.stable
        assert loop.sensitivity_peak < 2.0  # Skogestad and Postlethwaite: 2 or less, which is a gain of 2 and 30 deg
        assert loop.gain > 2.0
        assert loop.phase_deg > 30.0
        assert loop.delay_s > found.vertical_s


def test_the_slower_axis_is_judged() -> None:
    _, lags = horizontal_loop(ControllerSettings(), lagging(12.0, 7.0))
    assert lags.frequency_rad_s == 7.0
