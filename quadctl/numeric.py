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


SYMBOLIC: dict[type, Callable[..., Any]] = {}
"""Types of a computer algebra, each with its way to apply a function of this module: (name, *arguments) -> expression.
Whoever exports a model registers them; in flight there are none."""


def _either(name: str, scalar: Callable[..., float], array: Callable[..., Any]) -> Callable[..., Any]:
    def function(*arguments: Any) -> Any:
        for argument in arguments:
            if isinstance(argument, np.ndarray):
                return array(*arguments)
        if SYMBOLIC and (apply := _algebra(*arguments)):
            return apply(name, *arguments)
        return scalar(*arguments)

    return function


def _algebra(*arguments: Any) -> Callable[..., Any] | None:
    """The way to apply a function to these arguments, where one of them is an expression."""
    return next((SYMBOLIC[type(argument)] for argument in arguments if type(argument) in SYMBOLIC), None)


def _of_one(name: str, scalar: Callable[[float], float], array: Callable[..., Any]) -> Callable[[Any], Any]:
    """The same of one argument, with a short way for a float: most calls are those of the simulation."""
    either = _either(name, scalar, array)
    return lambda value: scalar(value) if type(value) is float else either(value)


exp = _of_one("exp", math.exp, np.exp)
sqrt = _of_one("sqrt", math.sqrt, np.sqrt)
sin = _of_one("sin", math.sin, np.sin)
cos = _of_one("cos", math.cos, np.cos)
asin = _of_one("asin", math.asin, np.arcsin)
atan2 = _either("atan2", math.atan2, np.arctan2)
minimum = _either("minimum", min, np.minimum)
maximum = _either("maximum", max, np.maximum)
where = _either("where", lambda condition, yes, no: yes if condition else no, np.where)


def inverse(value: Any) -> Any:
    """1 / value, infinite at 0 for one number as for an array."""
    if isinstance(value, np.ndarray):
        with np.errstate(divide="ignore"):
            return 1.0 / value
    if SYMBOLIC and _algebra(value):
        return 1.0 / value
    return 1.0 / value if value else math.inf


def clip(value: Any, low: float, high: float) -> Any:
    """Clip `value` to `low` and `high`."""
    if isinstance(value, np.ndarray):
        return np.clip(value, low, high)
    if SYMBOLIC and (apply := _algebra(value)):
        return apply("clip", value, low, high)
    return low if value < low else high if value > high else value


def step(value: Any) -> Any:
    """Step function: 0 below zero, 1 from zero on."""
    return (value >= 0.0) * 1.0


def known_or(value: Any, otherwise: float) -> Any:
    """Replace nan in `value` by `otherwise`."""
    if isinstance(value, np.ndarray):
        return np.where(np.isnan(value), otherwise, value)
    if SYMBOLIC and (apply := _algebra(value)):
        return apply("known_or", value, otherwise)
    return otherwise if math.isnan(value) else value


def plus(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def minus(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def scaled(factor: Number, a: Vector) -> Vector:
    return factor * a[0], factor * a[1], factor * a[2]
