"""Parameters of autopilots from a model: hover throttle, thrust curve, and the drag that their estimators use.

What the autopilots share stands here; what differs is a `Dialect`, one for each in a file of its own.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from quadctl.errors import SettingsError
from quadctl.export.estimate import Estimate, estimate
from quadctl.export.hover import bend, hover_throttle
from quadctl.model import Model

SEA_LEVEL_DENSITY_KG_M3 = 1.225
THRUST, CURVE = ("thrust_scale", "thrust_map", "thrust_curve"), ("thrust_map", "thrust_curve")
"""Families of effects between command and thrust, and those of them that bend it."""
RUNS = "runs at several speeds, such as missions/forward_runs.yaml"
CLIMBS = "climbs and descents, such as missions/vertical_runs.yaml"
HOVER = "a flight away from the ground, such as missions/hover_staircase_high.yaml"


OFF = Estimate(0.0, 0.0, 0.0)


class Dialect(NamedTuple):
    """Names of the parameters of one autopilot."""

    name: str
    hover: str
    """Throttle of hover."""
    curve: str
    """Bend of the thrust over the signal."""
    ballistic_x: str
    ballistic_y: str
    momentum_drag: str
    switches: Mapping[str, float]
    """Parameters that must have these values for the drag to be used."""
    default_curve: float
    notes: Mapping[str, str]
    """Note beside a parameter."""
    frame: str
    """Parameter that tells the number of rotors."""
    n_rotors: Callable[[float], int | None]
    """Function from its value to that number; None where it does not say."""
    file_line: Callable[[str, float], str]
    """Function from a parameter's name and value to its line in a parameter file."""


class Row(NamedTuple):
    """One parameter: its estimate, or the reason why there is none."""

    name: str
    formula: str
    estimate: Estimate | None = None
    lacking: str = ""
    """Reason why these flights do not tell it, and the flight that would."""
    logs: tuple[str, ...] = ()
    """Logs that the estimate stands on."""
    present: float | None = None
    """Value on the vehicle, where it is known."""
    note: str = ""


class _Quantity(NamedTuple):
    name: str
    formula: str
    families: Sequence[str]
    """Effects of which one must have been fitted."""
    flight: str
    """Flight that shows it, in words and as a mission."""
    of: Callable[[Model], float]


def check_same_autopilot(present: Mapping[str, float], dialect: Dialect, source: str) -> None:
    """Refuse present parameters of another kind of autopilot: their curve of the motors would be taken for the default.

    `source` is the name of their file.

    Raises
    ------
    SettingsError
        None of the parameters that the export is about is among them.
    """
    names = (dialect.hover, dialect.curve, dialect.ballistic_x, dialect.ballistic_y, dialect.momentum_drag)
    if not any(name in present for name in (*names, *dialect.switches)):
        raise SettingsError(
            f"{source}: holds {len(present)} parameters, such as {next(iter(present))}, "
            f"but none of {', '.join(names)}, expected a parameter file of {dialect.name}"
        )


def check_same_vehicle(present: Mapping[str, float], dialect: Dialect, model: Model, source: str) -> None:
    """Refuse present parameters of a vehicle with another number of rotors; `source` is where they are from.

    Raises
    ------
    SettingsError
        They tell another number of rotors than the model's vehicle has.
    """
    value = present.get(dialect.frame)
    found, expected = None if value is None else dialect.n_rotors(value), model.vehicle.n_rotors
    if found is not None and found != expected:
        raise SettingsError(
            f"{source}: is of a vehicle with {found} rotors ({dialect.frame} is {value:g}), "
            f"expected {expected} as {model.vehicle.name} has"
        )


def parameters(model: Model, dialect: Dialect, present: Mapping[str, float]) -> list[Row]:
    """Parameters of the autopilot that the model tells, and those that it does not, with the reason.

    `present` holds the values on the vehicle, where they are known.

    Raises
    ------
    SettingsError
        The model cannot hover.
    """
    used = present.get(dialect.curve, dialect.default_curve)
    drag = [
        _Quantity(dialect.ballistic_x, "mass / area_x", ("body_drag",), RUNS, lambda m: _ballistic(m, 0)),
        _Quantity(dialect.ballistic_y, "mass / area_y", ("body_drag",), RUNS, lambda m: _ballistic(m, 1)),
        _Quantity(dialect.momentum_drag, "mean of d_x and d_y, at 1.225 kg/m³", ("rotor_drag",), RUNS, _momentum),
    ]
    thrust = [
        _Quantity(dialect.hover, "throttle of hover, far from the ground", THRUST, HOVER, hover_throttle),
        _Quantity(dialect.curve, "b of thrust = b s² + (1 - b) s", CURVE, CLIMBS, lambda m: bend(m, used)),
    ]
    drag_rows = [_row(quantity, model) for quantity in drag]
    if any(row.estimate is not None for row in drag_rows):  # what the model does not hold must not be added to it
        families = {effect.family() for effect in model.effects}
        drag_rows = [
            row if set(quantity.families) & families else Row(row.name, "off, as the model holds no such drag", OFF)
            for row, quantity in zip(drag_rows, drag, strict=True)
        ]
        drag_rows += [
            Row(name, "uses the drag", Estimate(value, value, value)) for name, value in dialect.switches.items()
        ]
    rows = [*(_row(quantity, model) for quantity in thrust), *drag_rows]
    return [row._replace(present=present.get(row.name), note=dialect.notes.get(row.name, "")) for row in rows]


def _row(quantity: _Quantity, model: Model) -> Row:
    row = Row(quantity.name, quantity.formula)
    items = [item for item in model.stack if item.effect.family() in quantity.families]
    fly = f"fly {quantity.flight}, and fit it"
    if not items:
        *others, last = quantity.families
        names = f"{', '.join(others)} or {last}" if others else last
        fit = f"quadctl add {quantity.families[0]} fits one to {quantity.flight}"
        return row._replace(lacking=f"the model holds no {names}: {fit}")
    found = estimate(model, quantity.of)
    fitted = any(item.fitted is not None and item.fitted.ci95 for item in items)
    if not fitted:
        return row._replace(lacking=f"the model's {items[0].effect.name} has no confidence intervals: {fly}")
    if math.isnan(found.low):  # whatever the parameters are within their intervals, it is at an end of its range
        found = Estimate(found.value, found.value, found.value)
    elif not found.known:
        return row._replace(lacking=f"these flights do not tell it ({found.low:.3g} to {found.high:.3g}): {fly}")
    logs = dict.fromkeys(log for item in items if item.fitted is not None for log in item.fitted.logs)
    return row._replace(estimate=found, logs=tuple(logs))


def _values(model: Model, family: str) -> dict[str, float]:
    return next((effect.values() for effect in model.effects if effect.family() == family), {})


def _ballistic(model: Model, axis: int) -> float:
    """Ballistic coefficient along body x or y, kg/m²: drag decelerates by half the dynamic pressure rho v² over it."""
    area_m2 = list(_values(model, "body_drag").values())[axis]
    return model.vehicle.mass_kg / area_m2 if area_m2 > 0.0 else math.inf


def _momentum(model: Model) -> float:
    """Momentum drag at sea level, 1/s: the estimators multiply it by the root of the density over 1.225 kg/m³."""
    drag = _values(model, "rotor_drag")
    denser = math.sqrt(SEA_LEVEL_DENSITY_KG_M3 / model.vehicle.air_density_kg_m3)
    return 0.5 * (drag["d_x"] + drag["d_y"]) * denser


def parameter_file(rows: Sequence[Row], dialect: Dialect, title: str) -> str:
    """Text of a parameter file with what the model tells; the rest stands in comments.

    Raises
    ------
    SettingsError
        The model tells none of the parameters.
    """
    if all(row.estimate is None for row in rows):
        reasons = "; ".join(f"{row.name}: {row.lacking}" for row in rows)
        raise SettingsError(f"{title}: tells no parameter of {dialect.name} ({reasons})")
    lines = [f"# Parameters for {dialect.name} from {title}, with 95 % confidence intervals"]
    for row in rows:
        if row.estimate is None:
            lines.append(f"# {row.name}: {row.lacking}")
            continue
        lines.append(f"# {row.name}: {said(row)}")
        lines.append(dialect.file_line(row.name, row.estimate.value))
    return "\n".join([*lines, ""])


def said(row: Row) -> str:
    """Sentence about a row with an estimate: formula, interval, logs, note."""
    assert row.estimate is not None
    found = row.estimate
    interval = "" if found.low == found.high else f", [{found.low:.4g}, {found.high:.4g}]"
    logs = f", from {', '.join(row.logs)}" if row.logs else ""
    note = f"; {row.note}" if row.note else ""
    return f"{row.formula}{interval}{logs}{note}"
