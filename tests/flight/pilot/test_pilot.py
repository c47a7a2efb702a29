"""The pilot in lockstep with the simulated autopilot: the flight as it should be, and every fault at any time."""

import math
from collections.abc import Callable
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from quadctl.effects.ground_effect import Sanchez
from quadctl.flight.pilot.guards import GuardLimits
from quadctl.flight.pilot.tick import Request, Stage
from quadctl.frames import euler_from_quaternion
from quadctl.missions.mission import Turn
from quadctl.model import Provenance, StackedEffect
from tests.support.watched import (
    HAND_OVER,
    HARMLESS,
    LAND,
    RATE_HZ,
    Change,
    Flight,
    hop,
    in_flight,
    moved,
    plan_with,
    stall,
    take_over,
)


def test_a_short_hop_is_completed() -> None:
    flight = Flight().fly()
    assert flight.pilot.ended == "completed"
    assert flight.pilot.phases_flown == ["takeoff", "hover", "down"]
    assert flight.watch.stages() == [
        Stage.STREAM,
        Stage.START,
        Stage.SPOOL_UP,
        Stage.FLY,
        Stage.LAND,
        Stage.DONE,
    ]
    assert flight.at_rest
    assert flight.autopilot.asked == ["OFFBOARD", "ARM", "LAND"]
    assert flight.pilot.flight_s == pytest.approx(hop().mission.duration_s, abs=0.03)


def test_the_vehicle_goes_where_it_is_told() -> None:
    flight = Flight().fly()
    for tick in flight.watch.ticks:
        if tick.stage is Stage.FLY:
            assert tick.setpoint is not None
            assert math.dist(tick.setpoint.position_ned_m, tick.state.position_ned_m) < 0.12
    hover_end = [t for t in flight.watch.ticks if t.phase == "hover"][-1]
    assert -hover_end.state.position_ned_m[2] == pytest.approx(0.6, abs=0.03)


def test_the_streams_of_a_start_are_idle_and_come_first() -> None:
    ticks = Flight().fly().watch.ticks
    offboard = next(i for i, t in enumerate(ticks) if Request.OFFBOARD in t.requests)
    arm = next(i for i, t in enumerate(ticks) if Request.ARM in t.requests)
    assert offboard / RATE_HZ >= 1.0
    assert arm > offboard
    assert ticks[arm].state.mode == "OFFBOARD"
    assert all(t.target is not None and t.target.throttle == 0.0 for t in ticks[1 : arm + 1])


def test_throttle_rises_to_half_of_hover_before_control_begins() -> None:
    ticks = Flight().fly().watch.ticks
    throttles = [t.target.throttle for t in ticks if t.stage is Stage.SPOOL_UP and t.target is not None]
    vehicle = hop().body.vehicle
    hover = vehicle.throttle.offset + vehicle.throttle.per_newton * vehicle.weight_n
    assert throttles == sorted(throttles)
    assert throttles[-1] == pytest.approx(0.5 * hover, rel=0.05)
    assert len(throttles) == pytest.approx(RATE_HZ, abs=2)


@pytest.mark.parametrize("heading_deg", [60.0, -179.0])
def test_the_heading_at_take_off_is_kept(heading_deg: float) -> None:
    flight = Flight()
    half = 0.5 * math.radians(heading_deg)
    flight.autopilot.body.attitude = (math.cos(half), 0.0, 0.0, math.sin(half))
    flight.autopilot.step(0.1)
    flight.fly()
    assert flight.pilot.ended == "completed"
    for tick in flight.watch.ticks:
        if tick.target is not None:
            yaw = euler_from_quaternion(tick.target.attitude)[2]
            assert math.cos(yaw - math.radians(heading_deg)) > math.cos(math.radians(1.0))


def test_the_missions_heading_is_turned_to_in_flight_and_kept_for_the_landing() -> None:
    turning = hop().mission._replace(turns=(Turn(0.0, 1.0),), yaw_rate_rad_s=0.5)
    flight = Flight(hop()._replace(mission=turning)).fly()
    assert flight.pilot.ended == "completed"
    begin_s = next(t.time_s for t in flight.watch.ticks if t.stage is Stage.FLY)
    for tick in flight.watch.ticks:
        if tick.target is not None:
            yaw = euler_from_quaternion(tick.target.attitude)[2]
            in_flight = tick.stage in (Stage.FLY, Stage.LAND)
            turned = min(0.5 * (tick.time_s - begin_s), 1.0) if in_flight else 0.0
            assert yaw == pytest.approx(turned, abs=0.02)
    last = [t for t in flight.watch.ticks if t.stage is Stage.FLY][-1]
    assert euler_from_quaternion(last.state.attitude)[2] == pytest.approx(1.0, abs=0.05)


def test_positions_are_relative_to_where_the_vehicle_stood() -> None:
    flight = Flight().show(moved(100.0, -50.0, 0.0)).fly()
    assert flight.pilot.ended == "completed"
    assert flight.at_rest
    assert math.hypot(*flight.autopilot.body.position[:2]) < 0.1


def test_heights_are_those_above_where_it_took_off_where_the_frame_knows_no_ground() -> None:
    flight = Flight(plan_with(height_datum="takeoff")).show(moved(0.0, 0.0, 7.0)).fly()
    assert flight.pilot.ended == "completed"
    hover_end = [t for t in flight.watch.ticks if t.phase == "hover"][-1]
    assert hover_end.state.position_ned_m[2] == pytest.approx(7.0 - 0.6, abs=0.03)
    assert flight.watch.ticks[-1].ground_down_m == pytest.approx(7.0, abs=0.01)


def test_a_compensator_beyond_its_data_fades_out_and_the_log_says_so() -> None:
    item = StackedEffect(Sanchez(), Provenance(height_m=(0.05, 0.2)))
    model = replace(hop().body, stack=(item,))
    flight = Flight(hop()._replace(compensator=model)).fly()
    assert flight.pilot.ended == "completed"
    events = [e for t in flight.watch.ticks for e in t.events]
    assert [e.answer for e in events] == ["fade out", "land"]
    faded = flight.watch.first(lambda t: bool(t.events))
    assert faded.output is not None
    assert faded.output.compensation.trust < 1.0
    hover = flight.watch.first(in_flight(4.0))
    assert hover.output is not None
    assert hover.output.compensation.trust == 0.0
    assert hover.output.compensation.thrust_ratio == 1.0


FAULTS = [*(change for change, _ in HAND_OVER.values()), *(change for change, _ in LAND.values()), *HARMLESS.values()]


@settings(max_examples=25)
@given(
    at_s=st.floats(0.0, 10.0),
    fault=st.sampled_from(FAULTS),
    lasts_s=st.sampled_from([0.02, 0.3, 3.0, math.inf]),
    event=st.sampled_from(["nothing", "POSCTL", "HOLD", "disarm", "ask", "fail", "stall"]),
    event_at_s=st.floats(0.0, 10.0),
    refusals=st.sets(st.sampled_from(["LAND", "ARM"])),
    ignored=st.sets(st.sampled_from(["LAND"])),
)
def test_in_no_flight_is_there_a_bad_target_or_a_mode_taken_back(
    at_s: float, fault: Change, lasts_s: float, event: str, event_at_s: float, refusals: set[str], ignored: set[str]
) -> None:
    """`Watch` holds the promises, at every tick."""
    flight = Flight(plan_with(guards=GuardLimits(min_battery_v=13.5)))
    flight.autopilot.refusals = dict.fromkeys(refusals, "no")
    flight.autopilot.ignored = ignored
    flight.show(fault, lambda t: t.time_s >= at_s, lasts_s)
    actions: dict[str, Callable[[], object]] = {
        "nothing": lambda: None,
        "POSCTL": take_over(flight, "POSCTL"),
        "HOLD": take_over(flight, "HOLD"),
        "disarm": flight.autopilot._disarm,
        "ask": lambda: flight.pilot.ask_to_land("enough"),
        "fail": lambda: flight.pilot.fail("the cable is gone"),
        "stall": stall(flight, 0.7),
    }
    flight.when(lambda t: t.time_s >= event_at_s, actions[event]).fly()
