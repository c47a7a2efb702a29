"""Rollouts of the flights of NanoBench: physics with an observer, a regression, both, and a held state."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from quadctl.frames import quaternion_from_euler
from quadctl.lab.arrays import Floats
from quadctl.lab.rotation.parameters import Rotation, differences, fit_rotation
from quadctl.lab.rotation.records import Delayed, Record, record_of
from quadctl.lab.rotation.regression import change, changed, features, fit_ridge
from quadctl.lab.rotation.rollout import (
    HORIZONS_S,
    Disturbance,
    Driven,
    Physics,
    State,
    Track,
    errors,
    fit_disturbances,
    fit_forecasts,
    held,
    observe,
    roll_out,
    state_at,
)
from quadctl.logs.columns import motor_columns
from quadctl.logs.flight_log import ATTITUDE, POSITION, RATES, VELOCITY, FlightLog
from quadctl.vehicle import Vehicle

STEP_S = 0.01
TRAIN_EVERY, TEST_EVERY = 3, 5
OBSERVED_S = 2.0
"""Time before the first window, in which the observer settles."""
ABOVE_M = 0.5
ESTIMATED, FORECAST, CORRECTED = "physics, as estimated", "physics, fitted to forecasts", "the same and ridge"
MODELS = ("held", "ridge", ESTIMATED, FORECAST, CORRECTED)


@dataclass(frozen=True, eq=False)
class Flight:
    """One flight: the record for the fit, and its track; both from half a metre up."""

    shape: str
    record: Record
    track: Track

    def starts(self, every: int) -> NDArray[np.intp]:
        end = len(self.track.rates) - round(max(HORIZONS_S) / STEP_S) - 1
        return np.arange(round(OBSERVED_S / STEP_S), end, every)


def flight_of(log: FlightLog, shape: str, vehicle: Vehicle) -> Flight:
    """The part of a log that flies."""
    high = np.flatnonzero(log["z_m"] > ABOVE_M)
    begin, end = float(log.time_s[high[0]]) + 0.5, float(log.time_s[high[-1]]) - 0.5
    clock = np.arange(begin, end, STEP_S)

    def on_clock(names: Sequence[str]) -> Floats:
        return np.column_stack([np.interp(clock, log.time_s, log[name]) for name in names])

    angles = [np.interp(clock, log.time_s, np.unwrap(np.radians(log[name]))) for name in ATTITUDE]
    ned = np.array([1.0, 1.0, -1.0])
    track = Track(
        log.name,
        STEP_S,
        on_clock(POSITION) * ned,
        on_clock(VELOCITY) * ned,
        np.stack(quaternion_from_euler(*angles), axis=1),
        on_clock(RATES),
        on_clock(motor_columns(4, "output")),
    )
    return Flight(shape, record_of(log, vehicle, (begin, end)), track)


@dataclass(frozen=True, eq=False)
class Fitted:
    """Named physics as fitted to training flights."""

    rotation: Rotation
    vehicle: Vehicle

    @property
    def physics(self) -> Physics:
        axes = self.rotation.axes
        damping = [axes[name].values["damping_1_s"].value for name in ("roll", "pitch", "yaw")]
        inflow = self.rotation.thrust.inflow_1_s
        drag = self.rotation.drag
        slope = [axes[name].values["slope"].value for name in ("roll", "pitch", "yaw")]
        return Physics(
            (slope[0], slope[1], slope[2]),
            (damping[0], damping[1], damping[2]),
            (axes["roll"].values["airspeed"].value, axes["pitch"].values["airspeed"].value),
            self.rotation.thrust.value,
            (
                drag["d_x"].values["drag_1_s"].value,
                drag["d_y"].values["drag_1_s"].value,
                inflow.value if inflow is not None else 0.0,
            ),
        )

    def driven(self, track: Track) -> Driven:
        """Commands of a flight after the fitted delay and lag; those of the thrust are the mean of roll and pitch."""
        relative = track.command / self.rotation.hover_drive
        split = differences(relative, self.rotation.thrust.value, self.vehicle)
        late = [(a.values["delay_s"].value, a.values["lag_s"].value) for a in self.rotation.axes.values()]
        own, mean = relative - 1.0, np.mean(late[:2], axis=0)
        return Driven(
            np.stack([Delayed(split[:, i], track.step_s).by(*late[i]) for i in range(3)], axis=1),
            Delayed(own.mean(axis=1), track.step_s).by(*mean),
            Delayed((own**2).mean(axis=1), track.step_s).by(*mean),
        )


@dataclass(frozen=True, eq=False)
class Judged:
    """Errors of the models on test flights, and what was fitted to the training flights."""

    rotation: Rotation
    errors: dict[str, list[Floats]]
    """Mean errors in each test flight, each of shape (horizons, 4), by the name of the model."""


def judged(train: Sequence[Flight], test: Sequence[Flight], vehicle: Vehicle) -> Judged:
    """Fit all models to the training flights, and compare their rollouts of the test flights with the record."""
    half = train[::2]  # enough for a dozen parameters
    fitted = Fitted(fit_rotation([f.record for f in half], vehicle), vehicle)
    flights = [*((f, TRAIN_EVERY) for f in train), *((f, TEST_EVERY) for f in test)]
    driven = {f.track.name: fitted.driven(f.track) for f, _ in flights}
    known = [f.track for f in half], [driven[f.track.name] for f in half]
    steps = [round(h / STEP_S) for h in HORIZONS_S]
    named = {ESTIMATED: (fitted.physics, fit_disturbances(*known, fitted.physics))}
    named[FORECAST] = fit_forecasts(*known, fitted.physics)
    rolled: dict[tuple[str, str], list[State]] = {}
    observed: dict[str, tuple[Disturbance, Disturbance]] = {}
    for f, every in flights:
        name = f.track.name
        for model, (physics, noise) in named.items():
            seen = observe(f.track, driven[name], physics, noise)
            rolled[model, name] = roll_out(f.track, driven[name], physics, seen, f.starts(every), steps)
            observed[name] = seen
    found = {name: [np.zeros((len(steps), 4)) for _ in test] for name in MODELS}
    for h, k in enumerate(steps):
        windows = {
            f.track.name: _windows(f, every, k, rolled[FORECAST, f.track.name][h], observed) for f, every in flights
        }
        known_windows = [windows[f.track.name] for f in train]
        plain = fit_ridge([w.plain for w in known_windows], [w.change for w in known_windows])
        residual = fit_ridge([w.informed for w in known_windows], [w.change - w.guess for w in known_windows])
        for i, f in enumerate(test):
            w, rows, time_s = windows[f.track.name], f.starts(TEST_EVERY), k * STEP_S
            states = {
                "held": held(f.track, rows, k),
                "ridge": changed(w.start, plain.predict(w.plain), time_s),
                **{model: rolled[model, f.track.name][h] for model in named},
                CORRECTED: changed(w.start, w.guess + residual.predict(w.informed), time_s),
            }
            for name, state in states.items():
                found[name][i][h] = errors(state, f.track, rows + k).mean(axis=0)
    return Judged(fitted.rotation, found)


@dataclass(frozen=True, eq=False)
class _Windows:
    """Windows of one flight and horizon, as the regressions see them."""

    start: State
    plain: Floats
    informed: Floats
    """Inputs of a correction of the physics: also the forecast and the observed disturbances."""
    change: Floats
    guess: Floats


def _windows(
    f: Flight, every: int, steps: int, forecast: State, observed: dict[str, tuple[Disturbance, Disturbance]]
) -> _Windows:
    rows = f.starts(every)
    start, plain = state_at(f.track, rows), features(f.track, rows, steps)
    guess = change(start, forecast, steps * STEP_S)
    seen = [d.slow[rows] for d in observed[f.track.name]]
    true = change(start, state_at(f.track, rows + steps), steps * STEP_S)
    return _Windows(start, plain, np.hstack([plain, guess, *seen]), true, guess)
