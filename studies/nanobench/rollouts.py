"""Rollouts of the flights of NanoBench: physics with an observer, a regression, both, and a held state."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from quadctl.frames import GRAVITY_M_S2, quaternion_from_euler
from quadctl.lab.arrays import Floats
from quadctl.lab.rotation.parameters import Rotation, differences, fit_rotation
from quadctl.lab.rotation.records import Delayed, Record, record_of
from quadctl.lab.rotation.regression import change, changed, features, fit_ridge
from quadctl.lab.rotation.rollout import (
    HORIZONS_S,
    Driven,
    Physics,
    Track,
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
MODELS = ("held", "ridge", "physics", "physics + ridge")


@dataclass(frozen=True, eq=False)
class Flight:
    """One flight: the record for the fit, and its track; both from half a metre up."""

    shape: str
    record: Record
    track: Track

    def starts(self, every: int) -> NDArray[np.intp]:
        end = len(self.track.rates) - round(max(HORIZONS_S) / STEP_S) - 1
        return np.arange(round(OBSERVED_S / STEP_S), end, every)


def flight_of(log: FlightLog, shape: str) -> Flight:
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
    return Flight(shape, record_of(log, 4, (begin, end)), track)


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
        return Physics(
            (damping[0], damping[1], damping[2]),
            (axes["roll"].values["airspeed"].value, axes["pitch"].values["airspeed"].value),
            (
                self.rotation.drag["d_x"].values["drag_1_s"].value,
                self.rotation.drag["d_y"].values["drag_1_s"].value,
                inflow.value if inflow is not None else 0.0,
            ),
        )

    def driven(self, track: Track) -> Driven:
        """What the commands of a flight do, by the fitted lag, delay and thrust map."""
        relative, e = track.command / self.rotation.hover_drive, self.rotation.thrust.value
        split = differences(relative, e, self.vehicle)
        moments, late = [], []
        for i, axis in enumerate(self.rotation.axes.values()):
            v = axis.values
            delay_s, lag_s = v["delay_s"].value, v["lag_s"].value
            moments.append(v["slope"].value * Delayed(split[:, i], track.step_s).by(delay_s, lag_s))
            late.append((delay_s, lag_s))
        own = relative - 1.0
        shares = 1.0 + e * own.mean(axis=1) + (e - 1.0) * (own**2).mean(axis=1)
        thrust = GRAVITY_M_S2 * Delayed(shares, track.step_s).by(*np.mean(late[:2], axis=0))
        return Driven(np.array(moments).T, thrust)


def judged(train: Sequence[Flight], test: Sequence[Flight], vehicle: Vehicle) -> dict[str, list[Floats]]:
    """Mean errors of each model in each test flight, each of shape (horizons, 4)."""
    fitted = Fitted(fit_rotation([f.record for f in train], vehicle), vehicle)
    physics = fitted.physics
    driven = {f.track.name: fitted.driven(f.track) for f in [*train, *test]}
    noise = fit_disturbances([f.track for f in train], [driven[f.track.name] for f in train], physics)
    print(
        physics,
        noise,
        {n: {k: round(v.value, 4) for k, v in a.values.items()} for n, a in fitted.rotation.axes.items()},
    )
    disturbed = {f.track.name: observe(f.track, driven[f.track.name], physics, noise) for f in [*train, *test]}
    steps = [round(h / STEP_S) for h in HORIZONS_S]
    found = {name: [np.zeros((len(steps), 4)) for _ in test] for name in MODELS}
    rolled = {}
    for f, every in [*((f, TRAIN_EVERY) for f in train), *((f, TEST_EVERY) for f in test)]:
        rows, name = f.starts(every), f.track.name
        rolled[name] = roll_out(f.track, driven[name], physics, disturbed[name], rows, steps)
    for h, k in enumerate(steps):
        time_s = k * STEP_S

        def inputs(f: Flight, every: int, k: int = k, h: int = h, time_s: float = time_s) -> tuple[Floats, ...]:
            rows, name = f.starts(every), f.track.name
            start = state_at(f.track, rows)
            plain = features(f.track, rows, k)
            guess = change(start, rolled[name][h], time_s)
            moment, force = disturbed[name]
            seen = [d.slow[rows] for d in (moment, force)]
            true = change(start, state_at(f.track, rows + k), time_s)
            return plain, true, np.hstack([plain, guess, *seen]), true - guess, guess

        known = [inputs(f, TRAIN_EVERY) for f in train]
        plain = fit_ridge([k[0] for k in known], [k[1] for k in known])
        residual = fit_ridge([k[2] for k in known], [k[3] for k in known])
        for i, f in enumerate(test):
            rows = f.starts(TEST_EVERY)
            start = state_at(f.track, rows)
            x, _, more, _, guess = inputs(f, TEST_EVERY)
            states = {
                "held": held(f.track, rows, k),
                "ridge": changed(start, plain.predict(x), time_s),
                "physics": rolled[f.track.name][h],
                "physics + ridge": changed(start, guess + residual.predict(more), time_s),
            }
            for name, state in states.items():
                found[name][i][h] = errors(state, f.track, rows + k).mean(axis=0)
    return found
