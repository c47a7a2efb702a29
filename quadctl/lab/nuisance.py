"""Nuisances: what is a little wrong in every real flight and is no physics that a model should hold.

Each flight has its own: the thrust coefficient of its rotors and battery, the trim of its attitude estimate, the datum
of its height. They are fitted along with the effects, so that they do not masquerade as one, and held to what rotors
and sensors really do, so that they do not swallow one.
"""

from dataclasses import dataclass, replace

import numpy as np

from quadctl.frames import multiply, quaternion_from_euler
from quadctl.lab.data import predict
from quadctl.lab.prepare import Flight, Floats
from quadctl.model import Model


@dataclass(frozen=True)
class Kind:
    """One nuisance: its usual size (the standard deviation of its prior) and the most that is believed."""

    name: str
    usual: float
    most: float


KINDS = (
    Kind("thrust_scale", 0.005, 0.01),
    Kind("roll_rad", np.radians(0.2), np.radians(0.35)),
    Kind("pitch_rad", np.radians(0.2), np.radians(0.35)),
    Kind("height_m", 0.007, 0.012),
)
USUAL = np.array([kind.usual for kind in KINDS])
MOST = np.array([kind.most for kind in KINDS])


def disturbed(flight: Flight, nuisance: Floats) -> Flight:
    """The flight as it would have been logged without its nuisance: what the prediction has to be made from."""
    if not nuisance.any():
        return flight
    scale, roll, pitch, height = (float(value) for value in nuisance)
    c = flight.conditions
    attitude = multiply(c.attitude, quaternion_from_euler(roll, pitch, 0.0)) if roll or pitch else c.attitude
    return replace(
        flight,
        conditions=replace(c, attitude=attitude, height_m=c.height_m + height),
        nominal_n=[(1.0 + scale) * thrust for thrust in flight.nominal_n] if scale else flight.nominal_n,
    )


def sensitivity(model: Model, flight: Flight) -> Floats:
    """d prediction / d nuisance, at no nuisance, shape (n, 3, kinds): so small, they act linearly."""
    plain = predict(model, flight)
    changes = [(predict(model, disturbed(flight, row)) - plain) / USUAL[i] for i, row in enumerate(np.diag(USUAL))]
    return np.stack(changes, axis=-1)
