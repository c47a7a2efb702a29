"""Forecasts of flights, or parts of flights, that the fit did not see, beside a held state."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from quadctl.errors import LogError, SettingsError
from quadctl.frames import quaternion_from_euler
from quadctl.lab.arrays import Floats
from quadctl.lab.rotation.forecast import SETTLED_S, Forecast, fit_forecast
from quadctl.lab.rotation.innovations import BLOCK_S
from quadctl.lab.rotation.model import with_rotation
from quadctl.lab.rotation.parameters import Rotation, fit_rotation
from quadctl.lab.rotation.records import Record, record_of
from quadctl.lab.rotation.regression import Reference, fit_reference
from quadctl.lab.rotation.replay import Replay, fit_observer
from quadctl.lab.rotation.rollout import (
    Commands,
    Late,
    Physics,
    Track,
    commands_of,
    errors,
    held,
)
from quadctl.lab.rotation.rollout_errors import (
    FORECAST,
    HELD,
    HORIZONS_S,
    LEAST_BLOCKS,
    MODELS,
    QUANTITIES,
    REFERENCE,
    SAVED,
    Unseen,
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


def forecast_unseen(
    logs: Sequence[FlightLog],
    model: Model,
    held_out: Sequence[FlightLog] = (),
    progress: Callable[[str], None] = lambda text: None,
) -> Unseen:
    """Forecast the flights that are held out by fits to the others. Where none is, they are left out in turn, in at
    most `MOST_PARTS` parts, and of one flight each half.

    Raises
    ------
    LogError
        As `flown_of`; or the parts are too short for a forecast.
    """
    found: dict[str, list[Floats]] = {name: [] for name in MODELS}
    folds = _folds(logs, model.vehicle, held_out)
    for number, (used, left_out) in enumerate(folds, start=1):
        progress(f"fitting to what is not held out, {number} of {len(folds)}")
        known = know(used, model)
        reference = fit_reference([flown.track for flown in used], model.vehicle, _steps(used[0].track))
        for flown in left_out:
            for name, blocks in _in_blocks(flown.track, known, reference).items():
                found[name] += blocks
    if len(found[HELD]) < LEAST_BLOCKS:
        raise LogError(f"{logs[0].name}: flies too briefly to forecast parts that the fit did not see")
    return Unseen({name: np.array(blocks) for name, blocks in found.items()})


def _folds(
    logs: Sequence[FlightLog], vehicle: Vehicle, held_out: Sequence[FlightLog]
) -> list[tuple[list[Flown], list[Flown]]]:
    """Flights, or parts of them, that fits use, and those that they are tested on."""
    if len(logs) == 1 and not held_out:
        begin, end = _longest_usable(logs[0])
        middle = (begin + end) / 2.0
        parts = [[flown_of(logs[0], vehicle, span)] for span in ((begin, middle), (middle, end))]
    else:
        flights = [flown_of(log, vehicle) for log in logs]
        if held_out:
            return [(flights, [flown_of(log, vehicle) for log in held_out])]
        parts = [flights[i::MOST_PARTS] for i in range(min(MOST_PARTS, len(flights)))]
    return [([flown for other in parts if other is not part for flown in other], part) for part in parts]


def _steps(track: Track) -> list[int]:
    return [round(horizon_s / track.step_s) for horizon_s in HORIZONS_S]


def _in_blocks(track: Track, known: Known, reference: Reference) -> dict[str, list[Floats]]:
    """Mean errors in blocks of `BLOCK_S`, each of shape (horizons, quantities); none where the track is too short."""
    steps, size = _steps(track), round(BLOCK_S / track.step_s / EVERY)
    rows = np.arange(round(SETTLED_S / track.step_s), len(track.rates) - max(steps), EVERY)
    rows = rows[: len(rows) // size * size]
    if len(rows) == 0:
        return {}
    ends = {
        HELD: [held(track, rows, k) for k in steps],
        SAVED: known.replay(track).roll_out(rows, steps),
        FORECAST: known.forecast.roll_out(track, known.commands(track), rows, steps),
        REFERENCE: reference.roll_out(track, rows, steps),
    }
    found = {}
    for name, states in ends.items():
        missed = [errors(state, track, rows + k) for k, state in zip(steps, states, strict=True)]
        found[name] = list(np.stack(missed, axis=1).reshape(-1, size, len(steps), len(QUANTITIES)).mean(axis=1))
    return found
