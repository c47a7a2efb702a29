"""Events of an autopilot's log: changes of its flight mode, its messages, and changes of its parameters."""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from quadctl.logs.findings import Finding, Kind, Span, finding
from quadctl.logs.parameter_history import ParameterHistory

PX4_MODES = {
    0: "MANUAL", 1: "ALTCTL", 2: "POSCTL", 3: "AUTO.MISSION", 4: "AUTO.LOITER", 5: "AUTO.RTL", 6: "POSITION_SLOW",
    8: "ALTITUDE_CRUISE", 10: "ACRO", 12: "DESCEND", 13: "TERMINATION", 14: "OFFBOARD", 15: "STABILIZED",
    17: "AUTO.TAKEOFF", 18: "AUTO.LAND", 19: "AUTO.FOLLOW", 20: "AUTO.PRECLAND", 21: "ORBIT", 22: "VTOL.TAKEOFF",
}  # fmt: skip
"""Names of `nav_state` in PX4's vehicle_status."""
EARLY_S = 1.0
"""Time before the first row of a log from which events are kept: they hold at its begin."""
MODE = "mode "
"""Begin of the events at which the flight mode changes; its name follows."""
RESET = "estimator reset its "
"""Begin of the events at which an estimator corrected itself by a jump; what was reset follows."""
_COLOURS = re.compile(r"\x1b\[[0-9;]*m")


class Event(NamedTuple):
    """One event; its time is on the autopilot's clock, of those in `meta` from the log's first row."""

    time_s: float
    what: str


def mode_changes(time_s: Iterable[float], modes: Sequence[Any], names: Mapping[int, str] | None = None) -> list[Event]:
    """The first mode, and every change of it; `modes` are names, or numbers with `names`."""
    found: list[Event] = []
    last: Any = None
    for time, mode in zip(time_s, modes, strict=True):
        if mode != last:
            name = mode if names is None else names.get(int(mode), f"number {int(mode)}")
            found.append(Event(float(time), f"{MODE}{name}"))
            last = mode
    return found


def parameter_changes(history: ParameterHistory) -> list[Event]:
    """Changes of parameters; a value that is said for the first time, or again, is none."""
    return [
        Event(change.time_s, f"{change.name} = {change.after:g} (was {change.before:g})")
        for change in history.changes()
    ]


def estimator_resets(time_s: Sequence[float], counter: Sequence[float], what: str) -> list[Event]:
    """Each change of an estimator's `counter` of the resets of one quantity, `what`."""
    changed = [i for i in range(1, len(counter)) if counter[i] != counter[i - 1]]
    return [Event(float(time_s[i]), f"{RESET}{what}") for i in changed]


def events_of(meta: Mapping[str, Any]) -> list[Event]:
    """The events in a log's `meta`, in the order of time; entries that a reader cannot place are left out."""
    found = []
    entries = meta.get("events")
    for entry in entries if isinstance(entries, list) else []:
        time_s = entry.get("time_s") if isinstance(entry, dict) else None
        if isinstance(time_s, int | float) and math.isfinite(time_s):
            found.append(Event(float(time_s), str(entry.get("what", "event"))))
    return sorted(found, key=lambda event: event.time_s)


def resets_of(meta: Mapping[str, Any]) -> list[Finding]:
    """Findings on the resets among the events of a log's `meta`, one for each quantity."""
    times: dict[str, list[Span]] = {}
    for event in events_of(meta):
        if event.what.startswith(RESET):
            times.setdefault(event.what.removeprefix(RESET), []).append((event.time_s, event.time_s))
    return [finding(Kind.RESET, when, of=what) for what, when in times.items()]


def said(time_s: Iterable[float], texts: Iterable[str]) -> list[Event]:
    """Messages, without the codes of colours; the same text at the same time is one."""
    cleaned = (Event(float(time), _COLOURS.sub("", text).strip()) for time, text in zip(time_s, texts, strict=True))
    return list(dict.fromkeys(event for event in cleaned if event.what))


def events_in_meta(events: Iterable[Event], begin_s: float, end_s: float) -> list[dict[str, Any]]:
    """Entries of a log's `meta`, in the order of time from `begin_s`; events outside of the log are left out."""
    inside = [event for event in events if begin_s - EARLY_S <= event.time_s <= end_s]
    return [
        {"time_s": round(max(event.time_s - begin_s, 0.0), 3), "what": event.what}
        for event in sorted(inside, key=lambda event: event.time_s)
    ]
