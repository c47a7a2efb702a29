"""A quantity computed from a model, with an interval from the intervals of the model's parameters."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

from quadctl.errors import SettingsError
from quadctl.model import Model


class Estimate(NamedTuple):
    """A value and its 95 % confidence interval; nan where no parameter with an interval moves it."""

    value: float
    low: float = math.nan
    high: float = math.nan

    @property
    def known(self) -> bool:
        """True where there is an interval, narrower than the value is large."""
        return self.high - self.low < 2.0 * abs(self.value)


def estimate(model: Model, quantity: Callable[[Model], float]) -> Estimate:
    """Evaluate `quantity` of the model, and its interval.

    Each parameter goes to the two ends of its own interval while the others keep their values; the changes are added
    as those of independent errors, upward and downward apart. Correlations between parameters are not in a model file.
    Where a model at such an end does not have the quantity, as one that cannot hover, the interval has no bounds.
    """
    value = quantity(model)
    below = above = 0.0
    for i, item in enumerate(model.stack):
        for name, bounds in (item.fitted.ci95 if item.fitted is not None else {}).items():
            try:
                changes = [quantity(_with(model, i, name, bound)) - value for bound in bounds]
            except SettingsError:
                return Estimate(value, -math.inf, math.inf)
            below += min(*changes, 0.0) ** 2
            above += max(*changes, 0.0) ** 2
    if below == above == 0.0:
        return Estimate(value)
    return Estimate(value, value - math.sqrt(below), value + math.sqrt(above))


def _with(model: Model, i: int, name: str, value: float) -> Model:
    effects = list(model.effects)
    effects[i] = replace(effects[i], **{name: value})
    return model.with_effects(effects)
