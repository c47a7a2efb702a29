"""Noise of residuals, as fit, intervals and tests take it: scale, spectrum, and the uncertainty of sums and means.

Residuals stay correlated for tens of seconds and drift: at the lowest frequencies of a flight the noise is a power law.
"""

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.fft import rfft

from quadctl.lab.arrays import Floats
from quadctl.lab.flights.dataset import Dataset

MAX_LAG_S = 3.0
"""Time lag beyond which residuals of a flight are taken as uncorrelated, s."""
LEAST_VARIANCE = 1e-30
LEAST_NOISE = 1e-4
"""Least noise scale of an axis relative to the largest of all axes."""
SLOPES = np.linspace(0.0, 2.0, 21)
"""Exponents of the power law of the noise: from white noise to a random walk."""
CORNERS = np.array([0.0, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0])
"""Frequencies below which that noise is white, in units of the lowest one: a disturbance that a controller or an
estimator answers within seconds does not grow over a minute."""


def noise_scale(residual: Floats) -> Floats:
    """Robust standard deviation of each axis about its median, shape (axes,): a constant error is not noise."""
    deviation = 1.4826 * np.median(np.abs(residual - np.median(residual, axis=0)), axis=0)
    return np.asarray(np.maximum(deviation, LEAST_NOISE * max(float(deviation.max()), 1e-3)))


class Noise:
    """Noise of several axes, shape (n, axes), with the spectra of `values` in each flight of `parts` (see `spectrum`).

    With `fitted`, same shape, a fit has taken out of the noise what varies as that does.
    """

    def __init__(self, values: Floats, parts: Sequence[slice], fitted: Floats | None = None) -> None:
        self._parts = parts
        self.degrees = sum(_lowest(part.stop - part.start) for part in parts)
        """Degrees of freedom of the spectra at the lowest frequencies."""
        taken = np.zeros_like(values) if fitted is None else fitted
        self._densities = [
            np.column_stack([density(v, np.abs(rfft(t)) ** 2) for v, t in zip(values[p].T, taken[p].T, strict=True)])
            for p in parts
        ]
        """Density of each axis, shape (frequencies, axes), of each flight."""

    def variances_of_sum(self, weights: Floats) -> Floats:
        """Variance of sum(weights * noise) on each axis, shape (axes,); `weights` have shape (n,) or (n, axes)."""
        each = weights if weights.ndim > 1 else weights[:, None]
        total = sum(
            np.sum(np.abs(rfft(each[part], axis=0)) ** 2 * own, axis=0)
            for part, own in zip(self._parts, self._densities, strict=True)
        )
        return np.asarray(np.maximum(total, LEAST_VARIANCE))

    def errors_of_means(self, group: NDArray[np.intp], count: int) -> Floats:
        """Standard error of the mean of each group of samples on each axis, shape (count, axes); `group` is the number
        of the group of each sample, shape (n,)."""
        size = np.maximum(np.bincount(group, minlength=count), 1)
        return np.sqrt([self.variances_of_sum((group == number) / size[number]) for number in range(count)])


def density(noise: Floats, taken: Floats) -> Floats:
    """Contribution of the power of weights at each frequency of `rfft` to the variance of sum(weights * noise), for the
    noise of one flight, shape (n,); `taken` as for `spectrum`."""
    n, at = len(noise), np.arange(len(noise) // 2 + 1)
    sides = np.where((at == 0) | (2 * at == n), 1.0, 2.0)
    return np.asarray(sides / n * spectrum(noise, taken, _lowest(n)))


def spectrum(noise: Floats, taken: Floats, low: int) -> Floats:
    """Variance of the noise of one flight, shape (n,), at each frequency of `rfft`; white noise has its variance at
    all.

    The periodogram, but at the `low` lowest frequencies the mean of power laws that level off below a corner, (f^2 +
    c^2)^(-slope / 2), each by its likelihood (Whittle's, with the best scale). A fit takes the noise out at the
    frequencies at which its model varies, so a frequency counts the less the more of the power `taken` of the model is
    there. The mean counts as half the lowest frequency.
    """
    found = np.abs(rfft(noise)) ** 2 / len(noise)
    lowest = slice(1, min(low, len(found) - 1) + 1)
    power = found[lowest]
    share = 1.0 / (1.0 + taken[lowest] / max(float(taken[lowest].mean()), LEAST_VARIANCE))
    share /= share.sum()
    shapes, inverse, logarithm = _shapes(len(power))
    scales = np.maximum(inverse @ (share * power), LEAST_VARIANCE)
    likelihoods = -(logarithm @ share + np.log(scales)) / float(share @ share)
    weights = np.exp(likelihoods - likelihoods.max())
    found[: lowest.stop] = (weights / weights.sum() * scales) @ shapes
    return np.asarray(found)


def _lowest(n: int) -> int:
    """Number of the lowest frequencies, of `n` samples, at which the noise is taken for a power law."""
    return max(2, round(math.sqrt(n)))


@lru_cache(maxsize=16)
def _shapes(count: int) -> tuple[Floats, Floats, Floats]:
    """Every shape of the spectrum at half the lowest frequency and at the `count` lowest ones, shape (shapes, count +
    1); its inverse and its logarithm at the latter, shape (shapes, count) each."""
    at = np.array([0.5, *np.arange(1.0, count + 1.0)])
    corners = CORNERS[at[-1] > CORNERS]
    shapes = np.concatenate([(at**2 + corner**2) ** (-0.5 * SLOPES[:, None]) for corner in corners])
    return shapes, shapes[:, 1:] ** -1.0, np.log(shapes[:, 1:])


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
