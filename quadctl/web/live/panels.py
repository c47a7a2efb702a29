"""Numbers and words of the live view: each is drawn once, and `show` updates it."""

import math
from collections.abc import Callable

from nicegui import ui
from nicegui.element import Element

from quadctl.flight.pilot.tick import Stage
from quadctl.flight.record.view_link import Record
from quadctl.web.elements.html import tag
from quadctl.web.live.history import Brief, History
from quadctl.web.live.nearness import Nearness, guards

NEAR = 0.7
"""Share of a limit above which a guard is highlighted."""
UNKNOWN = "\u2013"


class NowPanel:
    """Present phase of the flight, and the next one."""

    def __init__(self, brief: Brief) -> None:
        self._mission = brief.mission
        self._stage = ui.label("waiting for telemetry").classes("muted stage")
        self._phase = ui.label(UNKNOWN).classes("big phase").props('id="phase"')
        with tag("div", "phases").props('aria-hidden="true"'):
            self._bars = []
            for phase in brief.mission.phases:
                room = tag("span", "phase-room").style(f"flex-grow:{max(phase.end_s - phase.start_s, 0.1):.1f}")
                with room:
                    self._bars.append(tag("span", "phase-done").style("width:0%"))
        with tag("div", "line"):
            self._time = ui.label().classes("muted grow")
            self._next = ui.label().classes("muted next")
        self._changes = ui.label().classes("changes").props('id="changes"')

    def show(self, history: History) -> None:
        record = history.latest
        if record is None:
            return
        self._stage.set_text(
            f"{Stage[record.stage].value} · {record.mode or 'no mode'} · {'armed' if record.armed else 'disarmed'}"
        )
        self._phase.set_text(record.phase.replace("_", " "))
        self._changes.set_text("; ".join(record.changes))
        self._time.set_text(f"{record.flight_s:.0f} of {self._mission.duration_s:.0f} s")
        following = [phase.name for phase in self._mission.phases if phase.start_s > record.flight_s]
        flying = record.stage == Stage.FLY.name
        self._next.set_text(f"next: {following[0] if following else 'land'}" if flying else "")
        for phase, bar in zip(self._mission.phases, self._bars, strict=True):
            length = max(phase.end_s - phase.start_s, 1e-9)
            done = min(max((record.flight_s - phase.start_s) / length, 0.0), 1.0)
            bar.style(replace=f"width:{100.0 * done:.0f}%")


class Tiles:
    """The present values: height, speed, throttle, battery, lateness, age of the state."""

    def __init__(self) -> None:
        self._tiles: list[tuple[ui.label, ui.label, Callable[[Record, History], tuple[str, str]]]] = []
        with tag("section", "tiles").props('aria-label="Numbers"'):
            for name, unit, words in _TILES:
                with tag("div", "card tile"):
                    tag("span", "muted tile-name", name)
                    with tag("div", "tile-value"):
                        value = ui.label(UNKNOWN)
                        tag("span", "unit", unit)
                    self._tiles.append((value, ui.label().classes("muted tile-more"), words))

    def show(self, history: History) -> None:
        if history.latest is None:
            return
        for value, more, words in self._tiles:
            text, beside = words(history.latest, history)
            value.set_text(text)
            more.set_text(beside)


class GuardList:
    """A bar for each guard: value, limit, and the answer of a guard that has acted."""

    def __init__(self, brief: Brief) -> None:
        self._brief = brief
        self._rows: dict[str, tuple[Element, ui.label, Element]] = {}
        self._place = tag("ul", "guards")

    def show(self, record: Record) -> None:
        for guard in guards(record, self._brief):
            if guard.guard not in self._rows:
                self._rows[guard.guard] = self._row(guard)
            row, words, bar = self._rows[guard.guard]
            answer = guard.acted(record)
            share = min(guard.share, 1.0) if math.isfinite(guard.share) else float(guard.share > 0.0)
            kind = "acted" if answer else "near" if share > NEAR else ""
            row.classes(replace=f"guard {kind}")
            now = f"{_number(guard.value, guard.decimals)} / {guard.limit:.3g} {guard.unit}".rstrip()
            words.set_text(f"acted: {answer}" if answer else now)
            bar.style(replace=f"width:{100.0 * share:.0f}%")

    def _row(self, guard: Nearness) -> tuple[Element, ui.label, Element]:
        with self._place, tag("li", "guard").props(f'data-guard="{guard.guard}"') as row:
            tag("span", "guard-name", guard.guard)
            words = ui.label().classes("guard-value")
            with tag("span", "guard-room"):
                bar = tag("span", "guard-bar")
        return row, words, bar


class EventList:
    """List of events, the newest on top: phases as they begin, and the events that go into the log."""

    def __init__(self) -> None:
        self._shown = -1
        self._place = tag("ol", "events").props('id="events"')

    def show(self, history: History) -> None:
        events = history.latest.events if history.latest else ()
        if self._shown == len(history.phases) + len(events):
            return
        self._shown = len(history.phases) + len(events)
        lines = [(t, name.replace("_", " "), "") for t, name in history.phases]
        lines += [(event.time_s, event.what, event.answer) for event in events]
        self._place.clear()
        with self._place:
            for t, what, answer in sorted(lines, key=lambda line: line[0], reverse=True):
                with tag("li", "event acted" if answer else "event"):
                    tag("span", "muted event-time", f"{t:.1f} s")
                    tag("span", "grow", what)
                    if answer:
                        tag("span", "answer", answer)


def _number(value: float, decimals: int) -> str:
    return f"{value:.{decimals}f}" if math.isfinite(value) else UNKNOWN


def _height(record: Record, history: History) -> tuple[str, str]:
    known = math.isfinite(record.height_ref_m)
    return _number(record.height_m, 2), f"reference {record.height_ref_m:.2f}" if known else "no reference"


def _speed(record: Record, history: History) -> tuple[str, str]:
    return _number(record.speed_m_s, 2), f"tilt {_number(record.tilt_deg, 1)}°"


def _throttle(record: Record, history: History) -> tuple[str, str]:
    known = math.isfinite(record.thrust_n)
    return _number(100.0 * record.throttle, 0), f"thrust {record.thrust_n:.1f} N" if known else "no thrust"


def _battery(record: Record, history: History) -> tuple[str, str]:
    limit = history.brief.guards.min_battery_v
    return _number(record.battery_v, 2), f"lands below {limit:g} V" if limit > 0.0 else "not guarded"


def _lateness(record: Record, history: History) -> tuple[str, str]:
    return _number(1e3 * record.late_s, 2), f"worst {1e3 * history.worst_late_s:.2f} ms"


def _link(record: Record, history: History) -> tuple[str, str]:
    return _number(1e3 * record.state_age_s, 0), f"link {_number(record.link_age_s, 1)} s"


_TILES: tuple[tuple[str, str, Callable[[Record, History], tuple[str, str]]], ...] = (
    ("Height", "m", _height),
    ("Speed", "m/s", _speed),
    ("Throttle", "%", _throttle),
    ("Battery", "V", _battery),
    ("Tick late", "ms", _lateness),
    ("State age", "ms", _link),
)
