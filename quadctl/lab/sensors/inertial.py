"""Estimated height as a reference for the barometer that it follows: what the barometer did to it is undone.

Between its corrections an estimator integrates accelerometers, over seconds far truer than an integrated climb rate of
GPS. A complementary filter of second order adds `g1 (b - z) + g2 integral(b - z)` to the rate of its height z, b being
the barometer: z less both integrals in time is what the accelerometers tell. The gains are fitted together with the
barometer's errors and noise by maximum likelihood (an autoregression with inputs, Ljung 1999, section 4.2).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from quadctl.effects.sensor_error import SensorError
from quadctl.lab.arrays import Floats
from quadctl.lab.sensors.heights import BIN_S, Estimated, Heights, Reference


def freed(flight: Heights, estimated: Estimated, gain_1_s: float) -> Heights:
    """The flight beside its estimated height, freed of the barometer's corrections with this gain of the first.

    The second gain, that of the last nuisance, is a coefficient like others: a double integral does not hold the noise
    of its own bin.
    """
    true = estimated.height_m - gain_1_s * estimated.followed_m_s[:, 0]
    time = flight.time_s - flight.time_s.mean()
    nuisances = np.stack([(time / time[-1]) ** 2, estimated.apart_m_s, -estimated.followed_m_s[:, 1]], axis=1)
    return replace(flight, reference=Reference.ESTIMATE, true_m=true, nuisances=nuisances)


def with_unsure_gain(flight: Heights, estimated: Estimated) -> Heights:
    """The freed flight, whose first gain is not quite known: beside the integral up to the begin of each bin."""
    apart = flight.reading_m - estimated.height_m
    before = estimated.followed_m_s[:, 0] - 0.5 * BIN_S * (apart - np.median(apart))
    known = [] if flight.nuisances is None else [flight.nuisances]
    return replace(flight, nuisances=np.column_stack([*known, before]))


def above_ground(flight: Heights, errors: Sequence[SensorError], gains: tuple[float, float]) -> Floats:
    """Height above the ground without these errors, as the estimator followed them from its rest, m, shape (n,)."""
    from scipy.signal import lsim  # brings scipy.stats, which the start of the page should not wait for

    error = sum((np.asarray(one.error_m(flight.conditions(flight.wind_ne_m_s))) for one in errors), np.zeros(1))
    even = np.arange(flight.time_s[0], flight.time_s[-1] + BIN_S, BIN_S)
    read = np.interp(even, flight.time_s, np.broadcast_to(error, flight.time_s.shape))
    _, followed, _ = lsim((gains, (1.0, *gains)), read, even)
    return np.asarray(flight.above_ground_m - np.interp(flight.time_s, even, followed))
