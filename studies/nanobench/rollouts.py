"""Rollouts of flights of a public benchmark: physics with an observer, regressions, both, and a held state."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from quadctl.errors import LogError
from quadctl.lab.arrays import Floats
from quadctl.lab.rotation.forecast import SETTLED_S
from quadctl.lab.rotation.regression import (
    ABOUT,
    ALONG,
    CHANGED,
    TRAIN_EVERY,
    Features,
    change,
    changed,
    fit_ridge,
    future_features,
    inputs,
    past_features,
    side_by_side,
    with_motions,
)
from quadctl.lab.rotation.rollout import State, Track, errors, held, state_at, turned_back
from quadctl.lab.rotation.unseen import STEP_S, Flown, Known, flown_of, know
from quadctl.logs.findings import Span
from quadctl.logs.flight_log import FlightLog
from quadctl.model import Model
from quadctl.vehicle import Vehicle

from .perceptron import fit_perceptrons

ESTIMATE_EVERY = 2
"""Every so many flights are enough for a dozen parameters."""
ABOVE_M = 0.5
HELD, RIDGE, NETWORK = "held", "ridge", "perceptrons"
ESTIMATED, FORECAST, CORRECTED = "physics, as estimated", "physics, fitted to forecasts", "the same and ridge"


@dataclass(frozen=True, eq=False)
class Flight:
    """One flight, and the shape of its trajectory."""

    shape: str
    flown: Flown


def flight_of(log: FlightLog, shape: str, vehicle: Vehicle, span_s: Span | None = None) -> Flight:
    """A log from half a metre up, or the part `span_s` of it.

    Raises
    ------
    LogError
        It does not fly, or as `flown_of`.
    """
    return Flight(shape, flown_of(log, vehicle, span_s or _high(log)))


def _high(log: FlightLog) -> Span:
    high = np.flatnonzero(log["z_m"] > ABOVE_M)
    if len(high) == 0:
        raise LogError(f"{log.name}: stays below {ABOVE_M:g} m")
    return float(log.time_s[high[0]]) + 0.5, float(log.time_s[high[-1]]) - 0.5


@dataclass(frozen=True, eq=False)
class Judged:
    """Rollouts by one model, of flights that no fit saw."""

    errors: list[Floats]
    """Mean errors in each flight, each of shape (horizons, 4)."""
    fit_s: list[float]
    """Processor time of each fit, that of what it builds on included."""
    window_us: list[float]
    """Processor time of a window's prediction, all horizons together, in each flight."""


def together(parts: Sequence[dict[str, Judged]]) -> dict[str, Judged]:
    """Results of several fits as one, by the name of the model."""
    return {
        name: Judged(*([x for p in parts for x in getattr(p[name], of)] for of in ("errors", "fit_s", "window_us")))
        for name in parts[0]
    }


def judged(
    train: Sequence[Flight], test: Sequence[Flight], vehicle: Vehicle, horizons_s: Sequence[float], every: int
) -> dict[str, Judged]:
    """Fit all models to the training flights, and compare their rollouts of the test flights with the record, from a
    window in every so many samples, by the name of the model."""
    steps = [round(h / STEP_S) for h in horizons_s]
    begin = time.process_time()
    known = know([f.flown for f in train], Model(vehicle), estimate_every=ESTIMATE_EVERY)
    physics_s = time.process_time() - begin
    training = [Windows(f.flown.track, TRAIN_EVERY, steps, known) for f in train]
    found = {}
    for name, (fit, before_s) in _models(training, known, physics_s).items():
        begin = time.process_time()
        predict = fit()
        fit_s = before_s + time.process_time() - begin
        missed, window_us = [], []
        for f in test:
            windows, track = Windows(f.flown.track, every, steps, known), f.flown.track
            begin = time.process_time()
            ends = predict(windows)
            window_us.append(1e6 * (time.process_time() - begin) / len(windows.rows))
            pairs = zip(steps, ends, strict=True)
            missed.append(np.array([errors(end, track, windows.rows + k).mean(axis=0) for k, end in pairs]))
        found[name] = Judged(missed, [fit_s], window_us)
    return found


@dataclass(frozen=True, eq=False)
class Windows:
    """Windows of one flight, their forecasts, and what a regression sees of them."""

    track: Track
    every: int
    steps: Sequence[int]
    known: Known

    @cached_property
    def rows(self) -> NDArray[np.intp]:
        return np.arange(round(SETTLED_S / STEP_S), len(self.track.rates) - max(self.steps) - 1, self.every)

    @cached_property
    def start(self) -> State:
        return state_at(self.track, self.rows)

    @cached_property
    def forecasts(self) -> list[State]:
        return self.known.forecast.roll_out(self.track, self.known.commands(self.track), self.rows, self.steps)

    @cached_property
    def _slow(self) -> Features:
        """Slow moment and force, as the forecast reckons with them."""
        moment, force = (
            d.slow[self.rows] for d in self.known.forecast.seen(self.track, self.known.commands(self.track))
        )
        return Features(np.hstack([moment, turned_back(self.start.attitude, force)]), ABOUT + ALONG)

    @cached_property
    def _moved(self) -> Track:
        return with_motions(self.track, self.known.model.vehicle)

    @cached_property
    def _past(self) -> Features:
        return past_features(self._moved, self.rows)

    def _future(self, horizon: int) -> Features:
        return future_features(self._moved, self.rows, self.steps[horizon])

    def plain(self, horizon: int) -> Features:
        """Inputs of a model that knows no physics."""
        return inputs(self._moved, self.rows, self.steps[horizon])

    def first(self, horizon: int) -> Features:
        """Least that a correction of the physics sees: the forecast, and the commands."""
        return side_by_side([self._future(horizon), Features(self.guess(horizon), CHANGED)])

    def informed(self, horizon: int) -> Features:
        return side_by_side([self.first(horizon), self._past, self._slow])

    def guess(self, horizon: int) -> Floats:
        """Change of the state by the forecast."""
        return change(self.start, self.forecasts[horizon], self.steps[horizon] * STEP_S)

    def change(self, horizon: int) -> Floats:
        return change(self.start, state_at(self.track, self.rows + self.steps[horizon]), self.steps[horizon] * STEP_S)

    def after(self, horizon: int, moved: Floats) -> State:
        return changed(self.start, moved, self.steps[horizon] * STEP_S)


class Map(Protocol):
    """Predictions of a regression."""

    def predict(self, x: Floats) -> Floats: ...


Predict = Callable[[Windows], list[State]]
"""States of windows after each horizon."""


def _models(
    training: Sequence[Windows], known: Known, physics_s: float
) -> dict[str, tuple[Callable[[], Predict], float]]:
    """Fit of each model, and the processor time of what it builds on, s."""
    return {
        HELD: (lambda: _held, 0.0),
        RIDGE: (partial(_fitted, training, fit_ridge), 0.0),
        NETWORK: (partial(_fitted, training, fit_perceptrons), 0.0),
        ESTIMATED: (lambda: _as_estimated, physics_s),
        FORECAST: (lambda: lambda windows: windows.forecasts, physics_s),
        CORRECTED: (partial(_corrected, training), physics_s),
    }


def _held(windows: Windows) -> list[State]:
    return [held(windows.track, windows.rows, k) for k in windows.steps]


def _as_estimated(windows: Windows) -> list[State]:
    """Rollouts by the model of the physics as estimated, with its observer."""
    return windows.known.replay(windows.track).roll_out(windows.rows, windows.steps)


def _fitted(training: Sequence[Windows], fit: Callable[[list[Features], list[Floats]], Map]) -> Predict:
    """Regression that knows no physics, for each horizon."""
    horizons = range(len(training[0].steps))
    maps = [fit([w.plain(h) for w in training], [w.change(h) for w in training]) for h in horizons]
    return lambda windows: [windows.after(h, maps[h].predict(windows.plain(h).values)) for h in horizons]


def _corrected(training: Sequence[Windows]) -> Predict:
    """Forecasts with a regression of what they leave."""
    horizons, maps = range(len(training[0].steps)), []
    for h in horizons:
        few, many = (len(of(h).motions) for of in (training[0].first, training[0].informed))
        left = [w.change(h) - w.guess(h) for w in training]
        maps.append(fit_ridge([w.informed(h) for w in training], left, (few, many)))
    return lambda windows: [
        windows.after(h, windows.guess(h) + maps[h].predict(windows.informed(h).values)) for h in horizons
    ]
