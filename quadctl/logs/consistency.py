"""Agreement of the channels of a log with each other: by this a map is judged, and one is proposed.

`contradictions` refuses a log on clear evidence; here each pair of channels gets a number, by which maps compare.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from quadctl.frames import GRAVITY_M_S2
from quadctl.logs.contradictions import contradictions
from quadctl.logs.findings import Finding, Kind, finding, worded
from quadctl.logs.flight_log import ATTITUDE, IMU, POSITION, VELOCITY, FlightLog, Floats
from quadctl.logs.kinematics import LEAST_CARRIED, MOTION, PUSH, TURN, force_in_world, integral

MAX_GRAVITY_ANGLE_DEG = 25.0
"""Largest angle between the mean specific force of a flight and the vertical."""
MIN_STRETCHES = 8
"""Changes of all axes together below which nothing is compared."""


def complaints(log: FlightLog) -> list[str]:
    """Sentences on what cannot be in the frames and units that it is said to be in; [] without any."""
    return [worded(found) for found in (*contradictions(log), *_gravity_complaint(log))]


def misfit(log: FlightLog) -> float:
    """Sum of all disagreements, each from 0 (the same) to 1 (nothing in common, or nothing that could be compared)."""
    with np.errstate(all="ignore"):
        return sum(value if np.isfinite(value) else 1.0 for value in _misfits(log))


def _misfits(log: FlightLog) -> Iterator[float]:
    known = np.logical_and.reduce([np.isfinite(log[name]) for name in (*POSITION, *VELOCITY, *ATTITUDE)])
    time_s = log.time_s[known]
    if len(time_s) < 20:
        yield 10.0
        return
    for identity in (MOTION, PUSH, TURN):
        if all(log.has(name) for name in identity.columns):
            levels, slopes = identity.of({name: np.nan_to_num(log[name][known]) for name in identity.columns})
            ends = _rows(time_s, identity.stretch_s)
            changes = [np.diff(level[ends]) for level in levels]
            yield _disagreement(changes, [np.diff(integral(time_s, slope)[ends]) for slope in slopes])
    roll, pitch = (np.radians(log[name][known]) for name in ATTITUDE[:2])
    # An aircraft that flies upside down, as one does whose quaternion is misread.
    yield float(np.mean(np.cos(roll) * np.cos(pitch) < LEAST_CARRIED))
    if all(log.has(name) for name in IMU):
        north, east, up = _mean_force(log)
        yield min(1.0, float(np.linalg.norm([north, east, up - GRAVITY_M_S2])) / GRAVITY_M_S2)


def _gravity_complaint(log: FlightLog) -> Iterator[Finding]:
    if not all(log.has(name) for name in IMU):
        return
    force = _mean_force(log)
    size = float(np.linalg.norm(force))
    if size < 0.5 * GRAVITY_M_S2:
        yield finding(Kind.GRAVITY_TURNED, size_m_s2=size)
        return
    angle = float(np.degrees(np.arccos(np.clip(force[2] / size, -1.0, 1.0))))
    if angle > MAX_GRAVITY_ANGLE_DEG:
        yield finding(Kind.GRAVITY_TURNED, size_m_s2=size, angle_deg=angle)


def _mean_force(log: FlightLog) -> Floats:
    """Mean specific force, shape (3,): north, east, up."""
    force = force_in_world(log.columns)
    known = np.isfinite(force).all(axis=0)
    return np.asarray(force[:, known].mean(axis=1)) if known.any() else np.full(3, np.nan)


def _rows(time_s: Floats, length_s: float) -> NDArray[np.intp]:
    """Rows between stretches of about `length_s`."""
    edges = np.arange(time_s[0], time_s[-1], max(length_s, float(time_s[-1] - time_s[0]) / 5000.0))
    return np.unique(np.searchsorted(time_s, edges)).astype(np.intp)


def _disagreement(changes: list[Floats], expected: list[Floats]) -> float:
    """Size of the difference over the sum of the sizes; 1 where there are too few changes to compare."""
    a, b = np.concatenate(changes), np.concatenate(expected)
    if len(a) < MIN_STRETCHES:  # of a reading in which the flight takes no time, for example
        return 1.0
    size = np.mean(np.abs(a)) + np.mean(np.abs(b))
    return min(1.0, float(np.mean(np.abs(a - b)) / size)) if size > 0.0 else 0.0
