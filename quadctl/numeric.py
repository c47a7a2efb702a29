"""Elementary functions of one number or of an array.

The control loop calls the physics 50 times a second with floats and must not allocate numpy scalars; the lab calls the
same functions once with a whole log. `math` serves the first and numpy the second.
"""

import math
from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np

Number: TypeAlias = Any
"""One float, or an array of floats with one value per sample, shape (n,). A type checker cannot follow which."""

Vector: TypeAlias = tuple[Number, Number, Number]
"""Three components, each a `Number`."""


def _either(scalar: Callable[..., float], array: Callable[..., Any]) -> Callable[..., Any]:
    def function(*arguments: Any) -> Any:
        for argument in arguments:
            if isinstance(argument, np.ndarray):
                return array(*arguments)
        return scalar(*arguments)

    return function


exp = _either(math.exp, np.exp)
sqrt = _either(math.sqrt, np.sqrt)
sin = _either(math.sin, np.sin)
cos = _either(math.cos, np.cos)
asin = _either(math.asin, np.arcsin)
atan2 = _either(math.atan2, np.arctan2)
minimum = _either(min, np.minimum)
maximum = _either(max, np.maximum)


def clip(value: Any, low: float, high: float) -> Any:
    """Clip `value` to `low` and `high`."""
    if isinstance(value, np.ndarray):
        return np.clip(value, low, high)
    return low if value < low else high if value > high else value


def step(value: Any) -> Any:
    """Step function: 0 below zero, 1 from zero on."""
    return (value >= 0.0) * 1.0


def known_or(value: Any, otherwise: float) -> Any:
    """Replace nan in `value` by `otherwise`."""
    if isinstance(value, np.ndarray):
        return np.where(np.isnan(value), otherwise, value)
    return otherwise if math.isnan(value) else value
