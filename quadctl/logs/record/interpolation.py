"""Rows that a program drew between the packets it received: straight lines, which hold no measurement.

A table of even rows is often made of slower packets by interpolation; after the last packet the same program may go on
along the last line for ever. Noise is never straight: a value that lies on the line between its neighbours, in every
column of its channel and to the last digit, was drawn.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from quadctl.logs.findings import Finding, Kind, Span, finding
from quadctl.logs.flight_log import FlightLog, Floats
from quadctl.logs.merge import runs
from quadctl.logs.record.flight_time import Mask

NOISE_OF_RESOLUTION = 20.0
"""Usual distance from the line, in the least difference of two values, from which on a straight line is no chance: a
smooth signal of few digits is often straight."""
STRAIGHT = 2e-4
"""Largest distance from the line over the change, which the digits of large times leave."""
SMOOTH_CORRELATION = 0.3
"""Correlation of a kink with the next from which on they are those of a smooth curve."""
LEAST_SHARE = 0.03
"""Share of the updates on straight lines from which on a channel is interpolated."""
LINE_S = 1.0
"""A longer straight line joins no packets: its channel was lost."""


@dataclass(frozen=True)
class _Drawn:
    rows: NDArray[np.intp]
    """Rows between packets."""
    lost: tuple[Span, ...]
    """Times of long lines."""
    share: float
    """Share of the channel's updates that lie on lines."""


def measured_rows(log: FlightLog, groups: Mapping[str, Sequence[str]]) -> tuple[FlightLog, list[Finding]]:
    """The log without the rows of its channels that were drawn, and findings on interpolated and on lost channels.

    `groups` are the columns of each channel, by its name.
    """
    columns, findings = dict(log.columns), []
    for name, own in groups.items():
        drawn = _drawn(log, own)
        if drawn is None:
            continue
        for column in own:
            values = columns[column].copy()
            values[drawn.rows] = np.nan
            columns[column] = values
        updates = log.updates(*own)
        left = len(updates) - len(drawn.rows)
        span_s = float(log.time_s[updates[-1]] - log.time_s[updates[0]])
        if drawn.share >= LEAST_SHARE:
            told = {
                "channel": name,
                "share": drawn.share,
                "rows_hz": len(updates) / span_s,
                "at_most_hz": left / span_s,
            }
            findings.append(Finding(Kind.INTERPOLATED, told))
        if drawn.lost:
            findings.append(finding(Kind.EXTRAPOLATED, drawn.lost, channel=name))
    return replace(log, columns=columns), findings


def _drawn(log: FlightLog, names: Sequence[str]) -> _Drawn | None:
    if not all(log.has(name) for name in names):
        return None
    rows = log.updates(*names)
    if len(rows) < 10:
        return None
    time_s = log.time_s[rows]
    straight = np.ones(len(rows) - 2, dtype=bool)
    noisy = np.zeros(len(rows) - 2, dtype=bool)
    for name in names:
        values = log[name][rows]
        least = resolution(values)
        before = (time_s[1:-1] - time_s[:-2]) / (time_s[2:] - time_s[:-2])
        off = values[1:-1] - (values[:-2] + before * (values[2:] - values[:-2]))
        change = np.abs(values[2:] - values[:-2])
        on_line = np.abs(off) <= 2.0 * least + STRAIGHT * change
        straight &= on_line
        usual = 0.0 if on_line.all() else float(np.median(np.abs(off[~on_line])))
        if usual > NOISE_OF_RESOLUTION * least and _is_noise(off, on_line):
            noisy |= change > usual
    inner = np.concatenate([[False], straight & noisy, [False]])
    if not inner.any():
        return None
    lost, drawn = _long_lines(time_s, inner)
    share = float(np.mean(inner & ~drawn))
    if share < LEAST_SHARE and not lost:
        return None
    gone = drawn | (inner if share >= LEAST_SHARE else False)
    return _Drawn(rows[gone], tuple(lost), share)


def _is_noise(off: Floats, on_line: Mask) -> bool:
    """Tell whether the kinks of a signal come from noise, of which one does not tell the next, or from a smooth curve.

    A kink between two rows bends at both of them: they count as one.
    """
    kinks: list[Floats] = []
    for begin, end in runs(~on_line):
        run = off[begin:end]
        kinks.append(run.sum(keepdims=True) if len(run) <= 2 else run)
    each = np.concatenate(kinks) if kinks else np.zeros(0)
    power = float(each @ each)
    return len(each) > 10 and power > 0.0 and float(each[1:] @ each[:-1]) < SMOOTH_CORRELATION * power


def _long_lines(time_s: Floats, inner: Mask) -> tuple[list[Span], Mask]:
    """Times of lines longer than LINE_S, and the updates that they hold; a line that reaches the end holds the end."""
    lost: list[Span] = []
    drawn = np.zeros(len(inner), dtype=bool)
    for begin, end in runs(inner):
        if time_s[min(end, len(time_s) - 1)] - time_s[begin] < LINE_S:
            continue
        end_row = len(inner) if end >= len(inner) - 1 else end
        drawn[begin:end_row] = True
        lost.append((float(time_s[begin]), float(time_s[min(end, len(time_s) - 1)])))
    return lost, drawn


def resolution(values: Floats) -> float:
    """Least difference of two values that are not the same: the last digit, of few digits."""
    steps = np.diff(np.unique(values))
    steps = steps[steps > 1e-12 * max(float(np.max(np.abs(values))), 1e-12)]
    return float(steps.min()) if len(steps) else 0.0
