"""The pilot in lockstep with the simulated autopilot: the flight as it should be, and every way it can go wrong.

Every flight of this file is watched tick by tick by `Watch`, which holds what must be true whatever happens.
"""

import itertools
import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from quadctl.compensator import Compensator
from quadctl.control import ControlOutput
from quadctl.control import control as sound_control
from quadctl.effects.ground_effect import Sanchez
from quadctl.flight.guards import GuardLimits, defect
from quadctl.flight.pilot import Pilot
from quadctl.flight.session import FlightPlan, prepare_flight
from quadctl.flight.tick import Request, Stage, Tick
from quadctl.frames import euler_from_quaternion, quaternion_from_euler
from quadctl.missions.mission import Turn
from quadctl.model import Provenance, StackedEffect
from quadctl.state import NAN, AttitudeTarget, VehicleState
from sitl.autopilot import SimulatedAutopilot
from sitl.run import fly_lockstep

ROOT = Path(__file__).parents[1]
RATE_HZ = 50.0
Change = Callable[[VehicleState], VehicleState]
FLIGHT_STAGES = (Stage.SPOOL_UP, Stage.FLY, Stage.LAND)


@cache
def hop() -> FlightPlan:
    return prepare_flight(ROOT / "missions" / "short_hop.yaml", ROOT / "config" / "flight.yaml", None, None)


def plan_with(**changes: Any) -> FlightPlan:
    return hop()._replace(settings=hop().settings.model_copy(update=changes))


class Tampered(SimulatedAutopilot):
    """A simulated autopilot of which one sees what `change` makes of its estimate, and that may refuse requests."""

    def __init__(self) -> None:
        super().__init__(hop().body.vehicle)
        self.change: Change = lambda state: state
        self.refusals: dict[str, str] = {}
        self.ignored: set[str] = set()
        """Requests that are acknowledged and have no effect."""
        self.asked: list[str] = []

    def estimate(self) -> VehicleState:
        return self.change(super().estimate())

    def request_arm(self) -> str | None:
        return self._asked("ARM") if self._refused("ARM") else super().request_arm()

    def request_mode(self, mode: str) -> str | None:
        return self._asked(mode) if self._refused(mode) else super().request_mode(mode)

    def _refused(self, what: str) -> bool:
        self.asked.append(what)
        return what in self.refusals or what in self.ignored

    def _asked(self, what: str) -> str | None:
        return self.refusals.get(what)

    def somebody(self, mode: str) -> None:
        """The person with the remote control chooses a mode."""
        assert SimulatedAutopilot.request_mode(self, mode) is None


class Watch:
    """What must be true of every flight."""

    def __init__(self, pilot: Pilot, guards: GuardLimits) -> None:
        self.ticks: list[Tick] = []
        self.pilot = pilot
        self.guards = guards
        self.requests: list[Request] = []
        self.silenced = False
        """Some tick in flight had no target."""

    def __call__(self, tick: Tick) -> None:
        self.ticks.append(tick)
        assert len(self.ticks) < 200 * RATE_HZ, "the flight does not end"
        state = tick.state
        theirs = state.armed and state.mode != "OFFBOARD"
        if tick.target is not None:
            numbers = (*tick.target.attitude, tick.target.throttle)
            assert all(map(math.isfinite, numbers))
            assert math.hypot(*tick.target.attitude) == pytest.approx(1.0, abs=1e-6)
            assert 0.0 <= tick.target.throttle <= 1.0
            assert tick.stage not in (Stage.RELEASED, Stage.DONE, Stage.WAIT)
            if tick.stage in (Stage.STREAM, Stage.START):
                assert tick.target.throttle == 0.0
            if tick.stage in FLIGHT_STAGES:
                assert state.armed
                assert state.mode == "OFFBOARD"
                assert defect(state, self.guards) is None
                assert tick.late_s <= self.guards.max_tick_late_s
                assert not self.silenced, "a target after the silence"
        elif tick.stage in (*FLIGHT_STAGES, Stage.RELEASED):
            self.silenced = True
        assert not (theirs and tick.requests), "it takes the mode back"
        if tick.stage in (Stage.RELEASED, Stage.DONE):
            assert not tick.requests
        self.requests += tick.requests
        once = [request for request in self.requests if request is not Request.LAND]
        assert len(set(once)) == len(once), "it asks twice"
        if tick.output is not None:
            integral = tick.output.memory.velocity
            assert all(map(math.isfinite, (*integral.integral_m_s2, *integral.acceleration_m_s2)))

    def stages(self) -> list[Stage]:
        return [stage for stage, _ in itertools.groupby(t.stage for t in self.ticks)]

    def first(self, condition: Callable[[Tick], bool]) -> Tick:
        return next(tick for tick in self.ticks if condition(tick))

    def with_request(self, request: Request) -> list[Tick]:
        return [tick for tick in self.ticks if request in tick.requests]


class Flight:
    """A flight in preparation, then flown."""

    def __init__(self, plan: FlightPlan | None = None, pilot_class: type[Pilot] = Pilot) -> None:
        plan = plan or hop()
        compensator = Compensator(plan.compensator, plan.settings.compensator_limits)
        self.pilot = pilot_class(plan.mission, plan.body, plan.settings, compensator)
        self.autopilot = Tampered()
        self.watch = Watch(self.pilot, plan.settings.guards)
        self.also: list[Callable[[Tick], None]] = []

    def when(self, condition: Callable[[Tick], bool], action: Callable[[], object]) -> "Flight":
        """Do `action` once, at the end of the first tick for which `condition` holds."""
        pending = [action]

        def listener(tick: Tick) -> None:
            if pending and condition(tick):
                pending.pop()()

        self.also.append(listener)
        return self

    def show(self, change: Change, after: Callable[[Tick], bool] | None = None, until: float = math.inf) -> "Flight":
        """Let `change` act on the state from the tick after `after` on, `until` so many seconds later."""
        autopilot = self.autopilot

        def begin() -> None:
            end_s = autopilot.time_s + until + 1e-6
            autopilot.change = lambda state: change(state) if state.time_s <= end_s else state

        if after is None:
            begin()
            return self
        return self.when(after, begin)

    def fly(self) -> "Flight":
        fly_lockstep(self.autopilot, self.pilot, RATE_HZ, [self.watch, self._tell])
        assert self.pilot.done
        assert self.pilot.ended
        return self

    def _tell(self, tick: Tick) -> None:
        for listener in list(self.also):
            listener(tick)

    @property
    def at_rest(self) -> bool:
        return not self.autopilot.armed and self.autopilot.landed and self.autopilot.body.position[2] > -0.06


def in_flight(after_s: float) -> Callable[[Tick], bool]:
    """So long after the spool-up."""
    began: list[float] = []

    def condition(tick: Tick) -> bool:
        if tick.stage is Stage.FLY and not began:
            began.append(tick.time_s)
        return bool(began) and tick.time_s >= began[0] + after_s - 1e-9

    return condition


def at_stage(stage: Stage, ticks: int = 1) -> Callable[[Tick], bool]:
    """At the end of that many ticks in a stage."""
    seen = itertools.count(1)
    return lambda tick: tick.stage is stage and next(seen) >= ticks


# --- the flight as it should be --------------------------------------------------------------------------------------


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


def moved(north: float, east: float, down: float) -> Change:
    """The origin of the frame is somewhere else."""

    def change(s: VehicleState) -> VehicleState:
        x, y, z = s.position_ned_m
        return replace(s, position_ned_m=(x + north, y + east, z + down))

    return change


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


# --- guards in flight ------------------------------------------------------------------------------------------------


def old(s: VehicleState) -> VehicleState:
    return replace(s, received_s={**s.received_s, "position": s.time_s - 0.5})


def leaning(s: VehicleState) -> VehicleState:
    return replace(s, attitude=quaternion_from_euler(0.0, math.radians(-60.0), 0.0))


def gradually(change: Callable[[VehicleState, float], VehicleState]) -> Change:
    """`change` with a share that grows from 0 to 1 in a second, as a vehicle can move."""
    began_s = last_s = math.inf

    def now(s: VehicleState) -> VehicleState:
        nonlocal began_s, last_s
        if not last_s <= s.time_s < last_s + 1.0:  # another flight
            began_s = s.time_s
        last_s = s.time_s
        return change(s, min(s.time_s - began_s, 1.0))

    return now


def drifting(north_m: float, east_m: float, down_m: float) -> Change:
    def drift(s: VehicleState, share: float) -> VehicleState:
        return moved(share * north_m, share * east_m, share * down_m)(s)

    return gradually(drift)


HAND_OVER: dict[str, tuple[Change, str]] = {
    "stale position": (old, "the position is 0.50 s old, allowed are 0.2 s"),
    "stale attitude": (
        lambda s: replace(s, received_s={**s.received_s, "attitude": s.time_s - 0.21}),
        "the attitude is 0.21 s old",
    ),
    "no position": (lambda s: replace(s, position_ned_m=(NAN, NAN, NAN)), "not a number"),
    "one nan": (lambda s: replace(s, position_ned_m=(*s.position_ned_m[:2], NAN)), "not a number"),
    "no velocity": (lambda s: replace(s, velocity_ned_m_s=(0.0, NAN, 0.0)), "not a number"),
    "infinite velocity": (lambda s: replace(s, velocity_ned_m_s=(0.0, math.inf, 0.0)), "not a number"),
    "no attitude": (lambda s: replace(s, attitude=(NAN, 0.0, 0.0, 0.0)), "not a number"),
    "attitude of zeros": (lambda s: replace(s, attitude=(0.0, 0.0, 0.0, 0.0)), "no unit quaternion"),
    "tilt": (leaning, "the tilt is 60 deg, allowed are 50 deg"),
    "heartbeat": (lambda s: replace(s, connected=False), "the autopilot's heartbeat is lost"),
}
LAND: dict[str, tuple[Change, str]] = {
    "speed": (
        gradually(lambda s, share: replace(s, velocity_ned_m_s=(9.0 * share, 0.0, 0.0))),
        "the speed is 8.1 m/s, allowed are 8 m/s",
    ),
    "height": (drifting(0.0, 0.0, -4.0), "allowed are 1.5 m"),
    "floor": (drifting(0.0, 0.0, 4.0), "allowed are -0.4 m or more"),
    "distance": (drifting(0.0, 4.0, 0.0), "from take-off, allowed are 1.5 m"),
    "battery": (lambda s: replace(s, battery_v=13.4), "the battery is at 13.40 V, allowed are 13.5 V"),
    "battery unknown": (lambda s: replace(s, battery_v=NAN), "the battery is at nan V"),
}
HARMLESS: dict[str, Change] = {
    "rates": lambda s: replace(s, rates_rad_s=(NAN, NAN, NAN)),
    "rpm": lambda s: replace(s, rotor_rpm=(NAN,) * 4),
    "no rpm": lambda s: replace(s, rotor_rpm=()),
    "battery": lambda s: replace(s, battery_v=NAN),
}


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


def stall(flight: Flight, seconds: float) -> Callable[[], None]:
    return lambda: flight.autopilot.step(flight.autopilot.time_s + seconds)


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

    monkeypatch.setattr("quadctl.flight.steering.control", control)
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

    monkeypatch.setattr("quadctl.flight.steering.control", control)
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

    monkeypatch.setattr("quadctl.flight.steering.control", control)
    for when in (at_stage(Stage.START), at_stage(Stage.SPOOL_UP, 49), in_flight(2.0), at_stage(Stage.LAND, 3)):
        for name in ("no position", "no velocity", "no attitude"):
            flight = Flight()
            flight.autopilot.ignored.add("LAND")
            flight.show(HAND_OVER[name][0], when, until=0.1).fly()


# --- not known whose the mode is -----------------------------------------------------------------------------------


def test_after_a_stall_the_landing_is_asked_for_only_when_a_new_heartbeat_shows_offboard() -> None:
    flight = Flight()
    old_heartbeat_until_s = math.inf

    def late_news(s: VehicleState) -> VehicleState:
        if s.time_s >= old_heartbeat_until_s:
            return s
        return replace(s, mode="OFFBOARD", received_s={**s.received_s, "heartbeat": s.time_s - 0.6})

    def stall_now() -> None:
        nonlocal old_heartbeat_until_s
        stall(flight, 0.5)()
        old_heartbeat_until_s = flight.autopilot.time_s + 0.4

    flight.show(late_news, in_flight(3.0)).when(in_flight(3.0), stall_now).fly()
    (asked,) = flight.watch.with_request(Request.LAND)
    assert asked.state.time_s == pytest.approx(old_heartbeat_until_s, abs=0.05)
    assert not any(t.target for t in flight.watch.ticks if t.time_s > asked.time_s - 0.4)


def test_a_mode_taken_during_a_stall_is_left_alone_though_the_old_one_is_still_shown() -> None:
    flight = Flight()

    def late_news(s: VehicleState) -> VehicleState:
        if s.time_s > shown_until_s:
            return s
        return replace(s, mode="OFFBOARD", received_s={**s.received_s, "heartbeat": s.time_s - 0.6})

    shown_until_s = 0.0

    def take_over_in_a_stall() -> None:
        nonlocal shown_until_s
        take_over(flight, "POSCTL")()
        stall(flight, 0.5)()
        shown_until_s = flight.autopilot.time_s + 0.3

    flight.show(late_news, in_flight(3.0)).when(in_flight(3.0), take_over_in_a_stall).fly()
    assert flight.pilot.ended == "the control loop stalled for 0.48 s"
    assert "LAND" not in flight.autopilot.asked
    assert Stage.RELEASED in flight.watch.stages()  # recorded until the end
    assert flight.at_rest


def test_an_autopilot_that_restarts_is_let_go() -> None:
    flight = Flight().show(lambda s: replace(s, boots=1), in_flight(3.0), until=0.1)
    flight.when(at_stage(Stage.RELEASED, 25), lambda: flight.autopilot.somebody("LAND")).fly()
    assert flight.pilot.ended == "the autopilot restarted"
    assert "LAND" not in flight.autopilot.asked


# --- control that goes wrong -----------------------------------------------------------------------------------------


def test_control_that_fails_hands_over(monkeypatch: pytest.MonkeyPatch) -> None:
    flight = Flight()

    def control(*arguments: Any) -> ControlOutput:
        return sound_control(*arguments) if flight.pilot.flight_s < 3.0 else 1 / 0  # type: ignore[return-value]

    monkeypatch.setattr("quadctl.flight.steering.control", control)
    flight.fly()
    assert flight.pilot.ended == "control failed (division by zero)"
    assert flight.watch.with_request(Request.LAND)[0].target is None
    assert flight.at_rest


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


# --- somebody else flies ---------------------------------------------------------------------------------------------


def take_over(flight: Flight, mode: str, lands_after_s: float = 5.0) -> Callable[[], None]:
    """Somebody takes the mode, flies for a while, and lands."""

    def action() -> None:
        flight.autopilot.somebody(mode)
        end_s = flight.autopilot.time_s + lands_after_s
        flight.when(lambda _: flight.autopilot.time_s >= end_s, lambda: flight.autopilot.somebody("LAND"))

    return action


@pytest.mark.parametrize("mode", ["POSCTL", "HOLD", "RTL"])
def test_a_mode_taken_by_somebody_is_never_taken_back(mode: str) -> None:
    flight = Flight()
    flight.when(in_flight(3.0), take_over(flight, mode)).fly()
    assert flight.pilot.ended == f"the autopilot left offboard for {mode}"
    taken = flight.watch.first(lambda t: t.state.mode == mode and t.state.armed)
    assert taken.target is None
    assert taken.stage is Stage.RELEASED
    assert flight.autopilot.asked == ["OFFBOARD", "ARM"]
    assert flight.at_rest
    recorded = [t for t in flight.watch.ticks if t.stage is Stage.RELEASED]
    assert len(recorded) > 2.0 * RATE_HZ
    assert not flight.watch.ticks[-1].state.armed


@pytest.mark.parametrize("trouble", ["no position", "stale position", "heartbeat", "tilt"])
def test_it_is_not_taken_back_for_another_trouble_in_the_same_tick(trouble: str) -> None:
    flight = Flight()
    change = HAND_OVER[trouble][0]
    flight.when(in_flight(3.0), take_over(flight, "POSCTL")).show(change, in_flight(3.0), until=0.02).fly()
    assert flight.pilot.ended == "the autopilot left offboard for POSCTL"
    assert "LAND" not in flight.autopilot.asked


def test_it_is_not_taken_back_after_a_stall_a_failed_send_or_a_wish_to_land() -> None:
    for action in (
        lambda f: f.autopilot.step(f.autopilot.time_s + 0.5),
        lambda f: f.pilot.fail("the cable is gone"),
        lambda f: f.pilot.ask_to_land("asked to land by SIGINT"),
    ):
        flight = Flight()
        flight.when(in_flight(3.0), take_over(flight, "POSCTL"))
        flight.when(in_flight(3.0), lambda act=action, f=flight: act(f)).fly()  # type: ignore[misc]
        assert flight.pilot.ended.endswith("the autopilot left offboard for POSCTL")
        assert "LAND" not in flight.autopilot.asked
        assert not flight.watch.ticks[-1].state.armed


def test_a_mode_taken_and_given_back_is_not_flown_again() -> None:
    flight = Flight()
    flight.when(in_flight(3.0), take_over(flight, "POSCTL"))
    flight.show(
        lambda s: replace(s, mode="OFFBOARD") if s.mode == "POSCTL" else s, lambda t: t.stage is Stage.RELEASED
    ).fly()
    assert flight.pilot.ended == "the autopilot left offboard for POSCTL"


def test_a_mode_taken_while_spooling_up_is_let_go() -> None:
    flight = Flight()
    flight.when(at_stage(Stage.SPOOL_UP, 20), take_over(flight, "POSCTL")).fly()
    assert flight.pilot.ended == "the autopilot left offboard for POSCTL"
    assert "LAND" not in flight.autopilot.asked


def test_a_mode_taken_before_the_arming_is_let_go() -> None:
    flight = Flight()
    flight.autopilot.ignored.add("ARM")
    flight.when(at_stage(Stage.START, 10), lambda: flight.autopilot.somebody("POSCTL")).fly()
    assert flight.pilot.ended == "the autopilot went to POSCTL"
    assert flight.autopilot.asked == ["OFFBOARD", "ARM"]


def test_a_mode_taken_while_landing_is_let_go() -> None:
    flight = Flight()
    flight.when(at_stage(Stage.LAND, 5), take_over(flight, "POSCTL")).fly()
    assert flight.autopilot.asked == ["OFFBOARD", "ARM", "LAND"]
    assert flight.at_rest


def test_when_somebody_else_flies_a_wish_to_land_only_ends_the_recording() -> None:
    flight = Flight()
    flight.when(in_flight(3.0), take_over(flight, "POSCTL"))
    flight.when(at_stage(Stage.RELEASED, 50), lambda: flight.pilot.ask_to_land("asked to land by SIGINT")).fly()
    assert flight.pilot.ended == "the autopilot left offboard for POSCTL"
    assert flight.autopilot.mode == "POSCTL"


def test_disarmed_in_flight() -> None:
    flight = Flight()
    flight.when(in_flight(3.0), flight.autopilot._disarm).fly()
    assert flight.pilot.ended == "the vehicle was disarmed"
    assert flight.watch.stages()[-2:] == [Stage.RELEASED, Stage.DONE]
    assert "LAND" not in flight.autopilot.asked


# --- asked to land ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("stage", [Stage.STREAM, Stage.START])
def test_asked_to_land_before_the_arming_nothing_is_armed(stage: Stage) -> None:
    flight = Flight()
    flight.autopilot.ignored.add("OFFBOARD")
    flight.when(at_stage(stage, 10), lambda: flight.pilot.ask_to_land("enough")).fly()
    assert flight.pilot.ended == "enough"
    assert "ARM" not in flight.autopilot.asked


def test_asked_to_land_while_waiting() -> None:
    flight = Flight().show(lambda s: replace(s, connected=False))
    flight.when(at_stage(Stage.WAIT, 10), lambda: flight.pilot.ask_to_land("enough")).fly()
    assert flight.pilot.ended == "enough"
    assert flight.autopilot.asked == []


@pytest.mark.parametrize("stage", [Stage.SPOOL_UP, Stage.FLY])
def test_asked_to_land_with_motors_on(stage: Stage) -> None:
    flight = Flight()
    flight.when(at_stage(stage, 40), lambda: flight.pilot.ask_to_land("enough")).fly()
    assert flight.pilot.ended == "enough"
    (asked,) = flight.watch.with_request(Request.LAND)
    assert asked.target is not None  # it holds its place until the mode is taken
    assert flight.at_rest


def test_asked_to_let_go_while_landing_it_is_gone_and_the_landing_goes_on() -> None:
    flight = Flight()
    flight.when(in_flight(3.0), lambda: flight.pilot.ask_to_land("first"))
    flight.when(at_stage(Stage.LAND, 5), lambda: flight.pilot.ask_to_let_go("second")).fly()
    assert flight.pilot.ended == "first; second"
    assert flight.autopilot.mode == "LAND"
    assert flight.autopilot.asked == ["OFFBOARD", "ARM", "LAND"]
    landing = [t for t in flight.watch.ticks if t.stage is Stage.LAND]
    assert len(landing) == 5
    assert [(e.what, e.answer) for t in flight.watch.ticks for e in t.events] == [
        ("first", "land"),
        ("second", "hand over"),
    ]


def test_asked_to_let_go_in_flight_at_once() -> None:
    flight = Flight()
    flight.when(in_flight(3.0), lambda: flight.pilot.ask_to_let_go("both at once")).fly()
    assert flight.pilot.done
    last = [t for t in flight.watch.ticks if t.target is not None][-1]
    assert flight.watch.ticks[-1].time_s - last.time_s < 0.1


def test_asked_to_let_go_of_an_autopilot_that_does_not_answer_it_goes_all_the_same() -> None:
    flight = Flight()
    flight.autopilot.ignored.add("LAND")
    flight.autopilot.parameters["COM_OF_LOSS_T"] = 60.0
    flight.when(at_stage(Stage.LAND, 5), lambda: flight.pilot.ask_to_let_go("enough")).fly()
    landing = [t for t in flight.watch.ticks if t.stage is Stage.LAND]
    assert landing[-1].time_s - landing[5].time_s == pytest.approx(1.0, abs=0.1)
    assert not any(t.target for t in landing[6:])


def test_asked_to_land_while_landing_changes_nothing() -> None:
    flight = Flight()
    flight.autopilot.ignored.add("LAND")
    flight.when(at_stage(Stage.LAND, 10), lambda: flight.pilot.ask_to_land("enough")).fly()
    assert flight.pilot.ended == "completed"
    assert sum(t.target is not None for t in flight.watch.ticks if t.stage is Stage.LAND) > 1.9 * RATE_HZ


def test_an_arming_that_comes_after_it_was_given_up_is_landed_and_recorded() -> None:
    """The command was on its way when the flight was broken off."""
    flight = Flight()
    flight.autopilot.ignored.add("ARM")
    asked = at_stage(Stage.START, 5)
    flight.when(asked, lambda: flight.pilot.ask_to_land("enough"))

    def arm_late() -> None:
        flight.autopilot.armed, flight.autopilot._armed_s = True, flight.autopilot.time_s

    flight.when(at_stage(Stage.LAND, 25), arm_late).fly()
    assert flight.pilot.ended == "enough"
    assert "LAND" in flight.autopilot.asked
    assert any(t.state.armed for t in flight.watch.ticks)
    assert flight.at_rest


# --- refused ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("request_", "words"), [("ARM", "arm"), ("OFFBOARD", "enter offboard")])
def test_a_refused_start_ends_the_flight_with_the_reason(request_: str, words: str) -> None:
    flight = Flight()
    flight.autopilot.refusals[request_] = "preflight check failed"
    flight.fly()
    assert flight.pilot.ended == f"the simulated autopilot refused to {words}: preflight check failed"
    assert not any(t.state.armed for t in flight.watch.ticks)
    assert flight.pilot.phases_flown == []


@pytest.mark.parametrize("request_", ["ARM", "OFFBOARD"])
def test_a_start_that_is_accepted_and_never_happens_is_given_up(request_: str) -> None:
    flight = Flight()
    flight.autopilot.ignored.add(request_)
    flight.fly()
    mode = "HOLD" if request_ == "OFFBOARD" else "OFFBOARD"
    assert flight.pilot.ended == (
        f"the autopilot did not get ready in 8 s: armed is False, mode is {mode}, expected OFFBOARD"
    )


def test_a_refused_landing_is_answered_by_silence() -> None:
    flight = Flight()
    flight.autopilot.refusals["LAND"] = "not now"
    flight.fly()
    assert flight.pilot.ended == "completed; the simulated autopilot refused to land: not now"
    (asked,) = flight.watch.with_request(Request.LAND)
    assert not any(t.target for t in flight.watch.ticks[flight.watch.ticks.index(asked) + 1 :])
    assert any(t.state.mode == "RTL" for t in flight.watch.ticks)  # its failsafe
    assert flight.at_rest


@pytest.mark.parametrize("heartbeats_old_s", [0.0, 3.0])
def test_a_refused_landing_is_asked_for_again_while_the_mode_is_known_to_be_ours(heartbeats_old_s: float) -> None:
    flight = Flight()
    flight.autopilot.parameters["COM_OF_LOSS_T"] = 60.0  # no failsafe acts
    flight.autopilot.refusals["LAND"] = "not now"
    flight.when(at_stage(Stage.LAND, 25), flight.autopilot.refusals.clear)
    flight.show(
        lambda s: replace(s, received_s={**s.received_s, "heartbeat": s.time_s - 0.6}),
        at_stage(Stage.LAND),
        until=heartbeats_old_s,
    ).fly()
    first, second = flight.watch.with_request(Request.LAND)
    assert second.time_s - first.time_s == pytest.approx(max(2.0, heartbeats_old_s), abs=0.05)
    assert not any(t.target for t in flight.watch.ticks if t.time_s > first.time_s)
    assert flight.at_rest


def test_a_landing_that_does_not_end_is_left_to_the_autopilot() -> None:
    flight = Flight()
    flight.autopilot.parameters["COM_DISARM_LAND"] = 1e9
    flight.fly()
    assert flight.pilot.ended == "completed; the autopilot did not land and disarm in 60 s"


# --- before the flight -----------------------------------------------------------------------------------------------


def test_an_armed_vehicle_is_not_taken() -> None:
    flight = Flight()
    assert SimulatedAutopilot.request_arm(flight.autopilot) is None
    flight.fly()
    assert flight.pilot.ended == "the vehicle is armed already, expected it to stand disarmed on the ground"
    assert flight.autopilot.asked == []
    assert not any(t.target for t in flight.watch.ticks)


@pytest.mark.parametrize("stage", [Stage.STREAM, Stage.START])
def test_a_vehicle_that_somebody_arms_is_not_taken(stage: Stage) -> None:
    """It may be in the air a moment later: idle throttle in offboard would drop it."""
    flight = Flight()
    flight.autopilot.ignored.add("OFFBOARD")

    def arm() -> None:
        assert SimulatedAutopilot.request_arm(flight.autopilot) is None

    flight.when(at_stage(stage, 10), take_over(flight, "POSCTL")).when(at_stage(stage, 10), arm).fly()
    assert flight.pilot.ended in ("somebody else armed the vehicle", "the autopilot went to POSCTL")
    assert set(flight.autopilot.asked) <= {"OFFBOARD"}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda s: replace(s, connected=False, received_s={}), "the autopilot's heartbeat is lost"),
        (lambda s: replace(s, received_s={"attitude": s.time_s}), "the position never came"),
        (lambda s: replace(s, received_s={"position": s.time_s}), "the attitude never came"),
        (HAND_OVER["no position"][0], "the state holds a value that is not a number"),
        (HAND_OVER["stale attitude"][0], "the attitude is 0.21 s old, allowed are 0.2 s"),
        (HAND_OVER["attitude of zeros"][0], "the attitude is no unit quaternion, its norm is 0"),
        (LAND["battery"][0], "the battery is at 13.40 V, expected 13.5 V or more"),
        (LAND["battery unknown"][0], "the battery is at nan V, expected 13.5 V or more"),
    ],
    ids=str,
)
def test_a_state_that_does_not_become_usable_is_not_flown(change: Change, words: str) -> None:
    flight = Flight(plan_with(guards=GuardLimits(min_battery_v=13.5))).show(change).fly()
    assert flight.pilot.ended == f"no usable state came from the autopilot in 15 s: {words}"
    assert flight.watch.ticks[-1].time_s == pytest.approx(15.0, abs=0.1)
    assert flight.autopilot.asked == []


def test_a_state_that_comes_later_is_waited_for() -> None:
    flight = Flight().show(lambda s: replace(s, received_s={}, position_ned_m=(NAN,) * 3), until=10.0).fly()
    assert flight.pilot.ended == "completed"
    assert flight.watch.stages()[0] is Stage.WAIT


@pytest.mark.parametrize("stage", [Stage.STREAM, Stage.START])
@pytest.mark.parametrize("name", ["no position", "stale position", "heartbeat", "attitude of zeros"])
def test_a_state_that_is_lost_before_the_arming_is_not_flown(stage: Stage, name: str) -> None:
    change, words = HAND_OVER[name]
    flight = Flight().show(change, at_stage(stage)).fly()
    assert words in flight.pilot.ended
    assert not {Stage.SPOOL_UP, Stage.FLY} & set(flight.watch.stages())
    assert flight.at_rest


def test_a_broken_link_before_the_arming_is_the_reason_given() -> None:
    flight = Flight()
    flight.when(at_stage(Stage.STREAM, 10), lambda: flight.pilot.fail("the cable is gone")).fly()
    assert flight.pilot.ended == "the cable is gone"
    assert flight.autopilot.asked == []


# --- whatever happens ------------------------------------------------------------------------------------------------

FAULTS = [*(change for change, _ in HAND_OVER.values()), *(change for change, _ in LAND.values()), *HARMLESS.values()]


@settings(max_examples=25)
@given(
    at_s=st.floats(0.0, 16.0),
    fault=st.sampled_from(FAULTS),
    lasts_s=st.sampled_from([0.02, 0.3, 3.0, math.inf]),
    event=st.sampled_from(["nothing", "POSCTL", "HOLD", "disarm", "ask", "fail", "stall"]),
    event_at_s=st.floats(0.0, 16.0),
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
