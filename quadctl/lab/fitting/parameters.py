"""Free parameters of a model: their values, Jacobian, intervals, and remarks."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from quadctl.effects import Effect, Parameter
from quadctl.lab.arrays import Floats
from quadctl.lab.flights.flight import Flight
from quadctl.lab.flights.prediction import PREDICT, concerns
from quadctl.model import Model

STEP = 1e-4
"""Step of the finite differences of the Jacobian, as a share of a parameter's range."""
UNDETERMINED = 0.8
"""A parameter whose 95 % interval spans more than this share of its range is not determined."""


@dataclass(frozen=True)
class Free:
    """One fitted parameter: index of its effect in the stack, and its declaration."""

    effect: int
    parameter: Parameter


def free_parameters(model: Model) -> list[Free]:
    """Parameters of the stack that a fit may change."""
    stack = enumerate(model.stack)
    return [Free(i, p) for i, item in stack if not item.held for p in item.effect.parameters() if p.fitted]


def values_of(model: Model, free: Sequence[Free]) -> Floats:
    return np.array([getattr(model.effects[f.effect], f.parameter.name) for f in free])


def with_values(model: Model, free: Sequence[Free], values: Floats) -> Model:
    """Copy of the model with its free parameters at `values`."""
    changed: list[dict[str, float]] = [effect.values() for effect in model.effects]
    for f, value in zip(free, values, strict=True):
        changed[f.effect][f.parameter.name] = float(value)
    effects: list[Effect] = [type(e)(**v) for e, v in zip(model.effects, changed, strict=True)]
    return model.with_effects(effects)


def parameter_jacobian(
    model: Model, flight: Flight, groups: Sequence[str], predicted: Floats, free: Sequence[Free] | None = None
) -> Floats:
    """Jacobian of the prediction with respect to the parameters `free`, by default all that are, shape (n, axes, p), by
    finite differences within the bounds.

    `predicted` is the prediction of the flight's targets at the present parameters, shape (n, axes).
    """
    free = free_parameters(model) if free is None else free
    values = values_of(model, free)
    found = np.zeros((*predicted.shape, len(free)))
    for i, f in enumerate(free):
        step = STEP * (f.parameter.high - f.parameter.low)
        step = step if values[i] + step <= f.parameter.high else -step
        moved = values.copy()
        moved[i] += step
        other = with_values(model, free, moved)
        for first, group in enumerate(groups):
            if concerns(model.effects[f.effect], group):
                axes = slice(3 * first, 3 * first + 3)
                found[:, axes, i] = (PREDICT[group](other, flight) - predicted[:, axes]) / step
    return found


HELD = 1e-6
"""Distance to a bound, relative to the range, within which the bound holds an unknown."""


def intervals(free: Sequence[Free], values: Floats, draws: Floats) -> list[tuple[float, float]]:
    """95 % interval of each free parameter, from its fitted value, shape (p,), and its draws, shape (draws, p).

    Percentiles of the draws. The interval of a parameter that a bound holds is one-sided: it begins at the value, and
    95 % of the draws are within it (see `constrained_draws`). Where a bound holds one parameter, the draws of the
    others lie beside their values: an interval is extended to the value that it belongs to.
    """
    if not free:
        return []
    found = []
    for f, value, own in zip(free, values, draws.T, strict=True):
        near = HELD * (f.parameter.high - f.parameter.low)
        low, q5, q95, high = np.percentile(own, [2.5, 5.0, 95.0, 97.5])
        if value - f.parameter.low <= near:
            low, high = value, max(q95, value)
        elif f.parameter.high - value <= near:
            low, high = min(q5, value), value
        found.append((float(min(low, value)), float(max(high, value))))
    return found


def undetermined(free: Sequence[Free], ci: Sequence[tuple[float, float]]) -> list[Free]:
    return [f for f, own in zip(free, ci, strict=True) if is_undetermined(f, own)]


def is_undetermined(free: Free, ci: tuple[float, float]) -> bool:
    """Tell whether an interval spans more than `UNDETERMINED` of the range of its parameter."""
    return ci[1] - ci[0] > UNDETERMINED * (free.parameter.high - free.parameter.low)


AT_BOUND = 1e-3
"""Distance to a bound, relative to the parameter's range, within which a parameter is at the bound."""


def is_at_bound(free: Free, value: float) -> bool:
    """Tell whether a parameter ran into a bound; a lower bound of 0 is none: there the effect vanishes."""
    p = free.parameter
    near = AT_BOUND * (p.high - p.low)
    return p.high - value < near or (value - p.low < near and p.low != 0.0)


def leaves_out_zero(free: Free, ci: tuple[float, float]) -> bool:
    """Tell whether a 95 % interval leaves 0 out."""
    near = HELD * (free.parameter.high - free.parameter.low)
    return ci[0] > near or ci[1] < -near


def remarks(free: Free, value: float, ci: tuple[float, float]) -> list[str]:
    """Remarks for the user on a fitted parameter: at a bound, or not determined by these data."""
    p, found = free.parameter, []
    if is_at_bound(free, value):
        end, bound = ("upper", p.high) if value > 0.5 * (p.low + p.high) else ("lower", p.low)
        found.append(f"{p.name} is at its {end} bound {bound:g}: the form is wrong, or the data do not show it")
    elif value - p.low < AT_BOUND * (p.high - p.low):
        found.append(f"{p.name} is 0: these data do not show it")
    if is_undetermined(free, ci):
        found.append(f"{p.name} is not determined by these data: its interval spans most of its range")
    return found
