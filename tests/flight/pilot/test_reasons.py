"""Words of the reasons for which a flight ends."""

import pytest

from quadctl.flight.pilot.reasons import Kind, Reason, reason

STARTING = {"waited_s": 8.0, "armed": False, "expected": "OFFBOARD"}
WORDS = {
    "the autopilot left offboard for POSCTL": reason(Kind.LEFT_OFFBOARD, mode="POSCTL"),
    "the autopilot left offboard for an unknown mode": reason(Kind.LEFT_OFFBOARD, mode=""),
    "the position is 0.20 s old, allowed are 0.2 s": reason(Kind.STALE, part="position", age_s=0.201, most_s=0.2),
    "the height is -0.46 m, allowed are -0.45 m or more": reason(Kind.FLOOR, height_m=-0.46, least_m=-0.45),
    "the vehicle touches the ground: thrust carries 60% of its weight, and it does not fall": reason(
        Kind.CARRIED, share=0.6
    ),
    "the control loop stalled for 1.48 s, then the vehicle was disarmed": reason(
        Kind.STALLED_BEFORE, stalled_s=1.48, reason=Reason(Kind.DISARMED)
    ),
    "the autopilot did not get ready in 8 s: armed is False, mode is unknown, expected OFFBOARD": reason(
        Kind.NOT_STARTED, mode="", **STARTING
    ),
    "the autopilot did not get ready in 8 s: armed is False, mode is HOLD, expected OFFBOARD": reason(
        Kind.NOT_STARTED, mode="HOLD", **STARTING
    ),
    "no usable state came from the autopilot in 15 s: the autopilot restarted; no GPS; no home": reason(
        Kind.NO_USABLE_STATE, waited_s=15.0, problem=Reason(Kind.RESTARTED), texts=["no GPS", "no home"]
    ),
    "refused": reason(Kind.REFUSED, text="refused", texts=[]),
    "known by now: drag 0.1; thrust 1": reason(Kind.KNOWN, known={"drag": 0.1, "thrust": 1}),
}


@pytest.mark.parametrize("words", WORDS)
def test_a_reason_is_worded_by_its_template(words: str) -> None:
    assert str(WORDS[words]) == words
