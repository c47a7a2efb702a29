"""Library of functions for sparse expressions: those of table 1 of the thesis (Appius), bumps, and products.

Each term is a Python expression of the names of `VARIABLES`, so that a result can be printed, and saved as an effect,
as it is.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from quadctl.lab.arrays import Floats
from quadctl.lab.flights.dataset import Dataset

VARIABLES = (
    "height_over_radius",
    "climb_rate",
    "speed_forward",
    "speed_right",
    "speed",
    "thrust",
    "north",
    "east",
)
"""Variables of the library: height in rotor radii; climb rate (up), forward and right speed, horizontal speed, m/s;
thrust, N; position, m.

Time and battery are left out because a law of them does not repeat. Roll and pitch are left out because the error of
the attitude is in both the residual and the variable.
"""

SIGNED = ("climb_rate", "speed_forward", "speed_right")
DECAYS = (0.5, 1.0, 2.0, 4.0)
"""Decay rates of the exponentials, per rotor radius of height."""
SPREAD = 0.01
"""Standard deviation, in the unit of the variable, below which a variable is constant except for noise."""
BUMPS = ((7, 6.0), (3, 3.0))
"""Bumps: number over the range of a variable, and ratio of the range to the half width."""
SAME = 0.9999
"""Correlation with an earlier term above which a term is left out."""


@dataclass(frozen=True, eq=False)
class Term:
    """Term of the library."""

    text: str
    variables: tuple[str, ...]
    values: Floats
    """Values at the samples, shape (n,)."""


def variables_of(dataset: Dataset) -> dict[str, Floats]:
    """Those of `VARIABLES` that are logged and vary, at the samples, shape (n,) each."""
    found: dict[str, Floats] = {}
    for name in VARIABLES:
        if name == "speed":
            u, v = dataset.variable("speed_forward"), dataset.variable("speed_right")
            x = None if u is None or v is None else np.hypot(u, v)
        elif not dataset.is_flown(name):
            x = None
        else:
            x = dataset.variable(name)
        if x is not None and np.std(x) > SPREAD:
            found[name] = x
    return found


def library(variables: dict[str, Floats]) -> list[Term]:
    """All terms except the constant, without those that these data do not distinguish from an earlier one."""
    terms: list[Term] = []
    units: list[Floats] = []
    for term in _candidates(variables):
        deviation = term.values - term.values.mean()
        length = float(np.linalg.norm(deviation))
        if length < 1e-9 * float(np.linalg.norm(term.values)):
            continue
        unit = deviation / length
        if units and np.abs(np.array(units) @ unit).max() > SAME:
            continue
        units.append(unit)
        terms.append(term)
    return terms


def _candidates(variables: dict[str, Floats]) -> Iterator[Term]:
    for name, x in variables.items():
        yield Term(name, (name,), x)
        yield Term(f"{name}**2", (name,), x**2)
        yield Term(f"{name}**3", (name,), x**3)
        if name in SIGNED:
            yield Term(f"{name}*abs({name})", (name,), x * np.abs(x))
    near_ground = list(_near_ground(variables))
    yield from near_ground
    moving = [Term(name, (name,), variables[name]) for name in (*SIGNED, "speed") if name in variables]
    if "thrust" in variables:
        thrust = Term("thrust", ("thrust",), variables["thrust"])
        yield from (_product(thrust, other) for other in (*near_ground, *moving))
    yield from (_product(one, other) for one in moving for other in near_ground)
    yield from (_product(one, other) for i, one in enumerate(moving) for other in moving[:i])
    for name, x in variables.items():
        yield from _bumps(name, x)


def _near_ground(variables: dict[str, Floats]) -> Iterator[Term]:
    """Terms that fade with height."""
    name = "height_over_radius"
    if name not in variables:
        return
    z = variables[name]
    for decay in DECAYS:
        yield Term(f"exp(-{decay:g}*{name})", (name,), np.exp(-decay * z))
    if z.min() > 0.1:
        yield Term(f"1/{name}", (name,), 1.0 / z)
        yield Term(f"1/{name}**2", (name,), 1.0 / z**2)


def _bumps(name: str, x: Floats) -> Iterator[Term]:
    low, high = np.percentile(x, [1.0, 99.0])
    for count, part in BUMPS:
        width = float(f"{(high - low) / part:.3g}")
        for place in np.linspace(low, high, count):
            centre = float(f"{place:.3g}")
            offset = f"{name} - {centre:g}" if centre >= 0.0 else f"{name} + {-centre:g}"
            yield Term(f"exp(-(({offset})/{width:g})**2)", (name,), np.exp(-(((x - centre) / width) ** 2)))


def _product(one: Term, other: Term) -> Term:
    variables = tuple(dict.fromkeys((*one.variables, *other.variables)))
    return Term(f"{one.text}*{other.text}", variables, one.values * other.values)
