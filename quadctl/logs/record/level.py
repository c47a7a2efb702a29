"""A step of the attitude's level: the autopilot's board, or a marker, slips on the vehicle.

From then on the body's axes are others, so that all that acts along the body seems turned. The rates show how the
sensor turns, but the vehicle does not begin to speed up to that side: in this it differs from every force.
"""

from typing import NamedTuple

import numpy as np

from quadctl.frames import GRAVITY_M_S2, quaternion_from_euler, rotate_inverse
from quadctl.logs.findings import Finding, Kind, Span, finding
from quadctl.logs.flight_log import ATTITUDE, VELOCITY, FlightLog, Floats
from quadctl.logs.record.flight_time import averaged, on_clock, total
from quadctl.logs.record.heading import cut_to

STEP_S, SMOOTHED_STEPS, INDEPENDENT_S = 0.1, 5, 1.0
"""Step of the clock, half the width of the filter, and the time after which errors are independent."""
SIDE_S = 10.0
"""Least time on either side of a step."""
MATTERS_DEG, SIGMA = 1.0, 8.0
"""Least step that is told, and standard errors by which it must differ from zero."""
EXPLAINS = 0.4
"""Least share by which the step must lower the root mean square of what drag and an offset leave."""
SUDDEN_S, AROUND_S, SHARE = 0.6, 3.0, 0.6
"""Time within which the attitude and the force change at the step, time around it in which this is looked at, and the
share of the step by which they must: a force that comes with a speed comes slowly."""


def of_one_level(log: FlightLog, spans: tuple[Span, ...]) -> tuple[list[Span], list[Finding]]:
    """Stretch that is left out for a step of the level, and the finding about it: the longer side is kept."""
    if not all(log.has(name) for name in (*VELOCITY, *ATTITUDE)) or total(spans) < 2.0 * SIDE_S:
        return [], []
    step = _step(log, spans)
    if step is None:
        return [], []
    time_s, roll_deg, pitch_deg = step
    before, after = (total(cut_to(spans, *side)) for side in ((-np.inf, time_s), (time_s, np.inf)))
    told = finding(
        Kind.LEVEL_STEP,
        [(time_s, time_s)],
        roll_deg=roll_deg,
        pitch_deg=pitch_deg,
        left_out="before" if before < after else "after",
    )
    around_s = SMOOTHED_STEPS * STEP_S
    cut = (-np.inf, time_s + around_s) if before < after else (time_s - around_s, np.inf)
    return [cut], [told]


def _step(log: FlightLog, spans: tuple[Span, ...]) -> tuple[float, float, float] | None:
    """Time, and roll and pitch, degrees, by which the attitude's level changes there; None where it does not."""
    parts = [_forces(log, span) for span in spans if span[1] - span[0] > 4.0 * INDEPENDENT_S]
    if not parts:
        return None
    time_s = np.concatenate([part[0] for part in parts])
    force, velocity, lean = (np.concatenate([part[i] for part in parts], axis=1) for i in (1, 2, 3))
    places = np.flatnonzero((time_s > time_s[0] + SIDE_S) & (time_s < time_s[-1] - SIDE_S))
    if len(places) < 2:
        return None
    place = int(places[np.argmax(_explained(force, velocity)[places])])
    fit = _fit(force, velocity, place)
    angle = np.degrees(np.array([-fit.step[1], fit.step[0]]) / GRAVITY_M_S2)
    matters = float(np.hypot(*angle)) > MATTERS_DEG and float(np.hypot(*(fit.step / fit.std))) > SIGMA
    explains = fit.left < (1.0 - EXPLAINS) * _fit(force, velocity, len(time_s)).left
    sudden = _turns(lean, place, angle) and _is_sharp(fit, place)
    return (float(time_s[place]), float(angle[0]), float(angle[1])) if matters and explains and sudden else None


def _explained(force: Floats, velocity: Floats) -> Floats:
    """Sum of squares, (m/s^2)^2, that a step at each row takes off what drag and an offset leave, shape (n,).

    The step is made orthogonal to both (Frisch and Waugh, 1933); its products with them are sums over the rows after.
    """
    n = force.shape[1]
    explained = np.zeros(n)
    for axis in range(2):
        other = np.column_stack([velocity[axis], np.ones(n)])
        inverse = np.linalg.pinv(other.T @ other)
        left = force[axis] - other @ (inverse @ other.T @ force[axis])
        with_other = np.cumsum(other[::-1], axis=0)[::-1]
        size = with_other[:, 1] - np.einsum("ni,ij,nj->n", with_other, inverse, with_other)
        explained += np.cumsum(left[::-1])[::-1] ** 2 / np.maximum(size, 1e-9 * n)
    return explained


class _Fit(NamedTuple):
    """A step of the lateral force at a row, m/s^2, beside drag and an offset."""

    left: float
    """Root mean square of what is left."""
    step: Floats
    std: Floats
    """On both axes."""
    without_drag: Floats
    """Force without drag and offset, shape (2, n)."""


def _fit(force: Floats, velocity: Floats, place: int) -> _Fit:
    """Fit the step at a row; the number of rows gives a fit without one."""
    n = force.shape[1]
    after = (np.arange(n) >= place).astype(float)
    step, std, left, without_drag = np.zeros(2), np.ones(2), 0.0, np.empty_like(force)
    for axis in range(2):
        matrix = np.column_stack([after, velocity[axis], np.ones(n)])
        inverse = np.linalg.pinv(matrix.T @ matrix)
        found = inverse @ matrix.T @ force[axis]
        error = float(np.mean((force[axis] - matrix @ found) ** 2))
        without_drag[axis] = force[axis] - matrix[:, 1:] @ found[1:]
        step[axis], left = found[0], left + 0.5 * error
        std[axis] = max(np.sqrt(error * inverse[0, 0] * INDEPENDENT_S / STEP_S), 1e-9)
    return _Fit(float(np.sqrt(left)), step, std, without_drag)


def _turns(lean: Floats, place: int, angle_deg: Floats) -> bool:
    """Tell whether the attitude itself turns by about that angle, at once."""
    reach = round(SUDDEN_S / STEP_S)
    along = angle_deg @ lean[:, max(place - 2 * reach, 0) : place + 2 * reach]
    turns = [float(np.max(along[steps:] - along[:-steps])) for steps in range(1, min(reach, len(along) - 1) + 1)]
    return max(turns, default=0.0) > SHARE * float(angle_deg @ angle_deg)


def _is_sharp(fit: _Fit, place: int) -> bool:
    """Tell whether most of the step lies between the moments just before and just after it."""
    inner, outer = round((SUDDEN_S + SMOOTHED_STEPS * STEP_S) / STEP_S), round(AROUND_S / STEP_S)
    before = fit.without_drag[:, max(place - outer, 0) : place - inner]
    after = fit.without_drag[:, place + inner : place + outer]
    if not (before.size and after.size):
        return False
    change = after.mean(axis=1) - before.mean(axis=1)
    return float(change @ fit.step) > SHARE * float(fit.step @ fit.step)


def _forces(log: FlightLog, span: Span) -> tuple[Floats, Floats, Floats, Floats]:
    """Clock, specific force and velocity along the body's first two axes, and roll and pitch, degrees, shape (2, n)."""
    grid = np.arange(span[0], span[1], STEP_S)
    angles = [np.radians(on_clock(grid, log, name, unwrap=True)) for name in ATTITUDE]
    velocity = [averaged(on_clock(grid, log, name), SMOOTHED_STEPS) for name in VELOCITY]
    north, east, up = (np.gradient(own, STEP_S) for own in velocity)
    attitude = quaternion_from_euler(*angles)
    force = rotate_inverse(attitude, (north, east, -up - GRAVITY_M_S2))
    along = rotate_inverse(attitude, (velocity[0], velocity[1], -velocity[2]))
    smooth = averaged(np.array(force[:2]), SMOOTHED_STEPS)
    return grid, smooth, averaged(np.array(along[:2]), SMOOTHED_STEPS), np.degrees(np.array(angles[:2]))
