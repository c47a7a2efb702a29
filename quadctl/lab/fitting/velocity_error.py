"""Errors of the logged velocity, which weaken what depends on it (errors in variables; Fuller 1987, Measurement Error
Models).

An estimator without a camera or a mocap system is wrong by decimetres per second. Where a vehicle moves little faster
than that, a drag that is fitted to the logged velocity comes out too small: by the share that errors have in the
velocity's variance. How large they can be, the flight says itself. With a drag of rate d, 1/s, a velocity that is wrong
by e leaves the acceleration wrong by de/dt + d e: at the angular frequency w the errors have at most the power of the
residual over (w^2 + d^2).
"""

from dataclasses import replace

import numpy as np
from scipy.fft import rfft, rfftfreq

from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.flexible_regression import turned_by
from quadctl.lab.flights.flight import Flight
from quadctl.lab.flights.prediction import AXES, predict
from quadctl.model import Model

STEP = 0.01
"""Relative change of a velocity, from which the change of the prediction is extrapolated."""
LEAST_VARIANCE = 1e-12
"""Least sum of squares of a velocity that is divided by, (m/s)^2."""


def weakening(model: Model, flight: Flight, predicted: Floats, residual: Floats) -> Floats:
    """Change of the prediction, shape (n, axes), where velocities forward and to the right mean as much more as errors
    may have weakened them.

    `predicted` and `residual` have the shape (n, axes), their first axes are the acceleration north, east, up. 0 for a
    model without a force on the body that depends on the velocity.
    """
    change = np.zeros_like(predicted)
    pushing = (effect.depends_on for effect in model.effects_on_body)
    if not any({"speed_forward", "speed_right"} & set(names) for names in pushing):
        return change
    for axis, name in enumerate(("speed_forward", "speed_right")):
        by_velocity = _change_by_velocity(model, flight, predicted, axis)
        velocity = flight.variables[name]
        along, left = (turned_by(a[:, :2], -flight.heading_rad)[:, axis] for a in (by_velocity, residual))
        rate = -np.vdot(along, velocity) / (np.vdot(velocity, velocity) + LEAST_VARIANCE)
        if rate > 0.0:
            share = error_share(velocity, left, float(rate), flight.time_s)
            change[:, : len(AXES)] += share * by_velocity
    return change


def error_share(velocity: Floats, residual: Floats, rate: float, time_s: Floats) -> float:
    """Largest share that errors may have in the variance of `velocity`, m/s, shape (n,), at most 1.

    `residual` is the residual acceleration along it, m/s^2, shape (n,), beside a drag of `rate`, 1/s.
    """
    frequency = 2.0 * np.pi * rfftfreq(len(velocity), float(np.median(np.diff(time_s))))
    power, of_residual = (np.abs(rfft(signal)[1:]) ** 2 for signal in (velocity, residual))
    errors = float(np.sum(of_residual / (frequency[1:] ** 2 + rate**2)))
    return min(errors / (float(power.sum()) + LEAST_VARIANCE), 1.0)


def _change_by_velocity(model: Model, flight: Flight, predicted: Floats, axis: int) -> Floats:
    """Change of the predicted acceleration, shape (n, 3), where one component of the velocity is twice as large, to
    first order."""
    c = flight.conditions
    scaled = tuple(v * (1.0 + STEP) if i == axis else v for i, v in enumerate(c.velocity_body_m_s))
    moved = replace(flight, conditions=replace(c, velocity_body_m_s=scaled))
    return np.asarray((predict(model, moved) - predicted[:, : len(AXES)]) / STEP)
