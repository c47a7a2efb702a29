"""Readings of scales, typed or sent, and the numbers of motors."""

import asyncio

import pytest

from quadctl.frames import GRAVITY_M_S2
from quadctl.thrust_stand.motor import clockwise_place
from quadctl.thrust_stand.scale import TypedScale, parse_reading
from tests.support.thrust_stand import VEHICLE


@pytest.mark.parametrize(
    ("line", "reading"),
    [
        ("123.4 g", (123.4, "g")),
        ("ST,GS,+0123.4g", (123.4, "g")),
        ("- 0.5 kg", (-0.5, "kg")),
        ("12,5 N", (12.5, "n")),
        ("17", (17.0, "")),
        ("OL", None),
        ("a8f7x", None),
        ("\x007\ufffd", None),
    ],
)
def test_lines_of_scales(line: str, reading: tuple[float, str] | None) -> None:
    assert parse_reading(line) == reading


def test_a_person_is_asked_again_after_what_is_no_number() -> None:
    answers = iter(["", "many", "250 kg", "250"])
    scale = TypedScale("g", lambda _: next(answers))
    asyncio.run(scale.tare(0.0))
    assert asyncio.run(scale.thrust_n(0.0)) == pytest.approx(0.25 * GRAVITY_M_S2)


def test_ardupilot_counts_motors_clockwise_from_the_front() -> None:
    assert [clockwise_place(VEHICLE, number) for number in (1, 2, 3, 4)] == [1, 3, 4, 2]
