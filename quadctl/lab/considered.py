"""Errors of a set-up that no fit can know, but that its parameters are uncertain by: considered, not estimated.

Schmidt 1966 (consider parameters): what a fit makes of them follows from how they change the predictions, and widens
the intervals. They are the same in all flights, so more flights do not average them out.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from quadctl.lab.arrays import Floats
from quadctl.lab.data import predict_targets
from quadctl.lab.flight import Flight
from quadctl.model import Model

ROTOR_COEFFICIENT = 0.01
"""Standard deviation of the thrust coefficients of rotors of one batch, as a share."""
GROUND_SLOPE = math.tan(math.radians(0.5))
"""Of the ground against the frame of the log; the public RAPTOR logs have 0.9 degrees."""


def draw_errors(draws: int, n_rotors: int, random: np.random.Generator) -> Floats:
    """Errors in units of their usual size, shape (draws, rotors + 2)."""
    return random.standard_normal((draws, n_rotors + 2))


def setup_slopes(model: Model, flight: Flight, groups: Sequence[str], here: Floats) -> Floats:
    """What each error of its usual size does to the prediction `here`, shape (n, axes, rotors + 2)."""
    found = [predict_targets(model, wrong, groups) - here for wrong in _wrong(flight)]
    return np.stack(found, axis=-1)


def _wrong(flight: Flight) -> list[Flight]:
    """The flight with one rotor after the other a little stronger, and over ground that rises to the north or east.

    What a stronger rotor does in hover is a nuisance of the flight already: here it acts on its thrust beyond the mean.
    """
    thrusts = flight.nominal_n
    mean = sum(thrusts) / len(thrusts)
    stronger = [
        replace(flight, nominal_n=[*thrusts[:i], thrust + ROTOR_COEFFICIENT * (thrust - mean), *thrusts[i + 1 :]])
        for i, thrust in enumerate(thrusts)
    ]
    c = flight.conditions
    sloped = [
        replace(flight, conditions=replace(c, height_m=c.height_m - GROUND_SLOPE * along)) for along in c.position_ne_m
    ]
    return [*stronger, *sloped]
