"""Before the flight: whose vehicle it is, what is waited for, and a start that is refused."""

from dataclasses import replace

import pytest

from quadctl.flight.pilot.guards import GuardLimits
from quadctl.flight.pilot.tick import Request, Stage
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.state import NAN, StatusText, VehicleState
from tests.support.watched import HAND_OVER, LAND, Change, Flight, at_stage, leaning, moved, plan_with, take_over


def test_an_armed_vehicle_is_not_taken() -> None:
    flight = Flight()
    assert SimulatedAutopilot.request_arm(flight.autopilot) is None
    flight.fly()
    assert flight.pilot.ended == "the vehicle is armed already, expected it to stand disarmed on the ground"
    assert flight.autopilot.asked == []
    assert not any(t.target for t in flight.watch.ticks)


@pytest.mark.parametrize("stage", [Stage.STREAM, Stage.START])
def test_a_vehicle_that_somebody_arms_is_not_taken(stage: Stage) -> None:
    """The vehicle may be in the air a moment later: idle throttle in offboard would drop it."""
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
        (
            lambda s: replace(s, battery_alarm="critical", battery_remaining=0.03),
            "the autopilot calls the battery critical (3 % of the battery is left)",
        ),
    ],
    ids=lambda v: v if isinstance(v, str) else "",
)
def test_a_state_that_does_not_become_usable_is_not_flown(change: Change, words: str) -> None:
    flight = Flight(plan_with(guards=GuardLimits(min_battery_v=13.5))).show(change).fly()
    assert flight.pilot.ended == f"no usable state came from the autopilot in 15 s: {words}"
    assert flight.watch.ticks[-1].time_s == pytest.approx(15.0, abs=0.1)
    assert flight.autopilot.asked == []


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (leaning, "expected at most 10 deg"),
        (lambda s: replace(s, velocity_ned_m_s=(0.0, 0.4, 0.0)), "expected at most 0.3 m/s"),
        (moved(0.0, 0.0, -1.0), "height_datum: frame takes z = 0 for the ground, expected the vehicle there"),
    ],
    ids=["leaning", "moving", "above z = 0"],
)
def test_a_vehicle_that_does_not_stand_on_the_ground_is_not_flown(change: Change, words: str) -> None:
    flight = Flight().show(change).fly()
    assert "in 15 s: the vehicle does not stand on the ground: " in flight.pilot.ended
    assert words in flight.pilot.ended
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


def test_an_autopilot_that_is_not_ready_is_asked_for_its_reasons() -> None:
    told = (StatusText(55.0, 6, "calibrated"), StatusText(56.0, 2, "Preflight Fail: no mag"))

    def unready(state: VehicleState) -> VehicleState:
        return replace(state, ready_to_arm=False, texts=told if state.time_s > 56.0 else ())

    flight = Flight().show(unready).fly()
    assert flight.pilot.ended == (
        "no usable state came from the autopilot in 60 s: the autopilot is not ready to arm in HOLD; "
        "Preflight Fail: no mag"
    )
    asked_s = [t.time_s for t in flight.watch.ticks if Request.CHECKS in t.requests]
    assert asked_s == pytest.approx([5.0 * i for i in range(12)], abs=0.5)
    assert set(flight.watch.requests) == {Request.CHECKS}
    events = [(event.what, event.answer) for tick in flight.watch.ticks for event in tick.events]
    assert events[:2] == [
        ("the autopilot says (info): calibrated", ""),
        ("the autopilot says (critical): Preflight Fail: no mag", ""),
    ]


def test_an_autopilot_that_gets_ready_is_flown() -> None:
    flight = Flight().show(lambda s: replace(s, ready_to_arm=False), until=7.0).fly()
    assert flight.pilot.ended == "completed"


def test_a_broken_link_before_the_arming_is_the_reason_given() -> None:
    flight = Flight()
    flight.when(at_stage(Stage.STREAM, 10), lambda: flight.pilot.fail("the cable is gone")).fly()
    assert flight.pilot.ended == "the cable is gone"
    assert flight.autopilot.asked == []


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
