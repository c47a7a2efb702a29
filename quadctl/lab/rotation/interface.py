"""Python interface of the rotation: what `quadctl rotation` tells and saves, of logs or their paths."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from quadctl.lab.rotation.model import with_rotation
from quadctl.lab.rotation.parameters import Rotation, fit_rotation
from quadctl.lab.rotation.records import records_of
from quadctl.lab.rotation.replay import Replay, fit_observer
from quadctl.lab.rotation.rollout_errors import Unseen
from quadctl.lab.rotation.unseen import STATE, flown_of, forecast_unseen
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.read import read_imu_log
from quadctl.logs.record.copies import without_copies
from quadctl.model import Model, load_model

AnyModel = Model | str | Path
Logs = FlightLog | str | Path | Sequence[FlightLog | str | Path]


def identify_rotation(model: AnyModel, logs: Logs) -> Rotation:
    """Identify moment gains, rotor lag and delay, damping, reaction and thrust map; no position is needed.

    `told(axis)` holds the parameters of an axis with 95 % intervals, `to_dict()` everything.

    Raises
    ------
    LogError
        A log has no gyro or no commands, or they are too slow or too short.
    """
    vehicle = _opened(model).vehicle
    return fit_rotation([record for log in _read(logs) for record in records_of(log, vehicle)], vehicle)


def add_rotation(model: AnyModel, found: Rotation, logs: Logs = ()) -> Model:
    """The model with what was identified, and with an observer by those logs that have a position, as `quadctl rotation
    -o` saves it.

    Raises
    ------
    SettingsError
        Nothing is identified, or no body has such an inertia.
    """
    new = with_rotation(_opened(model), found)
    flown = [flown_of(log, new.vehicle) for log in _read(logs) if all(map(log.has, STATE))]
    replays = [Replay(new, f.track, found.measured) for f in flown]
    return replace(new, observer=fit_observer(replays)) if replays else new


def rollouts(model: AnyModel, logs: Logs) -> Unseen:
    """Errors of the whole state after 10, 100, 500 ms and 2 s in flights that no fit saw: of a state that is `held`, of
    the `model` that `add_rotation` gives, of the `forecast`, and of the nonparametric `reference`.

    `mean(name, horizon, quantity)` is a mean error with its 95 % interval; `to_dict()` holds them all.

    Raises
    ------
    LogError
        A log has no position, velocity or attitude, or is too short.
    """
    return forecast_unseen(_read(logs), _opened(model))


def _opened(model: AnyModel) -> Model:
    return model if isinstance(model, Model) else load_model(model)


def _read(logs: Logs) -> list[FlightLog]:
    given = [logs] if isinstance(logs, FlightLog | str | Path) else logs
    return without_copies([log if isinstance(log, FlightLog) else read_imu_log(log) for log in given])
