"""Noise that stays correlated for long: standard errors of the means of groups of samples."""

import math
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.fft import rfft

from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.noise import LEAST_VARIANCE, spectrum


class Parted(Protocol):
    """Samples of several flights, one after the other."""

    @property
    def parts(self) -> list[slice]:
        """Slice of the samples of each flight."""


class LongRangeNoise:
    """Noise of several axes, shape (n, axes), with the spectra of `values`: a power law at the lowest frequencies of
    each flight (see `spectrum`), as in the tests of the effects.

    A mean over minutes averages only what changes within minutes: residuals drift, so that neighbouring minutes are not
    independent either.
    """

    def __init__(self, values: Floats, flights: "Parted") -> None:
        self._parts = flights.parts
        self._spectra: list[Floats] = []
        """Share of each frequency in a variance, shape (frequencies, axes), of each flight."""
        self.degrees = 0
        """Degrees of freedom of the spectra at the lowest frequencies."""
        for part in self._parts:
            n = int(part.stop - part.start)
            low = max(2, round(math.sqrt(n)))
            self.degrees += low
            frequency = np.arange(n // 2 + 1)
            sides = np.where((frequency == 0) | (2 * frequency == n), 1.0, 2.0) / n
            untaken = np.zeros(len(frequency))
            found = [spectrum(axis - axis.mean(), untaken, low) for axis in values[part].T]
            self._spectra.append(sides[:, None] * np.column_stack(found))

    def variances_of_sum(self, weights: Floats) -> Floats:
        """Variance of sum(weights * noise) on each axis, shape (axes,); `weights` have shape (n,)."""
        total = np.zeros(self._spectra[0].shape[1])
        for part, spectra in zip(self._parts, self._spectra, strict=True):
            total += np.abs(rfft(weights[part])) ** 2 @ spectra
        return np.asarray(np.maximum(total, LEAST_VARIANCE))

    def errors_of_means(self, group: NDArray[np.intp], count: int) -> Floats:
        """Standard error of the mean of each group of samples on each axis, shape (count, axes); `group` is the number
        of the group of each sample, shape (n,)."""
        size = np.maximum(np.bincount(group, minlength=count), 1)
        return np.sqrt([self.variances_of_sum((group == number) / size[number]) for number in range(count)])
