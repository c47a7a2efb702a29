"""Significance tests of held-out errors, with the autocorrelation of the residual accounted for."""

import math

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.noise import CorrelatedNoise
from quadctl.lab.flights.dataset import Dataset

NO_CHANGE = 1e-3
"""Least change of the prediction relative to the residual that is tested; a smaller change comes from the convergence
of the fit."""
LEAST_BATCHES = 16
"""Least number of batches from which a variance is estimated."""
LEAST_FLIGHTS = 4
"""Least number of flights whose differences are the noise; fewer say nothing of an effect in one of them."""


def improvement_p_value(before: Floats, predicted_change: Floats, dataset: Dataset) -> float:
    """One-sided p-value of the hypothesis that a candidate's change of the prediction does not explain the residual.

    `before` is the residual without the candidate and `predicted_change` the held-out change of the prediction by the
    candidate, both of shape (n, axes). For an irrelevant candidate their product has mean zero (Clark & West 2007, J.
    Econometrics 138, test for nested models). The variance of the sum comes from the residual with the candidate (see
    `_variance_of_sum`).
    """
    after = before - predicted_change
    used = [
        axis
        for axis in range(before.shape[1])
        if np.mean(predicted_change[:, axis] ** 2) >= NO_CHANGE**2 * _power(after[:, axis])
    ]
    if not used:
        return 1.0
    weights = predicted_change[:, used] / np.array([_power(after[:, axis]) for axis in used])
    score = float(np.sum(weights * before[:, used]))
    variance, degrees = _variance_of_sum(weights, after[:, used], dataset)
    return float(stats.t.sf(score / math.sqrt(variance), degrees))


def _variance_of_sum(weights: Floats, noise: Floats, dataset: Dataset) -> tuple[float, int]:
    """Variance of sum(weights * noise), shape (n, axes) each, and its degrees of freedom.

    Residuals of flights stay correlated for tens of seconds, so the sum is also taken over blocks of time of several
    lengths, each of which is an independent unit if it is long enough (batch means); the largest of these variances
    counts. Where flights differ by more than their blocks tell (F test), the flight is the unit.
    """
    products = np.sum(weights * noise, axis=1)
    blocks = np.unique(dataset.block, return_inverse=True)[1]
    count = int(blocks.max()) + 1
    short = sum(
        CorrelatedNoise(noise[:, axis], dataset).variance_of_sum(weights[:, axis]) for axis in range(noise.shape[1])
    )
    found = (short, max(2, count - 1))
    length = 1
    while count // length >= LEAST_BATCHES:
        variance, degrees = _batch_variance(products, blocks // length)
        if variance > found[0]:
            found = variance, degrees
        length *= 2
    if len(dataset.flights) >= LEAST_FLIGHTS:
        variance, degrees = _batch_variance(products, dataset.flight_index)
        if variance > found[0] * float(stats.f.ppf(0.95, degrees, found[1])):
            found = variance, degrees
    return found


def _batch_variance(products: Floats, batch: NDArray[np.int64]) -> tuple[float, int]:
    """Variance of the sum of `products`, from their sums over batches of samples, and its degrees of freedom."""
    sums = np.bincount(np.unique(batch, return_inverse=True)[1], products)
    return float(sums @ sums) * len(sums) / max(len(sums) - 1, 1), max(len(sums) - 1, 1)


def difference_p_value(better: Floats, other: Floats, dataset: Dataset) -> float:
    """Two-sided p-value of the difference of two held-out residuals, by blocks of time (paired t test).

    Used for candidates that do not contain each other; axes are weighted by their noise in `better`.
    """
    power = np.array([_power(better[:, axis]) for axis in range(better.shape[1])])
    gain = ((other**2 - better**2) / power).sum(axis=1)
    blocks = np.unique(dataset.block, return_inverse=True)[1]
    per_block = np.bincount(blocks, gain)
    if len(per_block) < 3 or np.ptp(per_block) < 1e-12:
        return 1.0
    return float(stats.ttest_1samp(per_block, 0.0).pvalue)


def _power(values: Floats) -> float:
    return max(float(np.mean(values**2)), 1e-12)
