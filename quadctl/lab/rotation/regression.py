"""Ridge regression of the state after a horizon: the nonparametric reference, or a correction of the physics.

It names no cause and holds for the controller and the flights that it was trained on; it says how much of the motion
can be predicted.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from quadctl.lab.arrays import Floats
from quadctl.lab.rotation.rollout import State, Track, rotation_vector, turned, turned_back, turned_by

PAST_S = 0.3
KNOT_S = 0.05
"""Spacing at which past states and commands, and future commands, enter."""
PENALTIES = (1e-4, 1e-3, 1e-2, 1e-1)
"""Penalties that are tried, over the number of samples, on whole flights left out in turn."""
DOWN = np.array([[0.0, 0.0, 1.0]])


def features(track: Track, rows: NDArray[np.intp], steps: int) -> Floats:
    """Present state in body axes, its past `PAST_S`, and the commands until the horizon, shape (w, f)."""
    knot = max(round(KNOT_S / track.step_s), 1)
    past = range(0, round(PAST_S / track.step_s) + 1, knot)
    q = track.attitude[rows]
    parts = []
    for back in past:
        at = rows - back
        parts += [
            turned_back(q, track.velocity[at]),
            turned_back(track.attitude[at], np.repeat(DOWN, len(rows), axis=0)),
            track.rates[at],
            track.command[at],
        ]
    sums = np.vstack([np.zeros((1, track.command.shape[1])), np.cumsum(track.command, axis=0)])
    for begin in range(0, steps, knot):
        end = min(begin + knot, steps)
        parts.append((sums[rows + end + 1] - sums[rows + begin + 1]) / (end - begin))
    speed, tilt, turn = parts[0], parts[1], parts[2]
    products = [speed[:, [i]] * turn for i in range(3)] + [tilt[:, [i]] * turn for i in range(2)]
    return np.hstack([*parts, *products])


def change(start: State, end: State, time_s: float) -> Floats:
    """Change of the state in the axes of its start, beyond that of a held velocity, shape (w, 12)."""
    return np.hstack(
        [
            turned_back(start.attitude, end.position - start.position - time_s * start.velocity),
            turned_back(start.attitude, end.velocity - start.velocity),
            rotation_vector(start.attitude, end.attitude),
            end.rates - start.rates,
        ]
    )


def changed(start: State, moved: Floats, time_s: float) -> State:
    """State after a change: the inverse of `change`."""
    position, velocity, rotation, rates = np.split(moved, 4, axis=1)
    return State(
        start.position + time_s * start.velocity + turned(start.attitude, position),
        start.velocity + turned(start.attitude, velocity),
        turned_by(start.attitude, rotation),
        start.rates + rates,
    )


@dataclass(frozen=True, eq=False)
class Ridge:
    """Linear map of standardised features."""

    mean: Floats
    scale: Floats
    weights: Floats
    offset: Floats

    def predict(self, x: Floats) -> Floats:
        return np.asarray((x - self.mean) / self.scale @ self.weights + self.offset)


def fit_ridge(x: Sequence[Floats], y: Sequence[Floats]) -> Ridge:
    """Fit to flights, each of shape (w, f) and (w, t); each target has the penalty that predicts left-out flights
    best."""
    folds = np.arange(len(x)) % min(4, len(x))
    trials = []
    for fold in range(folds.max() + 1) if len(x) > 1 else ():
        kept = [i for i, f in enumerate(folds) if f != fold]
        out = [i for i, f in enumerate(folds) if f == fold]
        x_out, y_out = (np.concatenate([a[i] for i in out]) for a in (x, y))
        fits = _ridges(np.concatenate([x[i] for i in kept]), np.concatenate([y[i] for i in kept]))
        trials.append([np.sum((fit.predict(x_out) - y_out) ** 2, axis=0) for fit in fits])
    fits = _ridges(np.concatenate(x), np.concatenate(y))
    best = np.argmin(np.sum(trials, axis=0), axis=0) if trials else np.full(y[0].shape[1], len(PENALTIES) - 1)
    weights = np.stack([fits[p].weights[:, i] for i, p in enumerate(best)], axis=1)
    return Ridge(fits[0].mean, fits[0].scale, weights, fits[0].offset)


def _ridges(x: Floats, y: Floats) -> list[Ridge]:
    mean, offset = x.mean(axis=0), y.mean(axis=0)
    scale = np.maximum(x.std(axis=0), 1e-9)
    unit = (x - mean) / scale
    gram, moment = unit.T @ unit, unit.T @ (y - offset)
    eye = np.eye(len(gram)) * len(x)
    return [Ridge(mean, scale, np.linalg.solve(gram + p * eye, moment), offset) for p in PENALTIES]
