"""Estimated height as a reference for the barometer that it follows: what the barometer did to it is undone.

Between its corrections an estimator integrates accelerometers, over seconds far truer than an integrated climb rate of
GPS. A complementary filter of second order adds `g1 (b - z) + g2 integral(b - z)` to the rate of its height z, b being
the barometer: z less both integrals in time is what the accelerometers tell. The gains are fitted together with the
barometer's errors and noise by maximum likelihood (an autoregression with inputs, Ljung 1999, section 4.2).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.signal import lsim

from quadctl.effects.sensor_error import SensorError
from quadctl.lab.arrays import Floats
from quadctl.lab.sensors.heights import BIN_S, Estimated, Heights, Reference


def freed(flight: Heights, estimated: Estimated, gains: Floats) -> Heights:
    """The flight beside its estimated height, freed of the barometer's corrections with these gains."""
    true = estimated.height_m - (estimated.followed_m_s - estimated.followed_m_s.mean(axis=0)) @ gains
    time = flight.time_s - flight.time_s.mean()
    nuisances = np.stack([(time / time[-1]) ** 2, estimated.apart_m_s], axis=1)
    return replace(flight, reference=Reference.ESTIMATE, true_m=true, nuisances=nuisances)


def with_unsure_gains(flight: Heights, estimated: Estimated) -> Heights:
    """The freed flight, whose gains are not quite known.

    The integrals are those up to the begin of a bin, which do not hold the noise of that bin.
    """
    apart = flight.reading_m - estimated.height_m
    before = estimated.followed_m_s - 0.5 * BIN_S * np.stack([apart - np.median(apart), 0.0 * apart], axis=1)
    return replace(flight, nuisances=np.column_stack([flight.nuisances, before - before.mean(axis=0)]))


def above_ground(flight: Heights, errors: Sequence[SensorError], gains: Floats) -> Floats:
    """Height above the ground without these errors, as the estimator followed them from its rest, m, shape (n,)."""
    error = sum((np.asarray(one.error_m(flight.conditions(flight.wind_ne_m_s))) for one in errors), np.zeros(1))
    even = np.arange(flight.time_s[0], flight.time_s[-1] + BIN_S, BIN_S)
    read = np.interp(even, flight.time_s, np.broadcast_to(error, flight.time_s.shape))
    _, followed, _ = lsim((gains, (1.0, *gains)), read, even)
    return np.asarray(flight.above_ground_m - np.interp(flight.time_s, even, followed))
