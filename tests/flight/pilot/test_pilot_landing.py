"""The landing: asked for by a person, refused by the autopilot, without an end."""

import itertools
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import pytest

from quadctl.flight.pilot.guards import GuardLimits
from quadctl.flight.pilot.pilot import Pilot
from quadctl.flight.pilot.tick import Request, Stage, Tick
from tests.support.watched import RATE_HZ, Flight, at_stage, in_flight, plan_with, take_over


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
        lambda s: replace(s, received_s={**s.received_s, "heartbeat": s.time_s - 0.8}),
        at_stage(Stage.LAND),
        until=heartbeats_old_s,
    ).fly()
    first, second = flight.watch.with_request(Request.LAND)
    assert second.time_s - first.time_s == pytest.approx(max(2.0, heartbeats_old_s), abs=0.05)
    assert not any(t.target for t in flight.watch.ticks if t.time_s > first.time_s)
    assert flight.at_rest


def unanswered(flight: Flight, request: Request) -> Callable[[Tick], None]:
    """Listener by which no request of this kind is answered: each is lost, and known to be lost half a second later."""
    asked_s: list[float] = []

    def listener(tick: Tick) -> None:
        if asked_s and tick.time_s - asked_s[0] >= 0.5:
            asked_s.clear()
            flight.pilot.request_failed(request, "no answer", refused=False)
        if request in tick.requests:
            asked_s.append(tick.time_s)

    return listener


def test_a_landing_that_is_not_answered_is_asked_for_again_and_then_answered_by_silence() -> None:
    flight = Flight()
    flight.autopilot.parameters["COM_OF_LOSS_T"] = 60.0
    flight.autopilot.ignored.add("LAND")
    flight.also.append(unanswered(flight, Request.LAND))
    flight.when(at_stage(Stage.LAND, 220), flight.autopilot.ignored.clear).fly()
    times = [t.time_s for t in flight.watch.with_request(Request.LAND)]
    assert [round(b - a, 1) for a, b in itertools.pairwise(times[:4])] == [0.5, 0.5, 0.5]
    assert flight.pilot.ended == "completed; no answer"
    assert flight.at_rest


def test_a_landing_that_is_not_answered_is_not_asked_for_again_once_somebody_has_taken_the_mode() -> None:
    flight = Flight()
    flight.autopilot.ignored.add("LAND")
    flight.also.append(unanswered(flight, Request.LAND))
    flight.when(at_stage(Stage.LAND, 10), take_over(flight, "POSCTL")).fly()
    assert len(flight.watch.with_request(Request.LAND)) == 1
    assert flight.at_rest


def test_an_arming_that_is_not_answered_is_asked_for_again_some_times() -> None:
    flight = Flight()
    flight.autopilot.ignored.add("ARM")
    flight.also.append(unanswered(flight, Request.ARM))
    flight.fly()
    assert len(flight.watch.with_request(Request.ARM)) == 8
    assert flight.pilot.ended == "no answer"


def test_a_landing_that_does_not_end_is_left_to_the_autopilot() -> None:
    flight = Flight(plan_with(guards=GuardLimits(max_over_time_s=5.0)))
    flight.autopilot.parameters["COM_DISARM_LAND"] = 1e9
    flight.fly()
    assert flight.pilot.ended == "completed; the autopilot did not land and disarm in 5 s"
    assert [e.answer for t in flight.watch.ticks for e in t.events] == ["land", "end"]


def unheard(stays_up: bool) -> Flight:
    """A flight whose autopilot falls silent, on its heartbeats and on its mode, and hears no wish to land."""
    plan = plan_with(guards=GuardLimits(max_over_time_s=20.0))
    flight = Flight(plan, partial(Pilot, autopilot_stays_up=stays_up))
    flight.autopilot.parameters["COM_OF_LOSS_T"] = 60.0
    flight.autopilot.ignored = {"LAND"}
    return flight.show(lambda s: replace(s, connected=False, mode="OFFBOARD"), in_flight(3.0)).fly()


def test_an_autopilot_that_our_heartbeats_keep_up_is_left_alone_where_nothing_shows_that_it_lands() -> None:
    flight = unheard(stays_up=True)
    lost, left = flight.pilot.ended.split("; ")
    assert lost == "the autopilot's heartbeat is lost"
    assert left == "nothing shows that the autopilot lands: its failsafe acts when quadctl is gone"
    began = flight.watch.first(lambda t: t.stage is Stage.LAND)
    assert 5.0 < flight.watch.ticks[-1].time_s - began.time_s < 6.2


def test_any_other_is_not() -> None:
    assert unheard(stays_up=False).pilot.ended == (
        "the autopilot's heartbeat is lost; the autopilot did not land and disarm in 20 s"
    )
