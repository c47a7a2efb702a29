"""The display in the terminal: the texts of the autopilot, and an autopilot that is gone."""

import io
from dataclasses import replace

from rich.console import Console

from quadctl.flight.pilot.tick import Stage
from quadctl.flight.record.display import Display, picture
from quadctl.state import StatusText, VehicleState
from tests.support.watched import Flight, at_stage


def test_every_text_of_the_autopilot_is_printed_with_its_severity() -> None:
    flight, told = Flight().fly(), io.StringIO()
    texts = (StatusText(1.0, 2, "Battery [low] failure"), StatusText(1.0, 6, "Landing detected"))
    with Display(flight.pilot, Console(file=told)) as display:
        display(flight.watch.ticks[-1]._replace(texts=texts))
    assert "the autopilot says (critical): Battery [low] failure\n" in told.getvalue()
    assert "the autopilot says (info): Landing detected\n" in told.getvalue()


def test_a_text_that_is_repeated_is_printed_once() -> None:
    flight, told = Flight().fly(), io.StringIO()
    with Display(flight.pilot, Console(file=told)) as display:
        for i in range(24):
            display(flight.watch.ticks[-1]._replace(texts=(StatusText(float(i), 2, "Preflight Fail: no mag"),)))
    assert told.getvalue().count("Preflight Fail: no mag") == 1


def test_an_autopilot_of_which_nothing_comes_is_called_gone() -> None:
    heard_s = 6.0

    def silent(state: VehicleState) -> VehicleState:
        old = {part: min(received_s, heard_s) for part, received_s in state.received_s.items()}
        return replace(state, received_s=old, connected=state.time_s - heard_s < 3.0)

    flight = Flight().show(silent, at_stage(Stage.FLY, 1)).fly()
    assert flight.pilot.ended.endswith("; the autopilot is gone")
    text = io.StringIO()
    told = Console(file=text)
    told.print(picture(flight.watch.ticks[-1], flight.pilot))
    assert "gone: no message for " in text.getvalue()
    events = [(event.what, event.answer) for tick in flight.watch.ticks for event in tick.events]
    assert ("the autopilot is gone: nothing comes from it", "") in events
