"""Flights in lockstep with the simulated autopilot, watched tick by tick: `Watch` holds what must be true whatever
happens.

With the troubles that the tests of the pilot make: a distorted state, a stall, a mode taken.
"""

import itertools
import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import pytest

from quadctl.compensator import Compensator
from quadctl.flight.pilot.guards import GuardLimits, defect
from quadctl.flight.pilot.pilot import Pilot
from quadctl.flight.pilot.tick import Request, Stage, Tick
from quadctl.flight.preflight.plan import FlightPlan
from quadctl.flight.preflight.preparation import prepare_flight
from quadctl.frames import quaternion_from_euler
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.sitl.run import fly_lockstep
from quadctl.state import NAN, VehicleState
from tests.support.places import ROOT

RATE_HZ = 50.0
Change = Callable[[VehicleState], VehicleState]
FLIGHT_STAGES = (Stage.SPOOL_UP, Stage.FLY, Stage.LAND)


@cache
def hop() -> FlightPlan:
    return prepare_flight(ROOT / "tests" / "support" / "hop.yaml", ROOT / "config" / "flight.yaml", None, None)


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
    """Checks that must hold in every flight."""

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
        if tick.stage in FLIGHT_STAGES:
            assert Request.ARM not in tick.requests
        self.requests += tick.requests
        repeated = (Request.LAND, Request.CHECKS, Request.ARM)
        once = [request for request in self.requests if request not in repeated]
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

    def __init__(self, plan: FlightPlan | None = None, pilot_class: Callable[..., Pilot] = Pilot) -> None:
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
        of_this_flight = change.anew() if isinstance(change, Gradual) else change

        def begin() -> None:
            end_s = autopilot.time_s + until + 1e-6
            autopilot.change = lambda state: of_this_flight(state) if state.time_s <= end_s else state

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


def moved(north: float, east: float, down: float) -> Change:
    """The origin of the frame is somewhere else."""

    def change(s: VehicleState) -> VehicleState:
        x, y, z = s.position_ned_m
        return replace(s, position_ned_m=(x + north, y + east, z + down))

    return change


def old(s: VehicleState) -> VehicleState:
    return replace(s, received_s={**s.received_s, "position": s.time_s - 0.5})


def leaning(s: VehicleState) -> VehicleState:
    return replace(s, attitude=quaternion_from_euler(0.0, math.radians(-60.0), 0.0))


class Gradual:
    """`change` with a share that grows from 0 to 1 in a second, as a vehicle can move."""

    def __init__(self, change: Callable[[VehicleState, float], VehicleState]) -> None:
        self.change = change
        self.began_s = math.inf

    def __call__(self, s: VehicleState) -> VehicleState:
        self.began_s = min(self.began_s, s.time_s)
        return self.change(s, min(s.time_s - self.began_s, 1.0))

    def anew(self) -> "Gradual":
        """Return the same for another flight."""
        return Gradual(self.change)


def drifting(north_m: float, east_m: float, down_m: float) -> Change:
    def drift(s: VehicleState, share: float) -> VehicleState:
        return moved(share * north_m, share * east_m, share * down_m)(s)

    return Gradual(drift)


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
        Gradual(lambda s, share: replace(s, velocity_ned_m_s=(9.0 * share, 0.0, 0.0))),
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


def stall(flight: Flight, seconds: float) -> Callable[[], None]:
    return lambda: flight.autopilot.step(flight.autopilot.time_s + seconds)


def take_over(flight: Flight, mode: str, lands_after_s: float = 5.0) -> Callable[[], None]:
    """Somebody takes the mode, flies for a while, and lands."""

    def action() -> None:
        flight.autopilot.somebody(mode)
        end_s = flight.autopilot.time_s + lands_after_s
        flight.when(lambda _: flight.autopilot.time_s >= end_s, lambda: flight.autopilot.somebody("LAND"))

    return action
