"""Rollouts of the flights of NanoBench: physics with an observer, a regression, both, and a held state."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from quadctl.frames import quaternion_from_euler
from quadctl.lab.arrays import Floats
from quadctl.lab.rotation.forecast import Forecast, fit_forecast
from quadctl.lab.rotation.parameters import Rotation, fit_rotation
from quadctl.lab.rotation.records import Record, record_of
from quadctl.lab.rotation.regression import change, changed, fit_ridge, future_features, past_features
from quadctl.lab.rotation.rollout import (
    HORIZONS_S,
    Commands,
    Late,
    Physics,
    State,
    Track,
    commands_of,
    errors,
    fit_disturbances,
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

    @property
    def late(self) -> tuple[Late, ...]:
        return tuple(Late(a.values["delay_s"].value, a.values["lag_s"].value) for a in self.rotation.axes.values())

    @property
    def thrust_late(self) -> Late:
        """Of the thrust: the mean of roll and pitch."""
        roll, pitch, _ = self.late
        return Late((roll.delay_s + pitch.delay_s) / 2.0, (roll.lag_s + pitch.lag_s) / 2.0)

    def commands(self, track: Track) -> Commands:
        return commands_of(track, self.rotation.hover_drive, self.rotation.thrust.value, self.vehicle)


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
    physics, commands = fitted.physics, {f.track.name: fitted.commands(f.track) for f in (*train, *test)}
    driven = {name: c.driven(fitted.late, fitted.thrust_late) for name, c in commands.items()}
    noise = fit_disturbances([f.track for f in half], [driven[f.track.name] for f in half], physics)
    forecast = fit_forecast(
        [f.track for f in train], [commands[f.track.name] for f in train], physics, fitted.late, noise
    )
    steps = [round(h / STEP_S) for h in HORIZONS_S]
    rolled = {
        f.track.name: _Rolled(f, every, forecast, commands[f.track.name], steps)
        for f, every in (*((f, TRAIN_EVERY) for f in train), *((f, TEST_EVERY) for f in test))
    }
    found = {name: [np.zeros((len(steps), 4)) for _ in test] for name in MODELS}
    estimated = [
        roll_out(f.track, d, physics, observe(f.track, d, physics, noise), f.starts(TEST_EVERY), steps)
        for f in test
        for d in [driven[f.track.name]]
    ]
    for h, k in enumerate(steps):
        windows = [rolled[f.track.name].windows(h, k) for f in train]
        count = windows[0].future.shape[1] + windows[0].guess.shape[1]
        plain = fit_ridge([w.plain for w in windows], [w.change for w in windows])
        residual = fit_ridge(
            [w.informed for w in windows], [w.change - w.guess for w in windows], (count, windows[0].informed.shape[1])
        )
        for i, f in enumerate(test):
            w, rows, time_s = rolled[f.track.name].windows(h, k), f.starts(TEST_EVERY), k * STEP_S
            states = {
                "held": held(f.track, rows, k),
                "ridge": changed(w.start, plain.predict(w.plain), time_s),
                ESTIMATED: estimated[i][h],
                FORECAST: rolled[f.track.name].ends[h],
                CORRECTED: changed(w.start, w.guess + residual.predict(w.informed), time_s),
            }
            for name, state in states.items():
                found[name][i][h] = errors(state, f.track, rows + k).mean(axis=0)
    return Judged(fitted.rotation, found)


class _Rolled:
    """Forecasts of one flight, and what a regression sees of it."""

    def __init__(
        self, flight: Flight, every: int, forecast: Forecast, commands: Commands, steps: Sequence[int]
    ) -> None:
        self._track, self._rows = flight.track, flight.starts(every)
        self.ends = forecast.roll_out(self._track, commands, self._rows, steps)
        self._seen = forecast.seen(self._track, commands)

    def windows(self, horizon: int, steps: int) -> "_Windows":
        start = state_at(self._track, self._rows)
        return _Windows(
            start,
            future_features(self._track, self._rows, steps),
            past_features(self._track, self._rows),
            change(start, self.ends[horizon], steps * STEP_S),
            np.hstack([d.slow[self._rows] for d in self._seen]),
            change(start, state_at(self._track, self._rows + steps), steps * STEP_S),
        )


@dataclass(frozen=True, eq=False)
class _Windows:
    """Windows of one flight and horizon, as the regressions see them."""

    start: State
    future: Floats
    past: Floats
    guess: Floats
    slow: Floats
    """Slow moment and force, as the forecast reckons with them."""
    change: Floats

    @property
    def plain(self) -> Floats:
        return np.hstack([self.future, self.past])

    @property
    def informed(self) -> Floats:
        """Inputs of a correction of the physics."""
        return np.hstack([self.future, self.guess, self.past, self.slow])
