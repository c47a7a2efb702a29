"""Somebody else flies: a mode that was taken is never taken back, known or not."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import pytest

from quadctl.flight.pilot.pilot import Pilot
from quadctl.flight.pilot.tick import Request, Stage
from quadctl.state import VehicleState
from tests.support.watched import HAND_OVER, RATE_HZ, Flight, at_stage, in_flight, stall, take_over


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
        flight.when(in_flight(3.0), partial(action, flight)).fly()
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


@pytest.mark.parametrize("stays_up", [True, False])
def test_an_autopilot_that_hovers_for_our_heartbeats_is_let_go_when_the_mode_is_given_back(stays_up: bool) -> None:
    """ArduPilot hovers in GUIDED for as long as it hears us; PX4's own failsafe lands it without targets."""
    flight = Flight(pilot_class=partial(Pilot, autopilot_stays_up=stays_up))
    flight.autopilot.parameters["COM_OF_LOSS_T"] = 60.0
    back_s = math.inf

    def give_back() -> None:
        nonlocal back_s
        flight.autopilot._enter("OFFBOARD")
        back_s = flight.autopilot.time_s

    flight.when(in_flight(3.0), lambda: flight.autopilot.somebody("POSCTL"))
    flight.when(at_stage(Stage.RELEASED, 30), give_back)
    flight.when(at_stage(Stage.RELEASED, 300), lambda: flight.autopilot.somebody("LAND")).fly()
    last = flight.watch.ticks[-1]
    assert flight.autopilot.asked == ["OFFBOARD", "ARM"]
    if stays_up:
        assert last.state.time_s - back_s == pytest.approx(2.0, abs=0.1)
        assert flight.pilot.ended == (
            "the autopilot left offboard for POSCTL; the mode is OFFBOARD again, which nobody flies: "
            "its failsafe lands it when quadctl is gone"
        )
    else:
        assert flight.pilot.ended == "the autopilot left offboard for POSCTL"
        assert not last.state.armed


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


def test_disarmed_before_the_news_of_it_the_landing_notes_it_and_nothing_more_is_asked_for() -> None:
    """PX4's state jumps when it is disarmed in flight, up to a second before a heartbeat tells."""
    flight = Flight()
    told_s = math.inf

    def late_news(s: VehicleState) -> VehicleState:
        vx, vy, vz = s.velocity_ned_m_s
        return replace(s, armed=s.time_s < told_s, velocity_ned_m_s=(vx, vy, vz + 3.5))

    def disarm() -> None:
        nonlocal told_s
        told_s = flight.autopilot.time_s + 0.59
        flight.autopilot._disarm()

    flight.autopilot.refusals["LAND"] = "disarmed"
    flight.show(late_news, in_flight(3.0)).when(in_flight(3.0), disarm).fly()
    assert flight.pilot.ended.startswith("the velocity jumped by 2.7 m/s")
    assert flight.pilot.ended.endswith("; the vehicle was disarmed")
    assert flight.watch.ticks[-1].events[-1][1:3] == ("the vehicle was disarmed", "release")


def test_a_vehicle_that_is_disarmed_already_is_not_asked_to_land() -> None:
    flight = Flight()
    flight.autopilot.ignored.add("LAND")

    def disarm() -> None:
        flight.autopilot._disarm()
        flight.pilot.request_failed(Request.LAND, "no answer", refused=False)

    flight.autopilot.parameters["COM_OF_LOSS_T"] = 60.0
    flight.when(at_stage(Stage.LAND, 120), disarm).fly()
    assert flight.autopilot.asked == ["OFFBOARD", "ARM", "LAND"]
    assert flight.pilot.ended == "completed; the vehicle was disarmed"
    assert "no answer" in [event.what for tick in flight.watch.ticks for event in tick.events]


# --- not known whose the mode is -----------------------------------------------------------------------------------


def test_after_a_stall_the_landing_is_asked_for_only_when_a_new_heartbeat_shows_offboard() -> None:
    flight = Flight()
    old_heartbeat_until_s = math.inf

    def late_news(s: VehicleState) -> VehicleState:
        if s.time_s >= old_heartbeat_until_s:
            return s
        return replace(s, mode="OFFBOARD", received_s={**s.received_s, "heartbeat": s.time_s - 0.8})

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
        return replace(s, mode="OFFBOARD", received_s={**s.received_s, "heartbeat": s.time_s - 0.8})

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


def test_after_a_stall_a_word_on_the_mode_that_waited_in_a_queue_shows_nothing() -> None:
    """All that had waited is as old as the stall was long, until the queue is empty."""
    flight = Flight()
    queued_until_s = math.inf

    def queued(s: VehicleState) -> VehicleState:
        if s.time_s >= queued_until_s:
            return s
        return replace(s, mode="OFFBOARD", received_s=dict.fromkeys(s.received_s, s.time_s - 0.6))

    def take_over_in_a_stall() -> None:
        nonlocal queued_until_s
        take_over(flight, "POSCTL")()
        stall(flight, 0.55)()
        queued_until_s = flight.autopilot.time_s + 0.1

    flight.when(in_flight(3.0), take_over_in_a_stall).show(queued, in_flight(3.0)).fly()
    assert "LAND" not in flight.autopilot.asked
    assert Stage.RELEASED in flight.watch.stages()


def test_an_autopilot_that_restarts_is_let_go() -> None:
    flight = Flight().show(lambda s: replace(s, boots=1), in_flight(3.0), until=0.1)
    flight.when(at_stage(Stage.RELEASED, 25), lambda: flight.autopilot.somebody("LAND")).fly()
    assert flight.pilot.ended == "the autopilot restarted"
    assert "LAND" not in flight.autopilot.asked


# --- the line is silent --------------------------------------------------------------------------------------------


def silent(since_s: float, mode_told_before_s: float = 0.0) -> Callable[[VehicleState], VehicleState]:
    """Change to a state of which nothing has arrived since `since_s`, the word on the mode some time before."""

    def change(s: VehicleState) -> VehicleState:
        received_s = dict.fromkeys(s.received_s, since_s) | {"heartbeat": since_s - mode_told_before_s}
        return replace(s, mode="OFFBOARD", received_s=received_s)

    return change


@pytest.mark.parametrize("mode_told_before_s", [0.0, 0.9])
def test_when_the_line_falls_silent_the_landing_is_asked_for_at_once_however_seldom_the_mode_is_told(
    mode_told_before_s: float,
) -> None:
    """The other direction may still work."""
    flight = Flight()

    def cut() -> None:
        flight.autopilot.change = silent(flight.autopilot.time_s, mode_told_before_s)

    flight.when(in_flight(3.0), cut)
    flight.when(at_stage(Stage.LAND, 100), lambda: setattr(flight.autopilot, "change", lambda s: s)).fly()
    began = flight.watch.first(lambda t: t.stage is Stage.LAND)
    (asked,) = flight.watch.with_request(Request.LAND)
    assert asked.time_s - began.time_s < 0.05
    assert flight.pilot.ended == "the position is 0.20 s old, allowed are 0.2 s"


def test_a_silence_that_a_stall_hid_does_not_show_whose_the_mode_is() -> None:
    flight = Flight()

    def cut() -> None:
        flight.autopilot.change = silent(flight.autopilot.time_s)
        stall(flight, 0.5)()

    flight.when(in_flight(3.0), cut)
    flight.when(at_stage(Stage.LAND, 100), lambda: setattr(flight.autopilot, "change", lambda s: s)).fly()
    assert flight.pilot.ended.startswith("the control loop stalled")
    assert "LAND" not in flight.autopilot.asked[:-1]
    for asked in flight.watch.with_request(Request.LAND):
        assert asked.state.mode_age_s <= 0.5


def test_a_stream_that_stops_alone_is_no_silence() -> None:
    flight = Flight()

    def change(s: VehicleState) -> VehicleState:
        return replace(s, received_s={**s.received_s, "position": 0.0, "heartbeat": s.time_s - 0.8})

    flight.show(change, in_flight(3.0), until=0.5).fly()
    (asked,) = flight.watch.with_request(Request.LAND)
    assert asked.state.mode_age_s == 0.0


# --- news that come apart -------------------------------------------------------------------------------------------


def clock_from_disarming() -> Callable[[VehicleState], float]:
    """Time since the first state that was disarmed, s; minus infinity before."""
    disarmed_s = math.inf

    def since_s(s: VehicleState) -> float:
        nonlocal disarmed_s
        if not s.armed:
            disarmed_s = min(disarmed_s, s.time_s)
        return s.time_s - disarmed_s

    return since_s


def test_a_mode_that_changes_after_landing_before_the_disarming_is_known_is_nobodys() -> None:
    """The mode may be told more often than the heartbeat, which alone tells armed from disarmed."""
    flight = Flight()
    since_disarmed_s = clock_from_disarming()

    def late_news(s: VehicleState) -> VehicleState:
        return replace(s, armed=s.armed or 0.0 <= since_disarmed_s(s) < 0.9)

    flight.show(late_news, at_stage(Stage.LAND)).fly()
    assert [e.answer for t in flight.watch.ticks for e in t.events] == ["land"]
    assert Stage.RELEASED not in flight.watch.stages()
    assert flight.watch.ticks[-1].state.mode == "HOLD"


def test_who_takes_off_again_after_the_landing_flies() -> None:
    flight = Flight()
    since_disarmed_s = clock_from_disarming()

    def taken(s: VehicleState) -> VehicleState:
        age_s = since_disarmed_s(s)
        return replace(s, armed=True, landed=age_s < 0.5, mode="POSCTL") if 0.0 <= age_s < 3.0 else s

    flight.show(taken, at_stage(Stage.LAND)).fly()
    assert Stage.RELEASED in flight.watch.stages()
    assert flight.autopilot.asked == ["OFFBOARD", "ARM", "LAND"]
