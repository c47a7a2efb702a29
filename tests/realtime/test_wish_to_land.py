"""The wish to land: the one word that comes back from a live view, from the process to which the flight gave an end."""

from collections.abc import Iterator

import pytest

from quadctl.flight.loop import fly
from quadctl.flight.pilot.tick import Tick
from quadctl.flight.realtime import run
from quadctl.flight.record.view_link import LANDED_BY, WISH_TO_LAND, ViewEnd, ViewLink, connected_ends
from tests.support.in_process import HURRY_HZ, InProcess, in_flight, plan

pytestmark = pytest.mark.realtime


@pytest.fixture
def ends() -> Iterator[tuple[ViewEnd, ViewEnd]]:
    """The flight's and the viewer's."""
    made = connected_ends()
    yield made
    for end in made:
        end.close()


def flown(flight: ViewEnd, viewer: ViewEnd, words: list[bytes]) -> str:
    """Ending of a flight to which the viewer sends `words` once it is in the air."""
    autopilot, pilot, ticks = InProcess(), plan().pilot(), list[Tick]()

    def say(tick: Tick) -> None:
        ticks.append(tick)
        if in_flight(ticks) and words:
            viewer.send(words.pop())

    run(fly(autopilot, pilot, HURRY_HZ, [say, ViewLink(flight, pilot)]))
    assert not autopilot.px.armed
    return pilot.ended


def test_the_wish_to_land_lands(ends: tuple[ViewEnd, ViewEnd]) -> None:
    assert flown(*ends, [WISH_TO_LAND]) == LANDED_BY


def test_other_words_do_not_and_no_other_program_has_an_address_to_send_one_to(ends: tuple[ViewEnd, ViewEnd]) -> None:
    assert [end.getsockname() for end in ends] == ["", ""]
    assert flown(*ends, [b"lan", b"", b"LAND", b"\xff" * 2000]) == "completed"
