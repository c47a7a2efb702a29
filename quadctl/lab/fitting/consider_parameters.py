"""Errors that no fit can know, but that its parameters are uncertain by: considered, not estimated.

Schmidt 1966 (consider parameters): what a fit makes of them follows from how they change the predictions, and widens
the intervals. They are the same in all flights, so more flights do not average them out. Some are of the set-up: rotors
that are not all alike, ground that slopes. The others are of the model: an effect that depends on something has a form,
and no form is quite that of nature.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from quadctl.lab.arrays import Floats
from quadctl.lab.flights.flight import Flight
from quadctl.lab.flights.prediction import AXES, predict, predict_targets
from quadctl.model import Model

ROTOR_COEFFICIENT = 0.01
"""Standard deviation of the thrust coefficients of rotors of one batch, as a share."""
GROUND_SLOPE = math.tan(math.radians(0.5))
"""Of the ground against the frame of the log; the public RAPTOR logs have 0.9 degrees."""
FORM = 0.1
"""What the form of an effect on the thrust is off by where it should be nothing, as a share of the root mean square of
what it does: published forms of the ground effect differ by that, and more."""
UP = AXES.index("up")


def error_slopes(model: Model, flight: Flight, groups: Sequence[str], here: Floats) -> Floats:
    """What each error of its usual size does to the prediction `here`, shape (n, axes, errors)."""
    found = [predict_targets(model, wrong, groups) - here for wrong in _wrong(flight)]
    found += _misshapen(model, flight, here)
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


def _misshapen(model: Model, flight: Flight, here: Floats) -> Iterator[Floats]:
    """Each effect that changes the thrust by a form, off by a constant."""
    for i, effect in enumerate(model.effects):
        if not effect.depends_on or effect.retards or effect not in model.effects_on_thrust:
            continue
        without = replace(model, stack=(*model.stack[:i], *model.stack[i + 1 :]))
        does = here[:, UP] - predict(without, flight)[:, UP]
        found = np.zeros_like(here)
        found[:, UP] = FORM * np.sqrt(np.mean(does**2))
        yield found
