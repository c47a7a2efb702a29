"""Forecasts of flights, or parts of flights, that the fit did not see, beside a held state."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.stats import t as student

from quadctl.errors import LogError, SettingsError
from quadctl.frames import quaternion_from_euler
from quadctl.lab.arrays import Floats
from quadctl.lab.rotation.forecast import SETTLED_S, Forecast, fit_forecast
from quadctl.lab.rotation.innovations import BLOCK_S, Value
from quadctl.lab.rotation.model import with_rotation
from quadctl.lab.rotation.parameters import Rotation, fit_rotation
from quadctl.lab.rotation.records import Record, record_of
from quadctl.lab.rotation.replay import Replay, fit_observer
from quadctl.lab.rotation.rollout import (
    HORIZONS_S,
    QUANTITIES,
    Commands,
    Late,
    Physics,
    Track,
    commands_of,
    errors,
    held,
)
from quadctl.logs.findings import Span
from quadctl.logs.flight_log import ATTITUDE, POSITION, VELOCITY, FlightLog
from quadctl.logs.record.record import examine
from quadctl.model import Model
from quadctl.vehicle import Vehicle

STEP_S = 0.01
EVERY = 5
"""Number of steps from one window to the next."""
MOST_PARTS = 4
"""Largest number of parts of the flights that are left out in turn."""
LEAST_BLOCKS = 3
"""Number of blocks that an interval needs."""
NED = np.array([1.0, 1.0, -1.0])
STATE = (*POSITION, *VELOCITY, *ATTITUDE)
"""Columns that a flight needs beside rates and commands to be forecast."""


@dataclass(frozen=True, eq=False)
class Flown:
    """One flight: its record for the estimation, and its track for forecasts."""

    record: Record
    track: Track


def flown_of(log: FlightLog, vehicle: Vehicle, span_s: Span | None = None) -> Flown:
    """The longest part of a log that can be used, or the part `span_s`.

    Raises
    ------
    LogError
        As `record_of`; or the log has no position, velocity or attitude.
    """
    if not all(map(log.has, STATE)):
        raise LogError(f"{log.name}: has no position, velocity or attitude, expected all to forecast the whole state")
    record = record_of(log, vehicle, span_s or _longest_usable(log))
    sampled = record.begin_s + record.step_s * np.arange(len(record.rates))
    clock = np.arange(sampled[0], sampled[-1], STEP_S)

    def of_log(names: Sequence[str]) -> Floats:
        rows = log.updates(*names)
        return np.column_stack([np.interp(clock, log.time_s[rows], log[name][rows]) for name in names])

    def of_record(signal: Floats) -> Floats:
        return np.column_stack([np.interp(clock, sampled, column) for column in signal.T])

    rows = log.updates(*ATTITUDE)
    angles = [np.interp(clock, log.time_s[rows], np.unwrap(np.radians(log[name][rows]))) for name in ATTITUDE]
    attitude = np.stack(quaternion_from_euler(*angles), axis=1)
    rates, drive = of_record(record.rates), of_record(record.drive)
    return Flown(
        record, Track(log.name, STEP_S, of_log(POSITION) * NED, of_log(VELOCITY) * NED, attitude, rates, drive)
    )


def _longest_usable(log: FlightLog) -> Span:
    return max(examine(log).usable, key=lambda span: span[1] - span[0], default=(0.0, 0.0))


@dataclass(frozen=True, eq=False)
class Known:
    """Physics as estimated from flights, and what a forecast trusts of it."""

    rotation: Rotation
    model: Model
    """The model of the physics as estimated, with its observer, as it is saved."""
    forecast: Forecast

    def commands(self, track: Track) -> Commands:
        return _commands(track, self.rotation, self.model.vehicle)

    def replay(self, track: Track) -> Replay:
        return Replay(self.model, track, self.rotation.measured)


def _commands(track: Track, rotation: Rotation, vehicle: Vehicle) -> Commands:
    return commands_of(track, rotation.hover_drive, rotation.thrust.value, vehicle)


def physics_of(rotation: Rotation) -> Physics:
    """Physics as estimated; what these flights cannot tell is 0."""
    axes = [rotation.axes[name].values for name in ("roll", "pitch", "yaw")]
    slope, damping = ([float(axis[key].value) for axis in axes] for key in ("slope", "damping_1_s"))
    airspeed = [float(axis["airspeed"].value) if "airspeed" in axis else 0.0 for axis in axes]
    drag = [rotation.drag[n].values["drag_1_s"].value if n in rotation.drag else 0.0 for n in ("d_x", "d_y")]
    inflow = rotation.thrust.inflow_1_s
    return Physics(
        (slope[0], slope[1], slope[2]),
        (damping[0], damping[1], damping[2]),
        (airspeed[0], airspeed[1]),
        rotation.thrust.value,
        (drag[0], drag[1], inflow.value if inflow is not None else 0.0),
    )


def late_of(rotation: Rotation) -> tuple[tuple[Late, ...], Late]:
    """Delay and lag about each axis, and those of the thrust: the mean of roll and pitch."""
    told = [{name: value.value for name, value in axis.values.items()} for axis in rotation.axes.values()]
    roll, pitch, yaw = (Late(t["delay_s"], t["lag_s"], t.get("lead_s", 0.0)) for t in told)
    return (roll, pitch, yaw), Late((roll.delay_s + pitch.delay_s) / 2.0, (roll.lag_s + pitch.lag_s) / 2.0)


def know(flights: Sequence[Flown], model: Model, *, estimate_every: int = 1) -> Known:
    """Estimate the physics from every so many of the flights, and fit its forecasts to all of them; what is not
    identified stays as in `model`."""
    some = flights[::estimate_every]
    rotation = fit_rotation([f.record for f in some], model.vehicle)
    with suppress(SettingsError):
        model = with_rotation(model, rotation)
    observer = fit_observer([Replay(model, f.track, rotation.measured) for f in some])
    physics, late = physics_of(rotation), late_of(rotation)
    commands = [_commands(f.track, rotation, model.vehicle) for f in flights]
    forecast = fit_forecast([f.track for f in flights], commands, physics, late[0], observer)
    return Known(rotation, replace(model, observer=observer), forecast)


@dataclass(frozen=True, eq=False)
class Unseen:
    """Mean errors of forecasts of what no fit saw, in blocks of `BLOCK_S`, by the name of the model; each of shape
    (blocks, horizons, quantities)."""

    errors: dict[str, Floats]

    def mean(self, model: str, horizon: int, quantity: int) -> Value:
        """Mean over the blocks, with the interval that their scatter gives."""
        values = self.errors[model][:, horizon, quantity]
        half = float(student.ppf(0.975, max(len(values) - 1, 1)) * np.std(values, ddof=1) / np.sqrt(len(values)))
        mean = float(np.mean(values))
        return Value(mean, mean - half, mean + half)

    def to_dict(self) -> dict[str, Any]:
        return {
            model: {
                f"{horizon_s:g}": {name: self.mean(model, h, q).to_dict() for q, name in enumerate(QUANTITIES)}
                for h, horizon_s in enumerate(HORIZONS_S)
            }
            for model in self.errors
        }


def forecast_unseen(logs: Sequence[FlightLog], model: Model) -> Unseen:
    """Leave out the flights in turn, in at most `MOST_PARTS` parts; of one flight, predict each half by the other.

    Raises
    ------
    LogError
        As `flown_of`; or the parts are too short for a forecast.
    """
    if len(logs) == 1:
        begin, end = _longest_usable(logs[0])
        middle = (begin + end) / 2.0
        parts = [[flown_of(logs[0], model.vehicle, span)] for span in ((begin, middle), (middle, end))]
    else:
        flights = [flown_of(log, model.vehicle) for log in logs]
        parts = [flights[i::MOST_PARTS] for i in range(min(MOST_PARTS, len(flights)))]
    found: dict[str, list[Floats]] = {"held": [], "model": [], "forecast": []}
    for part in parts:
        known = know([flown for other in parts if other is not part for flown in other], model)
        for flown in part:
            for name, blocks in _in_blocks(flown.track, known).items():
                found[name] += blocks
    if len(found["held"]) < LEAST_BLOCKS:
        raise LogError(f"{logs[0].name}: flies too briefly to forecast parts that the fit did not see")
    return Unseen({name: np.array(blocks) for name, blocks in found.items()})


def _in_blocks(track: Track, known: Known) -> dict[str, list[Floats]]:
    """Mean errors in blocks of `BLOCK_S`, each of shape (horizons, quantities); none where the track is too short."""
    steps, size = [round(h / track.step_s) for h in HORIZONS_S], round(BLOCK_S / track.step_s / EVERY)
    rows = np.arange(round(SETTLED_S / track.step_s), len(track.rates) - max(steps), EVERY)
    rows = rows[: len(rows) // size * size]
    if len(rows) == 0:
        return {}
    ends = {
        "held": [held(track, rows, k) for k in steps],
        "model": known.replay(track).roll_out(rows, steps),
        "forecast": known.forecast.roll_out(track, known.commands(track), rows, steps),
    }
    found = {}
    for name, states in ends.items():
        missed = [errors(state, track, rows + k) for k, state in zip(steps, states, strict=True)]
        found[name] = list(np.stack(missed, axis=1).reshape(-1, size, len(steps), len(QUANTITIES)).mean(axis=1))
    return found
