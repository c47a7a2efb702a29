"""Delay of a log's rotor signal relative to the force it makes, estimated from the flight for a given motor lag."""

import math

import numpy as np

from quadctl.lab.arrays import Floats
from quadctl.lab.flights.flight import Flight
from quadctl.model import Model

DELAYS_S = np.arange(-0.04, 0.3001, 0.01)
"""Delays that are tried, s. Position estimators are up to 40 ms late; a force that comes later still is physics
(`motor_lag`, or an effect of the climb rate)."""
LEAST_EXPLAINED = 0.1
"""Least share of the variance of the quick vertical acceleration that the thrust must explain for the delay to be
known."""


def align(flight: Flight, lag: Model) -> Flight:
    """Shift the rotor signal to the time of its force, given the motor lag that the model `lag` holds.

    A delay that is estimated without the lag would contain a part of the lag.
    """
    thrust_n = np.asarray(sum(lag.late().rotor_thrust(flight.nominal_n, flight.conditions)))
    return flight.shifted(estimated_delay(flight, thrust_n))


def estimated_delay(flight: Flight, thrust_n: Floats) -> float:
    """Delay of the rotor signal relative to the force that it makes, s, estimated from quick vertical motion.

    The delay is the shift with the largest correlation between thrust and vertical acceleration, interpolated by a
    parabola; 0 where the correlation is too small.

    Parameters
    ----------
    thrust_n
        Of all rotors on the flight's grid, shape (m,): what comes late, comes as late after a signal that is shifted.
    """
    quick_up = _detrended(flight.measured[:, 2], flight.time_s)
    if not np.any(quick_up):
        return 0.0
    shifted = (flight.filtered(flight.later(thrust_n, delay_s)) for delay_s in DELAYS_S)
    scores = np.array([_correlation(_detrended(thrust, flight.time_s), quick_up) for thrust in shifted])
    best = int(np.argmax(scores))
    if scores[best] <= math.sqrt(LEAST_EXPLAINED):
        return 0.0
    if 0 < best < len(DELAYS_S) - 1:
        before, here, after = scores[best - 1 : best + 2]
        return float(
            DELAYS_S[best] + 0.5 * (DELAYS_S[1] - DELAYS_S[0]) * (before - after) / (before - 2.0 * here + after)
        )
    return float(DELAYS_S[best])


def _correlation(a: Floats, b: Floats) -> float:
    power = float(np.sqrt(a @ a * (b @ b)))
    return float(a @ b) / power if power > 0.0 else 0.0


def _detrended(values: Floats, time_s: Floats, window_s: float = 3.0) -> Floats:
    """Subtract a running mean over `window_s`."""
    n = max(3, round(window_s / float(np.median(np.diff(time_s)))) | 1)
    padded = np.pad(values, n // 2, mode="edge")
    return values - np.convolve(padded, np.full(n, 1.0 / n), mode="valid")
