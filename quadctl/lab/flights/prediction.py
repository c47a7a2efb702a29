"""Prediction of one flight by a model, filtered as the measured signals are, and the error that is left.

A flight measures up to three groups of three axes: the acceleration, where rates and single rotors are logged the
torque, and where an accelerometer is logged its error. Each group has one function that predicts it.
"""

from collections.abc import Sequence

import numpy as np

from quadctl.effects import Effect
from quadctl.frames import ned_from_neu
from quadctl.lab.arrays import Floats
from quadctl.lab.flights.flight import Flight
from quadctl.model import Model

AXES = ("north", "east", "up")
MOMENTS = ("roll", "pitch", "yaw")
SENSED = ("imu_north", "imu_east", "imu_up")
GROUPS = {"total": AXES, "turning": MOMENTS, "sensing": SENSED}
"""Axes of each measured group, by the name of the root of the sum of its squares: kinematic acceleration (m/s^2),
torque (N m), and accelerometer minus acceleration (m/s^2)."""


def predict(model: Model, flight: Flight) -> Floats:
    """Filtered kinematic acceleration of one flight by `model`, north, east, up, m/s^2, shape (n, 3)."""
    acceleration = ned_from_neu(model.acceleration_ned(flight.nominal_n, flight.conditions))
    return np.column_stack([flight.filtered(component) for component in acceleration])


def predict_torque(model: Model, flight: Flight) -> Floats:
    """Torque of one flight by `model`, after the slow filter, FRD, N m, shape (n, 3).

    Only the effects that the balance of moments can show are in it: the others scale what is near zero on average.
    """
    turning = model.turning()
    if not turning.stack:
        return flight.nominal_torque
    torque = turning.body_torque(flight.nominal_n, flight.conditions)
    return flight.slowly(np.column_stack([flight.filtered(component) for component in torque]))


def predict_imu_error(model: Model, flight: Flight) -> Floats:
    """Filtered error of the accelerometer by `model`, north, east, up, m/s^2, shape (n, 3)."""
    if not any(effect.senses for effect in model.effects):
        return np.zeros_like(flight.measured)
    sensed = ned_from_neu(model.sensed_ned_m_s2(flight.conditions))
    return np.column_stack([flight.filtered(component) for component in sensed])


def concerns(effect: Effect, group: str) -> bool:
    """Tell whether `effect` changes what `group` measures."""
    return {"total": True, "turning": effect.turns, "sensing": effect.senses}[group]


PREDICT = {"total": predict, "turning": predict_torque, "sensing": predict_imu_error}


def predict_targets(model: Model, flight: Flight, groups: Sequence[str]) -> Floats:
    """Prediction of the measured `groups` of one flight, shape (n, 3 * groups)."""
    return np.column_stack([PREDICT[group](model, flight) for group in groups])


def measured_targets(flight: Flight, groups: Sequence[str]) -> Floats:
    """Measured `groups` of one flight, shape (n, 3 * groups): the targets of a fit."""
    known = {"total": flight.measured, "turning": flight.moments, "sensing": flight.imu_error}
    return np.column_stack([values for group in groups if (values := known[group]) is not None])


def rmse(residual: Floats, groups: Sequence[str] = ("total",)) -> dict[str, float]:
    """Root mean square per axis, and for each group the root of the sum of the squares of its axes."""
    squares = np.mean(residual**2, axis=0)
    errors: dict[str, float] = {}
    for i, group in enumerate(groups):
        three = squares[3 * i : 3 * i + 3]
        errors |= {axis: float(np.sqrt(value)) for axis, value in zip(GROUPS[group], three, strict=True)}
        errors[group] = float(np.sqrt(three.sum()))
    return errors
