"""Autocorrelated noise: uncertainty of weighted sums and means."""

import numpy as np
from numpy.typing import NDArray

from quadctl.lab.arrays import Floats
from quadctl.lab.flights.dataset import Dataset

MAX_LAG_S = 3.0
"""Time lag beyond which residuals of a flight are taken as uncorrelated, s."""
LEAST_VARIANCE = 1e-30


def autocovariance(values: Floats, dataset: Dataset) -> list[Floats]:
    """Autocovariance of one residual axis over lags of whole samples, per flight, about zero mean of the flight."""
    found = []
    for flight, part in zip(dataset.flights, dataset.parts, strict=True):
        x = values[part] - values[part].mean()
        step = float(np.median(np.diff(flight.time_s)))
        lags = min(len(x) - 1, max(1, round(MAX_LAG_S / step)))
        found.append(np.array([x[: len(x) - lag] @ x[lag:] / len(x) for lag in range(lags + 1)]))
    return found


class CorrelatedNoise:
    """Noise of one axis, shape (n,), with the autocovariance of `values` (Bartlett weights)."""

    def __init__(self, values: Floats, dataset: Dataset) -> None:
        self._parts = dataset.parts
        self._kernels = [
            gamma * (2.0 - (np.arange(len(gamma)) == 0)) * (1.0 - np.arange(len(gamma)) / len(gamma))
            for gamma in autocovariance(values, dataset)
        ]
        """Contribution of pairs of samples so many steps apart to a variance, per flight."""

    def variance_of_sum(self, weights: Floats) -> float:
        """Variance of sum(weights * noise)."""
        total = 0.0
        for part, kernel in zip(self._parts, self._kernels, strict=True):
            w = weights[part]
            total += sum(k * float(w[: len(w) - lag] @ w[lag:]) for lag, k in enumerate(kernel))
        return max(total, LEAST_VARIANCE)

    def errors_of_means(self, group: NDArray[np.intp], count: int) -> Floats:
        """Standard error of the mean of each group of samples, shape (count,); `group` is its number, shape (n,)."""
        total = np.zeros(count)
        for part, kernel in zip(self._parts, self._kernels, strict=True):
            g = group[part]
            for lag, k in enumerate(kernel):
                first, later = g[: len(g) - lag], g[lag:]
                total += k * np.bincount(first[first == later], minlength=count)
        size = np.maximum(np.bincount(group, minlength=count), 1)
        return np.asarray(np.sqrt(np.maximum(total / size**2, LEAST_VARIANCE)))
