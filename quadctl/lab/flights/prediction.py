"""Prediction of one flight by a model, with the filter of the measured signals, and the error.

A flight measures up to three groups of three axes: the acceleration; the torque, where body rates and signals of single
rotors are logged; and the error of the accelerometer, where there is one. One function predicts each group.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import wraps
from weakref import WeakKeyDictionary

import numpy as np

from quadctl.effects import Conditions, Effect
from quadctl.frames import ned_from_neu
from quadctl.lab.arrays import Floats
from quadctl.lab.flights.flight import Flight
from quadctl.model import Model
from quadctl.numeric import Number, Vector
from quadctl.vehicle import Vehicle

AXES = ("north", "east", "up")
MOMENTS = ("roll", "pitch", "yaw")
SENSED = ("imu_north", "imu_east", "imu_up")
PIECE = 1 << 15
"""Places of the grid that a model is evaluated for at once."""
GROUPS = {"total": AXES, "turning": MOMENTS, "sensing": SENSED}
"""Axes of each measured group: kinematic acceleration (m/s^2), torque (N m), and accelerometer minus acceleration
(m/s^2). The key of a group also names the root of the sum of the squares of its axes."""


MOST_KEPT = 8
"""Number of predictions that are kept of a flight."""
_Key = tuple[Callable[[Model, Flight], Floats], tuple[Effect, ...], int]
_KEPT: WeakKeyDictionary[Flight, dict[_Key, tuple[Vehicle, Floats]]] = WeakKeyDictionary()
"""Last predictions of each flight, as long as it lives; with the vehicle, whose `id` is then no other's."""


def _kept(predict: Callable[[Model, Flight], Floats]) -> Callable[[Model, Flight], Floats]:
    """Keep the last predictions of each flight: residual, Jacobian and intervals of a fit need the same ones."""

    @wraps(predict)
    def kept(model: Model, flight: Flight) -> Floats:
        known, key = _KEPT.setdefault(flight, {}), (predict, model.effects, id(model.vehicle))
        found = known.pop(key, None)
        if found is None:
            found = model.vehicle, predict(model, flight)
            found[1].flags.writeable = False
            if len(known) >= MOST_KEPT:
                del known[next(iter(known))]
        known[key] = found
        return found[1]

    return kept


@_kept
def predict(model: Model, flight: Flight) -> Floats:
    """Predict `measured` of one flight, north, east, up, m/s^2, shape (n, 3): the filtered kinematic acceleration, with
    the error of the accelerometer where that measures it; without its mean where that is the velocity's."""
    found = _filtered(model, flight, lambda nominal, c: ned_from_neu(model.acceleration_ned(nominal, c)))
    if flight.trajectory is None:
        return found
    error = predict_imu_error(model, flight)
    if flight.tells_force:
        return found + error
    for axis in flight.doubted_axes:
        found[:, axis] += error[:, axis] - np.mean(error[:, axis])
    return found


def _filtered(model: Model, flight: Flight, at: Callable[[Sequence[Number], Conditions], Vector]) -> Floats:
    """Filter what `model` says `at` nominal thrusts and conditions, three components, shape (n, 3).

    It is computed for pieces of the grid, whose intermediate values stay in the cache and need little memory; only an
    effect that delays the thrust has to see all of it at once.
    """
    if any(effect.adds_lag for effect in model.effects):
        return flight.filtered_vector(at(flight.nominal_n, flight.conditions))
    columns = np.empty((len(flight.grid_s), 3))
    for piece, nominal, c in flight.pieces(PIECE):
        for i, component in enumerate(at(nominal, c)):
            columns[piece, i] = component
    return np.asarray(flight.smooth @ columns)


def predict_torque(model: Model, flight: Flight) -> Floats:
    """Predict the slowly filtered torque of one flight, FRD, N m, shape (n, 3).

    Only effects that are visible in the balance of moments are included: the others scale a moment that is nearly zero
    on average.
    """
    turning = model.turning()
    return _predict_turning(turning, flight) if turning.stack else flight.nominal_torque


@_kept
def _predict_turning(turning: Model, flight: Flight) -> Floats:
    if turning.needs_thrust_rate:
        step_s = float(flight.grid_s[1] - flight.grid_s[0])
        rates = tuple(np.gradient(thrust, step_s) for thrust in flight.nominal_n)
        flight = replace(flight, conditions=replace(flight.conditions, thrust_rate_n_s=rates))
    return flight.slowly(_filtered(turning, flight, turning.body_torque))


@_kept
def predict_imu_error(model: Model, flight: Flight) -> Floats:
    """Predict the filtered error of the accelerometer, north, east, up, m/s^2, shape (n, 3)."""
    if not any(concerns(effect, "sensing") for effect in model.effects):
        return np.zeros_like(flight.measured)
    sensed = ned_from_neu(model.sensed_ned_m_s2(flight.conditions))
    return flight.filtered_vector(sensed)


def concerns(effect: Effect, group: str) -> bool:
    """Tell whether `effect` changes what `group` measures."""
    return {"total": True, "turning": effect.affects_moment, "sensing": effect.acts_by("sensed_m_s2")}[group]


PREDICT = {"total": predict, "turning": predict_torque, "sensing": predict_imu_error}


def predict_targets(model: Model, flight: Flight, groups: Sequence[str]) -> Floats:
    """Predict the measured `groups` of one flight, shape (n, 3 * groups)."""
    return np.column_stack([PREDICT[group](model, flight) for group in groups])


def measured_targets(flight: Flight, groups: Sequence[str]) -> Floats:
    """Measured `groups` of one flight, shape (n, 3 * groups): the targets of a fit."""
    known = {"total": flight.measured, "turning": flight.moments, "sensing": flight.imu_error}
    return np.column_stack([values for group in groups if (values := known[group]) is not None])


def rmse(residual: Floats, groups: Sequence[str] = ("total",)) -> dict[str, float]:
    """Root mean square of each axis, and for each group the root of the sum of the squares of its axes."""
    squares = np.mean(residual**2, axis=0)
    errors: dict[str, float] = {}
    for i, group in enumerate(groups):
        three = squares[3 * i : 3 * i + 3]
        errors |= {axis: float(np.sqrt(value)) for axis, value in zip(GROUPS[group], three, strict=True)}
        errors[group] = float(np.sqrt(three.sum()))
    return errors
