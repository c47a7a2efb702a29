"""Bootstrap over blocks of time: intervals of a root mean square error of correlated samples."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from quadctl.lab.arrays import Floats
from quadctl.words import estimate

RESAMPLES = 1000
FEWEST_BLOCKS = 4
"""Least number of blocks for an interval: with fewer, resampling does not tell how much the next flight may differ."""


@dataclass(frozen=True)
class Estimate:
    """Root mean square with its 95 % interval, which is None where there are too few data."""

    rmse: float
    ci95: tuple[float, float] | None

    def in_words(self, unit: str = "") -> str:
        """Format value and interval, such as `0.31 m [0.27, 0.35]`."""
        if not np.isfinite(self.rmse):
            return "unbounded"
        if self.ci95 is None:
            return f"{self.rmse:#.3g}".removesuffix(".") + f" {unit}".rstrip()
        value, interval = estimate(self.rmse, self.ci95)
        return " ".join(filter(None, (value, unit, interval)))

    def to_dict(self) -> dict[str, float | list[float] | None]:
        finite = bool(np.isfinite(self.rmse))
        return {
            "rmse": self.rmse if finite else None,
            "ci95": list(self.ci95) if finite and self.ci95 is not None else None,
        }


def resampled_means(values: Floats, block: NDArray[np.int64]) -> Floats:
    """Means of `values`, shape (n, k), over bootstrap draws of whole blocks, shape (draws, k).

    `block` is the block number of each sample, shape (n,). The same blocks give the same draws, so that means of two
    quantities over them are paired.
    """
    _, place, counts = np.unique(block, return_inverse=True, return_counts=True)
    sums = np.zeros((len(counts), values.shape[1]))
    np.add.at(sums, place, values)
    random = np.random.default_rng(0)
    means = np.empty((RESAMPLES, values.shape[1]))
    for draw in means:
        times = np.bincount(random.integers(0, len(counts), len(counts)), minlength=len(counts))
        draw[:] = times @ sums / (times @ counts)
    return means


def estimates(squares: Floats, block: NDArray[np.int64]) -> list[Estimate]:
    """Root mean and its interval for each column of squared errors, shape (n, k)."""
    roots = np.sqrt(squares.mean(axis=0))
    if len(np.unique(block)) < FEWEST_BLOCKS or not np.isfinite(roots).all():
        return [Estimate(float(root), None) for root in roots]
    low, high = np.sqrt(np.percentile(resampled_means(squares, block), [2.5, 97.5], axis=0))
    return [Estimate(float(r), (float(a), float(b))) for r, a, b in zip(roots, low, high, strict=True)]


def drop_interval(before: Floats, after: Floats, block: NDArray[np.int64]) -> tuple[float, float]:
    """95 % interval of the relative drop 1 - RMSE after / RMSE before of paired residuals, shape (n, 3) each, all axes
    together."""
    squares = np.column_stack([np.sum(before**2, axis=1), np.sum(after**2, axis=1)])
    means = resampled_means(squares, block)
    low, high = np.percentile(1.0 - np.sqrt(means[:, 1] / means[:, 0]), [2.5, 97.5])
    return float(low), float(high)
