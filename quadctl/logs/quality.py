"""Content and quality of a log: true update rates, gaps, clock, and whether it can be analysed.

Rows say little: a log holds a slow channel's value from row to row. So everything is counted in updates, the rows in
which a channel got a new value.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from quadctl.logs.channel_groups import channel_groups, updates_of_any
from quadctl.logs.findings import Finding, Kind, Span, finding, worded
from quadctl.logs.flight_log import POSITION, VELOCITY, FlightLog
from quadctl.logs.kinematics import integral
from quadctl.logs.own_correction import correction_findings
from quadctl.logs.record.record import Record, examine, mean_rate_hz
from quadctl.words import By, Template, When, Words, plain

GAP_FACTOR = 5.0
"""An interval between updates longer than this many median ones is a gap."""
MOVING_M = 0.5
"""A stretch of a second in which the vehicle covers more than this along an axis tells of the clock."""
MIN_MOVING_STRETCHES = 20
MIN_CLOCK_ERROR = 0.01
CLOCK_ERROR_SIGMA = 4.0
LINES: tuple[Template, ...] = (
    (
        "Clock: rows {row_interval_ms:.1f} ms apart (median; standard deviation {row_jitter_ms:.1f} ms, longest "
        "{longest_ms:.0f} ms)",
        When("is_counted", ", all equal: counted, or simulated, not measured"),
        ".",
    ),
    When(
        "wrong",
        (
            "Positions change {percent:.1f} % (±{error_percent:.1f}) ",
            By("wrong", {"slow": "more"}, "less"),
            " than the velocities say: the clock runs {wrong} by as much, or the velocity is wrong.",
        ),
    ),
    ("In flight for about {flight_s:.0f} s; thrust from ", When("thrust_source", "{thrust_source}", "nothing"), "."),
)
"""Templates of the first lines of a report."""
SOURCE, NOTE = "From {source}: {channels:list}.", "Note: {note}."
CAN_BE, CANNOT_BE = "Can be analysed.", "Cannot be analysed:"


@dataclass(frozen=True)
class ChannelQuality:
    """Columns that arrive together."""

    name: str
    columns: tuple[str, ...]
    source: str
    """The autopilot's message and the rate at which it was logged, "" where the log does not say."""
    n_updates: int
    rate_hz: float
    """Updates per second in flight, or over the log where it holds no flight; 0 when there are not two."""
    median_interval_s: float
    longest_gap_s: float
    longest_gap_at_s: float
    """Begin of the longest interval without an update; NaN when there are not two updates."""
    n_gaps: int
    """Intervals between updates longer than GAP_FACTOR median ones."""
    held_share: float
    """Share of the rows with a value that repeat the one before."""
    nan_share: float
    """Share of all rows without a value."""


@dataclass(frozen=True)
class ClockQuality:
    """The rows' clock."""

    n_rows: int
    row_interval_s: float
    """Median."""
    row_jitter_s: float
    """Standard deviation of the interval between rows."""
    longest_row_interval_s: float
    is_counted: bool
    """All rows equally far apart, to the digit: counted, not measured."""
    scale: float
    """True time per logged time, from position against velocity; NaN where the motion does not tell."""
    scale_error: float
    """Standard error of `scale`."""

    @property
    def runs_wrong(self) -> bool:
        """True where `scale` differs from 1 by more than chance."""
        return abs(self.scale - 1.0) > max(MIN_CLOCK_ERROR, CLOCK_ERROR_SIGMA * self.scale_error)


@dataclass(frozen=True)
class QualityReport:
    """Content and quality of one log. Prints as a table."""

    name: str
    duration_s: float
    record: Record
    """The judgement of the record, which every command shares."""
    channels: tuple[ChannelQuality, ...]
    clock: ClockQuality
    findings: tuple[Finding, ...]
    """Those of the record, and those about its channels that only a reader needs."""

    @property
    def flight_s(self) -> float:
        """Time in flight."""
        return self.record.flight_s

    @property
    def thrust_source(self) -> str | None:
        """The best signal of the thrust that can be read."""
        return self.record.thrust_source

    @property
    def obstacles(self) -> tuple[str, ...]:
        """Reasons why it cannot be analysed, in words; none where it can."""
        return tuple(worded(found) for found in self.record.obstacles)

    @property
    def notes(self) -> tuple[str, ...]:
        """The findings in words."""
        return tuple(worded(found) for found in self.findings)

    @property
    def can_be_analysed(self) -> bool:
        return not self.obstacles

    def channel(self, name: str) -> ChannelQuality | None:
        return next((channel for channel in self.channels if channel.name == name), None)

    def to_dict(self) -> dict[str, Any]:
        """For JSON: what is not finite becomes None."""
        told = {
            "name": self.name,
            "duration_s": self.duration_s,
            "flight_s": self.flight_s,
            "flights_s": self.record.flights,
            "usable_s": self.record.usable,
            "channels": [asdict(channel) for channel in self.channels],
            "clock": asdict(self.clock),
            "thrust_source": self.thrust_source,
            "obstacles": self.obstacles,
            "findings": [found.to_dict() for found in self.findings],
            "cannot_be_analysed_for": [found.to_dict() for found in self.record.obstacles],
            "notes": self.notes,
            "can_be_analysed": self.can_be_analysed,
        }
        found: dict[str, Any] = plain(told)
        return found

    def __rich__(self) -> RenderableType:
        table = Table(title=f"{self.name}: {self.duration_s:.1f} s, {self.clock.n_rows} rows", title_justify="left")
        table.add_column("channel", no_wrap=True)
        for head in ("updates", "Hz", "longest gap", f"> {GAP_FACTOR:g}x", "held", "missing"):
            table.add_column(head, justify="right", no_wrap=True)
        for c in self.channels:
            several = c.n_updates > 1
            table.add_row(
                c.name,
                str(c.n_updates),
                f"{c.rate_hz:.1f}" if several else "-",
                f"{c.longest_gap_s:.2f} s at {c.longest_gap_at_s:.0f}" if several else "-",
                str(c.n_gaps) if several else "-",
                f"{c.held_share:.0%}",
                f"{c.nan_share:.1%}",
            )
        return Group(table, Text("\n".join(self._lines())))

    def _lines(self) -> list[str]:
        sources: dict[str, list[str]] = {}
        for channel in self.channels:
            if channel.source:
                sources.setdefault(channel.source, []).append(channel.name)
        facts = {
            "row_interval_ms": 1000.0 * self.clock.row_interval_s,
            "row_jitter_ms": 1000.0 * self.clock.row_jitter_s,
            "longest_ms": 1000.0 * self.clock.longest_row_interval_s,
            "is_counted": self.clock.is_counted,
            "wrong": self.clock.runs_wrong and ("slow" if self.clock.scale > 1.0 else "fast"),
            "percent": 100.0 * abs(self.clock.scale - 1.0),
            "error_percent": 100.0 * self.clock.scale_error,
            "flight_s": self.flight_s,
            "thrust_source": self.thrust_source,
        }
        words = Words()
        first = [line for template in LINES if (line := words.say(template, facts))]
        each = [words.say(SOURCE, {"source": source, "channels": names}) for source, names in sources.items()]
        each += [words.say(NOTE, {"note": note}) for note in self.notes]
        last = [CAN_BE] if self.can_be_analysed else [CANNOT_BE, *(f"  - {obstacle}" for obstacle in self.obstacles)]
        return [*first, *each, *last]


def quality(log: FlightLog) -> QualityReport:
    """Look through `log`; nothing is changed and nothing raised."""
    record = examine(log)
    channels = tuple(
        _channel(record.log, name, columns, record.usable) for name, columns in channel_groups(log).items()
    )
    return QualityReport(
        name=log.name,
        duration_s=float(log.time_s[-1] - log.time_s[0]) if len(log) else 0.0,
        record=record,
        channels=channels,
        clock=_clock(record.log),
        findings=(*record.findings, *_of_channels(channels, record.thrust_source), *correction_findings(record.log)),
    )


def _channel(log: FlightLog, name: str, named: tuple[str, ...], flown: tuple[Span, ...]) -> ChannelQuality:
    columns = tuple(column for column in named if column in log.columns)
    if not columns:  # of a channel that does not live
        nan = float("nan")
        return ChannelQuality(name, named, "", 0, 0.0, nan, nan, nan, 0, 0.0, 1.0)
    rows = updates_of_any(log, columns)
    time = log.time_s[rows]
    intervals = np.diff(time)
    finite = np.logical_or.reduce([np.isfinite(log[column]) for column in columns])
    n_finite = int(np.count_nonzero(finite))
    several = len(intervals) > 0
    median = float(np.median(intervals)) if several else float("nan")
    longest = int(np.argmax(intervals)) if several else 0
    return ChannelQuality(
        name=name,
        columns=columns,
        source=_source(log, columns),
        n_updates=len(rows),
        rate_hz=mean_rate_hz(log, columns, flown or ((float(log.time_s[0]), float(log.time_s[-1])),))
        if several
        else 0.0,
        median_interval_s=median,
        longest_gap_s=float(intervals[longest]) if several else float("nan"),
        longest_gap_at_s=float(time[longest]) if several else float("nan"),
        n_gaps=int(np.count_nonzero(intervals > GAP_FACTOR * median)) if several else 0,
        held_share=1.0 - len(rows) / n_finite if n_finite else 0.0,
        nan_share=1.0 - n_finite / len(log) if len(log) else 0.0,
    )


def _source(log: FlightLog, columns: Sequence[str]) -> str:
    """The messages that filled the columns, with the rate at which they were logged, from the reader's `meta`."""
    sources = log.meta.get("sources")
    if not isinstance(sources, dict):
        return ""
    found = {
        name: source.get("rate_hz")
        for name, source in sources.items()
        if isinstance(source, dict) and set(columns) & set(source.get("columns", ()))
    }
    rates = ", ".join(sorted({f"{rate:.1f}" for rate in found.values() if isinstance(rate, float)}))
    return f"{', '.join(found)} at {rates} Hz" if rates else ", ".join(found)


def _clock(log: FlightLog) -> ClockQuality:
    intervals = np.diff(log.time_s)
    scale, error = _time_scale(log)
    if not len(intervals):
        return ClockQuality(len(log), float("nan"), float("nan"), float("nan"), False, scale, error)
    median = float(np.median(intervals))
    return ClockQuality(
        n_rows=len(log),
        row_interval_s=median,
        row_jitter_s=float(np.std(intervals)),
        longest_row_interval_s=float(intervals.max()),
        is_counted=len(log) > 10 and bool(np.all(np.abs(intervals - median) < 1e-6)),
        scale=scale,
        scale_error=error,
    )


def _time_scale(log: FlightLog) -> tuple[float, float]:
    """True time per logged time and its standard error: distances covered against integrals of velocity.

    The median over stretches of about a second with motion enough that the noise of the velocity counts for little,
    and jumps of an estimator for nothing; NaN where a log has too few of them.
    """
    unknown = (float("nan"), float("nan"))
    if not all(log.has(name) for name in (*POSITION, *VELOCITY)):
        return unknown
    known = np.logical_and.reduce([np.isfinite(log[name]) for name in (*POSITION, *VELOCITY)])
    rows = log.updates(*POSITION)
    rows = rows[known[rows]]
    if len(rows) < MIN_MOVING_STRETCHES:
        return unknown
    per_second = len(rows) / float(log.time_s[rows[-1]] - log.time_s[rows[0]])
    ends = rows[:: max(1, round(per_second))]
    ratios = []
    for position, velocity in zip(POSITION, VELOCITY, strict=True):
        if len(log.updates(position)) < MIN_MOVING_STRETCHES:  # a position that is not known stands at 0
            continue
        covered = np.diff(log[position][ends])
        integrated = np.diff(integral(log.time_s, np.nan_to_num(log[velocity]))[ends])
        moving = np.abs(covered + integrated) > 2.0 * MOVING_M
        moving &= integrated != 0.0
        ratios.append(covered[moving] / integrated[moving])
    ratio = np.concatenate([np.zeros(0), *ratios])
    if len(ratio) < MIN_MOVING_STRETCHES:
        return unknown
    scale = float(np.median(ratio))
    spread = 1.4826 * float(np.median(np.abs(ratio - scale)))
    return scale, 1.2533 * spread / len(ratio) ** 0.5


def _of_channels(channels: Sequence[ChannelQuality], thrust_source: str | None) -> list[Finding]:
    findings = [finding(Kind.NO_VALUES, channel=channel.name) for channel in channels if channel.n_updates == 0]
    constant = [channel.name for channel in channels if channel.n_updates == 1]
    if constant:
        findings.append(finding(Kind.NEVER_CHANGES, channels=constant))
    if thrust_source not in (None, "rpm"):
        findings.append(finding(Kind.THRUST_FROM, source=thrust_source))
    return findings
