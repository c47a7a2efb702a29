"""Generalised least squares with noise that wanders: white, and two processes of its own time each.

The difference of two height sensors is never white: pressure drifts with the weather, and a height that GPS's climb
rate is integrated to wanders. How much, and how fast, is learned from the same data by restricted maximum likelihood
(Patterson and Thompson 1971), so that a coefficient is as uncertain as the wander makes it.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dpbtrf, dpbtrs
from scipy.optimize import minimize

from quadctl.lab.arrays import Floats

PROCESSES = 2
START = ((0.5, 0.02, 2.0, 0.05, 60.0), (0.5, 0.2, 5.0, 0.5, 300.0))
"""Starts of the search: white noise as a share of the difference's change from row to row, then size, m, and time, s,
of each process."""
GAIN_1_S = 0.3
"""Start of the search of a gain."""
LEAST_M, SHORTEST_S, LONGEST_S = 1e-4, 0.2, 1e5
"""Bounds of the noise: sizes, and times."""
NOT_TOLD = 1e-15
"""Share of the largest eigenvalue of a precision below which another is 0."""


class Noise(NamedTuple):
    """Noise of a difference of heights."""

    white_m: float
    """Standard deviation of each row."""
    sizes_m: tuple[float, ...]
    times_s: tuple[float, ...]
    """Standard deviation and correlation time of each process."""


class Rows(NamedTuple):
    """Rows of a regression, in the order of time within each flight."""

    time_s: Floats
    flight: Floats
    """Number of the flight, shape (n,)."""
    columns: Floats
    """Shape (n, k)."""
    target: Floats


class Estimate(NamedTuple):
    """Coefficients with their covariance."""

    value: Floats
    covariance: Floats
    misfit: float
    """Weighted squared error that is left."""
    log_likelihood: float
    """Restricted, without constants."""
    log_determinant: float
    """Logarithm of the determinant of the rows' covariance."""


def estimate(rows: Rows, noise: Noise, prior: Floats | None = None) -> Estimate:
    """Coefficients that fit best; `prior` is the precision of each about 0, shape (k,)."""
    products, log_det = _weighted_products(rows, noise)
    k = rows.columns.shape[1]
    precision = products[:k, :k] + (0.0 if prior is None else np.diag(prior))
    sizes, axes = np.linalg.eigh(precision)
    told = np.abs(sizes) > NOT_TOLD * np.max(np.abs(sizes), initial=0.0)
    covariance = (axes[:, told] / sizes[told]) @ axes[:, told].T  # the pseudoinverse: columns may depend on others
    value = covariance @ products[:k, k]
    misfit = float(products[k, k] - value @ products[:k, k])
    log_det_columns = float(np.sum(np.log(np.abs(sizes + 1e-12 * np.trace(precision)))))
    return Estimate(value, covariance, misfit, -0.5 * (log_det + misfit + log_det_columns), log_det)


def learned(rows: Rows) -> Noise:
    """The noise that is most likely, whatever the coefficients."""
    return learned_with_gain(rows, None, 0.0)[0]


def learned_with_gain(rows: Rows, followed: Floats | None, step_s: float) -> tuple[Noise, float, float]:
    """Noise and gain, 1/s, for which the rows' target plus gain times `followed` is most likely; and its restricted log
    likelihood.

    `followed` is the integral of the target over time, up to the middle of each step: a larger gain spreads the target,
    which costs the logarithm of the Jacobian's determinant. Without it the gain is 0.
    """
    change = max(float(np.median(np.abs(np.diff(rows.target)))), 1e-3)
    parts = len(START[0])

    def gain_of(logarithms: Floats) -> float:
        return 0.0 if followed is None else float(np.exp(np.clip(logarithms[parts], -14.0, 4.0)))

    def cost(logarithms: Floats) -> float:
        gain = gain_of(logarithms)
        beyond = np.sum(np.maximum(np.abs(logarithms) - 14.0, 0.0))  # keeps the search where numbers are
        there = rows if followed is None else rows._replace(target=rows.target + gain * followed)
        spread = len(rows.target) * np.log1p(0.5 * step_s * gain)
        return float(beyond - spread) - estimate(there, _noise(logarithms[:parts])).log_likelihood

    found = []
    for white, *others in START:
        start = np.log([white * change, *others, *([] if followed is None else [GAIN_1_S])])
        most = 80 * len(start)
        found.append(
            minimize(cost, start, method="Nelder-Mead", options={"maxiter": most, "xatol": 0.02, "fatol": 0.02})
        )
    best = min(found, key=lambda one: float(one.fun))
    return _noise(best.x[:parts]), gain_of(best.x), -float(best.fun)


def _noise(logarithms: Floats) -> Noise:
    white, size_1, time_1, size_2, time_2 = np.exp(np.clip(logarithms, -14.0, 14.0)).tolist()
    times = tuple(min(max(time, SHORTEST_S), LONGEST_S) for time in (time_1, time_2))
    return Noise(max(white, LEAST_M), (max(size_1, LEAST_M), max(size_2, LEAST_M)), times)


def _weighted_products(rows: Rows, noise: Noise) -> tuple[Floats, float]:
    """Products of the columns and the target, one beside the other, with the inverse covariance between, and the
    logarithm of the covariance's determinant.

    The processes are Markov: their precision has a narrow band, and Woodbury's identity adds the white noise.
    """
    n, m = len(rows.time_s), PROCESSES
    band = np.zeros((m + 1, m * n), order="F")
    log_det = n * 2.0 * np.log(noise.white_m)
    same, step_s = rows.flight[1:] == rows.flight[:-1], np.maximum(np.diff(rows.time_s), 1e-6)
    for i, (size, time) in enumerate(zip(noise.sizes_m, noise.times_s, strict=True)):
        decay = np.where(same, np.exp(-step_s / time), 0.0)
        variance = size**2 * np.concatenate([[1.0], np.maximum(1.0 - decay**2, 1e-12)])
        diagonal = 1.0 / variance
        diagonal[:-1] += decay**2 / variance[1:]
        band[m, i::m] = diagonal
        band[0, m + i :: m] = -decay / variance[1:]
        log_det += float(np.sum(np.log(variance)))
    weight = noise.white_m**-2
    band[m] += weight
    band[m - 1, 1::m] = weight  # both processes are seen as one sum
    # LAPACK itself: the search of the noise comes here hundreds of times, and scipy's checks last longer than the work.
    factor, failed = dpbtrf(band, overwrite_ab=True)
    if failed:
        raise np.linalg.LinAlgError("the covariance of the rows is not positive definite")
    whole = np.column_stack([rows.columns, rows.target])
    inner, _ = dpbtrs(factor, np.repeat(weight * whole.T, m, axis=1).T, overwrite_b=True)
    log_det += 2.0 * float(np.sum(np.log(factor[m])))
    # Subtracted row by row: of products that are nearly the same, the difference would have no digits.
    return whole.T @ (weight * whole - weight * sum(inner[i::m] for i in range(m))), log_det


def stacked(parts: Sequence[Rows]) -> Rows:
    """The rows of several flights."""
    time, flight, columns, target = zip(*parts, strict=True)
    return Rows(np.concatenate(time), np.concatenate(flight), np.concatenate(columns), np.concatenate(target))
