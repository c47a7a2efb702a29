"""A flexible regression of the residual on all logged variables: how much could any model of them still explain?

It is no physics and is never flown. Its held-out error is the noise floor; its held-out gain over the model tells
whether something is left to be found, also when no effect of the catalogue explains it.
"""

import numpy as np

from quadctl.lab.arrays import Floats
from quadctl.lab.data import Dataset

KNOTS = 6
RIDGES = (3.0, 30.0, 300.0)


def flexible_residual(residual: Floats, dataset: Dataset) -> Floats:
    """What a ridge regression on piecewise linear functions of every variable predicts of `residual`, held out.

    Shape (n, axes). Each fold is predicted from the others; per axis the ridge with the least held-out error is taken.
    """
    features = _features(dataset)
    best = np.zeros_like(residual)
    for axis in range(residual.shape[1]):
        target = residual[:, axis]
        least = np.inf
        for ridge in RIDGES:
            predicted = _held_out(features, target, dataset, ridge)
            error = float(np.mean((target - predicted) ** 2))
            if error < least:
                least, best[:, axis] = error, predicted
    return best


def noise_floor(residual: Floats, flexible: Floats) -> Floats:
    """What the flexible regression leaves, or the residual where that is less (it found nothing), shape (n, 3)."""
    left = residual - flexible
    better = np.mean(left**2, axis=0) < np.mean(residual**2, axis=0)
    return np.where(better, left, residual)


def _held_out(features: Floats, target: Floats, dataset: Dataset, ridge: float) -> Floats:
    predicted = np.zeros_like(target)
    for number in dataset.folds:
        held = dataset.fold == number
        x, y = features[~held], target[~held]
        mean = y.mean()
        weights = np.linalg.solve(x.T @ x + ridge * np.eye(x.shape[1]), x.T @ (y - mean))
        predicted[held] = features[held] @ weights + mean
    return predicted


def _features(dataset: Dataset) -> Floats:
    """Hinges of every variable at its quantiles, standardised, shape (n, p)."""
    columns = []
    for name in dataset.flights[0].variables:
        x = dataset.variable(name)
        if x is None or np.ptp(x) < 1e-9:
            continue
        x = (x - x.mean()) / x.std()
        columns.append(x)
        knots = np.quantile(x, np.linspace(0.0, 1.0, KNOTS + 2)[1:-1])
        columns += [np.maximum(x - knot, 0.0) for knot in knots]
    features: Floats = np.column_stack(columns)
    features -= features.mean(axis=0)
    features /= np.maximum(features.std(axis=0), 1e-9)
    return features
