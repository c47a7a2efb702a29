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
"""Spacing at which past states and commands, and future commands, enter; in the last one each command does, which a
controller made of the state that is asked for."""
PENALTIES = (1e-4, 1e-3, 1e-2, 3e-2, 1e-1, 0.3, 1.0, 3.0)
"""Penalties that are tried, over the number of samples, on whole flights left out in turn."""
FOLDS = 4
ROUNDS = 3
"""Rounds of weights, by which a large error counts in proportion to its size."""
AXES = 3
DOWN = np.array([[0.0, 0.0, 1.0]])


def past_features(track: Track, rows: NDArray[np.intp]) -> Floats:
    """Present state in body axes, and its past `PAST_S` with the commands, shape (w, f)."""
    q, parts = track.attitude[rows], []
    for back in range(0, round(PAST_S / track.step_s) + 1, _knot(track)):
        at = rows - back
        parts += [
            turned_back(q, track.velocity[at]),
            turned_back(track.attitude[at], np.repeat(DOWN, len(rows), axis=0)),
            track.rates[at],
            track.command[at],
        ]
    return np.hstack(parts)


def future_features(track: Track, rows: NDArray[np.intp], steps: int) -> Floats:
    """Commands until the horizon, shape (w, f)."""
    knot = _knot(track)
    sums = np.vstack([np.zeros((1, track.command.shape[1])), np.cumsum(track.command, axis=0)])
    ends = [(begin, min(begin + knot, steps)) for begin in range(0, steps, knot)]
    means = [(sums[rows + end + 1] - sums[rows + begin + 1]) / (end - begin) for begin, end in ends]
    return np.hstack([*means, *(track.command[rows + steps - back] for back in range(min(knot + 1, steps)))])


def _knot(track: Track) -> int:
    return max(round(KNOT_S / track.step_s), 1)


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


def fit_ridge(x: Sequence[Floats], y: Sequence[Floats], choices: Sequence[int] = ()) -> Ridge:
    """Fit to flights, each of shape (w, f) and (w, t).

    Each three targets, the axes of one quantity, have the penalty, and the number of the first columns out of
    `choices`, that come closest to the flights left out. What counts is the mean size of an error, not of its square.
    """
    joined, target = np.concatenate(x), np.concatenate(y)
    mean, scale = joined.mean(axis=0), np.maximum(joined.std(axis=0), 1e-9)
    unit = (joined - mean) / scale
    fold = np.repeat(np.arange(len(x)) % min(FOLDS, len(x)), [len(a) for a in x])
    weights, offset = np.zeros((unit.shape[1], target.shape[1])), np.zeros(target.shape[1])
    for first in range(0, target.shape[1], AXES):
        axes = slice(first, first + AXES)
        tried = [(_best(unit[:, :n], target[:, axes], fold), n) for n in choices or (unit.shape[1],)]
        (_, found), n = min(tried, key=lambda t: t[0][0])
        weights[:n, axes], offset[axes] = found
    return Ridge(mean, scale, weights, offset)


_Map = tuple[Floats, Floats]
"""Weights, shape (f, t), and offset, shape (t,)."""


def _best(unit: Floats, target: Floats, fold: NDArray[np.intp]) -> tuple[float, _Map]:
    """Sum of the errors in the flights left out, and the map to the targets, with the best penalty."""
    count = np.ones(len(unit))
    for _ in range(ROUNDS):
        weights, offset = _ridges(_moments(unit, target, count))[PENALTIES.index(1e-2)]
        size = np.linalg.norm(target - unit @ weights - offset, axis=1)
        count = 1.0 / np.maximum(np.hypot(size, 0.5 * np.median(size)), 1e-300)
        count /= count.mean()
    parts = [_moments(unit[fold == f], target[fold == f], count[fold == f]) for f in range(fold.max() + 1)]
    total = sum(parts[1:], start=parts[0])
    left = np.zeros(len(PENALTIES))
    for f, part in enumerate(parts if len(parts) > 1 else ()):
        out = fold == f
        left += [np.linalg.norm(target[out] - unit[out] @ w - b, axis=1).sum() for w, b in _ridges(total - part)]
    best = int(np.argmin(left)) if len(parts) > 1 else len(PENALTIES) - 1
    return float(left[best]), _ridges(total)[best]


def _moments(unit: Floats, target: Floats, count: Floats) -> Floats:
    """Weighted sums of products of the columns (1, unit) with (1, unit, target)."""
    left = np.hstack([np.ones((len(unit), 1)), unit])
    return np.asarray((left * count[:, None]).T @ np.hstack([left, target]))


def _ridges(moments: Floats) -> list[_Map]:
    """Maps with each of the `PENALTIES`."""
    f = len(moments)
    centre = moments[0] / moments[0, 0]
    gram, product = (
        moments[1:, s] / moments[0, 0] - np.outer(centre[1:f], centre[s]) for s in (slice(1, f), slice(f, None))
    )
    values, vectors = np.linalg.eigh(gram)
    turned_product = vectors.T @ product
    maps = [vectors @ (turned_product / (np.maximum(values, 0.0) + p)[:, None]) for p in PENALTIES]
    return [(weights, centre[f:] - centre[1:f] @ weights) for weights in maps]
