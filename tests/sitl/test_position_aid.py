"""GPS or motion capture is lost: the mocks do as was measured on the real autopilots."""

import math

import pytest

from quadctl.sitl.rules.copter import DISTRUST_S, UNAIDED_S, SimulatedCopter
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.state import VehicleState
from quadctl.vehicle import load_vehicle
from tests.support.places import ROOT

RAPTOR = load_vehicle(ROOT / "config" / "vehicles" / "raptor.yaml")


def after(seconds: float, autopilot: SimulatedAutopilot) -> VehicleState:
    """Estimate so long after the loss."""
    autopilot.step(1.0)
    autopilot.lose_position_aid()
    autopilot.step(1.0 + seconds)
    return autopilot.estimate()


@pytest.mark.parametrize(("seconds", "std_m"), [(0.0, 0.29), (2.0, 0.56), (5.0, 1.46)])
def test_the_accuracy_that_px4_states_grows_as_measured(seconds: float, std_m: float) -> None:
    assert after(seconds, SimulatedAutopilot(RAPTOR)).horizontal_std_m == pytest.approx(std_m, abs=0.02)


def test_the_position_drifts_smoothly_by_as_much_as_measured() -> None:
    state = after(5.0, SimulatedAutopilot(RAPTOR))
    assert 1.1 < math.hypot(*state.position_ned_m[:2]) < 2.3
    assert 0.05 < math.hypot(*after(1.0, SimulatedAutopilot(RAPTOR)).position_ned_m[:2]) < 0.28


@pytest.mark.parametrize("trusted_s", [5.0, 1.0])
def test_px4_trusts_its_dead_reckoning_for_its_parameter_and_says_nothing_of_its_sensors(trusted_s: float) -> None:
    def lost(seconds: float) -> VehicleState:
        px4 = SimulatedAutopilot(RAPTOR)
        px4.parameters["EKF2_NOAID_TOUT"] = 1e6 * trusted_s
        return after(seconds, px4)

    assert lost(trusted_s - 0.1).estimator_ok
    assert not lost(trusted_s + 0.1).estimator_ok
    assert not lost(trusted_s + 0.1).aid_lost


def test_ardupilot_says_that_its_gps_has_no_fix_and_trusts_its_estimate_for_seven_seconds() -> None:
    assert not after(0.3, SimulatedCopter(RAPTOR)).aid_lost
    state = after(0.5, SimulatedCopter(RAPTOR))
    assert state.aid_lost
    assert state.estimator_ok
    assert after(DISTRUST_S - 0.1, SimulatedCopter(RAPTOR)).estimator_ok
    assert not after(DISTRUST_S + 0.1, SimulatedCopter(RAPTOR)).estimator_ok


def test_ardupilots_own_failsafe_lands_it_then_and_says_why() -> None:
    copter = SimulatedCopter(RAPTOR)
    assert copter.request_mode("GUIDED") is None
    assert copter.request_arm() is None
    assert copter.request_take_off(2.0) is None
    after(UNAIDED_S - 0.1, copter)
    assert copter.mode == "GUIDED"
    copter.step(1.0 + UNAIDED_S + 0.1)
    assert copter.mode == "LAND"
    assert [text for _, text in copter.said] == ["EKF variance"]
