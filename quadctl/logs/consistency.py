"""Agreement of the channels of a log with each other: by this a map is judged, and one is proposed.

`contradictions` refuses a log on clear evidence; here each pair of channels gets a number, by which maps compare.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from quadctl.frames import GRAVITY_M_S2, Quaternion, quaternion_from_euler, rotate
from quadctl.logs.contradictions import contradictions
from quadctl.logs.findings import Finding, Kind, finding
from quadctl.logs.flight_log import ATTITUDE, IMU, POSITION, RATES, VELOCITY, FlightLog, Floats
from quadctl.logs.words import worded

MAX_GRAVITY_ANGLE_DEG = 25.0
"""Largest angle between the mean specific force of a flight and the vertical."""
STRETCH_S, SHORT_STRETCH_S = 1.0, 0.2
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
    names = [*POSITION, *VELOCITY, *ATTITUDE]
    known = np.logical_and.reduce([np.isfinite(log[name]) for name in names])
    time_s = log.time_s[known]
    if len(time_s) < 20:
        yield 10.0
        return
    long, short = _rows(time_s, STRETCH_S), _rows(time_s, SHORT_STRETCH_S)
    velocity = [log[name][known] for name in VELOCITY]
    moved = [np.diff(log[name][known][long]) for name in POSITION]
    yield _disagreement(moved, [np.diff(_integral(time_s, v)[long]) for v in velocity])
    roll, pitch, yaw = (np.unwrap(np.radians(log[name][known])) for name in ATTITUDE)
    q = quaternion_from_euler(roll, pitch, yaw)
    up_n, up_e, up_d = rotate(q, (np.zeros_like(roll), np.zeros_like(roll), -np.ones_like(roll)))
    pushed = [GRAVITY_M_S2 * side / np.maximum(-up_d, 0.3) for side in (up_n, up_e)]
    yield _disagreement(
        [np.diff(v[long]) for v in velocity[:2]], [np.diff(_integral(time_s, push)[long]) for push in pushed]
    )
    yield float(np.mean(-up_d < 0.3))  # an aircraft that flies upside down, as one does whose quaternion is misread
    if all(log.has(name) for name in RATES):
        p, q_, r = (np.nan_to_num(log[name][known]) for name in RATES)
        about_yaw = q_ * np.sin(roll) + r * np.cos(roll)
        slopes = (p + about_yaw * np.tan(pitch), q_ * np.cos(roll) - r * np.sin(roll), about_yaw / np.cos(pitch))
        yield _disagreement(
            [np.diff(angle[short]) for angle in (roll, pitch, yaw)],
            [np.diff(_integral(time_s, slope)[short]) for slope in slopes],
        )
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
    parts = [log[name] for name in (*ATTITUDE, *IMU)]
    known = np.logical_and.reduce([np.isfinite(part) for part in parts])
    roll, pitch, yaw, x, y, z = (part[known] for part in parts)
    if not len(roll):
        return np.full(3, np.nan)
    q: Quaternion = quaternion_from_euler(*np.radians([roll, pitch, yaw]))
    north, east, down = rotate(q, (x, y, z))
    return np.array([np.mean(north), np.mean(east), -np.mean(down)])


def _rows(time_s: Floats, length_s: float) -> NDArray[np.intp]:
    """Rows between stretches of about `length_s`."""
    edges = np.arange(time_s[0], time_s[-1], max(length_s, float(time_s[-1] - time_s[0]) / 5000.0))
    return np.unique(np.searchsorted(time_s, edges)).astype(np.intp)


def _integral(time_s: Floats, values: Floats) -> Floats:
    return np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(time_s))])


def _disagreement(changes: list[Floats], expected: list[Floats]) -> float:
    """Size of the difference over the sum of the sizes; 1 where there are too few changes to compare."""
    a, b = np.concatenate(changes), np.concatenate(expected)
    if len(a) < MIN_STRETCHES:  # of a reading in which the flight takes no time, for example
        return 1.0
    size = np.mean(np.abs(a)) + np.mean(np.abs(b))
    return min(1.0, float(np.mean(np.abs(a - b)) / size)) if size > 0.0 else 0.0
