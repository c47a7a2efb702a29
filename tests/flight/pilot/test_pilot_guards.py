"""Guards in flight: a state that control cannot stand on, a limit that is left, a loop or a control that fails."""

import math
from typing import Any

import pytest

from quadctl.control import ControlOutput
from quadctl.control import control as sound_control
from quadctl.flight.pilot.guards import GuardLimits
from quadctl.flight.pilot.pilot import Pilot
from quadctl.flight.pilot.tick import Request, Stage, Tick
from quadctl.state import NAN, AttitudeTarget, VehicleState
from tests.support.watched import HAND_OVER, HARMLESS, LAND, RATE_HZ, Flight, at_stage, in_flight, plan_with, stall


@pytest.mark.parametrize("name", HAND_OVER)
def test_a_state_that_control_cannot_stand_on_is_answered_by_silence_and_a_landing(name: str) -> None:
    change, words = HAND_OVER[name]
    flight = Flight().show(change, in_flight(3.0)).fly()
    assert words in flight.pilot.ended
    (asked,) = flight.watch.with_request(Request.LAND)
    assert asked.target is None
    at = flight.watch.ticks.index(asked)
    assert all(t.target is None for t in flight.watch.ticks[at:])
    assert flight.watch.ticks[at - 1].target is not None
    assert asked.time_s == pytest.approx(flight.watch.first(in_flight(3.0)).time_s + 0.02)  # in the very next tick
    assert flight.at_rest


@pytest.mark.parametrize("name", LAND)
def test_a_limit_that_is_left_is_answered_by_a_landing(name: str) -> None:
    change, words = LAND[name]
    plan = plan_with(guards=GuardLimits(min_battery_v=13.5))
    flight = Flight(plan).show(change, in_flight(3.0)).fly()
    assert words in flight.pilot.ended
    (asked,) = flight.watch.with_request(Request.LAND)
    assert asked.target is not None
    assert flight.at_rest
    assert not any(t.target for t in flight.watch.ticks[flight.watch.ticks.index(asked) + 1 :])  # LAND was taken


@pytest.mark.parametrize("name", HARMLESS)
def test_what_control_does_not_stand_on_may_be_missing(name: str) -> None:
    assert Flight().show(HARMLESS[name]).fly().pilot.ended == "completed"


def test_the_fault_of_one_tick_is_enough_and_its_end_changes_nothing() -> None:
    flight = Flight().show(HAND_OVER["one nan"][0], in_flight(3.0), until=0.02).fly()
    assert "not a number" in flight.pilot.ended
    assert flight.at_rest


@pytest.mark.parametrize("name", ["no position", "stale position", "heartbeat", "tilt"])
def test_the_same_guards_hold_while_spooling_up(name: str) -> None:
    change, words = HAND_OVER[name]
    flight = Flight().show(change, at_stage(Stage.SPOOL_UP, 10)).fly()
    assert words in flight.pilot.ended
    assert Stage.FLY not in flight.watch.stages()
    assert flight.at_rest


@pytest.mark.parametrize("name", [*HAND_OVER, *LAND])
def test_while_the_land_mode_is_awaited_a_fault_silences_and_a_limit_does_not(name: str) -> None:
    """The landing has been asked for, and the autopilot takes its time."""
    change = {**HAND_OVER, **LAND}[name][0]
    flight = Flight(plan_with(guards=GuardLimits(min_battery_v=13.5)))
    flight.autopilot.ignored.add("LAND")
    flight.show(change, at_stage(Stage.LAND, 10)).fly()
    assert flight.pilot.ended == "completed"
    landing = [t for t in flight.watch.ticks if t.stage is Stage.LAND]
    held = sum(t.target is not None for t in landing)
    assert held == pytest.approx(10 if name in HAND_OVER else 2.0 * RATE_HZ, abs=1)
    assert flight.autopilot.mode == "HOLD"  # the silence triggered the failsafe, which landed it
    assert flight.at_rest


# --- the loop itself -------------------------------------------------------------------------------------------------


def late_pilot(late_s: float) -> type[Pilot]:
    """A pilot one of whose ticks in flight comes late."""

    class LatePilot(Pilot):
        def tick(self, state: VehicleState, late_s_: float) -> Tick:
            return super().tick(state, late_s if 3.0 < self.flight_s < 3.03 else late_s_)

    return LatePilot


def test_a_tick_that_is_late_by_the_limit_is_flown() -> None:
    assert Flight(pilot_class=late_pilot(0.2)).fly().pilot.ended == "completed"


def test_a_tick_that_is_later_hands_over() -> None:
    flight = Flight(pilot_class=late_pilot(0.21)).fly()
    assert flight.pilot.ended == "the control loop stalled for 0.21 s"
    assert flight.watch.with_request(Request.LAND)[0].target is None
    assert flight.at_rest


def test_a_stall_that_nobody_counted_is_seen_in_the_clock_of_the_state() -> None:
    flight = Flight()
    flight.when(in_flight(3.0), stall(flight, 0.5)).fly()
    assert flight.pilot.ended == "the control loop stalled for 0.48 s"  # beyond the period of a tick
    assert flight.at_rest


def test_after_a_long_stall_the_autopilots_failsafe_is_left_alone() -> None:
    flight = Flight()
    flight.when(in_flight(3.0), stall(flight, 1.5)).fly()
    assert flight.pilot.ended == "the control loop stalled for 1.48 s, then the autopilot left offboard for RTL"
    assert flight.autopilot.asked == ["OFFBOARD", "ARM"]
    assert flight.at_rest


def test_a_target_that_could_not_be_sent_hands_over() -> None:
    flight = Flight()
    flight.when(in_flight(3.0), lambda: flight.pilot.fail("the cable is gone")).fly()
    assert flight.pilot.ended == "the cable is gone"
    assert flight.watch.with_request(Request.LAND)[0].target is None


@pytest.mark.parametrize("stage", [Stage.FLY, Stage.LAND])
@pytest.mark.parametrize("throttle", [NAN, math.inf])
def test_a_target_that_is_no_number_is_not_sent_whatever_made_it(
    monkeypatch: pytest.MonkeyPatch, stage: Stage, throttle: float
) -> None:
    flight = Flight()
    if stage is Stage.LAND:
        flight.autopilot.ignored.add("LAND")
    broken = False

    def control(*arguments: Any) -> ControlOutput:
        output = sound_control(*arguments)
        return output._replace(target=AttitudeTarget(output.target.attitude, throttle)) if broken else output

    def break_it() -> None:
        nonlocal broken
        broken = True

    monkeypatch.setattr("quadctl.flight.pilot.steering.control", control)
    flight.when(in_flight(3.0) if stage is Stage.FLY else at_stage(Stage.LAND, 5), break_it).fly()
    assert flight.at_rest
    if stage is Stage.FLY:
        assert flight.pilot.ended == "control gave a value that is not a number"
        assert len(flight.watch.with_request(Request.LAND)) == 1
    else:
        assert flight.pilot.ended == "completed"


def test_a_hold_target_that_is_no_number_still_lands(monkeypatch: pytest.MonkeyPatch) -> None:
    """Control breaks in the very tick in which the landing begins."""
    flight = Flight()

    def control(setpoint: Any, *rest: Any) -> ControlOutput:
        output = sound_control(setpoint, *rest)
        begins = flight.pilot.stage is Stage.LAND
        return output._replace(target=AttitudeTarget(output.target.attitude, NAN)) if begins else output

    monkeypatch.setattr("quadctl.flight.pilot.steering.control", control)
    flight.fly()
    (asked,) = flight.watch.with_request(Request.LAND)
    assert asked.target is None
    assert flight.at_rest


def test_the_pilot_never_calls_control_on_a_state_that_is_no_number(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its memory would carry the nan to all later ticks."""

    def control(setpoint: Any, state: VehicleState, memory: Any, dt: float, *rest: Any) -> ControlOutput:
        assert state.finite
        assert all(map(math.isfinite, (*setpoint.position_ned_m, setpoint.yaw_rad, dt)))
        return sound_control(setpoint, state, memory, dt, *rest)

    monkeypatch.setattr("quadctl.flight.pilot.steering.control", control)
    for when in (at_stage(Stage.START), at_stage(Stage.SPOOL_UP, 49), in_flight(2.0), at_stage(Stage.LAND, 3)):
        for name in ("no position", "no velocity", "no attitude"):
            flight = Flight()
            flight.autopilot.ignored.add("LAND")
            flight.show(HAND_OVER[name][0], when, until=0.1).fly()


# --- control that goes wrong -----------------------------------------------------------------------------------------


def test_control_that_fails_hands_over(monkeypatch: pytest.MonkeyPatch) -> None:
    flight = Flight()

    def control(*arguments: Any) -> ControlOutput:
        if flight.pilot.flight_s >= 3.0:
            raise ZeroDivisionError("division by zero")
        return sound_control(*arguments)

    monkeypatch.setattr("quadctl.flight.pilot.steering.control", control)
    flight.fly()
    assert flight.pilot.ended == "control failed (division by zero)"
    assert flight.watch.with_request(Request.LAND)[0].target is None
    assert flight.at_rest
