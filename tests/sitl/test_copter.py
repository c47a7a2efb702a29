"""The simulated Copter keeps ArduPilot's rules."""

import math

import pytest

from quadctl.sitl.rules.copter import SimulatedCopter, SimulatedCopter47
from quadctl.state import AttitudeTarget
from quadctl.vehicle import load_vehicle
from tests.support.links import LEVEL, RAPTOR

VEHICLE = load_vehicle(RAPTOR)


def copter_in_guided(kind: type[SimulatedCopter] = SimulatedCopter) -> SimulatedCopter:
    copter = kind(VEHICLE)
    copter.parameters["GUID_OPTIONS"] = 8.0
    assert copter.request_mode("GUIDED") is None
    assert copter.request_arm() is None
    return copter


def run(copter: SimulatedCopter, seconds: float, target: AttitudeTarget | None = None) -> None:
    for _ in range(round(seconds / 0.02)):
        if target is not None:
            copter.set_attitude_target(target)
        copter.step(copter.time_s + 0.02)


def test_a_target_in_the_middle_of_a_take_off_ends_it() -> None:
    copter = copter_in_guided()
    assert copter.request_take_off(1.0) is None
    run(copter, 0.1, AttitudeTarget(LEVEL, 0.0))
    run(copter, 2.0, AttitudeTarget(LEVEL, 0.0))
    assert copter.landed
    run(copter, 9.0, AttitudeTarget(LEVEL, 0.0))
    assert not copter.armed  # DISARM_DELAY


def test_without_targets_it_levels_after_its_time_out_and_stays() -> None:
    copter = copter_in_guided()
    copter.request_take_off(1.0)
    run(copter, 4.0)
    assert -copter.body.position[2] == pytest.approx(1.05, abs=0.15)
    tilted = AttitudeTarget((math.cos(0.05), math.sin(0.05), 0.0, 0.0), VEHICLE.hover_throttle)
    run(copter, 0.5, tilted)
    run(copter, 2.9)
    assert abs(copter.body.attitude[1]) > 0.03
    run(copter, 1.0)
    assert abs(copter.body.attitude[1]) < 0.01
    run(copter, 3.0)
    assert copter.mode == "GUIDED"
    assert not copter.landed


def test_thrust_is_a_climb_rate_with_the_bit_clear() -> None:
    copter = copter_in_guided()
    copter.request_take_off(1.0)
    run(copter, 4.0)
    copter.parameters["GUID_OPTIONS"] = 0.0
    run(copter, 2.0, AttitudeTarget(LEVEL, 0.6))  # a tenth over the middle of the range: 0.5 m/s
    assert copter.body.velocity[2] == pytest.approx(-0.5, abs=0.1)


def test_lifting_off_by_targets_blocks_the_next_arming() -> None:
    copter = copter_in_guided()
    run(copter, 1.5, AttitudeTarget(LEVEL, 1.1 * VEHICLE.hover_throttle))
    assert not copter.landed
    copter.request_mode("LAND")
    run(copter, 10.0)
    assert not copter.armed
    copter.request_mode("GUIDED")
    assert copter.request_arm() == "PreArm: Internal errors 0x4000000"


@pytest.mark.parametrize(("kind", "climbs_m"), [(SimulatedCopter, 2.5), (SimulatedCopter47, 0.0)], ids=["4.5", "4.7"])
def test_a_return_near_home_is_bounded_by_a_cone(kind: type[SimulatedCopter], climbs_m: float) -> None:
    copter = copter_in_guided(kind)
    copter.request_take_off(1.0)
    run(copter, 4.0)
    highest_m = before_m = -copter.body.position[2]
    copter.request_mode("RTL")
    while not copter.landed:
        run(copter, 0.5)
        highest_m = max(highest_m, -copter.body.position[2])
    assert highest_m - before_m == pytest.approx(climbs_m, abs=0.35)


def test_a_return_from_afar_climbs_to_the_cone() -> None:
    copter = copter_in_guided(SimulatedCopter47)
    copter.request_take_off(1.0)
    run(copter, 4.0)
    copter.body.position = (2.0, -1.5, copter.body.position[2])  # 2.5 m from home, and 7.5 m on the cone
    copter.request_mode("RTL")
    run(copter, 6.5)
    assert copter.body.position == pytest.approx((2.0, -1.5, -7.5), abs=0.3)  # it climbs on the spot
    run(copter, 20.0)
    assert copter.landed
    assert copter.body.position[:2] == pytest.approx((0.0, 0.0), abs=0.3)


@pytest.mark.parametrize("fails", [True, False], ids=["failsafe", "command"])
def test_the_landing_of_a_failsafe_keeps_its_height_first(fails: bool) -> None:
    copter = copter_in_guided()
    copter.request_take_off(2.0)
    run(copter, 6.0)
    before_m = -copter.body.position[2]
    copter.fail_battery() if fails else copter.request_mode("LAND")
    run(copter, 3.5)
    assert copter.mode == "LAND"
    assert -copter.body.position[2] == pytest.approx(before_m if fails else before_m - 1.7, abs=0.25)
