"""Heading before and after the estimator resets it: which side of a reset fits the motion.

A vehicle accelerates to where its thrust leans. Where the heading is wrong by an angle, it accelerates to another side
by that angle; drag and a steady wind change the size of the acceleration, not its side.
"""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from quadctl.frames import GRAVITY_M_S2, quaternion_from_euler, rotate
from quadctl.logs.findings import Finding, Kind, Span, finding
from quadctl.logs.flight_log import ATTITUDE, VELOCITY, FlightLog, Floats
from quadctl.logs.record.flight_time import averaged, total, updated, usable

STEP_S, SMOOTHED_STEPS, INDEPENDENT_S = 0.1, 5, 0.5
"""Step of the clock, half the width of the filter, and the time after which errors are independent."""
MATTERS_DEG = 5.0
"""Least reset that makes directions wrong, and largest standard error of a heading's error that tells a side."""
SIGMA = 5.0
"""Standard errors by which a heading must be off to be corrected."""
FITS = 0.4
"""Share of a reset within which a side fits the motion."""
WINDOW_S, LEAST_WINDOWS = 20.0, 4
"""Length of the windows in which the heading of a flight is told, and least number of them that tells a drift."""
ENOUGH_S = 20.0
"""Time in flight after a reset from which on the part before it is not needed."""


@dataclass(frozen=True)
class HeadingError:
    """Angle from the thrust's horizontal direction to that of the acceleration, degrees."""

    angle_deg: float
    std_deg: float

    @property
    def is_told(self) -> bool:
        return self.std_deg < MATTERS_DEG


UNKNOWN = HeadingError(0.0, 180.0)


class Motion(NamedTuple):
    """Updates of the channels that tell a heading, each as times, s, and values: read once for all windows of a log."""

    north_east: tuple[tuple[Floats, Floats], ...]
    """Velocity, m/s."""
    attitude: tuple[tuple[Floats, Floats], ...]
    """Roll, pitch, yaw, degrees, continuous."""


def heading_error(log: FlightLog, spans: tuple[Span, ...]) -> HeadingError:
    """Error of the heading within some stretches of time, by regression of the acceleration on the thrust's lean."""
    motion = motion_of(log)
    return UNKNOWN if motion is None else _error_within(motion, spans)


def _error_within(motion: Motion, spans: tuple[Span, ...]) -> HeadingError:
    parts = [directions(motion, span) for span in spans if span[1] - span[0] > 4.0 * INDEPENDENT_S]
    if not parts:
        return UNKNOWN
    acceleration, lean, velocity = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    columns = np.column_stack([lean, velocity, np.ones(len(lean))])
    inverse = np.linalg.pinv(columns.conj().T @ columns)
    found = inverse @ columns.conj().T @ acceleration
    left = acceleration - columns @ found
    repeats = INDEPENDENT_S / STEP_S
    variance = float(np.mean(np.abs(left) ** 2)) * repeats * float(np.real(inverse[0, 0]))
    size = abs(found[0])
    if size == 0.0 or variance <= 0.0:
        return UNKNOWN
    return HeadingError(float(np.degrees(np.angle(found[0]))), float(np.degrees(np.sqrt(variance) / size)))


def with_one_heading(
    log: FlightLog, reset: Finding, flights: tuple[Span, ...], left_out: list[Span], around_s: float
) -> tuple[FlightLog, Finding, list[Span]]:
    """The log with one heading, the finding with what was done, and what is left out for it.

    The side of a reset that does not fit the motion is turned back by its size. Where the motion does not tell, the
    estimator is believed: what is before its last reset is left out, or turned where too little is left.
    """
    if not log.has("yaw_deg"):
        return log, reset, []
    yaw, cut, done = log["yaw_deg"].copy(), list[Span](), "nothing"
    for (time_s, _), size in reversed(list(zip(reset.times_s, reset.figures["by"], strict=True))):
        if not flights or not flights[0][0] < time_s < flights[-1][1]:
            continue
        cut.append((time_s - around_s, time_s + around_s))
        if abs(size) < MATTERS_DEG:
            continue
        here = replace(log, columns={**log.columns, "yaw_deg": yaw})
        parts = (cut_to(flights, -np.inf, time_s), cut_to(flights, time_s, np.inf))
        before, after = (heading_error(here, usable(part, [*left_out, *cut])) for part in parts)
        wrong_before = before.is_told and abs(_turn(before.angle_deg - size)) < FITS * abs(size)
        wrong_after = after.is_told and abs(_turn(after.angle_deg + size)) < FITS * abs(size)
        if wrong_after and not wrong_before:
            turned, by, done = log.time_s >= time_s, -size, "turned after"
        elif wrong_before or total(usable(parts[1], [*left_out, *cut])) < ENOUGH_S:
            turned, by, done = log.time_s < time_s, size, "turned before"
        else:
            cut.append((-np.inf, time_s))
            done = "left out before"
            break
        yaw[turned] = _turn(yaw[turned] + by)
    told = replace(reset, figures={**reset.figures, "done": done})
    return replace(log, columns={**log.columns, "yaw_deg": yaw}), told, cut


def corrected_heading(log: FlightLog, spans: tuple[Span, ...], logged: bool = True) -> tuple[FlightLog, list[Finding]]:
    """The log with the heading that fits its motion, and the finding where that is another than it says.

    `logged` is False where the heading has no direction of its own yet.
    """
    drift = _drift(log, spans)
    if drift is not None:
        log = _turned(log, drift.slope_deg_s * (log.time_s - drift.since_s))
    error = heading_error(log, spans)
    off = error.is_told and abs(error.angle_deg) > max(MATTERS_DEG, SIGMA * error.std_deg)
    if off or (error.is_told and (drift is not None or not logged)):
        log = _turned(log, error.angle_deg)
    if not logged:
        return log, []
    if drift is not None:
        return log, [finding(Kind.HEADING_DRIFTS, by_deg_s=-drift.slope_deg_s, std_deg_s=drift.std_deg_s)]
    return log, [finding(Kind.HEADING_OFF, by_deg=-error.angle_deg, std_deg=error.std_deg)] if off else []


def _turned(log: FlightLog, by_deg: Any) -> FlightLog:
    return replace(log, columns={**log.columns, "yaw_deg": _turn(log["yaw_deg"] + by_deg)})


class _Drift(NamedTuple):
    """Growth of the angle to the motion, with the standard error of its slope."""

    since_s: float
    slope_deg_s: float
    std_deg_s: float


def _drift(log: FlightLog, spans: tuple[Span, ...]) -> _Drift | None:
    """Drift of the heading; None where the angle to the motion does not grow."""
    windows = [
        (begin, min(begin + WINDOW_S, b)) for a, b in spans for begin in np.arange(a, b - 0.5 * WINDOW_S, WINDOW_S)
    ]
    motion = motion_of(log)
    if motion is None:
        return None
    told = [(0.5 * (a + b), _error_within(motion, ((a, b),))) for a, b in windows]
    told = [(time_s, error) for time_s, error in told if error.is_told]
    if len(told) < LEAST_WINDOWS:
        return None
    time_s = np.array([time for time, _ in told])
    angle = np.degrees(np.unwrap(np.radians([error.angle_deg for _, error in told])))
    weight = np.array([1.0 / error.std_deg**2 for _, error in told])
    since_s = float(np.average(time_s, weights=weight))
    spread = float(np.sum(weight * (time_s - since_s) ** 2))
    slope = float(np.sum(weight * (time_s - since_s) * angle)) / spread
    left = angle - np.average(angle, weights=weight) - slope * (time_s - since_s)
    scatter = max(1.0, float(np.sum(weight * left**2)) / (len(told) - 2))
    std = float(np.sqrt(scatter / spread))
    grows = abs(slope) > SIGMA * std and abs(slope) * float(time_s[-1] - time_s[0]) > MATTERS_DEG
    return _Drift(since_s, slope, std) if grows else None


def cut_to(spans: tuple[Span, ...], begin_s: float, end_s: float) -> tuple[Span, ...]:
    """Parts of stretches that lie between two times."""
    return tuple((max(a, begin_s), min(b, end_s)) for a, b in spans if min(b, end_s) > max(a, begin_s))


def is_of_heading(found: Finding) -> bool:
    """Tell whether a finding is a reset of the heading."""
    return found.kind == Kind.RESET and found.figures["of"] == "heading"


def motion_of(log: FlightLog) -> Motion | None:
    """Updates of velocity and attitude; None where one is not logged."""
    if not all(log.has(name) for name in (*VELOCITY, *ATTITUDE)):
        return None
    return Motion(
        tuple(updated(log, name) for name in VELOCITY[:2]), tuple(updated(log, name, unwrap=True) for name in ATTITUDE)
    )


def directions(motion: Motion, span: Span) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Horizontal acceleration, lean of the thrust times gravity, and velocity, as complex numbers north + i east."""
    grid = np.arange(span[0], span[1], STEP_S)
    north_east = [averaged(np.interp(grid, *channel), SMOOTHED_STEPS) for channel in motion.north_east]
    angles = (np.radians(np.interp(grid, *channel)) for channel in motion.attitude)
    north, east, down = rotate(quaternion_from_euler(*angles), (0.0, 0.0, -1.0))
    lean = GRAVITY_M_S2 * (np.asarray(north) + 1j * np.asarray(east)) / np.maximum(-np.asarray(down), 0.3)
    velocity = north_east[0] + 1j * north_east[1]
    smooth = averaged(lean.real, SMOOTHED_STEPS) + 1j * averaged(lean.imag, SMOOTHED_STEPS)
    return np.gradient(velocity, STEP_S), smooth, velocity


def _turn(degrees: Any) -> Any:
    """Angle from -180 to 180 degrees."""
    return (degrees + 180.0) % 360.0 - 180.0
