"""Multilayer perceptrons of the state after a horizon (scikit-learn), stopped by flights that they do not learn."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from sklearn.neural_network import MLPRegressor

from quadctl.lab.arrays import Floats
from quadctl.lab.rotation.regression import FOLDS, Features

HIDDEN = (32,)
EPOCHS, PATIENCE = 40, 4


@dataclass(frozen=True, eq=False)
class Perceptrons:
    """Mean of networks of standardised features and changes."""

    networks: list[MLPRegressor]
    of_features: tuple[Floats, Floats]
    """Mean and standard deviation."""
    of_changes: tuple[Floats, Floats]

    def predict(self, x: Floats) -> Floats:
        (mean, scale), (at, size) = self.of_features, self.of_changes
        unit = (x - mean) / scale
        return np.asarray(np.mean([n.predict(unit) for n in self.networks], axis=0) * size + at)


def fit_perceptrons(x: Sequence[Features], y: Sequence[Floats]) -> Perceptrons:
    """Fit to flights, two or more, the changes `y`, each of shape (w, 12).

    Each of `FOLDS` networks learns from the flights of the others' parts, and stops when it no longer predicts its own
    part better.
    """
    of_features, of_changes = _scale(np.concatenate([f.values for f in x])), _scale(np.concatenate(y))
    features = [(f.values - of_features[0]) / of_features[1] for f in x]
    changes = [(c - of_changes[0]) / of_changes[1] for c in y]
    parts = min(FOLDS, len(x))
    networks = []
    for part in range(parts):
        own = [i for i in range(len(x)) if i % parts == part]
        others = [i for i in range(len(x)) if i % parts != part]
        learned, seen = ([np.concatenate([a[i] for i in of]) for a in (features, changes)] for of in (others, own))
        networks.append(_stopped((learned[0], learned[1]), (seen[0], seen[1]), part))
    return Perceptrons(networks, of_features, of_changes)


def _stopped(learned: tuple[Floats, Floats], seen: tuple[Floats, Floats], seed: int) -> MLPRegressor:
    """Network that learns one pair of features and changes, and is the best of its epochs on the other."""
    network = MLPRegressor(hidden_layer_sizes=HIDDEN, alpha=1e-2, batch_size=128, random_state=seed)
    best, since = np.inf, 0
    weights: list[list[Floats]] = []
    for _ in range(EPOCHS):
        network.partial_fit(*learned)
        missed = float(np.mean((network.predict(seen[0]) - seen[1]) ** 2))
        since += 1
        if missed < best:
            best, since = missed, 0
            weights = [[w.copy() for w in network.coefs_], [b.copy() for b in network.intercepts_]]
        if since >= PATIENCE:
            break
    network.coefs_, network.intercepts_ = weights
    return network


def _scale(values: Floats) -> tuple[Floats, Floats]:
    return values.mean(axis=0), np.maximum(values.std(axis=0), 1e-9)
