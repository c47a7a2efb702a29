"""Scale of the logged velocity: whether the position changes as fast as the velocity says.

Where it does not, a clock is slow, a unit is off, or an estimator scales one of the two, and then acceleration, the
derivative of the velocity, is wrong by as much: an error that looks like a thrust with another exponent.
"""

import numpy as np

from quadctl.lab.arrays import Floats
from quadctl.lab.flights.flight import Flight
from quadctl.logs.findings import Finding, Kind, finding

LEAST_SPEED_M_S, LEAST_TOLD_M_S = 0.05, 0.3
"""Least standard deviation of a velocity of which a scale is computed, and of which a note is made: the velocity of a
vehicle that hardly moves is mostly the error of its estimator."""
OUTLIER = 5.0
"""Difference from the median, in robust standard deviations, from which on a sample is a reset of an estimator."""
WORTH_A_NOTE = 0.05
"""Least error of the scale that is told: motion capture reaches 4 %."""


def velocity_scale_errors(flight: Flight, least_speed_m_s: float = LEAST_SPEED_M_S) -> Floats:
    """Least error of the scale of the velocity that explains the derivative of the position; north, east, up.

    Both have noise, so that the scale lies between the slopes of the two regressions (Frisch 1934; Klepper & Leamer
    1984, Econometrica 52), each with two standard errors (jackknife over the blocks): the error is the distance of 1
    from that range, with the sign of the position's excess, and 0 within it or where the vehicle hardly moves.
    """
    c = flight.conditions
    found = np.zeros(3)
    for axis, position in enumerate((*c.position_ne_m, c.height_m)):
        if not isinstance(position, np.ndarray):
            continue
        change, speed = flight.derivative @ position, flight.smooth @ flight.velocity_neu[axis]
        apart = np.abs(change - speed - np.median(change - speed))
        kept = apart <= OUTLIER * 1.4826 * np.median(apart)
        change, speed = change[kept] - np.mean(change[kept]), speed[kept] - np.mean(speed[kept])
        if np.std(speed) < least_speed_m_s:
            continue
        by_block = [np.bincount(flight.block[kept], p) for p in (change * speed, speed * speed, change * change)]
        together, of_speed, of_change = (sums.sum() - np.append(0.0, sums) for sums in by_block)
        if np.min(together) > 0.0:
            low, high = _lowered(together / of_speed), -_lowered(-of_change / together)
            found[axis] = max(low - 1.0, 0.0) + min(high - 1.0, 0.0)
    return found


def _lowered(slopes: Floats) -> float:
    """The first slope, of all blocks, minus two standard errors from the others, each without one block."""
    without = slopes[1:]
    return float(slopes[0] - 2.0 * np.sqrt((len(without) - 1) * np.var(without)))


def scale_finding(flight: Flight) -> Finding | None:
    """Finding on a velocity whose scale is off; None where it is as usual."""
    errors = velocity_scale_errors(flight, LEAST_TOLD_M_S)
    axis = int(np.argmax(np.abs(errors)))
    if abs(errors[axis]) < WORTH_A_NOTE:
        return None
    name = ("x_m", "y_m", "z_m")[axis]
    return finding(Kind.VELOCITY_SCALE, position=name, velocity=f"v{name[0]}_m_s", factor=1.0 + float(errors[axis]))
