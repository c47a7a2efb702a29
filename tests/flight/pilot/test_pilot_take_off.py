"""The pilot of an autopilot that takes off by itself."""

import math
from collections.abc import Callable

import pytest

from quadctl.flight.pilot.guards import GuardLimits
from quadctl.flight.pilot.pilot import Pilot
from quadctl.flight.pilot.tick import Request, Stage, Tick
from quadctl.flight.preflight.preparation import prepare_flight
from quadctl.sitl.rules.copter import SimulatedCopter
from quadctl.sitl.run import fly_lockstep
from quadctl.vehicle import load_vehicle
from tests.support.links import RAPTOR
from tests.support.places import ROOT

VEHICLE = load_vehicle(RAPTOR)


def flown_in_lockstep(
    copter: SimulatedCopter,
    guards: GuardLimits | None = None,
    also: Callable[[Pilot, Tick], None] = lambda pilot, tick: None,
) -> tuple[Pilot, list[Tick]]:
    plan = prepare_flight(ROOT / "missions" / "short_hop.yaml", ROOT / "config" / "flight.yaml", None, None)
    if guards is not None:
        plan = plan._replace(settings=plan.settings.model_copy(update={"guards": guards}))
    copter.parameters["GUID_OPTIONS"] = 8.0
    pilot, ticks = plan.pilot(autopilot_takes_off=True), list[Tick]()
    fly_lockstep(copter, pilot, plan.settings.controller.rate_hz, [ticks.append, lambda tick: also(pilot, tick)])
    return pilot, ticks


def test_it_is_silent_until_the_autopilot_has_taken_off() -> None:
    pilot, ticks = flown_in_lockstep(SimulatedCopter(VEHICLE))
    assert pilot.ended == "completed"
    first = next(tick for tick in ticks if tick.target is not None)
    assert first.stage is Stage.FLY
    assert first.phase == "hover"
    assert -first.state.position_ned_m[2] == pytest.approx(0.6, abs=0.1)


@pytest.mark.parametrize(
    ("answer", "reason"),
    [
        ("Take-off is not allowed here", "Take-off is not allowed here"),
        (None, "the autopilot did not take off in 20 s"),
    ],
)
def test_a_take_off_that_does_not_come_ends_disarmed_without_a_target(answer: str | None, reason: str) -> None:
    class StayingCopter(SimulatedCopter):
        def request_take_off(self, height_m: float) -> str | None:
            return answer

    copter = StayingCopter(VEHICLE)
    copter.parameters["DISARM_DELAY"] = 25.0  # it does not end the wait by itself
    pilot, ticks = flown_in_lockstep(copter)
    assert pilot.ended.endswith(reason)
    assert [request for tick in ticks for request in tick.requests][-1] is Request.LAND
    assert all(tick.target is None for tick in ticks)
    assert not copter.armed


@pytest.mark.parametrize(("climbs", "reason"), [(True, "completed"), (False, "Take-off needs GUIDED")])
def test_a_take_off_whose_answer_was_lost_is_asked_for_again_and_its_refusal_in_the_air_ends_nothing(
    climbs: bool, reason: str
) -> None:
    class ClimbingCopter(SimulatedCopter):
        asked = 0

        def request_take_off(self, height_m: float) -> str | None:
            self.asked += 1
            if self.asked > 1:
                return "Take-off needs GUIDED, armed, on the ground"
            return super().request_take_off(height_m) if climbs else None

    def lose_the_answer(pilot: Pilot, tick: Tick) -> None:
        if Request.TAKE_OFF in tick.requests and copter.asked == 1:
            pilot.request_failed(Request.TAKE_OFF, "no answer", refused=False)

    copter = ClimbingCopter(VEHICLE)
    copter.parameters["DISARM_DELAY"] = 25.0
    pilot, _ = flown_in_lockstep(copter, also=lose_the_answer)
    assert copter.asked == 2
    assert reason in pilot.ended
    assert not copter.armed


def test_a_flight_that_a_slow_take_off_makes_too_long_lands() -> None:
    """Twelve seconds of mission, of which the take-off is a good one."""

    class SlowCopter(SimulatedCopter):
        climbs_s = math.inf
        height_m = 0.0

        def request_take_off(self, height_m: float) -> str | None:
            self.climbs_s, self.height_m = self.time_s + 7.0, height_m
            return None

        def step(self, until_s: float) -> None:
            if until_s > self.climbs_s:
                self.climbs_s = math.inf
                assert super().request_take_off(self.height_m) is None
            super().step(until_s)

    pilot, ticks = flown_in_lockstep(SlowCopter(VEHICLE), GuardLimits(max_over_time_s=4.0))
    assert pilot.ended == f"the flight lasts 16 s, the mission {pilot.mission.duration_s:.0f} s"
    (asked,) = [tick for tick in ticks if Request.LAND in tick.requests]
    assert asked.target is not None
    assert not ticks[-1].state.armed
    assert flown_in_lockstep(SlowCopter(VEHICLE))[0].ended == "completed"
