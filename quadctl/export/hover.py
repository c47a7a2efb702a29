"""Thrust and throttle of a model in still air, far from the ground."""

import math
from collections.abc import Callable

from quadctl.effects.base import Conditions
from quadctl.errors import SettingsError
from quadctl.model import Model
from quadctl.thrust_chain.chain import unbent

FAR_M = 100.0
"""Height at which no ground effect is left."""
ITERATIONS = 50
POINTS = 21
"""Commands at which the bend is fitted."""
TOLERANCE = 1e-9


def lift_n(model: Model, throttle: float) -> float:
    """Upward force of the level vehicle at a throttle, by the vehicle file's line and the effects of the model."""
    line, n = model.vehicle.throttle, model.vehicle.n_rotors
    nominal_n = (throttle - line.offset) / line.per_newton
    return -float(model.prompt().loads([nominal_n / n] * n, _still(model)).force_n[2])


def hover_throttle(model: Model) -> float:
    """Throttle at which the level vehicle hovers.

    Raises
    ------
    SettingsError
        No throttle from 0 to 1 carries the vehicle.
    """
    weight_n = model.vehicle.weight_n
    if not lift_n(model, 0.0) < weight_n < lift_n(model, 1.0):
        raise SettingsError(f"{model.name}: no throttle from 0 to 1 carries the vehicle, by this model")
    return root(lambda throttle: lift_n(model, throttle) - weight_n, 0.0, 1.0)


def root(rising: Callable[[float], float], low: float, high: float) -> float:
    """Argument between `low` and `high` at which a rising function is 0, by bisection."""
    for _ in range(ITERATIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if rising(middle) < 0.0 else (low, middle)
        if high - low < TOLERANCE:
            break
    return 0.5 * (low + high)


def _still(model: Model) -> Conditions:
    """At rest and level, at the battery voltage for which the thrust coefficients hold."""
    voltages = [effect.values()["reference_v"] for effect in model.effects if "reference_v" in effect.values()]
    return Conditions(FAR_M, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), battery_v=voltages[0] if voltages else math.nan)


def bend(model: Model, present: float) -> float:
    """The bend b with which thrust is proportional to the command of an autopilot.

    Both PX4 (THR_MDL_FAC) and ArduPilot (MOT_THST_EXPO) take the thrust for b s² + (1 - b) s, s being the signal to
    the motors as a share of its range, and invert that. `present` is the bend with which the command was turned into a
    signal in the flights of the model. The best b is that of least squares from half to one and a half of the thrust
    of hover.
    """
    hover = hover_throttle(model)
    full_n = lift_n(model, 1.0)
    numerator = denominator = 0.0
    for i in range(POINTS):
        command = min(hover * (0.5 + i / (POINTS - 1)), 1.0)
        signal = unbent(command, max(present, 0.0))
        form = signal * signal - signal
        numerator += form * (lift_n(model, command) / full_n - signal)
        denominator += form * form
    return min(max(numerator / denominator, 0.0), 1.0)
