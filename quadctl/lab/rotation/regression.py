"""Ridge regression of the state after a horizon: the nonparametric reference, or a correction of the physics.

It names no cause and holds for the controller and the flights that it was trained on; it says how much of the motion
can be predicted.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from quadctl.lab.arrays import Floats
from quadctl.lab.rotation.rollout import State, Track, rotation_vector, state_at, turned, turned_back, turned_by
from quadctl.vehicle import Vehicle

PAST_S = 0.3
KNOT_S = 0.05
"""Spacing at which past states and commands, and future commands, enter; in the last one each command does, which a
controller made of the state that is asked for."""
PENALTIES = (1e-5, 1e-4, 1e-3, 1e-2, 3e-2, 1e-1, 0.3, 1.0, 3.0)
"""Penalties that are tried, over the number of samples, on whole flights left out in turn."""
TRAIN_EVERY = 3
"""Number of steps from one window of a fit to the next."""
FOLDS = 4
ROUNDS = 3
"""Rounds of weights, by which a large error counts in proportion to its size."""
SHARES = tuple(np.linspace(0.0, 1.0, 11))
"""Shares of the map of motions apart that are tried."""
AXES = 3
DOWN = np.array([[0.0, 0.0, 1.0]])
HEAVE, ROLL, PITCH, YAW = range(4)
"""Motions that a vehicle keeps apart which is alike on the left and the right, in front and behind: as a mirror turns
them."""
ALONG, ABOUT = (PITCH, ROLL, HEAVE), (ROLL, PITCH, YAW)
"""Motions of the components of a vector, and of those of a rotation."""
COMMANDED = (HEAVE, ROLL, PITCH, YAW)
CHANGED = ALONG + ALONG + ABOUT + ABOUT
"""Motions of the columns of `change`."""


@dataclass(frozen=True, eq=False)
class Features:
    """Inputs of a regression: values, shape (w, f), and the motion of each column, shape (f,)."""

    values: Floats
    motions: tuple[int, ...]


def side_by_side(parts: Sequence[Features]) -> Features:
    return Features(np.hstack([p.values for p in parts]), sum((p.motions for p in parts), start=()))


def with_motions(track: Track, vehicle: Vehicle) -> Track:
    """The track with commands of all rotors together, and of their differences about roll, pitch and yaw, in place of
    those of each rotor."""
    arms = np.array(vehicle.moment_arms_m)
    split = track.command @ (arms / np.abs(arms).sum(axis=0))
    return replace(track, command=np.column_stack([track.command.mean(axis=1), split]))


def past_features(track: Track, rows: NDArray[np.intp]) -> Features:
    """Present state in body axes, and its past `PAST_S` with the commands of a track `with_motions`, w rows."""
    q, parts = track.attitude[rows], []
    for back in range(0, round(PAST_S / track.step_s) + 1, _knot(track)):
        at = rows - back
        parts += [
            turned_back(q, track.velocity[at]),
            turned_back(track.attitude[at], np.repeat(DOWN, len(rows), axis=0)),
            track.rates[at],
            track.command[at],
        ]
    return Features(np.hstack(parts), (ALONG + ALONG + ABOUT + COMMANDED) * (len(parts) // 4))


def future_features(track: Track, rows: NDArray[np.intp], steps: int) -> Features:
    """Commands of a track `with_motions` until the horizon, w rows."""
    knot = _knot(track)
    sums = np.vstack([np.zeros((1, track.command.shape[1])), np.cumsum(track.command, axis=0)])
    ends = [(begin, min(begin + knot, steps)) for begin in range(0, steps, knot)]
    means = [(sums[rows + end + 1] - sums[rows + begin + 1]) / (end - begin) for begin, end in ends]
    parts = [*means, *(track.command[rows + steps - back] for back in range(min(knot + 1, steps)))]
    return Features(np.hstack(parts), COMMANDED * len(parts))


def inputs(track: Track, rows: NDArray[np.intp], steps: int) -> Features:
    """Inputs of a regression that knows no physics, of a track `with_motions`: commands until the horizon, and past."""
    return side_by_side([future_features(track, rows, steps), past_features(track, rows)])


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


def fit_ridge(x: Sequence[Features], y: Sequence[Floats], choices: Sequence[int] = ()) -> Ridge:
    """Fit to flights the changes `y`, each of shape (w, 12).

    Each three targets, the axes of one quantity, have the penalty, and the number of the first columns out of
    `choices`, that come closest to the flights left out. What counts is the mean size of an error, not of its square.

    The map is a mean of two: one of all columns, and one in which each motion follows from its own columns alone, as in
    a vehicle that is alike on both sides; that has a quarter of the weights, so flights that are few determine them
    better. Their shares are those that come closest to the flights left out (stacked regressions, Breiman 1996, Machine
    Learning 24).
    """
    joined, target = np.concatenate([f.values for f in x]), np.concatenate(y)
    mean, scale = joined.mean(axis=0), np.maximum(joined.std(axis=0), 1e-9)
    unit, motions = (joined - mean) / scale, np.array(x[0].motions)
    fold = np.repeat(np.arange(len(x)) % min(FOLDS, len(x)), [len(f.values) for f in x])
    weights, offset = np.zeros((unit.shape[1], target.shape[1])), np.zeros(target.shape[1])
    for first in range(0, target.shape[1], AXES):
        axes = range(first, first + AXES)
        wanted = target[:, axes]
        count = _counts(unit, wanted)
        tried = [_best(unit, wanted, count, fold, [np.arange(n)] * AXES) for n in choices or (unit.shape[1],)]
        every = min(tried, key=lambda fitted: _missed(wanted - fitted.left))
        apart = _best(unit, wanted, count, fold, [np.flatnonzero(motions == CHANGED[axis]) for axis in axes])
        share = min(SHARES, key=lambda s: _missed(wanted - s * apart.left - (1.0 - s) * every.left))
        weights[:, axes] = share * apart.weights + (1.0 - share) * every.weights
        offset[axes] = share * apart.offset + (1.0 - share) * every.offset
    return Ridge(mean, scale, weights, offset)


@dataclass(frozen=True, eq=False)
class Reference:
    """Nonparametric reference: the map of each horizon, by its number of steps."""

    maps: dict[int, Ridge]
    vehicle: Vehicle

    def roll_out(self, track: Track, rows: NDArray[np.intp], steps: Sequence[int]) -> list[State]:
        """States that follow `rows` after each number of steps, one of those that it was fitted to."""
        moved, start = with_motions(track, self.vehicle), state_at(track, rows)
        by = {k: self.maps[k].predict(inputs(moved, rows, k).values) for k in steps}
        return [changed(start, by[k], k * track.step_s) for k in steps]


def fit_reference(tracks: Sequence[Track], vehicle: Vehicle, steps: Sequence[int]) -> Reference:
    """Fit the reference to flights, for each number of steps; few flights are cut into parts that are left out."""
    pieces = []
    for track in tracks:
        rows = np.arange(round(PAST_S / track.step_s), len(track.rates) - max(steps), TRAIN_EVERY)
        moved = with_motions(track, vehicle)
        pieces += [(track, moved, part) for part in np.array_split(rows, -(-FOLDS // len(tracks)))]
    maps = {}
    for k in steps:
        ends = [change(state_at(t, rows), state_at(t, rows + k), k * t.step_s) for t, _, rows in pieces]
        maps[k] = fit_ridge([inputs(moved, rows, k) for _, moved, rows in pieces], ends)
    return Reference(maps, vehicle)


_Map = tuple[Floats, Floats]
"""Weights, shape (f, t), and offset, shape (t,)."""


@dataclass(frozen=True, eq=False)
class _Fitted:
    """Map to the axes of one quantity, and what maps without each flight predict of it, shape (n, 3)."""

    weights: Floats
    offset: Floats
    left: Floats


def _missed(errors: Floats) -> float:
    return float(np.linalg.norm(errors, axis=1).sum())


def _counts(unit: Floats, target: Floats) -> Floats:
    """Weights of the samples, shape (n,), by which a large error counts in proportion to its size."""
    count = np.ones(len(unit))
    for _ in range(ROUNDS):
        weights, offset = _ridges(_moments(unit, target, count))[PENALTIES.index(1e-2)]
        size = np.linalg.norm(target - unit @ weights - offset, axis=1)
        count = 1.0 / np.maximum(np.hypot(size, 0.5 * np.median(size)), 1e-300)
        count /= count.mean()
    return count


def _best(
    unit: Floats, target: Floats, count: Floats, fold: NDArray[np.intp], columns: Sequence[NDArray[np.intp]]
) -> _Fitted:
    """Map with the best penalty; each axis has these columns."""
    parts = [_moments(unit[fold == f], target[fold == f], count[fold == f]) for f in range(fold.max() + 1)]
    total = sum(parts[1:], start=parts[0])
    left = np.zeros((len(PENALTIES), *target.shape))
    for f, part in enumerate(parts if len(parts) > 1 else ()):
        out = fold == f
        for penalty, (weights, offset) in enumerate(_maps(total - part, columns)):
            left[penalty, out] = unit[out] @ weights + offset
    best = int(np.argmin([_missed(target - one) for one in left])) if len(parts) > 1 else len(PENALTIES) - 1
    return _Fitted(*_maps(total, columns)[best], left[best])


def _maps(moments: Floats, columns: Sequence[NDArray[np.intp]]) -> list[_Map]:
    """Maps with each of the `PENALTIES`, by the moments of all columns and targets; each target has its own columns."""
    features, targets = len(moments) - 1, len(columns)
    weights, offsets = np.zeros((len(PENALTIES), features, targets)), np.zeros((len(PENALTIES), targets))
    alike = {tuple(own): [t for t, other in enumerate(columns) if np.array_equal(own, other)] for own in columns}
    for own, of in alike.items():
        used = np.array(own)
        rows = np.concatenate([[0], 1 + used])
        part = moments[np.ix_(rows, np.concatenate([rows, 1 + features + np.array(of)]))]
        for penalty, (found, offset) in enumerate(_ridges(part)):
            weights[penalty, used[:, None], of] = found
            offsets[penalty, of] = offset
    return list(zip(weights, offsets, strict=True))


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
