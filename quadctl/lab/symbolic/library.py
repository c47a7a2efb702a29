"""The functions that a sparse expression may be made of: those of the thesis' table 1 (Appius), bumps, and products.

Each term is a piece of Python over the names of `VARIABLES`, so that what was found can be printed, and saved as an
effect, as it stands.
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
"""Height in rotor radii; velocities, m/s, FRD but the climb rate, which is up; horizontal speed, m/s; thrust, N; m.

Time and battery are left out because a law of them does not come again, roll and pitch because the error of an
attitude is in both the residual and the variable."""

MANOEUVRES = 0.5
"""Share of the variance of the thrust that vertical acceleration must explain for the thrust to be a variable: in
steady flight the controller makes it mirror whatever else is missing."""

SIGNED = ("climb_rate", "speed_forward", "speed_right")
DECAYS = (0.5, 1.0, 2.0, 4.0)
"""Of exponentials, per rotor radius of height."""
SPREAD = 0.01
"""A variable with a smaller standard deviation, in its unit, is constant but for noise."""
BUMPS = ((7, 6.0), (3, 3.0))
"""How many over the range of a variable, and the part of the range that is the half width of each."""
SAME = 0.9999
"""A term that correlates more with an earlier one is left out."""


@dataclass(frozen=True, eq=False)
class Term:
    """One function of the library."""

    text: str
    variables: tuple[str, ...]
    values: Floats
    """At the samples, shape (n,)."""


def variables_of(dataset: Dataset) -> dict[str, Floats]:
    """Those of `VARIABLES` that are logged and vary, at the samples, shape (n,) each."""
    found: dict[str, Floats] = {}
    for name in VARIABLES:
        if name == "speed":
            u, v = dataset.variable("speed_forward"), dataset.variable("speed_right")
            x = None if u is None or v is None else np.hypot(u, v)
        elif name == "thrust" and not _manoeuvres(dataset):
            x = None
        else:
            x = dataset.variable(name)
        if x is not None and np.std(x) > SPREAD:
            found[name] = x
    return found


def _manoeuvres(dataset: Dataset) -> bool:
    thrust = dataset.variable("thrust")
    if thrust is None or np.std(thrust) < SPREAD:
        return False
    return bool(np.corrcoef(thrust, dataset.measured[:, 2])[0, 1] ** 2 > MANOEUVRES)


def library(variables: dict[str, Floats]) -> list[Term]:
    """All terms but the constant, without those that these data cannot tell from an earlier one."""
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
    """What fades with height."""
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
