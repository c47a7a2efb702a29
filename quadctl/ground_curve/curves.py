"""Fit of every ground-effect formula to measured thrusts, its error on heights that the fit has not seen, intervals.

A formula predicts T = T_far K; K comes from the effect of the catalogue itself. T_far is 1 where the table holds
ratios, else it is fitted with the formula, once for each tilt of the rotors. All readings of one height are held out
together: repeats share the errors of their height, and a curve is asked for heights at which nobody measured.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from quadctl.effects import CATALOG, Conditions, Effect
from quadctl.effects.base import Parameter
from quadctl.effects.ground_effect import NearGround, Surface
from quadctl.ground_curve.measurement import Measurement
from quadctl.vehicle import Vehicle

Floats = npt.NDArray[np.float64]
Indices = npt.NDArray[np.intp]

DRAWS = 200
"""Resampled tables for the intervals."""
MOST_EXACT = 12
"""Heights up to which all changes of sign are tried; beyond, `SIGN_DRAWS` random ones."""
SIGN_DRAWS = 8191
SIGNIFICANCE = 0.05
LEVEL: Conditions = Conditions(1.0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))


@dataclass(frozen=True)
class Formula:
    """An effect without numbers, or none: K = 1, against which all others are judged."""

    effect: type[NearGround] | None
    per_surface: tuple[str, ...] = ()
    """Surfaces that have a value each of the fitted parameters; empty: one value for all."""

    @property
    def name(self) -> str:
        return self.effect.name if self.effect else "no ground effect"

    @cached_property
    def fitted(self) -> tuple[Parameter, ...]:
        return tuple(p for p in self.effect.parameters() if p.fitted) if self.effect else ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the numbers of a fit, in order."""
        plain = tuple(p.name for p in self.fitted)
        return tuple(f"{name}[{s}]" for s in self.per_surface for name in plain) if self.per_surface else plain

    @property
    def bounds(self) -> tuple[list[float], list[float]]:
        times = max(len(self.per_surface), 1)
        return [p.low for p in self.fitted] * times, [p.high for p in self.fitted] * times

    @property
    def start(self) -> Floats:
        return np.array([p.default for p in self.fitted] * max(len(self.per_surface), 1))

    def with_values(self, values: Floats, surface: str = "") -> NearGround | None:
        """The effect with the numbers of a fit, over `surface` where each has its own."""
        if self.effect is None:
            return None
        first = self.per_surface.index(surface) * len(self.fitted) if self.per_surface else 0
        return self.effect(**{p.name: float(values[first + i]) for i, p in enumerate(self.fitted)})


@dataclass(frozen=True)
class _Cell:
    """Readings over one surface with one tilt of the rotors."""

    rows: Indices
    surface: str
    tilt: int
    """Number of the tilt among those of the table."""
    vehicle: Vehicle
    conditions: Conditions


class Table:
    """The readings as arrays."""

    def __init__(self, measurement: Measurement, vehicle: Vehicle) -> None:
        points = measurement.points
        self.thrust: Floats = np.array([p.thrust for p in points])
        self.height_m: Floats = np.array([p.height_m for p in points])
        self.is_ratio = measurement.is_ratio
        self.groups: list[Indices] = [np.array(g) for g in measurement.height_groups(vehicle.rotor.radius_m)]
        tilts = list(dict.fromkeys(_tilt(p.cant_deg, p.dihedral_deg) for p in points))
        self.tilt: Indices = np.array([tilts.index(_tilt(p.cant_deg, p.dihedral_deg)) for p in points])
        self.vehicles = [tilted(vehicle, *tilt) for tilt in tilts]
        self.cells: list[_Cell] = []
        for surface, k in itertools.product(measurement.surfaces, range(len(tilts))):
            rows = np.array([i for i, p in enumerate(points) if p.surface == surface and self.tilt[i] == k], dtype=int)
            if len(rows):
                speed = np.array([points[i].speed_m_s for i in rows])
                c = replace(LEVEL, height_m=self.height_m[rows], velocity_body_m_s=(speed, 0.0 * speed, 0.0 * speed))
                self.cells.append(_Cell(rows, surface, k, self.vehicles[k], c))

    def ratios(self, formula: Formula, values: Floats) -> Floats:
        """K of every reading; not finite below a pole."""
        k = np.ones(len(self.thrust))
        for cell in self.cells:
            effect = formula.with_values(values, cell.surface)
            if effect is not None:
                with np.errstate(all="ignore"):
                    k[cell.rows] = effect.ratio(cell.conditions, cell.vehicle)
        return k

    def far(self, k: Floats, rows: Indices) -> Floats:
        """Thrust far from the ground, of each tilt, that fits the readings of `rows` best."""
        if self.is_ratio:
            return np.ones(len(self.vehicles))
        weight, product = np.zeros(len(self.vehicles)), np.zeros(len(self.vehicles))
        np.add.at(weight, self.tilt[rows], k[rows] ** 2)
        np.add.at(product, self.tilt[rows], k[rows] * self.thrust[rows])
        with np.errstate(invalid="ignore"):
            found = product / weight
        missing = ~np.isfinite(found)
        if missing.any() and not missing.all():  # a tilt of which all heights are held out
            found[missing] = found[~missing].mean()
        return found

    def errors(self, k: Floats, far: Floats, rows: Indices) -> Floats:
        """Measured minus predicted thrust of `rows`, over the thrust far from the ground."""
        t_far = far[self.tilt[rows]]
        return self.thrust[rows] / t_far - k[rows]


def formulas(vehicles: Sequence[Vehicle], surfaces: Sequence[str]) -> list[Formula]:
    """All ground effects of the catalogue that the vehicles can have, and none.

    `ground_effect.surface` takes part where there are several surfaces: over one it is `sanchez`.
    """
    found = [Formula(None)]
    for effect in CATALOG.values():
        if not issubclass(effect, NearGround) or not any(effect.applies_to(v) for v in vehicles):
            continue
        if effect is Surface:
            if len(surfaces) > 1:
                found.append(Formula(effect, tuple(surfaces)))
        else:
            found.append(Formula(effect))
    return found


def tilted(vehicle: Vehicle, cant_deg: float | None, dihedral_deg: float | None) -> Vehicle:
    """The vehicle with its rotors tilted to these sizes, each in the direction of the file; None: as in the file."""
    rotors = tuple(
        rotor.model_copy(
            update={
                key: math.copysign(value, getattr(rotor, key))
                for key, value in (("cant_deg", cant_deg), ("dihedral_deg", dihedral_deg))
                if value is not None
            }
        )
        for rotor in vehicle.rotors
    )
    return vehicle.model_copy(update={"rotors": rotors}) if rotors != vehicle.rotors else vehicle


@dataclass(frozen=True)
class Fit:
    """One formula fitted to the whole table."""

    formula: Formula
    values: Floats
    far: Floats
    """Thrust far from the ground, N, of each tilt; 1 where the table holds ratios."""
    rmse: float
    """On the readings of the fit, as a share of the thrust far from the ground; infinite below a pole."""
    height_errors: Floats
    """Mean squared error of each height, when it was held out."""
    draws: Floats
    """Values from resampled heights, shape (draws, numbers)."""

    @property
    def held_out(self) -> float:
        """RMSE on heights that the fit has not seen: each height counts the same."""
        return float(np.sqrt(self.height_errors.mean()))

    @property
    def ci95(self) -> dict[str, tuple[float, float]]:
        """95 % interval of each number; none where it is at its bound in all tables."""
        if not len(self.draws) or not self.formula.names:
            return {}
        low, high = np.quantile(self.draws, (0.025, 0.975), axis=0)
        limits = zip(self.formula.names, low, high, strict=True)
        return {name: (float(a), float(b)) for name, a, b in limits if a < b}


def fit_all(measurement: Measurement, vehicle: Vehicle, seed: int = 1) -> list[Fit]:
    """All formulas, the one with the smallest held-out error first."""
    table = Table(measurement, vehicle)
    fits = [_fit(formula, table, seed) for formula in formulas(table.vehicles, measurement.surfaces)]
    return sorted(fits, key=lambda fit: fit.held_out)


def p_same(a: Fit, b: Fit, seed: int = 1) -> float:
    """Probability of a difference of held-out error as large where both formulas are equally good.

    Test by change of sign, height by height: exact for few heights. Four heights give no p below 1/8.
    """
    difference = a.height_errors - b.height_errors
    if not np.isfinite(difference).all():
        return 1.0 if np.array_equal(a.height_errors, b.height_errors) else 0.0
    n = len(difference)
    if n <= MOST_EXACT:
        signs = np.array(list(itertools.product((1.0, -1.0), repeat=n)))
    else:
        drawn = np.random.default_rng(seed).choice((1.0, -1.0), size=(SIGN_DRAWS, n))
        signs = np.vstack([np.ones(n), drawn])
    sums = np.abs(signs @ difference)
    return float(np.mean(sums >= sums[0] * (1.0 - 1e-9)))


def _fit(formula: Formula, table: Table, seed: int) -> Fit:
    rows = np.arange(len(table.thrust))
    values = _values(formula, table, rows, formula.start)
    k = table.ratios(formula, values)
    far = table.far(k, rows)
    errors = table.errors(k, far, rows)
    rmse = float(np.sqrt(np.mean(errors**2))) if np.isfinite(errors).all() else math.inf
    return Fit(formula, values, far, rmse, _held_out(formula, table, values), _resampled(formula, table, values, seed))


def _values(formula: Formula, table: Table, rows: Indices, start: Floats) -> Floats:
    """The numbers that fit the readings of `rows` best; a row that appears twice counts twice."""
    if not len(start):
        return start
    low, high = (np.array(bound) for bound in formula.bounds)

    def residuals(values: Floats) -> Floats:
        k = table.ratios(formula, values)
        errors = table.errors(k, table.far(k, rows), rows)
        return np.nan_to_num(errors, nan=1e3, posinf=1e3, neginf=-1e3)

    inside = np.clip(start, low + 1e-6 * (high - low), high - 1e-6 * (high - low))
    scale = np.maximum(np.abs(inside), 0.01 * (high - low))
    found = least_squares(residuals, inside, bounds=(low, high), x_scale=scale).x
    # The solver stays inside its bounds by a hair: a number that wants to leave them is at the bound.
    hair = 1e-6 * (high - low)
    return np.where(found - low < hair, low, np.where(high - found < hair, high, found))


def _held_out(formula: Formula, table: Table, start: Floats) -> Floats:
    mean_squares = []
    for i, held in enumerate(table.groups):
        rows = np.concatenate([group for j, group in enumerate(table.groups) if j != i])
        k = table.ratios(formula, _values(formula, table, rows, start))
        errors = table.errors(k, table.far(k, rows), held)
        mean_squares.append(float(np.mean(errors**2)) if np.isfinite(errors).all() else math.inf)
    return np.array(mean_squares)


def _resampled(formula: Formula, table: Table, values: Floats, seed: int) -> Floats:
    """Values from tables of as many heights, drawn with replacement, and of each as many of its readings."""
    if not len(values):
        return np.empty((0, 0))
    random, n = np.random.default_rng(seed), len(table.groups)
    draws: list[Floats] = []
    while len(draws) < DRAWS:
        heights = random.integers(n, size=n)
        if len(set(heights.tolist())) < min(n, 3):
            continue
        rows = np.concatenate([random.choice(group, len(group)) for group in (table.groups[h] for h in heights)])
        draws.append(_values(formula, table, rows, values))
    return np.array(draws)


def _tilt(cant_deg: float, dihedral_deg: float) -> tuple[float | None, float | None]:
    return None if math.isnan(cant_deg) else cant_deg, None if math.isnan(dihedral_deg) else dihedral_deg


def effects_of(fit: Fit) -> dict[str, Effect | None]:
    """The fitted effect, by surface; one entry named "" where the formula has one value for all."""
    return {surface: fit.formula.with_values(fit.values, surface) for surface in fit.formula.per_surface or ("",)}
