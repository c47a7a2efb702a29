"""The point whose position and velocity a log holds: an antenna or a marker may lie beside the centre of mass.

A point at r in the body moves by w x r more than the centre of mass, and is accelerated by a x r + w x (w x r) more (w:
body rates, a: their change). Nothing else that acts on a multirotor goes with the change of its rates.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from quadctl.frames import GRAVITY_M_S2, Quaternion, quaternion_from_euler, rotate, rotate_inverse
from quadctl.logs.findings import Finding, Kind, Span, finding
from quadctl.logs.flight_log import ATTITUDE, POSITION, RATES, VELOCITY, FlightLog, Floats
from quadctl.logs.record.flight_time import averaged, on_clock, thrust_drive
from quadctl.numeric import Vector

STEP_S, SMOOTHED_STEPS = 0.02, 5
"""Step of the clock, and half the width of the filter of all signals, used twice."""
INDEPENDENT_S = 0.2
"""Time after which what the regression leaves is independent."""
MATTERS_M, SIGMA = 0.02, 8.0
"""Least arm that is told, and standard errors by which it must differ from zero."""
EXPLAINS = 0.2
"""Least share by which the arm must lower the root mean square of what drag, wind, delays and offsets leave."""
LONGEST_M = 2.0
PIECE = 1 << 15
"""Samples whose equations are held at once."""


def at_centre_of_mass(
    log: FlightLog, thrust_source: str | None, spans: tuple[Span, ...]
) -> tuple[FlightLog, list[Finding]]:
    """The log with the motion of the centre of mass, and the finding where it holds that of another point."""
    if not all(log.has(name) for name in (*POSITION, *VELOCITY, *ATTITUDE, *RATES)):
        return log, []
    found = _arm(log, thrust_drive(log, thrust_source), spans)
    if found is None:
        return log, []
    arm_m, std_m = found
    return _moved(log, arm_m), [finding(Kind.LEVER_ARM, arm_m=list(arm_m), std_m=list(std_m))]


def _arm(log: FlightLog, drive: Floats | None, spans: tuple[Span, ...]) -> tuple[Vector, Vector] | None:
    """Point in the body, FRD, m, and its standard errors; None where it is not clearly another than the centre."""
    parts = [
        part for span in spans if span[1] - span[0] > 50.0 * INDEPENDENT_S for part in _equations(log, drive, span)
    ]
    if not parts:
        return None
    gram, along, square, n = (sum(values) for values in zip(*parts, strict=True))
    inverse = np.linalg.pinv(gram)
    found = inverse @ along
    left = max(square - along @ found, 0.0) / n
    without = max(square - along[3:] @ np.linalg.pinv(gram[3:, 3:]) @ along[3:], 0.0) / n
    variance = left * INDEPENDENT_S / STEP_S
    std = np.sqrt(np.maximum(variance * np.diag(inverse)[:3], 0.0))
    arm = found[:3]
    size = float(np.linalg.norm(arm))
    clear = size > MATTERS_M and float(np.linalg.norm(arm / np.maximum(std, 1e-9))) > SIGMA
    explains = np.sqrt(left) < (1.0 - EXPLAINS) * np.sqrt(without)
    if not (clear and explains and size < LONGEST_M):
        return None
    (x, y, z), (x_std, y_std, z_std) = arm.tolist(), std.tolist()
    return (x, y, z), (x_std, y_std, z_std)


def _equations(log: FlightLog, drive: Floats | None, span: Span) -> Iterator[tuple[Floats, Floats, float, int]]:
    """Parts of the regression of the specific force in the body: Gram matrix of its columns, those of the arm first,
    shape (m, m), their products with the force, its square, and the number of samples."""
    grid = np.arange(span[0], span[1], STEP_S)
    attitude, rates, change = _turning(log, grid)
    velocity = [_smooth(on_clock(grid, log, name)) for name in VELOCITY]
    north, east, up = (np.gradient(own, STEP_S) for own in velocity)
    force = np.array(rotate_inverse(attitude, (north, east, -up - GRAVITY_M_S2)))
    along = np.array(rotate_inverse(attitude, (velocity[0], velocity[1], -velocity[2])))
    lift = np.ones(len(grid)) if drive is None else _smooth(np.interp(grid, log.time_s, np.nan_to_num(drive)))
    lift = lift / max(float(np.median(lift)), 1e-9)
    # Rotors that follow late round the thrust: a delay and, of second order, the lag itself.
    late = np.gradient(lift, STEP_S)
    thrusts = np.array([lift, late, np.gradient(late, STEP_S)])
    # The drag of a wind has its direction over ground.
    toward = [np.array(rotate_inverse(attitude, fixed)) for fixed in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))]
    for begin in range(0, len(grid), PIECE):
        piece = np.s_[..., begin : begin + PIECE]
        signals = (rates, change, along, thrusts, *toward)
        columns = _columns(*(signal[piece] for signal in signals))
        own = force[piece].ravel()
        yield columns.T @ columns, columns.T @ own, float(own @ own), len(own)


def _columns(rates: Floats, change: Floats, along: Floats, thrusts: Floats, *toward: Floats) -> Floats:
    """Columns of the regression, shape (3 n, m)."""
    n = rates.shape[1]
    zero = np.zeros(n)
    blocks = [np.array(_beside(rates, change, tuple(row))) for row in np.eye(3)]
    for axis in range(2):  # drag, delay of the attitude (which turns the weight) and an offset, along and across
        signals = (along[axis], (-rates[1], rates[0])[axis], np.ones(n))
        blocks += [np.array([signal if i == axis else zero for i in range(3)]) for signal in signals]
    blocks += [np.array([zero, zero, one]) for one in (*thrusts, along[2], np.ones(n))]
    blocks += [np.where(np.arange(3)[:, None] == axis, own, 0.0) for own in toward for axis in range(3)]
    return np.stack([block.ravel() for block in blocks], axis=1)


def _turning(log: FlightLog, grid: Floats) -> tuple[Quaternion, Floats, Floats]:
    """Attitude, body rates, and their change, through the filter of the motion."""
    angles = [_smooth(np.radians(on_clock(grid, log, name, unwrap=True))) for name in ATTITUDE]
    rates = np.array([_smooth(on_clock(grid, log, name)) for name in RATES])
    return quaternion_from_euler(*angles), rates, np.gradient(rates, STEP_S, axis=1)


def _beside(rates: Floats, change: Floats, arm: Vector) -> Vector:
    """Acceleration of a point of the body beyond that of its centre of mass, in the body."""
    turned = np.cross(rates, np.cross(rates, np.reshape(arm, (3, 1)), axis=0), axis=0)
    x, y, z = np.cross(change, np.reshape(arm, (3, 1)), axis=0) + turned
    return x, y, z


def _moved(log: FlightLog, arm_m: Vector) -> FlightLog:
    """The log with position and velocity of the point at `-arm_m` from its own."""
    grid = log.time_s
    attitude = quaternion_from_euler(*(np.radians(on_clock(grid, log, name, unwrap=True)) for name in ATTITUDE))
    rates = np.array([on_clock(grid, log, name) for name in RATES])
    x, y, z = np.cross(rates, np.reshape(arm_m, (3, 1)), axis=0)
    beside = (*rotate(attitude, arm_m), *rotate(attitude, (x, y, z)))
    signs = (1.0, 1.0, -1.0) * 2  # the log counts up
    columns = {
        name: log[name] - sign * np.asarray(by)
        for name, by, sign in zip((*POSITION, *VELOCITY), beside, signs, strict=True)
    }
    return replace(log, columns={**log.columns, **columns})


def _smooth(values: Floats) -> Floats:
    return averaged(averaged(values, SMOOTHED_STEPS), SMOOTHED_STEPS)
