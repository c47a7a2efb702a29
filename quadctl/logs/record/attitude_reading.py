"""The attitude against the body rates: whether its angles are those of FRD in the order yaw, pitch, roll.

Motion capture often writes angles in another order, a quaternion may be the inverse, and a heading may be the course
over the ground. The gyro tells: read rightly, the attitude turns as the body rates say.
"""

from dataclasses import replace
from functools import reduce

import numpy as np

from quadctl.frames import Quaternion, euler_from_quaternion, euler_rates, multiply
from quadctl.logs.findings import Finding, Kind, finding
from quadctl.logs.flight_log import ATTITUDE, RATES, VELOCITY, FlightLog, Floats
from quadctl.logs.record.flight_time import STEP_S, averaged, clock_of, on_clock

TURNED_STEPS = 5
"""Steps of the clock over which turns are compared: some delay between the two does not matter then."""
LEAST_TURN_RAD = 0.03
"""Root mean square of a turn by the rates below which nothing is told."""
WRONG, RIGHT = 0.5, 0.35
"""Share of the turns that a wrong reading leaves unexplained, and that the right one may."""
BETTER = 0.5
"""Largest share of what the first reading leaves that another one leaves, to be the right one."""
STRANGE_TURN_DEG, STRANGE_SHARE = 10.0, 0.1
"""Turn of the heading that the rates do not know, and the share of the time in which it happens, from which on the
column is no heading: an estimator resets its heading now and then."""
STEEPEST_RAD = 1.47
"""Pitch beyond which a heading has no slope."""
COURSE_M_S, COURSE_DEG, COURSE_SHARE = 0.5, 5.0, 0.8
"""Least speed over the ground at which a course is known, and how near and how often the column is to it."""

Angles = tuple[Floats, Floats, Floats]
"""Angles about x, y and z, rad."""


READINGS = ("z-y-x", "x-y-z", "y-x-z", "z-x-y", "inverse")
"""Ways to read three angles, that of FlightLog first: orders of intrinsic angles; `inverse` turns the world into the
body."""


def _attitude(reading: str, angles: Angles) -> Quaternion:
    """Attitude of angles about x, y and z that are read in one of these ways."""
    if reading == "inverse":
        return _conjugate(_attitude("z-y-x", angles))
    return reduce(multiply, (_about(axis, angles[axis]) for axis in map("xyz".index, reading.split("-"))))


def read_rightly(log: FlightLog) -> tuple[FlightLog, list[Finding]]:
    """The log with the attitude that turns as its body rates say, and the finding where it was written otherwise."""
    if not all(log.has(name) for name in (*ATTITUDE, *RATES)):
        return log, []
    grid = clock_of(log.time_s)
    if len(grid) < 4 * TURNED_STEPS:
        return log, []
    turned = _turns_by_rates(log, grid)
    size = float(np.sqrt(np.mean(turned**2)))
    if size < LEAST_TURN_RAD:
        return log, []
    roll, pitch, yaw = (np.radians(on_clock(grid, log, name, unwrap=True)) for name in ATTITUDE)
    angles = roll, pitch, yaw
    left = {reading: _left(_turns(_attitude(reading, angles)), turned) / size for reading in READINGS}
    first, best = READINGS[0], min(left, key=left.__getitem__)
    if left[first] > WRONG and left[best] < min(RIGHT, BETTER * left[first]):
        told = finding(Kind.ATTITUDE_READ, order=best, unexplained=left[first], unexplained_then=left[best])
        return _written_anew(log, best), [told]
    return _with_a_heading(log, grid, angles)


def _turns_by_rates(log: FlightLog, grid: Floats) -> Floats:
    """Rotation vectors of the turns by the body rates, rad, shape (3, n)."""
    rates = np.array([on_clock(grid, log, name) for name in RATES])
    sums = np.cumsum(averaged(rates, 1), axis=1) * STEP_S
    return np.asarray(sums[:, TURNED_STEPS:] - sums[:, :-TURNED_STEPS])


def _turns(attitude: Quaternion) -> Floats:
    """Rotation vectors of the turns of an attitude over the same time, in the body, rad, shape (3, n)."""
    q = np.array([np.broadcast_to(part, np.shape(attitude[0])) for part in attitude])
    first, last = tuple(q[:, :-TURNED_STEPS]), tuple(q[:, TURNED_STEPS:])
    w, x, y, z = multiply(_conjugate(first), last)
    sign = np.sign(np.where(w == 0.0, 1.0, w))
    sine = np.sqrt(x**2 + y**2 + z**2)
    angle = 2.0 * np.arctan2(sine, np.abs(w))
    return np.asarray(sign * angle / np.maximum(sine, 1e-9) * np.array([x, y, z]))


def _left(turns: Floats, by_rates: Floats) -> float:
    """Root mean square that the rates do not explain; a twentieth of the time may hold resets and gaps."""
    squares = np.sum((turns - by_rates) ** 2, axis=0)
    return float(np.sqrt(np.mean(np.sort(squares)[: max(1, round(0.95 * len(squares)))]) / 3.0))


def _written_anew(log: FlightLog, reading: str) -> FlightLog:
    """The log with the angles in its own order."""
    roll, pitch, yaw = (np.radians(log[name]) for name in ATTITUDE)
    angles = euler_from_quaternion(_attitude(reading, (roll, pitch, yaw)))
    columns = {name: np.degrees(angle) for name, angle in zip(ATTITUDE, angles, strict=True)}
    return replace(log, columns={**log.columns, **columns})


def _with_a_heading(log: FlightLog, grid: Floats, angles: Angles) -> tuple[FlightLog, list[Finding]]:
    """The log with the heading by its gyro where the column is none, and the finding; its direction is still open."""
    roll, pitch, _ = angles
    p, q, r = (averaged(on_clock(grid, log, name), 1) for name in RATES)
    slopes = euler_rates(roll, np.clip(pitch, -STEEPEST_RAD, STEEPEST_RAD), p, q, r)
    by_gyro = STEP_S * np.cumsum(np.array(slopes), axis=1)
    turned = by_gyro[:, TURNED_STEPS:] - by_gyro[:, :-TURNED_STEPS]
    strange = np.array(angles)[:, TURNED_STEPS:] - np.array(angles)[:, :-TURNED_STEPS] - turned
    share = float(np.mean(np.abs(strange[2]) > np.radians(STRANGE_TURN_DEG)))
    gyro_is_right = float(np.sqrt(np.mean(strange[:2] ** 2))) < RIGHT * float(np.sqrt(np.mean(turned[:2] ** 2)))
    if share < STRANGE_SHARE or not gyro_is_right:
        return log, []
    heading = np.degrees(np.interp(log.time_s, grid, by_gyro[2]))
    told = finding(Kind.NO_HEADING, course=_is_course(log), share=share)
    return replace(log, columns={**log.columns, "yaw_deg": (heading + 180.0) % 360.0 - 180.0}), [told]


def _is_course(log: FlightLog) -> bool:
    """Tell whether the heading's column is the direction of the velocity."""
    if not all(log.has(name) for name in VELOCITY[:2]):
        return False
    known = np.isfinite(log["yaw_deg"]) & np.isfinite(log[VELOCITY[0]]) & np.isfinite(log[VELOCITY[1]])
    north, east, yaw = (log[name][known] for name in (*VELOCITY[:2], "yaw_deg"))
    moves = np.hypot(north, east) > COURSE_M_S
    off = (yaw - np.degrees(np.arctan2(east, north)) + 180.0) % 360.0 - 180.0
    return bool(moves.any()) and float(np.mean(np.abs(off[moves]) < COURSE_DEG)) > COURSE_SHARE


def _about(axis: int, angle: Floats) -> Quaternion:
    parts = [np.zeros_like(angle)] * 3
    parts[axis] = np.sin(0.5 * angle)
    return (np.cos(0.5 * angle), parts[0], parts[1], parts[2])


def _conjugate(q: Quaternion) -> Quaternion:
    return q[0], -q[1], -q[2], -q[3]
