"""Words of the facts about a flight that is to begin, and their form in JSON."""

import json
import math

import pytest

from quadctl.flight.preflight.facts import Kind
from quadctl.flight.preflight.findings import judged
from quadctl.words import Fact, fact

HOVER = {"duration_s": 12.0, "endurance_s": 300.0}
LAG = {"log": "last.csv", "lag_s": 0.25, "interval_s": (0.23, 0.27)}
WORDS = {
    "12 s of flight, the vehicle hovers for 300 s, lands below 14 V": fact(Kind.ENDURANCE, **HOVER, least_v=14.0),
    "12 s of flight": fact(Kind.ENDURANCE, duration_s=12.0, endurance_s=None, least_v=0.0),
    "attitude lag 0.25 s [0.23, 0.27] in last.csv, configured 0.17": fact(Kind.LAG_SHOWN, **LAG, configured_s=0.17),
    "attitude lag 0.25 s [0.23, 0.27] in last.csv, configured none: look-ahead is off; `quadctl fit` writes it into "
    "the model file": fact(Kind.LAG_SHOWN, **LAG, configured_s=None),
    "CA_ROTOR2_AX, _AY, _AZ are 0.000, 0.000, -1.000, expected 0.342, 0.000, -0.940, the axis of rotor 3 of 'a': it "
    "would mix lateral force for other rotors": fact(
        Kind.OTHER_AXIS, name="CA_ROTOR2_AX", found=[0, 0, -1], expected=(0.342, 0, -0.94), rotor=3, vehicle="a"
    ),
    "its own checks do not pass (no GPS; no home): it would not arm": fact(
        Kind.NOT_READY, reasons=["no GPS", "no home"]
    ),
    "its own checks do not pass: it would not arm": fact(Kind.NOT_READY, reasons=()),
    "unknown, disarmed": fact(Kind.MODE, mode="", armed=False),
    "16.10 V, 80 % left": fact(Kind.VOLTAGE, battery_v=16.1, left_percent=80.0),
}


@pytest.mark.parametrize("words", WORDS)
def test_a_fact_is_worded_by_its_template(words: str) -> None:
    assert str(WORDS[words]) == words


def test_json_holds_the_figures_of_result_and_objection() -> None:
    found = fact(Kind.MESSAGES, part="position", rate_hz=0.0, oldest_ms=math.inf)
    refused = judged("messages", found, refused=fact(Kind.TOO_OLD, most_s=0.2), warning=Fact(Kind.NONE_CAME))
    assert json.loads(json.dumps(refused.to_dict(), allow_nan=False)) == {
        "verdict": "refused",
        "topic": "messages",
        "text": "position at 0 Hz, up to inf ms old: the guard hands over at max_state_age_s = 0.2",
        "kind": "messages",
        "figures": {"part": "position", "rate_hz": 0.0, "oldest_ms": None},
        "objection": {"kind": "too_old", "figures": {"most_s": 0.2}},
    }
