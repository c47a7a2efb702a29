"""Tracking errors of flights, and the part of them that the ground causes: M_A, M_B, MAE, RMSE and the largest error.

M_A is the integral of x - x_ref. M_B compares with reference flights out of ground effect (OGE), flown on the same
trajectory shifted by dz = x_ref - x_ref_OGE: the integral of x - (x_OGE + dz), which is the integral of the difference
of the two tracking errors. Both are given **signed**, as the published tables are, where what is too high at one time
pays for what is too low at another; and **absolute**, where nothing cancels.
"""

import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from enum import unique
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from quadctl.errors import LogError
from quadctl.lab.tracking.steps import only_step, source_of_steps
from quadctl.logs.contradictions import contradictions
from quadctl.logs.findings import worded
from quadctl.logs.flight_log import FlightLog, Floats
from quadctl.words import Fact, Kinds, fact, nearest

TEST_PHASE = "step"
"""Phases with this in their name are measured unless others are asked for."""
MAX_GAP_S = 0.5
"""A window may begin or end this much outside the data, and a reference flight be this much shorter."""
SETPOINT_GRID_M = 0.05
"""A setpoint that has to be told from where the flights settled is taken to lie on this grid."""

_LAST_PART = 1 / 3
_RUN_NUMBER = re.compile(r"[_-]\d{1,2}$")


@unique
class Note(Kinds):
    """Notes on how flights were measured, each with its template."""

    STEP_SEEN = "{flight} has no phases: measured is its step {step}, as seen in the {source}, for {seconds:.2f} s"
    SETTLED = "the reference flights have no reference column, and settled at {setpoint_m:.2f} m"


# --- on arrays: `error` in m at `time_s`, both shape (n,), from the start of the window at time_s = 0 -----------------


def signed_integral(error: Floats, time_s: Floats) -> float:
    """Integral of the error, m s: each value holds from the sample before it, the first from time 0."""
    return float(np.sum(error * np.diff(time_s, prepend=0.0)))


def absolute_integral(error: Floats, time_s: Floats) -> float:
    """Integral of the absolute error, m s."""
    return signed_integral(np.abs(error), time_s)


def mean_absolute_error(error: Floats, time_s: Floats) -> float:
    """Mean of the absolute error over time, m."""
    return absolute_integral(error, time_s) / float(time_s[-1])


def root_mean_square_error(error: Floats, time_s: Floats) -> float:
    """Root of the mean of the squared error over time, m."""
    return float(np.sqrt(signed_integral(error**2, time_s) / time_s[-1]))


def largest_error(error: Floats) -> float:
    """The error of largest size, m, with its sign."""
    return float(error[np.argmax(np.abs(error))])


# --- on flights -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Window:
    """Part of a log that is measured: the time in (from_s, to_s], or a mission phase."""

    from_s: float | None = None
    to_s: float | None = None
    phase: str | None = None

    def __post_init__(self) -> None:
        if (self.from_s is None) != (self.to_s is None):
            raise LogError("the time window has one end only, expected both its start and its end in seconds")
        if self.from_s is not None and self.phase is not None:
            raise LogError("both a time window and a phase are given, expected one of them")
        if self.from_s is not None and self.to_s is not None and not 0.0 <= self.from_s < self.to_s < np.inf:
            raise LogError(f"the time window is from {self.from_s:g} to {self.to_s:g} s, expected 0 <= start < end")

    def __str__(self) -> str:
        if self.from_s is not None:
            return f"time in ({self.from_s:g}, {self.to_s:g}] s"
        return f"phase '{self.phase}'" if self.phase else f"phases named '{TEST_PHASE}'"

    def is_seen_in(self, log: FlightLog) -> bool:
        """True where the log must show its step itself: nothing is asked for, and it has no phases."""
        return self.from_s is None and self.phase is None and log.phase is None

    def bounds_s(self, log: FlightLog, axis: str = "z") -> tuple[float, float]:
        """Start and end in the log's own time.

        Raises
        ------
        LogError
            The log does not cover the window, has no such phase (or, without phases, not one step along `axis`), or
            flies it more than once.
        """
        if self.is_seen_in(log):
            step = only_step(log, axis)
            return step.start_s, step.end_s
        if self.from_s is None or self.to_s is None:
            rows = self._rows_of_phase(log)
            return float(log.time_s[rows[0]]), float(log.time_s[rows[-1]])
        first, last = float(log.time_s[0]), float(log.time_s[-1])
        if self.from_s < first - MAX_GAP_S or self.to_s > last + MAX_GAP_S:
            raise LogError(
                f"{log.name}: covers {first:g} to {last:g} s, expected it to cover {self.from_s:g} to {self.to_s:g} s"
            )
        return self.from_s, self.to_s

    def _rows_of_phase(self, log: FlightLog) -> NDArray[np.intp]:
        if log.phase is None:
            raise LogError(f"{log.name}: has no phases, expected a time window (--from, --to) in place of --phase")
        names = [str(name) for name in dict.fromkeys(log.phase.tolist()) if name]
        if self.phase is None:
            wanted = [name for name in names if TEST_PHASE in name.lower()]
            expected = f"one named '{TEST_PHASE}', or --phase, or a time window (--from, --to)"
        else:
            wanted = [name for name in names if name == self.phase]
            expected = f"'{self.phase}'{nearest(self.phase, names)}"
        rows = np.flatnonzero(np.isin(log.phase, wanted))
        if len(rows) < 2:
            raise LogError(f"{log.name}: its phases are {', '.join(names) or 'without names'}, expected {expected}")
        if rows[-1] - rows[0] + 1 != len(rows):
            raise LogError(
                f"{log.name}: {' and '.join(wanted)} is flown more than once with other phases between, "
                "expected one stretch: give --phase or a time window (--from, --to)"
            )
        return rows


@dataclass(frozen=True, eq=False)
class Tracking:
    """Position and tracking error of one flight, time from the start of the window; gaps left out."""

    name: str
    group: str
    time_s: Floats
    position_m: Floats
    reference_m: Floats

    @property
    def error_m(self) -> Floats:
        return self.position_m - self.reference_m

    def error_at(self, time_s: Floats) -> Floats:
        """The error at other times, interpolated."""
        return np.interp(time_s, self.time_s, self.error_m)


def tracking(
    log: FlightLog, window: Window, axis: str = "z", setpoint_m: float | None = None, longest_s: float = np.inf
) -> Tracking:
    """Position and error of `log` to its own reference along `axis` (x north, y east, z up), or to a constant one.

    Parameters
    ----------
    setpoint_m
        Constant reference in place of the log's own.
    longest_s
        A longer window is cut to this.

    Raises
    ------
    LogError
        The log lacks the window, the position, or a reference.
    """
    start, end = window.bounds_s(log, axis)
    end = min(end, start + longest_s)
    position = log[f"{axis}_m"]
    reference = np.full(len(log), np.nan if setpoint_m is None else setpoint_m)
    if setpoint_m is None:
        if not log.has(f"{axis}_ref_m"):
            raise LogError(
                f"{log.name}: has no reference column '{axis}_ref_m', expected one or a --setpoint in metres"
            )
        reference = log[f"{axis}_ref_m"]
    # Both ends are decimal numbers of a file or of a user: equal ones compare equal.
    inside = (log.time_s > start) & (log.time_s <= end) & np.isfinite(position) & np.isfinite(reference)
    if inside.sum() < 2:
        raise LogError(f"{log.name}: {inside.sum()} samples of {axis} in the {window}, expected at least two")
    return Tracking(log.name, group_of(log), log.time_s[inside] - start, position[inside], reference[inside])


@dataclass(frozen=True)
class FlightMetrics:
    """Metrics of one flight; integrals in m s, errors in m."""

    flight: str
    group: str
    is_reference: bool
    n_samples: int
    duration_s: float
    m_a_signed: float
    m_a_absolute: float
    mae_m: float
    rmse_m: float
    max_error_m: float
    """The error of largest size, with its sign."""
    m_b_signed: float | None = None
    """Integral against the mean of the reference flights; None without any."""
    m_b_absolute: float | None = None
    """The same of absolute values; for a reference flight, its distance from the mean of all of them."""


VALUES = ("m_a_signed", "m_a_absolute", "m_b_signed", "m_b_absolute", "mae_m", "rmse_m", "max_error_m")


@dataclass(frozen=True)
class GroupMetrics:
    """Runs of the same flight: mean and population standard deviation."""

    group: str
    is_reference: bool
    n_runs: int
    mean: dict[str, float | None]
    std: dict[str, float | None]
    m_b_absolute_of_mean: float | None
    """M_B absolute after averaging the runs over time: what differs from run to run is noise, and is averaged out."""


@dataclass(frozen=True)
class MetricsTable:
    """Metrics of all flights and of their groups; `to_dict` for JSON, `rendering.render` for a terminal."""

    axis: str
    window: str
    flights: tuple[FlightMetrics, ...]
    groups: tuple[GroupMetrics, ...]
    notes: tuple[Fact, ...] = field(default=())

    def to_dict(self) -> dict[str, Any]:
        return {**asdict(replace(self, notes=())), "notes": tuple(map(str, self.notes))}

    def group(self, name: str) -> GroupMetrics:
        """The group of that name.

        Raises
        ------
        LogError
            There is none.
        """
        for group in self.groups:
            if group.group == name:
                return group
        names = [group.group for group in self.groups]
        raise LogError(f"no flights are named '{name}'{nearest(name, names)}, expected one of {', '.join(names)}")


def metrics(
    logs: Sequence[FlightLog],
    references: Sequence[FlightLog] = (),
    *,
    window: Window | None = None,
    axis: str = "z",
    setpoint_m: float | None = None,
    reference_setpoint_m: float | None = None,
) -> MetricsTable:
    """Metrics of `logs` along `axis`, M_B against the mean of the `references`, aligned at the start of the window.

    Parameters
    ----------
    window
        The part of every log to measure. By default the phases that have `step` in their name; in a log without
        phases the one step that can be seen in its reference or position, all cut to the shortest.
    setpoint_m
        Constant reference of `logs` in place of their own reference column.
    reference_setpoint_m
        The same for `references`. Where neither it nor a column is there, it is told from where they settled.

    Raises
    ------
    LogError
        A log lacks what the metrics need, or contradicts itself.
    """
    if not logs:
        raise LogError("no flight is given, expected at least one log")
    for log in (*logs, *references):
        if problems := contradictions(log):
            raise LogError(f"{log.name}: {worded(problems[0])}")
    window = window or Window()
    longest, notes = _steps_seen([*logs, *references], window, axis)
    tracks = [tracking(log, window, axis, setpoint_m, longest) for log in logs]
    if references and reference_setpoint_m is None and not all(log.has(f"{axis}_ref_m") for log in references):
        reference_setpoint_m = settled_setpoint_m(references, window, axis, longest)
        notes.append(fact(Note.SETTLED, setpoint_m=reference_setpoint_m))
    reference_tracks = [tracking(log, window, axis, reference_setpoint_m, longest) for log in references]

    measured = [(track, False) for track in tracks] + [(track, True) for track in reference_tracks]
    flights = tuple(_flight_metrics(track, reference_tracks, is_reference) for track, is_reference in measured)
    said = "the steps seen in the logs" if all(map(window.is_seen_in, (*logs, *references))) else str(window)
    return MetricsTable(axis, said, flights, _groups(flights, measured, reference_tracks), tuple(notes))


def _steps_seen(logs: Sequence[FlightLog], window: Window, axis: str) -> tuple[float, list[Fact]]:
    """Length of the shortest step among the logs that show theirs themselves, s, and a note on each; else infinity."""
    steps = {log.name: (only_step(log, axis), source_of_steps(log, axis)) for log in logs if window.is_seen_in(log)}
    longest = min((step.end_s - step.start_s for step, _ in steps.values()), default=np.inf)
    return longest, [
        fact(Note.STEP_SEEN, flight=name, step=step, source=source, seconds=longest)
        for name, (step, source) in steps.items()
    ]


def settled_setpoint_m(logs: Sequence[FlightLog], window: Window, axis: str = "z", longest_s: float = np.inf) -> float:
    """Level at which the flights settled in the last third of the window, m, on a grid of 0.05 m, as setpoints are."""
    positions = []
    for log in logs:
        track = tracking(log, window, axis, 0.0, longest_s)
        positions.append(np.median(track.position_m[track.time_s > (1.0 - _LAST_PART) * track.time_s[-1]]))
    return round(float(np.mean(positions)) / SETPOINT_GRID_M) * SETPOINT_GRID_M


def _flight_metrics(track: Tracking, references: Sequence[Tracking], is_reference: bool) -> FlightMetrics:
    error, time = track.error_m, track.time_s
    effect = _effect(track, references)
    return FlightMetrics(
        flight=track.name,
        group=track.group,
        is_reference=is_reference,
        n_samples=len(time),
        duration_s=float(time[-1]),
        m_a_signed=signed_integral(error, time),
        m_a_absolute=absolute_integral(error, time),
        mae_m=mean_absolute_error(error, time),
        rmse_m=root_mean_square_error(error, time),
        max_error_m=largest_error(error),
        m_b_signed=None if effect is None else signed_integral(effect, time),
        m_b_absolute=None if effect is None else absolute_integral(effect, time),
    )


def _effect(track: Tracking, references: Sequence[Tracking]) -> Floats | None:
    """Tracking error less that of the mean reference flight, at the times of `track`, m."""
    if not references:
        return None
    for reference in references:
        if reference.time_s[-1] < track.time_s[-1] - MAX_GAP_S:
            raise LogError(
                f"{reference.name}: the reference lasts {reference.time_s[-1]:.2f} s, "
                f"expected {track.time_s[-1]:.2f} s as {track.name} does"
            )
    return track.error_m - _mean_error_at(track.time_s, references)


def _mean_error_at(time_s: Floats, tracks: Sequence[Tracking]) -> Floats:
    return np.asarray(np.mean([track.error_at(time_s) for track in tracks], axis=0), dtype=np.float64)


def group_of(log: FlightLog) -> str:
    """Name that runs of a flight share: mission and compensator, or the log's name without its run number (`_02`)."""
    mission, compensator = log.meta.get("mission"), log.meta.get("compensator")
    if isinstance(mission, str) and isinstance(compensator, str):
        return f"{mission}, {compensator}"
    return _RUN_NUMBER.sub("", Path(log.name).stem)


def _groups(
    flights: Sequence[FlightMetrics], measured: Sequence[tuple[Tracking, bool]], references: Sequence[Tracking]
) -> tuple[GroupMetrics, ...]:
    groups = []
    for name, is_reference in dict.fromkeys((flight.group, flight.is_reference) for flight in flights):
        runs = [flight for flight in flights if (flight.group, flight.is_reference) == (name, is_reference)]
        tracks = [track for track, role in measured if (track.group, role) == (name, is_reference)]
        groups.append(
            GroupMetrics(
                group=name,
                is_reference=is_reference,
                n_runs=len(runs),
                mean={value: _over_runs(np.mean, runs, value) for value in VALUES},
                std={value: _over_runs(np.std, runs, value) for value in VALUES},
                m_b_absolute_of_mean=_absolute_effect_of_mean(tracks, references),
            )
        )
    return tuple(groups)


def _over_runs(statistic: Any, runs: Sequence[FlightMetrics], value: str) -> float | None:
    values = [getattr(run, value) for run in runs]
    return None if None in values else float(statistic(values))


def _absolute_effect_of_mean(tracks: Sequence[Tracking], references: Sequence[Tracking]) -> float | None:
    if not references:
        return None
    shortest = min(tracks, key=lambda track: float(track.time_s[-1]))
    time = shortest.time_s
    return absolute_integral(_mean_error_at(time, tracks) - _mean_error_at(time, references), time)
