"""Templates are filled with facts, choose by them, and take the formats of their table."""

import json
import math

import pytest

from quadctl.words import By, Kinds, Template, When, Words, fact

WORDS = Words({"side": {True: "left", False: "right"}, "cm": lambda metres: f"{100.0 * metres:.0f} cm"})


class Kind(Kinds):
    SPEED = "{speed_m_s:.1f} m/s"
    WITHIN = "{inner}, within"


@pytest.mark.parametrize(
    ("template", "words"),
    [
        ("{height_m:.2f} m of {names:list}, {names:and}", "1.50 m of a, b, a and b"),
        ("{height_m:cm} to the {is_left:side}", "150 cm to the left"),
        ("{one:count row}, {two:count row}", "1 row, 2 rows"),
        (By("of", {"a": "first {two}"}, "another"), "first 2"),
        (By("of", {"b": "first"}, "another {of}"), "another a"),
        (By("absent", {None: "not known"}, "known"), "not known"),
        (By("zero", {None: "not known"}, "known"), "known"),
        (When("zero", "some", "none"), "none"),
        (When("absent", "some"), ""),
        (("x", When("two", (" and ", By("of", {"a": "{one}"}))), "."), "x and 1."),
    ],
)
def test_a_template_is_filled_with_facts(template: Template, words: str) -> None:
    facts = {"height_m": 1.5, "names": ["a", "b"], "is_left": True, "one": 1, "two": 2, "of": "a", "zero": 0.0}
    assert WORDS.say(template, facts) == words


def test_a_fact_that_a_template_needs_and_lacks_is_an_error() -> None:
    with pytest.raises(KeyError, match="speed_m_s"):
        str(fact(Kind.SPEED))


def test_a_fact_within_another_is_worded_and_written_with_it() -> None:
    found = fact(Kind.WITHIN, inner=fact(Kind.SPEED, speed_m_s=2.0), range_m=(0.1, math.nan), path=math)
    assert str(found) == "2.0 m/s, within"
    written = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert written["kind"] == "within"
    assert written["figures"]["inner"] == {"kind": "speed", "figures": {"speed_m_s": 2.0}}
    assert written["figures"]["range_m"] == [0.1, None]
