"""Rollouts of the flights of NanoBench: physics with an observer, a regression, both, and a held state."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from quadctl.errors import LogError
from quadctl.lab.arrays import Floats
from quadctl.lab.rotation.forecast import SETTLED_S
from quadctl.lab.rotation.regression import (
    ABOUT,
    ALONG,
    CHANGED,
    Features,
    change,
    changed,
    fit_ridge,
    future_features,
    past_features,
    side_by_side,
    with_motions,
)
from quadctl.lab.rotation.rollout import HORIZONS_S, State, errors, held, observe, roll_out, state_at, turned_back
from quadctl.lab.rotation.unseen import STEP_S, Flown, Known, flown_of, know, late_of
from quadctl.logs.flight_log import FlightLog
from quadctl.vehicle import Vehicle

TRAIN_EVERY, TEST_EVERY = 3, 5
ESTIMATE_EVERY = 2
"""Every so many flights are enough for a dozen parameters."""
ABOVE_M = 0.5
STEPS = [round(h / STEP_S) for h in HORIZONS_S]
ESTIMATED, FORECAST, CORRECTED = "physics, as estimated", "physics, fitted to forecasts", "the same and ridge"
MODELS = ("held", "ridge", ESTIMATED, FORECAST, CORRECTED)


@dataclass(frozen=True, eq=False)
class Flight:
    """One flight from half a metre up."""

    shape: str
    flown: Flown

    def starts(self, every: int) -> NDArray[np.intp]:
        return np.arange(round(SETTLED_S / STEP_S), len(self.flown.track.rates) - max(STEPS) - 1, every)


def flight_of(log: FlightLog, shape: str, vehicle: Vehicle) -> Flight:
    """The part of a log that flies.

    Raises
    ------
    LogError
        It does not fly, or as `flown_of`.
    """
    high = np.flatnonzero(log["z_m"] > ABOVE_M)
    if len(high) == 0:
        raise LogError(f"{log.name}: stays below {ABOVE_M:g} m")
    span_s = float(log.time_s[high[0]]) + 0.5, float(log.time_s[high[-1]]) - 0.5
    return Flight(shape, flown_of(log, vehicle, span_s))


def judged(train: Sequence[Flight], test: Sequence[Flight], vehicle: Vehicle) -> dict[str, list[Floats]]:
    """Fit all models to the training flights, and compare their rollouts of the test flights with the record.

    Returns mean errors in each test flight, each of shape (horizons, 4), by the name of the model.
    """
    known = know([f.flown for f in train], vehicle, estimate_every=ESTIMATE_EVERY)
    training = [_Rolled(f, TRAIN_EVERY, known) for f in train]
    tested = [(f, _Rolled(f, TEST_EVERY, known), _as_estimated(f, known)) for f in test]
    found = {name: [np.zeros((len(STEPS), 4)) for _ in test] for name in MODELS}
    for h, k in enumerate(STEPS):
        windows = [rolled.windows(h) for rolled in training]
        few, many = (len(f.motions) for f in (windows[0].first, windows[0].informed))
        plain = fit_ridge([w.plain for w in windows], [w.change for w in windows])
        residual = fit_ridge([w.informed for w in windows], [w.change - w.guess for w in windows], (few, many))
        for i, (f, rolled, estimated) in enumerate(tested):
            w, track, rows, time_s = rolled.windows(h), f.flown.track, f.starts(TEST_EVERY), k * STEP_S
            states = {
                "held": held(track, rows, k),
                "ridge": changed(w.start, plain.predict(w.plain.values), time_s),
                ESTIMATED: estimated[h],
                FORECAST: rolled.ends[h],
                CORRECTED: changed(w.start, w.guess + residual.predict(w.informed.values), time_s),
            }
            for name, state in states.items():
                found[name][i][h] = errors(state, track, rows + k).mean(axis=0)
    return found


def _as_estimated(flight: Flight, known: Known) -> list[State]:
    """Rollouts by the physics as estimated, with the observer that suits it."""
    track = flight.flown.track
    driven = known.commands(track).driven(*late_of(known.rotation))
    seen = observe(track, driven, known.physics, known.noise)
    return roll_out(track, driven, known.physics, seen, flight.starts(TEST_EVERY), STEPS)


class _Rolled:
    """Forecasts of one flight, and what a regression sees of it."""

    def __init__(self, flight: Flight, every: int, known: Known) -> None:
        self._track, self._rows = flight.flown.track, flight.starts(every)
        commands = known.commands(self._track)
        self.ends = known.forecast.roll_out(self._track, commands, self._rows, STEPS)
        moment, force = (d.slow[self._rows] for d in known.forecast.seen(self._track, commands))
        force = turned_back(self._track.attitude[self._rows], force)
        self._slow = Features(np.hstack([moment, force]), ABOUT + ALONG)
        self._moved = with_motions(self._track, known.vehicle)

    def windows(self, horizon: int) -> "_Windows":
        start, steps = state_at(self._track, self._rows), STEPS[horizon]
        return _Windows(
            start,
            future_features(self._moved, self._rows, steps),
            past_features(self._moved, self._rows),
            change(start, self.ends[horizon], steps * STEP_S),
            self._slow,
            change(start, state_at(self._track, self._rows + steps), steps * STEP_S),
        )


@dataclass(frozen=True, eq=False)
class _Windows:
    """Windows of one flight and horizon, as the regressions see them."""

    start: State
    future: Features
    past: Features
    guess: Floats
    slow: Features
    """Slow moment and force, as the forecast reckons with them."""
    change: Floats

    @property
    def plain(self) -> Features:
        return side_by_side([self.future, self.past])

    @property
    def first(self) -> Features:
        """Least that a correction of the physics sees: the forecast, and the commands."""
        return side_by_side([self.future, Features(self.guess, CHANGED)])

    @property
    def informed(self) -> Features:
        return side_by_side([self.first, self.past, self.slow])
