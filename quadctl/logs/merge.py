"""Channels that arrive each at its own rate become the one table of a `FlightLog`.

Autopilots log every message on its own clock. A row of the table is made for every update of a channel that says how
the vehicle moves or what drives it (position, attitude, rates, rotors, throttle); updates less than ROW_TOLERANCE_S
apart share a row. All values are held until their next update and NaN before the first, never interpolated, so that
`FlightLog.updates` finds the updates that were logged. Channels that come faster than the rows and are noisy (the IMU)
are averaged over the time since the row before: each sample counts once.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from quadctl.errors import LogError
from quadctl.logs.cleaning import increasing
from quadctl.logs.columns import STATE_COLUMNS
from quadctl.logs.events import Event, events_in_meta, resets_of
from quadctl.logs.findings import Finding, Kind, finding
from quadctl.logs.flight_log import ATTITUDE, POSITION, VELOCITY, FlightLog, Floats, doubt_of_copy

ROW_TOLERANCE_S = 0.002
"""Two updates closer than this are one row: at most 500 rows a second, and no value is off by more than this."""


@dataclass(frozen=True, eq=False)
class Channel:
    """Columns that arrive together, at their own updates."""

    source: str
    """Source in the log, e.g. the name of the message."""
    time_s: Floats
    """On the autopilot's clock, shape (n,)."""
    columns: dict[str, Floats]
    """By the names of the table's columns, each of shape (n,)."""
    makes_rows: bool = True
    averaged: bool = False

    @property
    def rate_hz(self) -> float:
        """Mean number of updates per second; 0 when there are not two."""
        span = float(self.time_s[-1] - self.time_s[0]) if len(self.time_s) > 1 else 0.0
        return (len(self.time_s) - 1) / span if span > 0.0 else 0.0


@dataclass(frozen=True)
class Origin:
    """Origin of the channels, for the log's `meta` and its error messages."""

    path: Path
    needs: str
    """Names of the messages without which there is no position, velocity or attitude."""
    meta: dict[str, Any]
    findings: list[Finding]
    armed_s: list[tuple[float, float]]
    """[(from, to), ...] in which the motors were armed, on the autopilot's clock; empty where the log does not say."""
    invalid: dict[str, str] = field(default_factory=dict)
    """Reason why a column holds no values although its message is there, by the name of the column."""
    events: list[Event] = field(default_factory=list)
    required: tuple[str, ...] = (*POSITION, *VELOCITY, *ATTITUDE)
    """Columns without which there is no log."""
    row_tolerance_s: float = ROW_TOLERANCE_S
    """Time within which updates share a row."""


def merge(channels: Iterable[Channel], origin: Origin) -> FlightLog:
    """Merge all `channels` into one table, by the rules of this module's docstring.

    Raises
    ------
    LogError
        A required column is missing: position, velocity or attitude.
    """
    findings = list(origin.findings)
    kept = [made for channel in channels if len((made := _with_increasing_time(channel, findings)).time_s)]
    found = {name for channel in kept for name, values in channel.columns.items() if np.isfinite(values).any()}
    missing = [name for name in origin.required if name not in found]
    if missing:
        there = list(dict.fromkeys(channel.source for channel in kept))
        raise LogError(
            f"{origin.path}: holds no values of {_reasoned(missing, there, origin)}{doubt_of_copy(findings)}"
        )
    clock = row_times(
        np.concatenate([channel.time_s for channel in kept if channel.makes_rows]), origin.row_tolerance_s
    )
    columns = {"time_s": np.round(clock - clock[0], 6)}
    for channel in kept:
        values, tolerance_s = channel.columns.values(), origin.row_tolerance_s
        if channel.averaged:
            together = np.array([averaged(clock, channel.time_s, each, tolerance_s) for each in values])
        else:
            each_row = np.reshape([*values], (len(values), len(channel.time_s)))
            together = held(clock, channel.time_s, each_row, tolerance_s)
        columns |= dict(zip(channel.columns, together, strict=True))
    absent = [name for name in STATE_COLUMNS if name not in columns]
    columns |= {name: np.full(len(clock), np.nan) for name in absent}
    if absent:
        findings.append(finding(Kind.ABSENT_COLUMNS, columns=absent))
    meta = {
        **origin.meta,
        "time_zero_s": float(clock[0]),
        "armed_s": [[round(edge - float(clock[0]), 3) for edge in interval] for interval in origin.armed_s],
        "events": events_in_meta(origin.events, float(clock[0]), float(clock[-1])),
        "sources": {c.source: {"rate_hz": round(c.rate_hz, 2), "columns": list(c.columns)} for c in kept},
    }
    on_log = [found.later(-float(clock[0])) for found in findings]
    return FlightLog(origin.path.name, origin.path, columns, None, meta, [*on_log, *resets_of(meta)])


def _reasoned(missing: list[str], there: list[str], origin: Origin) -> str:
    """The missing columns with what was expected: messages beside those that are there, or values that are valid."""
    reasons = dict.fromkeys(origin.invalid[name] for name in missing if name in origin.invalid)
    unsaid = [name for name in missing if name not in origin.invalid]
    beside = f" beside {', '.join(there)}" if there else ""
    expected = [f"messages {origin.needs}{beside}"] if unsaid else []
    expected += ["a flight in which they are valid"] if reasons else []
    return f"{', '.join(missing)}{''.join(f' ({reason})' for reason in reasons)}, expected {' and '.join(expected)}"


def row_times(time_s: Floats, tolerance_s: float = ROW_TOLERANCE_S) -> Floats:
    """Times of the rows, increasing: of updates closer than `tolerance_s` the first, shape (rows,)."""
    rows: list[float] = []
    end = -np.inf
    times = np.unique(time_s)
    if np.all(times[1:] > times[:-1] + tolerance_s):
        return times
    for time in times.tolist():
        if time > end:
            rows.append(time)
            end = time + tolerance_s
    return np.array(rows)


def held(clock_s: Floats, time_s: Floats, values: Floats, tolerance_s: float = ROW_TOLERANCE_S) -> Floats:
    """`values`, updated at `time_s`, as known at each row: the last update, NaN before the first. Shape (..., rows)."""
    last = _updates_so_far(clock_s, time_s, tolerance_s)
    return np.where(last > 0, values[..., np.maximum(last - 1, 0)], np.nan)


def averaged(clock_s: Floats, time_s: Floats, values: Floats, tolerance_s: float = ROW_TOLERANCE_S) -> Floats:
    """Mean of the finite `values` since the row before; held where there is none, NaN before the first."""
    finite = np.isfinite(values)
    time_s, values = time_s[finite], values[finite]
    last = _updates_so_far(clock_s, time_s, tolerance_s)
    # The first row has no row before: it takes its latest sample, not the mean of all that came earlier.
    before = np.concatenate([np.maximum(last[:1] - 1, 0), last[:-1]])
    new = last > before
    sums = np.concatenate([[0.0], np.cumsum(values)])
    means = (sums[last[new]] - sums[before[new]]) / (last[new] - before[new])
    return held(clock_s, clock_s[new], means, tolerance_s)


def _updates_so_far(clock_s: Floats, time_s: Floats, tolerance_s: float) -> NDArray[np.intp]:
    return np.searchsorted(time_s, clock_s + tolerance_s, side="right")


def _with_increasing_time(channel: Channel, findings: list[Finding]) -> Channel:
    keep = increasing(channel.time_s)
    if keep.all():
        return channel
    dropped = int(np.count_nonzero(~keep))
    findings.append(finding(Kind.MESSAGES_OUT_OF_TIME, left_out=dropped, messages=len(keep), source=channel.source))
    columns = {name: values[keep] for name, values in channel.columns.items()}
    return Channel(channel.source, channel.time_s[keep], columns, channel.makes_rows, channel.averaged)


def finite(values: Any) -> Floats:
    """`values` as floats, with NaN for any that is not finite."""
    with np.errstate(invalid="ignore"):  # damage can look like a signalling NaN
        array = np.asarray(values, dtype=np.float64)
    return np.where(np.isfinite(array), array, np.nan)


def intervals(time_s: Floats, on: NDArray[np.bool_]) -> list[tuple[float, float]]:
    """[(from, to), ...] in which a flag that is reported at `time_s` was set."""
    last = len(time_s) - 1
    return [(float(time_s[begin]), float(time_s[min(end, last)])) for begin, end in runs(on)]


def runs(on: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """[(begin, end), ...] of the rows in which a flag is set, each end the row after."""
    edges = np.flatnonzero(np.diff(on.astype(np.int8), prepend=0, append=0)).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))
