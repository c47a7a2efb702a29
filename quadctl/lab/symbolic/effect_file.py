"""Conversion of a formula to a Python file with an effect (docs/own-effect.md), which can be added, refitted and
flown."""

from quadctl.lab.flights.flight import SPAN_UNITS
from quadctl.lab.symbolic.formula import FRAME_AXES, Formula, Symbolic

CODE = {
    "height_over_radius": "c.height_m / vehicle.rotor.radius_m",
    "climb_rate": "-c.velocity_body_m_s[2]",
    "speed_forward": "c.velocity_body_m_s[0]",
    "speed_right": "c.velocity_body_m_s[1]",
    "speed": "sqrt(c.velocity_body_m_s[0] ** 2 + c.velocity_body_m_s[1] ** 2)",
    "thrust": "total_thrust_n",
    "north": "c.position_ne_m[0]",
    "east": "c.position_ne_m[1]",
}
"""Python expression of each variable of `library.VARIABLES` in an effect."""

MISSIONS = {
    "height_over_radius": "missions/hover_staircase.yaml",
    "climb_rate": "missions/vertical_runs.yaml",
    "thrust": "missions/vertical_runs.yaml",
}
"""Missions that vary a variable; FORWARD_RUNS varies the others."""
FORWARD_RUNS = "missions/forward_runs.yaml"

TEMPLATE = '''"""{title}"""

from dataclasses import dataclass
from typing import ClassVar

from quadctl.effects import Conditions, Effect, parameter
from quadctl.frames import rotate_inverse
from quadctl.numeric import Number, Vector, clip, exp, sqrt
from quadctl.vehicle import Vehicle


@dataclass(frozen=True)
class {kind}(Effect):
    name: ClassVar[str] = "{name}"
    source: ClassVar[str] = "{source}"
    depends_on: ClassVar[tuple[str, ...]] = ({depends_on})
    physics: ClassVar[str] = "{physics}"
    distinguished_by: ClassVar[str] = "{distinguished_by}"
    mission: ClassVar[str] = "{mission}"

    {parameters}

    def force(self, total_thrust_n: Number, c: Conditions, vehicle: Vehicle) -> Vector:
        # Outside the data of the fit each variable is held at its limit: a formula without physics is not extrapolated.
        {steps}
        return {force}
'''


def as_effect_file(symbolic: Symbolic, name: str) -> str:
    """Text of a Python file whose effect `name`, as `family.variant`, has the force of the laws.

    The force is the vehicle's mass times the acceleration of the law. Outside the data of the fit each variable is held
    at their limits: a formula without physics cannot be extrapolated.
    """
    laws = {law.axis: law.best for law in symbolic.laws}
    found = "; ".join(f"{axis} = {formula.text}" for axis, formula in laws.items())
    shares = " and ".join(f"{formula.held_out_share:.0%} {axis}" for axis, formula in laws.items())
    used = symbolic.variables
    plotted = [name for name in used if name != "speed"]
    plotted += [name for name in ("speed_forward", "speed_right") if "speed" in used and name not in plotted]
    parameters = [_declaration(axis, formula, key) for axis, formula in laws.items() for key in formula.coefficients]
    steps = [f"{name} = clip({CODE[name]}, {_ends(symbolic.ranges[name])})" for name in used]
    steps += [_sum(axis, formula) for axis, formula in laws.items()]
    x, y, up = (axis if axis in laws else None for axis in FRAME_AXES[symbolic.frame])
    force = f"({_force(x)}, {_force(y)}, {_force(up, '-')})"
    return TEMPLATE.format(
        title=f"Formula found by quadctl for an acceleration that no effect explains, m/s^2, {symbolic.frame} axes.",
        kind="".join(word.capitalize() for word in name.replace(".", "_").split("_")),
        name=name,
        source=f"sparse identification; share of the squared error explained on held-out data: {shares}",
        depends_on="".join(f'"{variable}", ' for variable in plotted).rstrip(),
        physics=f"Unknown: {found}.",
        distinguished_by=f"flights over the whole range of {', '.join(used)}",
        mission=MISSIONS.get(used[0], FORWARD_RUNS),
        parameters="\n    ".join(parameters),
        steps="\n        ".join(steps),
        force=f"rotate_inverse(c.attitude, {force})" if symbolic.frame == "world" else force,
    )


def _declaration(axis: str, formula: Formula, key: str) -> str:
    low, high = _ends(formula.bounds[key]).split(", ")
    unit = SPAN_UNITS[formula.variables[0]]
    units = {"c": "m/s^2", "m": unit, "w": unit, "b": f"1/({unit})"}
    value = f"{formula.coefficients[key]:.6g}"
    return f'{axis}_{key}: float = parameter({value}, {low}, {high}, "{units.get(key, "")}", "{key} of {axis}")'


def _ends(limits: tuple[float, float]) -> str:
    return f"{limits[0]:.5g}, {limits[1]:.5g}"


def _sum(axis: str, formula: Formula) -> str:
    names = {key: f"self.{axis}_{key}" for key in formula.coefficients}
    return "\n        ".join(
        f"push_{axis} {'+=' if i else '='} {part.format(**names)}" for i, part in enumerate(formula.parts)
    )


def _force(axis: str | None, sign: str = "") -> str:
    return "0.0" if axis is None else f"{sign}vehicle.mass_kg * push_{axis}"
