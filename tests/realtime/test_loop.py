"""The real-time loop on a simulated autopilot in the same process: what it does when something breaks."""

import time
from collections.abc import Callable

import pytest

from quadctl.errors import LinkError
from quadctl.flight.autopilot.port import Autopilot
from quadctl.flight.loop import fly
from quadctl.flight.pilot.guards import GuardLimits
from quadctl.flight.pilot.pilot import Pilot
from quadctl.flight.pilot.tick import Stage, Tick
from quadctl.flight.realtime import run
from quadctl.state import VehicleState
from tests.support.in_process import HURRY_HZ, InProcess, in_flight, plan

pytestmark = pytest.mark.realtime


def flown(autopilot: InProcess, *listeners: Callable[[Tick], None]) -> Pilot:
    pilot = plan().pilot()
    port: Autopilot = autopilot
    run(fly(port, pilot, HURRY_HZ, listeners))
    return pilot


def test_the_loop_flies_a_mission_and_tells_every_tick() -> None:
    autopilot, ticks = InProcess(), list[Tick]()
    pilot = flown(autopilot, ticks.append)
    assert pilot.ended == "completed"
    assert autopilot.asked == ["OFFBOARD", "ARM", "LAND"]
    assert [t.target for t in ticks if t.target is not None] == autopilot.sent
    assert not autopilot.px.armed


def test_a_link_that_breaks_in_flight_ends_in_silence() -> None:
    autopilot, ticks = InProcess(), list[Tick]()

    def broken() -> None:
        if in_flight(ticks):
            raise LinkError("the cable is gone")

    autopilot.before_send = broken
    pilot = flown(autopilot, ticks.append)
    assert pilot.ended == "the cable is gone"
    assert autopilot.asked[-1] == "LAND"
    assert len([t for t in ticks if t.target is not None]) == len(autopilot.sent) + 1


def test_a_stall_between_state_and_target_sends_nothing() -> None:
    """The target stands on a state that is old by the time it is ready."""
    autopilot, ticks = InProcess(), list[Tick]()
    look = autopilot.state

    def stalled_state() -> VehicleState:
        state = look()
        if in_flight(ticks) and ticks[-1].stage is Stage.FLY:
            time.sleep(0.3)
        return state

    autopilot.state = stalled_state  # type: ignore[method-assign]
    settings = plan().settings.model_copy(update={"guards": GuardLimits(max_tick_late_s=0.25)})
    pilot = plan()._replace(settings=settings).pilot()
    run(fly(autopilot, pilot, HURRY_HZ, [ticks.append]))
    assert pilot.ended.startswith("the control loop stalled for 0.3")
    decided = [t for t in ticks if t.target is not None]
    assert len(autopilot.sent) == len(decided) - 1
    assert autopilot.asked == ["OFFBOARD", "ARM", "LAND"]


class OurDefectError(Exception):
    """A mistake in our own code."""


@pytest.mark.parametrize("hangs", [False, True])
def test_a_defect_in_flight_still_lands_and_is_not_hidden(monkeypatch: pytest.MonkeyPatch, hangs: bool) -> None:
    monkeypatch.setattr("quadctl.flight.loop.LAST_WORD_S", 0.1)
    autopilot, ticks = InProcess(), list[Tick]()
    autopilot.land_hangs = hangs

    def defect(_: Tick) -> None:
        if in_flight(ticks):
            raise OurDefectError

    with pytest.raises(OurDefectError):
        flown(autopilot, ticks.append, defect)
    assert autopilot.asked == ["OFFBOARD", "ARM", "LAND"]


def test_a_defect_while_somebody_else_flies_does_not_take_the_mode_back() -> None:
    autopilot, ticks = InProcess(), list[Tick]()

    def somebody_and_a_defect(tick: Tick) -> None:
        if tick.stage is Stage.RELEASED:
            raise OurDefectError
        if in_flight(ticks):
            autopilot.px.request_mode("POSCTL")

    with pytest.raises(OurDefectError):
        flown(autopilot, ticks.append, somebody_and_a_defect)
    assert autopilot.asked == ["OFFBOARD", "ARM"]
    assert autopilot.px.mode == "POSCTL"


def test_a_refused_request_is_the_reason_given() -> None:
    autopilot = InProcess()
    autopilot.px.request_arm = lambda: "preflight check failed"  # type: ignore[method-assign]
    assert flown(autopilot).ended == "it refused ARM: preflight check failed"
