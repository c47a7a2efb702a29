"""Reference error: held-out error of a flexible regression of the residual on all logged variables.

The regression is not a physical model and is never used in flight. Its held-out error is the reference error. Its
held-out gain over the model tells whether something is missing, also when no effect of the catalogue explains it.
"""

from collections.abc import Collection

import numpy as np

from quadctl.lab.arrays import Floats
from quadctl.lab.flights.dataset import Dataset

KNOTS = 6
RIDGES = (3.0, 30.0, 300.0)


def flexible_residual(residual: Floats, dataset: Dataset, variables: Collection[str] | None = None) -> Floats:
    """Held-out prediction of `residual`, shape (n, axes), by ridge regression on `variables`, or on all; same shape.

    The features are piecewise linear functions of each variable. Each fold is predicted from the other folds; for each
    axis the ridge with the smallest held-out error is used. North and east, the first axes, are also predicted as
    forward and right, since some errors turn with the vehicle and others, such as wind, do not; the better of the two
    counts.
    """
    predicted = _by_hinges(residual, dataset, variables)
    heading = np.concatenate([flight.heading_rad for flight in dataset.flights])
    turned = _by_hinges(turned_by(residual[:, :2], -heading), dataset, variables)
    turned = turned_by(turned, heading)
    if np.sum((residual[:, :2] - turned) ** 2) < np.sum((residual[:, :2] - predicted[:, :2]) ** 2):
        predicted[:, :2] = turned
    return predicted


def turned_by(north_east: Floats, angle_rad: Floats) -> Floats:
    """Horizontal vectors, shape (n, 2), turned from north toward east by an angle each, shape (n,); shape (n, 2)."""
    north, east = north_east.T
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    return np.column_stack([cos * north - sin * east, sin * north + cos * east])


def _by_hinges(residual: Floats, dataset: Dataset, variables: Collection[str] | None) -> Floats:
    """Held-out prediction of each axis of `residual` by itself, same shape."""
    hinges = _Hinges(dataset, dataset.flights[0].variables if variables is None else variables)
    gram = _gram_by_fold(hinges, residual, dataset)
    others = [np.delete(gram, i, axis=0).sum(axis=0) for i in range(len(gram))]
    fitted = [[_ridge_coefficients(learnt, residual.shape[1], ridge) for ridge in RIDGES] for learnt in others]
    tried = np.empty((len(RIDGES), *residual.shape))
    for part in dataset.parts:
        features = hinges.of(part)
        for number, by_ridge in zip(dataset.folds, fitted, strict=True):
            held = dataset.fold[part] == number
            for predicted, (coefficients, mean) in zip(tried[:, part], by_ridge, strict=True):
                predicted[held] = features[held] @ coefficients + mean
    best = np.argmin([np.mean((residual - predicted) ** 2, axis=0) for predicted in tried], axis=0)
    return np.column_stack([tried[i, :, axis] for axis, i in enumerate(best)])


def drift_of(residual: Floats, dataset: Dataset) -> Floats:
    """Held-out prediction of `residual`, shape (n, axes), from time alone: each block of time from the means of the
    blocks before and after it; same shape."""
    predicted = np.zeros_like(residual)
    for flight, part in zip(dataset.flights, dataset.parts, strict=True):
        time_s, own, found = flight.time_s, residual[part], predicted[part]
        blocks = [dataset.block[part] == number for number in np.unique(dataset.block[part])]
        centres_s = np.array([time_s[block].mean() for block in blocks])
        means = np.array([own[block].mean(axis=0) for block in blocks])
        for i, block in enumerate(blocks if len(blocks) > 1 else []):
            others_s, others = np.delete(centres_s, i), np.delete(means, i, axis=0)
            found[block] = np.column_stack([np.interp(time_s[block], others_s, mean) for mean in others.T])
    return predicted


def noise_floor(residual: Floats, flexible: Floats) -> Floats:
    """Residual minus its held-out prediction `flexible`; per axis the residual itself where that is smaller, shape (n,
    3)."""
    left = residual - flexible
    better = np.mean(left**2, axis=0) < np.mean(residual**2, axis=0)
    return np.where(better, left, residual)


class _Hinges:
    """Features of the regression: the variables and hinge functions at their quantiles, all standardised."""

    def __init__(self, dataset: Dataset, variables: Collection[str]) -> None:
        self._variables: list[tuple[Floats, Floats]] = []
        for name in variables:
            x = dataset.variable(name)
            if x is None or np.ptp(x) < 1e-9:
                continue
            x = (x - x.mean()) / x.std()
            self._variables.append((x, np.quantile(x, np.linspace(0.0, 1.0, KNOTS + 2)[1:-1])))
        n = len(dataset.targets)
        self._mean = sum(self._raw(part).sum(axis=0) for part in dataset.parts) / n
        square = sum(((self._raw(part) - self._mean) ** 2).sum(axis=0) for part in dataset.parts) / n
        self._std = np.maximum(np.sqrt(square), 1e-9)

    def of(self, part: slice) -> Floats:
        """Features of the samples `part`, shape (n, p)."""
        return np.asarray((self._raw(part) - self._mean) / self._std)

    def _raw(self, part: slice) -> Floats:
        columns = []
        for x, knots in self._variables:
            columns += [x[part], *(np.maximum(x[part] - knot, 0.0) for knot in knots)]
        return np.column_stack(columns)


def _gram_by_fold(hinges: _Hinges, residual: Floats, dataset: Dataset) -> Floats:
    """Gram matrix of the features, a constant and the axes of `residual`, per fold, shape (folds, m, m)."""
    found: list[Floats] = []
    for part in dataset.parts:
        features = hinges.of(part)
        columns = np.column_stack([features, np.ones(len(features)), residual[part]])
        own = [columns[dataset.fold[part] == number] for number in dataset.folds]
        found.append(np.array([rows.T @ rows for rows in own]))
    return np.asarray(np.sum(found, axis=0))


def _ridge_coefficients(gram: Floats, axes: int, ridge: float) -> tuple[Floats, Floats]:
    """Ridge coefficients, shape (p, axes), and constants, shape (axes,), from the Gram matrix of the training folds."""
    p = len(gram) - 1 - axes
    mean = gram[p, p + 1 :] / gram[p, p]
    about_mean = gram[:p, p + 1 :] - np.outer(gram[:p, p], mean)
    return np.asarray(np.linalg.solve(gram[:p, :p] + ridge * np.eye(p), about_mean)), np.asarray(mean)
