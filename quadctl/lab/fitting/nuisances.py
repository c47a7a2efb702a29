"""Nuisances: what is a little wrong in every real flight and is no physics that a model should hold.

Each flight has its own: the thrust coefficient of its rotors and battery, the trim of its attitude estimate, the datum
of its height, the age of its rotor signal, a moment from rotors that are not all alike and a centre of mass that is
off. They are fitted along with the effects, so that they do not masquerade as one, and held to what rotors and sensors
really do, so that they do not swallow one.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from quadctl.frames import multiply, quaternion_from_euler
from quadctl.lab.arrays import Floats
from quadctl.lab.flights.flight import Flight
from quadctl.lab.flights.prediction import PREDICT, predict
from quadctl.model import Model


@dataclass(frozen=True)
class Kind:
    """One nuisance: its usual size (the standard deviation of its prior) and the most that is believed."""

    name: str
    usual: float
    most: float


KINDS = (
    Kind("thrust_scale", 0.005, 0.015),
    Kind("roll_rad", np.radians(0.2), np.radians(0.35)),
    Kind("pitch_rad", np.radians(0.2), np.radians(0.35)),
    Kind("height_m", 0.007, 0.012),
    Kind("delay_s", 0.008, 0.03),
    Kind("roll_moment", 0.01, 0.025),
    Kind("pitch_moment", 0.01, 0.025),
    Kind("yaw_moment", 0.01, 0.025),
)
"""The moments are in units of what all rotors together would turn with if their thrusts added up as independent errors
do: 0.01 is that of rotors whose coefficients are 1 % off each, and whose motors lean by `LEAN`. Like these errors, they
grow with the thrust."""
LEAN = np.radians(0.3)
"""Of each motor on its arm, beside coefficients that are 1 % off: about yaw, that is the larger error by far."""
USUAL = np.array([kind.usual for kind in KINDS])
MOST = np.array([kind.most for kind in KINDS])
HELD = 1e-4
"""Usual size, as a share of the kind's, of a nuisance that an effect stands for: the two could not be told apart."""
FORCES = 5
"""So many of the kinds act on the acceleration, the others on the moments."""
HEIGHT, AGE = ([kind.name for kind in KINDS].index(name) for name in ("height_m", "delay_s"))


def usual_sizes(model: Model) -> Floats:
    """Of the nuisances beside `model`, shape (kinds,)."""
    replaced = {name for effect in model.effects for name in effect.replaces}
    return np.array([HELD * kind.usual if kind.name in replaced else kind.usual for kind in KINDS])


def disturbed(flight: Flight, nuisance: Floats) -> Flight:
    """The flight as it would have been logged without its nuisance: what the prediction has to be made from."""
    if not nuisance[:FORCES].any():
        return flight
    scale, roll, pitch, height, delay_s = (float(value) for value in nuisance[:FORCES])
    c = flight.conditions
    attitude = multiply(c.attitude, quaternion_from_euler(roll, pitch, 0.0)) if roll or pitch else c.attitude
    flight = flight.shifted(delay_s)
    return replace(
        flight,
        conditions=replace(c, attitude=attitude, height_m=c.height_m + height),
        nominal_n=[(1.0 + scale) * thrust for thrust in flight.nominal_n] if scale else flight.nominal_n,
    )


def sensitivity(
    model: Model, flight: Flight, groups: Sequence[str], here: Floats, near: Floats | None = None
) -> Floats:
    """d prediction / d nuisance, at no nuisance, shape (n, 3 * groups, kinds): so small, they act linearly.

    `here` is the prediction of the flight's targets without a nuisance, shape (n, 3 * groups). `near` are the
    `acceleration_slopes` of the model with other parameters: they are about the same but for that to the height, which
    is nothing without some effects, and is made anew.
    """
    found = np.zeros((*here.shape, len(KINDS)))
    if near is None:
        found[:, :3, :FORCES] = acceleration_slopes(model, flight, here)
    else:
        found[:, :3, :FORCES] = near
        found[:, :3, HEIGHT] = _acceleration_slope(model, flight, here, HEIGHT)
    if "turning" in groups:
        first = 3 * groups.index("turning")
        for i, moment in enumerate(rotor_moments_n_m(flight).T):
            found[:, first + i, FORCES + i] = moment
    return found


def acceleration_slopes(model: Model, flight: Flight, here: Floats) -> Floats:
    """d acceleration / d nuisance of the forces, at no nuisance, shape (n, 3, FORCES); `here` as in `sensitivity`."""
    return np.stack([_acceleration_slope(model, flight, here, i) for i in range(FORCES)], axis=-1)


def _acceleration_slope(model: Model, flight: Flight, here: Floats, i: int) -> Floats:
    return np.asarray((predict(model, disturbed(flight, np.diag(USUAL)[i])) - here[:, :3]) / USUAL[i])


def predicted_with(model: Model, flight: Flight, nuisance: Floats, groups: Sequence[str]) -> Floats:
    """Prediction of one flight's targets with its nuisance, shape (n, 3 * groups)."""
    predicted = {group: PREDICT[group](model, flight) for group in groups if group != "total"}
    if "turning" in predicted:
        predicted["turning"] = predicted["turning"] + nuisance[FORCES:] * rotor_moments_n_m(flight)
    return np.column_stack([predict(model, disturbed(flight, nuisance)), *predicted.values()])


def rotor_moments_n_m(flight: Flight) -> Floats:
    """Root of the summed squares of the moments of the rotors, roll, pitch, yaw, shape (n, 3)."""
    vehicle = flight.vehicle
    lever_m = np.linalg.norm([rotor.position_m[:2] for rotor in vehicle.rotors])
    arms_m = np.linalg.norm(vehicle.moment_arms_m, axis=0)
    arms_m[2] = np.hypot(arms_m[2], LEAN / 0.01 * lever_m)
    return np.asarray(np.outer(flight.load, arms_m * vehicle.weight_n / vehicle.n_rotors))
