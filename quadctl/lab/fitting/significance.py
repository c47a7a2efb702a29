"""Significance tests of held-out errors, with the autocorrelation of the residual accounted for."""

import math

import numpy as np
from scipy import stats

from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.noise import CorrelatedNoise
from quadctl.lab.flights.dataset import Dataset

NO_CHANGE = 1e-3
"""Least change of the prediction relative to the residual that is tested; a smaller change comes from the convergence
of the fit."""


def improvement_p_value(before: Floats, predicted_change: Floats, dataset: Dataset) -> float:
    """One-sided p-value of the hypothesis that a candidate's change of the prediction does not explain the residual.

    `before` is the residual without the candidate and `predicted_change` the held-out change of the prediction by the
    candidate, both of shape (n, axes). For an irrelevant candidate their product has mean zero (Clark & West 2007, J.
    Econometrics 138, test for nested models). The variance of the sum comes from the autocovariance of the residual
    with the candidate.
    """
    score, variance = 0.0, 0.0
    after = before - predicted_change
    for axis in range(before.shape[1]):
        change = predicted_change[:, axis]
        if np.mean(change**2) < NO_CHANGE**2 * _power(after[:, axis]):
            continue
        score += float(change @ before[:, axis]) / _power(after[:, axis])
        variance += CorrelatedNoise(after[:, axis], dataset).variance_of_sum(change) / _power(after[:, axis]) ** 2
    if variance == 0.0:
        return 1.0
    degrees = max(2, len(np.unique(dataset.block)) - 1)
    return float(stats.t.sf(score / math.sqrt(variance), degrees))


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
