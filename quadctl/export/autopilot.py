"""Parameters of autopilots from a model: hover throttle, thrust curve, and the drag that their estimators use.

What the autopilots share stands here; what differs is a `Dialect`, one for each in a file of its own.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from enum import unique
from typing import NamedTuple

from quadctl.effects import Effect
from quadctl.effects.body_drag import QuadraticDrag
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.thrust_curve import PowerCurve
from quadctl.effects.thrust_map import LineMap
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.errors import SettingsError
from quadctl.export.estimate import Estimate, estimate
from quadctl.export.hover import bend, hover_throttle
from quadctl.export.left_out import Kind
from quadctl.model import Model, StackedEffect
from quadctl.words import Fact, Kinds, When, fact

SEA_LEVEL_DENSITY_KG_M3 = 1.225
THRUST = tuple(kind.family() for kind in (ConstantScale, LineMap, PowerCurve))
CURVE = THRUST[1:]
"""Families of effects between command and thrust, and those of them that bend it."""
RUNS = "runs at several speeds, such as missions/forward_runs.yaml"
AHEAD = "runs forward at several speeds, such as missions/forward_runs.yaml"
ASIDE = "runs to the side at several speeds, such as missions/headings.yaml"
CLIMBS = "climbs and descents, such as missions/vertical_runs.yaml"
HOVER = "a flight away from the ground, such as missions/hover_staircase_high.yaml"
WHOLE = 100
"""Least number of parameters in a file of all parameters of a vehicle; a smaller one is an excerpt."""
SAME = 1e-6
"""Largest relative difference between numbers that count as the same: autopilots hold 32 bits."""


OFF = Estimate(0.0, 0.0, 0.0)


_SINCE = When("since", " ({firmware} has it since {since})")


@unique
class Lacking(Kinds):
    """Reasons why a parameter is not exported, each with its template."""

    FIRMWARE = ("this firmware does not have it", _SINCE)
    NOT_AMONG = (
        "{source} does not hold it, but only {count} parameters: give all of the vehicle's, to tell whether its "
        "firmware has it",
        _SINCE,
    )
    NO_INTERVAL = "{parameter} of the model's {effect} has no confidence interval"
    MAY_BE_ZERO = (
        "the {meaning} ({parameter}) is not distinguished from zero: at most {most_m2:.2g} m²",
        When("least_kg_m2", ", so that it is at least {least_kg_m2:.2g} kg/m²"),
    )
    NOT_SHOWN = "these flights do not show {error}: {flight}"
    ZERO = ("{error} is not distinguished from zero", When("intervals", " ({intervals})"))


class Older(NamedTuple):
    """The parameter of older firmware that does what a newer one does."""

    name: str
    value: Callable[[float, float], float]
    """Function from its present value and that of the newer one to its value."""
    said: str
    """End of the sentence `this firmware does not have it: ...`."""


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
    ranges: Mapping[str, tuple[float, float]]
    """Values that the autopilot takes."""
    older: Mapping[str, Older]
    """Parameters of older firmware, by the names of the newer ones."""
    since: Mapping[str, str]
    """Versions that introduced a parameter."""
    notes: Mapping[str, str]
    """Note beside a parameter."""
    frame: str
    """Parameter that tells the number of rotors."""
    n_rotors: Callable[[float], int | None]
    """Function from its value to that number; None where it does not say."""
    file_line: Callable[[str, float], str]
    """Function from a parameter's name and value to its line in a parameter file."""

    @property
    def names(self) -> tuple[str, ...]:
        """Parameters that a model tells."""
        return self.hover, self.curve, self.ballistic_x, self.ballistic_y, self.momentum_drag

    @property
    def asked(self) -> tuple[str, ...]:
        """Parameters whose present values an export needs."""
        return (*self.names, *self.switches, *(older.name for older in self.older.values()), self.frame)


class Present(NamedTuple):
    """Parameters that are on the vehicle now."""

    values: Mapping[str, float]
    source: str
    """File or link that they are from."""
    is_whole: bool
    """True: they are all that were asked for, so that the firmware lacks what is not among them."""


class Row(NamedTuple):
    """One parameter: its estimate, or the reason why there is none."""

    name: str
    formula: str
    estimate: Estimate | None = None
    lacking: str = ""
    """Reason why it is not exported, and the flight that would tell it where that is the reason."""
    logs: tuple[str, ...] = ()
    """Logs that the estimate stands on."""
    present: float | None = None
    """Value on the vehicle, where it is known."""
    note: str = ""

    @property
    def is_confirmed(self) -> bool:
        """True where the value on the vehicle lies within the interval: then it stays as it is."""
        if self.estimate is None or self.present is None:
            return False
        slack = SAME * max(abs(self.estimate.value), SAME)
        return self.estimate.low - slack <= self.present <= self.estimate.high + slack

    @property
    def to_write(self) -> float | None:
        """Value for the vehicle; None where it keeps what it has."""
        return None if self.estimate is None or self.is_confirmed else self.estimate.value


class _Quantity(NamedTuple):
    name: str
    formula: str
    families: Sequence[str]
    """Effects of which one must have been fitted."""
    flight: str
    """Flight that shows it, in words and as a mission."""
    of: Callable[[Model], float]
    divisor: str = ""
    """Parameter of the effect that it is inverse to: without bound where that is not told from zero."""
    ends: tuple[float, ...] = ()
    """Ends of its range, where it stays whatever the parameters are."""


def check_same_autopilot(present: Present, dialect: Dialect) -> None:
    """Refuse present parameters of another kind of autopilot: their curve of the motors would be taken for the default.

    Raises
    ------
    SettingsError
        None of the parameters that the export is about is among them.
    """
    if not any(name in present.values for name in dialect.asked if name != dialect.frame):
        raise SettingsError(
            f"{present.source}: holds {len(present.values)} parameters, such as {next(iter(present.values))}, "
            f"but none of {', '.join(dialect.names)}, expected a parameter file of {dialect.name}"
        )


def check_same_vehicle(present: Present, dialect: Dialect, model: Model) -> None:
    """Refuse present parameters of a vehicle with another number of rotors.

    Raises
    ------
    SettingsError
        They tell another number of rotors than the model's vehicle has.
    """
    value = present.values.get(dialect.frame)
    found, expected = None if value is None else dialect.n_rotors(value), model.vehicle.n_rotors
    if found is not None and found != expected:
        raise SettingsError(
            f"{present.source}: is of a vehicle with {found} rotors ({dialect.frame} is {value:g}), "
            f"expected {expected} as {model.vehicle.name} has"
        )


def parameters(model: Model, dialect: Dialect, present: Present | None = None) -> list[Row]:
    """Parameters of the autopilot that the model tells, and those that are not exported, with the reason.

    Where `present` is given, those that the vehicle does not have are among the latter.

    Raises
    ------
    SettingsError
        The model cannot hover.
    """
    used = dialect.default_curve if present is None else present.values.get(dialect.curve, dialect.default_curve)
    drag = [
        _Quantity(
            dialect.ballistic_x,
            "mass / area_x",
            (QuadraticDrag.family(),),
            AHEAD,
            lambda m: _ballistic(m, 0),
            "area_x_m2",
        ),
        _Quantity(
            dialect.ballistic_y,
            "mass / area_y",
            (QuadraticDrag.family(),),
            ASIDE,
            lambda m: _ballistic(m, 1),
            "area_y_m2",
        ),
        _Quantity(
            dialect.momentum_drag,
            "mean of d_x and d_y, weighted by their intervals, at 1.225 kg/m³",
            (LinearDrag.family(),),
            RUNS,
            _momentum,
        ),
    ]
    thrust = [
        _Quantity(dialect.hover, "throttle of hover, far from the ground", THRUST, HOVER, hover_throttle),
        _Quantity(
            dialect.curve, "b of thrust = b s² + (1 - b) s", CURVE, CLIMBS, lambda m: bend(m, used), ends=(0.0, 1.0)
        ),
    ]
    rows = [_row(quantity, model, dialect) for quantity in thrust]
    rows += _without_others(drag, [_row(quantity, model, dialect) for quantity in drag], model)
    found = [row for each in rows for row in _for_firmware(each, dialect, present)]
    if any(row.estimate is not None and row.estimate.value > 0.0 for row in found if row.name in _drag_names(dialect)):
        for name, value in dialect.switches.items():
            found += _for_firmware(
                Row(name, "lets the estimator use the drag", Estimate(value, value, value)), dialect, present
            )
    return [row._replace(note=dialect.notes.get(row.name, "")) for row in found]


def left_out(model: Model, dialect: Dialect) -> tuple[Fact, ...]:
    """Effects of the model for which the autopilot has no parameter."""
    held = {*THRUST, QuadraticDrag.family(), LinearDrag.family()}
    others = (effect.name for effect in model.effects if effect.family() not in held)
    return tuple(fact(Kind.NO_PARAMETER, effect=name, target=dialect.name) for name in others)


def _drag_names(dialect: Dialect) -> tuple[str, ...]:
    return dialect.ballistic_x, dialect.ballistic_y, dialect.momentum_drag


def _without_others(drag: Sequence[_Quantity], rows: Sequence[Row], model: Model) -> list[Row]:
    """The rows of the drag; where one is exported, what the model does not hold is off, as it would be added to it."""
    if not any(row.estimate is not None for row in rows):
        return list(rows)
    families = {effect.family() for effect in model.effects}
    off = "off: the model has no such drag"
    return [
        row if set(quantity.families) & families else Row(row.name, off, OFF)
        for row, quantity in zip(rows, drag, strict=True)
    ]


def _for_firmware(row: Row, dialect: Dialect, present: Present | None) -> Iterator[Row]:
    """The row with the value that is on the vehicle; where the firmware does not have it, the reason, and the parameter
    that older firmware has in its place."""
    if present is None:
        yield row
        return
    values, older = present.values, dialect.older.get(row.name)
    if row.name in values:
        now = row._replace(present=values[row.name])
        if row.estimate == OFF and _lacks(
            dialect.momentum_drag, dialect, present
        ):  # 0 is off since there are two drags
            now = now._replace(estimate=None, lacking=f"{values[row.name]:g} stays: this firmware cannot switch it off")
        yield now
    elif row.estimate is None:
        yield row
    elif older is not None and older.name in values:
        before, wanted = values[older.name], row.estimate
        low, value, high = (older.value(before, end) for end in (wanted.low, wanted.value, wanted.high))
        change = f"here {before:g} -> {value:g}" if value != before else f"here {before:g} already"
        yield row._replace(estimate=None, lacking=f"this firmware does not have it: {older.said}, {change}")
        yield row._replace(name=older.name, estimate=Estimate(value, low, high), present=before)
    else:
        yield row._replace(estimate=None, lacking=str(_absence(row.name, dialect, present)))


def _lacks(name: str, dialect: Dialect, present: Present) -> bool:
    """True where the firmware does not have a parameter: it tells all of its own, or has one of older firmware."""
    is_older = any(older.name in present.values for older in dialect.older.values())
    return name not in present.values and (present.is_whole or is_older)


def _absence(name: str, dialect: Dialect, present: Present) -> Fact:
    """Reason why a parameter that is not among the present ones is not exported."""
    kind = Lacking.FIRMWARE if _lacks(name, dialect, present) else Lacking.NOT_AMONG
    facts = {"firmware": dialect.name, "since": dialect.since.get(name), "source": present.source}
    return fact(kind, **facts, count=len(present.values))


def _row(quantity: _Quantity, model: Model, dialect: Dialect) -> Row:
    row = Row(quantity.name, quantity.formula)
    items = [item for item in model.stack if item.effect.family() in quantity.families]
    fly = f"fly {quantity.flight}, and fit it"
    if not items:
        *others, last = quantity.families
        names = f"{', '.join(others)} or {last}" if others else last
        fit = f"`quadctl add {quantity.families[0]}` fits one to {quantity.flight}"
        return row._replace(lacking=f"the model holds no {names}; {fit}")
    if not any(item.fitted is not None and item.fitted.ci95 for item in items):
        return row._replace(lacking=f"the model's {items[0].effect.name} has no confidence intervals: {fly}")
    if quantity.divisor and (unbounded := _unbounded(quantity, items[0], model)):
        return row._replace(lacking=f"{unbounded}: {fly}")
    found = estimate(model, quantity.of)
    if math.isnan(found.low) and found.value in quantity.ends:  # it is there whatever the parameters are
        found = Estimate(found.value, found.value, found.value)
    elif math.isnan(found.low):
        return row._replace(lacking=f"none of the parameters that it depends on has a confidence interval: {fly}")
    elif not found.known:
        within = f"{found.low:.3g} to {found.high:.3g}" if math.isfinite(found.high - found.low) else "it has no bounds"
        return row._replace(lacking=f"these flights do not tell it ({within}): {fly}")
    low, high = dialect.ranges[quantity.name]
    if not low <= found.value <= high:
        taken = f"{dialect.name} takes {low:g} to {high:g}"
        return row._replace(lacking=f"it is {found.value:.4g} [{found.low:.4g}, {found.high:.4g}], but {taken}")
    logs = dict.fromkeys(log for item in items if item.fitted is not None for log in item.fitted.logs)
    return row._replace(estimate=found, logs=tuple(logs))


def _unbounded(quantity: _Quantity, item: StackedEffect, model: Model) -> Fact | None:
    """Reason why a quantity that is inverse to a parameter has no upper bound; None where it has one."""
    name = quantity.divisor
    value, interval = item.effect.values()[name], item.fitted.ci95.get(name) if item.fitted is not None else None
    if interval is None:
        return fact(Lacking.NO_INTERVAL, parameter=name, effect=item.effect.name)
    low, high = interval
    if low > 0.0 and value > 0.0:
        return None
    most = max(high, value)
    (meaning,) = (p.meaning for p in item.effect.parameters() if p.name == name)
    least = model.vehicle.mass_kg / most if most > 0.0 else None
    return fact(Lacking.MAY_BE_ZERO, meaning=meaning, parameter=name, most_m2=most, least_kg_m2=least)


def _values(model: Model, kind: type[Effect]) -> dict[str, float]:
    return next((effect.values() for effect in model.effects if isinstance(effect, kind)), {})


def _ballistic(model: Model, axis: int) -> float:
    """Ballistic coefficient along body x or y, kg/m²: drag decelerates by half the dynamic pressure rho v² over it."""
    area_m2 = list(_values(model, QuadraticDrag).values())[axis]
    return model.vehicle.mass_kg / area_m2 if area_m2 > 0.0 else math.inf  # an end of an interval may be 0


def _momentum(model: Model) -> float:
    """Momentum drag at sea level, 1/s: the estimators multiply it by the root of the density over 1.225 kg/m³.

    They have one number for both axes: the weighted mean, as an axis along which nobody flew tells little.
    """
    drag = _values(model, LinearDrag)
    weights = _precisions(model, LinearDrag, ("d_x", "d_y"))
    denser = math.sqrt(SEA_LEVEL_DENSITY_KG_M3 / model.vehicle.air_density_kg_m3)
    return sum(weight * drag[name] for name, weight in weights.items()) / sum(weights.values()) * denser


def _precisions(model: Model, kind: type[Effect], names: Sequence[str]) -> dict[str, float]:
    """Inverse squares of the half-widths of the parameters' intervals; all 1 where one has none. An interval that
    begins at 0, the bound of a drag, is the upper half of one."""
    for item in model.stack:
        ci95 = item.fitted.ci95 if item.fitted is not None else {}
        if isinstance(item.effect, kind) and all(name in ci95 and ci95[name][0] < ci95[name][1] for name in names):
            ends = {name: ci95[name] for name in names}
            return {name: (high if low <= 0.0 else 0.5 * (high - low)) ** -2.0 for name, (low, high) in ends.items()}
    return dict.fromkeys(names, 1.0)


def parameter_file(rows: Sequence[Row], dialect: Dialect, title: str) -> str:
    """Text of a parameter file with what the model tells; the rest stands in comments.

    Raises
    ------
    SettingsError
        The model tells none of the parameters.
    """
    if all(row.estimate is None for row in rows):
        reasons = "".join(f"\n  {row.name}: {row.lacking}" for row in rows)
        raise SettingsError(
            f"{title}: no parameter of {dialect.name} follows from this model, for these reasons:{reasons}"
        )
    lines = [f"# Parameters for {dialect.name} from {title}, with 95 % confidence intervals"]
    for row in rows:
        lines.append(f"# {row.name}: {said(row)}")
        if row.to_write is not None:
            lines.append(dialect.file_line(row.name, row.to_write))
    return "\n".join([*lines, ""])


def said(row: Row, with_interval: bool = True) -> str:
    """Sentence about a row: formula, interval, logs, note; the reason where it is not exported."""
    if row.estimate is None:
        return row.lacking
    found = row.estimate
    shown = with_interval and found.low != found.high
    interval = f", [{found.low:.4g}, {found.high:.4g}]" if shown else ""
    logs = f", from {', '.join(row.logs)}" if row.logs else ""
    if row.is_confirmed:
        return f"confirmed, stays {row.present:.6g}: {row.formula}{interval}{logs}"
    note = f"; {row.note}" if row.note else ""
    return f"{row.formula}{interval}{logs}{note}"
