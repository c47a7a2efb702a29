"""Chunks of STATUSTEXT become whole texts."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from quadctl.flight.autopilot.status_texts import CHUNK, LOST, PATIENCE_S, StatusTexts

LETTERS = st.characters(min_codepoint=48, max_codepoint=122)


def chunks(text: str, number: int, severity: int = 4) -> list[dict[str, object]]:
    """The messages in which PX4 sends a text."""
    return [
        {"severity": severity, "text": text[first : first + CHUNK], "id": number, "chunk_seq": place}
        for place, first in enumerate(range(0, len(text), CHUNK))
    ]


def taken(*messages: dict[str, object]) -> StatusTexts:
    texts = StatusTexts()
    for message in messages:
        texts.take(message, 1.0)
    return texts


@given(st.lists(st.text(LETTERS, min_size=1, max_size=180), min_size=1, max_size=10))
def test_texts_come_out_as_they_went_in(said: list[str]) -> None:
    texts = taken(*(message for number, text in enumerate(said) for message in chunks(text, number)))
    texts.settle(1.0 + 2.0 * PATIENCE_S)
    assert [text.text for text in texts.texts] == said


def test_a_short_text_is_there_at_once_and_a_full_chunk_after_a_moment() -> None:
    assert [str(text) for text in taken(*chunks("Battery failure", 0, 2)).texts] == [
        "the autopilot says (critical): Battery failure"
    ]
    full = taken(*chunks("x" * CHUNK, 7))
    assert full.texts == ()
    assert [text.text for text in full.since(1.0)] == ["x" * CHUNK]
    full.settle(1.0 + PATIENCE_S)
    assert full.texts == ()
    full.settle(1.1 + PATIENCE_S)
    assert [text.text for text in full.texts] == ["x" * CHUNK]


def test_chunks_out_of_order_are_put_in_order() -> None:
    text = "a" * CHUNK + "b" * CHUNK + "c"
    first, second, third = chunks(text, 3)
    assert [t.text for t in taken(third, first, second).texts] == [text]


def test_a_chunk_that_is_lost_is_marked_and_the_next_text_is_whole() -> None:
    first, _, third = chunks("a" * CHUNK + "b" * CHUNK + "c", 3)
    said = [text.text for text in taken(first, third, *chunks("next", 4)).texts]
    assert said == ["a" * CHUNK + LOST + "c", "next"]


@pytest.mark.parametrize("fields", [{"text": "PreArm: no\0\0"}, {"text": "PreArm: no\t", "id": 0, "chunk_seq": 0}])
def test_an_autopilot_without_chunks_is_understood(fields: dict[str, object]) -> None:
    texts = taken({"severity": 3, **fields}, {"severity": 3, **fields})
    assert [text.text for text in texts.texts] == ["PreArm: no"] * 2


def test_the_severities_of_warnings_and_worse_are_grave() -> None:
    assert [taken(*chunks("x", 0, severity)).texts[0].grave for severity in (0, 4, 5, 7)] == [True, True, False, False]
