"""Consider parameters: errors that are not estimated, but widen the intervals of the fitted parameters.

Schmidt (1966). Such errors are the same in all flights, so that more flights do not average them out. The effect on a
fit follows from the Jacobian of the prediction with respect to them. Some are errors of the vehicle and the set-up:
rotors that are not all alike, ground that is not level. The others are errors of the model: the assumed form of an
effect is never exactly the true one.
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
"""Standard deviation of the thrust coefficients of rotors of one batch, relative."""
GROUND_SLOPE = math.tan(math.radians(0.5))
"""Standard deviation of the slope of the ground in the frame of the log; the public RAPTOR logs have 0.9 degrees."""
FORM = 0.1
"""Standard deviation of the error of an effect's form, constant over the flight, relative to the root mean square of
the effect; published forms of the ground effect differ by as much or more."""
AIRSPEED = 0.05
"""Standard deviation of the relative error of the airspeed, constant over a campaign: drafts, gusts and the errors of
the velocity estimate weaken the relation between drag and the logged velocity (errors in variables)."""
UP = AXES.index("up")


def consider_jacobian(model: Model, flight: Flight, groups: Sequence[str], predicted: Floats) -> Floats:
    """Change of the prediction by one standard deviation of each considered error, shape (n, axes, errors)."""
    return np.stack(list(considered_changes(model, flight, groups, predicted)), axis=-1)


def considered_changes(model: Model, flight: Flight, groups: Sequence[str], predicted: Floats) -> Iterator[Floats]:
    """Change of the prediction by one standard deviation of each considered error, one by one, shape (n, axes).

    The form of an effect on the thrust may be off by a constant, and the airspeed, on which the forces on the body
    depend, by a factor: both change the acceleration alone, which is the first of the groups where it is among them.
    """
    for disturbed in _disturbed_flights(flight):
        yield predict_targets(model, disturbed, groups) - predicted
    of_acceleration = predicted[:, : len(AXES)] if "total" in groups else None
    for effect in model.effects:
        if effect.depends_on and not effect.adds_lag and effect in model.effects_on_thrust:
            found = np.zeros_like(predicted)
            if of_acceleration is not None:
                does = (of_acceleration - predict(model.without(effect), flight))[:, UP]
                found[:, UP] = FORM * np.sqrt(np.mean(does**2))
            yield found
    for effect in model.effects:
        if effect in model.effects_on_body and {"speed_forward", "speed_right"} & set(effect.depends_on):
            found = np.zeros_like(predicted)
            if of_acceleration is not None:
                found[:, : len(AXES)] = AIRSPEED * (of_acceleration - predict(model.without(effect), flight))
            yield found


def _disturbed_flights(flight: Flight) -> Iterator[Flight]:
    """Copies of the flight: each with one rotor a little stronger, then over ground that rises to the north, and to the
    east.

    The effect of a stronger rotor in hover is a nuisance of the flight already; so only its thrust beyond the mean of
    all rotors is scaled.
    """
    thrusts = flight.nominal_n
    mean = sum(thrusts) / len(thrusts)
    for i, thrust in enumerate(thrusts):
        stronger = thrust + ROTOR_COEFFICIENT * (thrust - mean)
        yield replace(flight, nominal_n=[*thrusts[:i], stronger, *thrusts[i + 1 :]])
    c = flight.conditions
    for along in c.position_ne_m:
        yield replace(flight, conditions=replace(c, height_m=c.height_m - GROUND_SLOPE * along))
