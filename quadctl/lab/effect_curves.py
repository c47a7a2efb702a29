"""Curves of a fitted effect over the variables that it depends on: numbers for a plot, without its style."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from quadctl.effects import Conditions, Effect
from quadctl.effects.ground_effect import LOWEST_HEIGHT_OVER_RADIUS, NearGround
from quadctl.frames import GRAVITY_M_S2
from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.fitted_model import FittedModel
from quadctl.lab.fitting.flexible_regression import turned_by
from quadctl.lab.fitting.noise import CorrelatedNoise
from quadctl.lab.fitting.parameters import free_parameters, with_values
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.flights.flight import VARIABLE_NAMES
from quadctl.lab.flights.prediction import MOMENTS, concerns
from quadctl.lab.selection.addition import Addition
from quadctl.lab.selection.wording import unit_of
from quadctl.model import Model

RATIO_DRAWS, CURVE_DRAWS = 400, 60
"""Number of bootstrap draws for a band: of a formula over height, and of a whole prediction."""
RATIO_BINS = 14
FAR_OVER_RADIUS = 30.0
"""Rotor height over radius at which no ground effect is left: less than 0.01 % by any formula of the catalogue."""
BODY_AXES = ("forward", "right", "up")
COMPONENTS = {
    "total": BODY_AXES,
    "turning": tuple(f"{axis} moment" for axis in MOMENTS),
    "sensing": tuple(f"accelerometer {axis}" for axis in BODY_AXES),
}
"""Axes along which an effect is plotted, of each measured group: of the vehicle's heading, and FRD for moments."""
_ACROSS = {"speed_forward": "forward", "speed_right": "right"}
"""Component of the effects that depend on these variables; all other effects are plotted along up."""


@dataclass(frozen=True, eq=False)
class Binned:
    """Means over bins of a variable."""

    x: Floats
    mean: Floats
    error: Floats
    """Standard error of the mean, autocorrelation included."""


@dataclass(frozen=True, eq=False)
class RatioCurve:
    """Thrust ratio of a fitted ground effect over height."""

    height_over_radius: Floats
    ratio: Floats
    low: Floats
    high: Floats
    """Ends `low` and `high` of the 95% band from the bootstrap draws."""
    measured: Binned
    """Measured over predicted upward specific force; predicted without this effect."""
    data_range: tuple[float, float]
    """Lowest and highest rotor height flown, in rotor radii."""


def ratio_curve(addition: Addition, index: int) -> RatioCurve:
    """Thrust ratio of the ground effect with index `index` of the stack over the heights flown, and a little more."""
    vehicle, dataset = addition.model.vehicle, addition.dataset
    radius = vehicle.rotor.radius_m
    low, high = (h / radius for h in dataset.heights_m)
    begin = max(LOWEST_HEIGHT_OVER_RADIUS, min(0.75 * low, 1.0))
    x = np.geomspace(begin, max(1.15 * high, 2.0 * begin), 160)  # dense where the curve bends
    effect, *drawn = (m.effects[index] for m in (addition.model, *_drawn_models(addition, index, RATIO_DRAWS)))
    band = np.percentile([ratio_at(each, x * radius, addition.model) for each in drawn], [2.5, 97.5], axis=0)
    expected = _predicted(addition.model.without(effect), dataset)[:, 2] + GRAVITY_M_S2
    measured = _without_trims(addition.fit_after)
    ratio = (measured[:, 2] + GRAVITY_M_S2) / expected
    noise = (measured - _predicted(addition.model, dataset))[:, 2] / expected
    points = binned(_variable(dataset, "height_over_radius"), ratio, noise, dataset)
    return RatioCurve(x, ratio_at(effect, x * radius, addition.model), band[0], band[1], points, (low, high))


@dataclass(frozen=True, eq=False)
class EffectCurve:
    """Residuals and contribution of an effect over one of its variables, of one axis of a measured group (see
    `COMPONENTS`)."""

    variable: str
    group: str
    component: str
    x: Floats
    before: Floats
    """Residual without the effect, in the unit of the group, shape (n,)."""
    after: Floats
    """Residual with the effect, in the unit of the group, shape (n,)."""
    binned_before: Binned
    binned_after: Binned
    fitted: Binned
    """Contribution of the effect in the same bins; its error is the spread of the bootstrap draws."""

    @property
    def residual_label(self) -> str:
        """Axis label of the residual: `residual forward / m/s²`."""
        return f"residual {self.component} / {unit_of(self.group)}"


def effect_curves(addition: Addition, index: int) -> list[EffectCurve]:
    """Curves of the effect with index `index` of the stack over each variable that it depends on, apart from bias and
    calibration of each flight.

    An effect that depends on no variable is shown over time, along the axes on which it is largest. One that acts on
    moments, or on the accelerometer, is shown there, too, where these are measured.
    """
    return _curves(addition.fit_after, index, _drawn_models(addition, index, CURVE_DRAWS))


def fitted_effect_curves(fit: FittedModel, index: int) -> list[EffectCurve]:
    """Curves of one effect of the stack of a fitted model, apart from bias and calibration of each flight; the spread
    of its contribution is 0."""
    return _curves(fit, index, [])


def _without_trims(fit: FittedModel, group: str = "total") -> Floats:
    """Measured values of a group without what bias and calibration of each flight add, shape (n, 3)."""
    first = 3 * fit.dataset.groups.index(group)
    columns = slice(first, first + 3)
    by_trims = fit.predicted[:, columns] - fit.fitter.dataset.predicted_group(fit.model, group)
    return fit.dataset.targets[:, columns] - by_trims


def _curves(fit: FittedModel, index: int, drawn: Sequence[Model]) -> list[EffectCurve]:
    """Curves of one effect of the stack; `drawn` are copies of the model whose spread is the error of the effect."""
    groups = [group for group in fit.dataset.groups if concerns(fit.model.effects[index], group)]
    return [curve for group in groups for curve in _curves_of_group(fit, fit.model.effects[index], drawn, group)]


def _curves_of_group(fit: FittedModel, effect: Effect, drawn: Sequence[Model], group: str) -> list[EffectCurve]:
    """Curves of one effect in a measured group; none where it does nothing there."""
    model, dataset = fit.model, fit.dataset
    without, full, *others = (_predicted(m, dataset, group) for m in (model.without(effect), model, *drawn))
    measured = _without_trims(fit, group)
    changes = [measured - without, measured - full, full - without, *(other - without for other in others)]
    if group != "turning":
        changes = [_in_heading(change, dataset) for change in changes]
    if not changes[2].any():
        return []
    pairs = [(name, BODY_AXES.index(_ACROSS.get(name, "up"))) for name in _logged(effect.depends_on, dataset)]
    if pairs and group != "total":
        # A moment near the ground goes with the lean as well: over height alone, its means would be a zigzag.
        pairs = [_closest(changes[2], _logged(VARIABLE_NAMES, dataset), dataset)]
    found = []
    for variable, a in pairs or [("time", a) for a in _pushed(changes[2])]:
        x, (before, after, push, *draws) = _variable(dataset, variable), (change[:, a] for change in changes)
        of_before, of_after, fitted = (binned(x, values, after, dataset) for values in (before, after, push))
        means = [binned(x, d, None, dataset).mean for d in draws] or [fitted.mean]
        fitted = replace(fitted, error=np.std(means, axis=0))
        component = COMPONENTS[group][a]
        found.append(EffectCurve(variable, group, component, x, before, after, of_before, of_after, fitted))
    return found


@dataclass(frozen=True, eq=False)
class Sketch:
    """Coarse curve of a model's last effect: residual without it, apart from a constant of each flight, and its
    contribution, m/s^2."""

    variable: str
    component: str
    residual: Binned
    effect: Binned


def sketch(model: Model, dataset: Dataset) -> Sketch | None:
    """Sketch the last effect of `model` along its largest axis, over the variable that it follows most closely; None
    where it has no force.

    The effect was fitted together with the per-flight bias, which is a constant: so the residual is drawn with the
    mean of the effect in each flight.
    """
    effect = model.effects[-1]
    without = _predicted(model.without(effect), dataset)
    push, residual = (_in_heading(v - without, dataset) for v in (_predicted(model, dataset), dataset.measured))
    if not push.any():
        return None
    # Over another variable, as forward speed for a drag to the side, the means of a smooth effect are a zigzag.
    variable, a = _closest(push, _logged(effect.depends_on, dataset) or ["time"], dataset)
    x = _variable(dataset, variable)
    for part in dataset.parts:
        residual[part] += (push[part] - residual[part]).mean(axis=0)
    dots, line = (binned(x, values[:, a], None, dataset) for values in (residual, push))
    return Sketch(variable, BODY_AXES[a], dots, line)


def _logged(names: Iterable[str], dataset: Dataset) -> list[str]:
    return [name for name in names if dataset.variable(name) is not None]


def _closest(push: Floats, names: Sequence[str], dataset: Dataset) -> tuple[str, int]:
    """The variable that an effect, shape (n, 3), follows most closely along its largest axis, and that axis."""
    a = int(np.argmax(np.mean(push**2, axis=0)))

    def followed(name: str) -> float:
        """Share of the variance that the means over bins of a variable have."""
        x = _variable(dataset, name)
        means = binned(x, push[:, a], None, dataset)
        return float(np.var(np.interp(x, means.x, means.mean))) if len(means.x) > 1 else 0.0

    return max(names, key=followed), a


def hover_ratio(model: Model, height_m: Floats, forward_m_s: Floats) -> Floats:
    """Thrust of the rotors over k rpm^2 in level attitude, at the rotor speed of hover."""
    level = (1.0, 0.0, 0.0, 0.0)
    c = model.in_air(Conditions(height_m, (forward_m_s, 0.0, 0.0), level))
    each = np.full_like(height_m + forward_m_s, model.vehicle.weight_n / model.vehicle.n_rotors)
    return np.asarray(sum(model.rotor_thrust([each] * model.vehicle.n_rotors, c)) / model.vehicle.weight_n)


def far_ratio(model: Model) -> float:
    """`hover_ratio` far from the ground and from any ceiling: the constant factor of the thrust, forms included that
    do not fade to 1."""
    vehicle = model.vehicle.model_copy(update={"ceiling_m": None})
    height_m = np.array([FAR_OVER_RADIUS * vehicle.rotor.radius_m])
    return float(hover_ratio(replace(model, vehicle=vehicle), height_m, np.zeros(1))[0])


def measured_ratio(dataset: Dataset, variable: str) -> Binned | None:
    """Measured counterpart of `hover_ratio` in bins: upward specific force over that of the rigid body; None where
    `variable` is not logged."""
    x = dataset.variable(variable)
    if x is None:
        return None
    expected = _predicted(Model(dataset.flights[0].vehicle), dataset)[:, 2] + GRAVITY_M_S2
    ratio = (dataset.measured[:, 2] + GRAVITY_M_S2) / expected
    means = binned(x, ratio, None, dataset)
    return binned(x, ratio, ratio - np.interp(x, means.x, means.mean), dataset)


def ratio_as_flown(model: Model, dataset: Dataset, variable: str) -> Binned | None:
    """`hover_ratio` of a model at the height and the forward speed of each sample, in the bins of `measured_ratio`;
    None where the speed or `variable` is not logged."""
    x, speed = dataset.variable(variable), dataset.variable("speed_forward")
    if x is None or speed is None:
        return None
    height_m = np.concatenate([flight.filtered(flight.conditions.height_m) for flight in dataset.flights])
    with np.errstate(all="ignore"):  # a formula may have a pole beyond its range
        return binned(x, hover_ratio(model, height_m, speed), None, dataset)


def binned(x: Floats, values: Floats, noise: Floats | None, dataset: Dataset) -> Binned:
    """Means of `values` in bins of `x` with about the same number of samples each.

    Standard errors are computed from `noise`, i.e. `values` without their structure; without `noise` they are 0.
    """
    edges = np.unique(np.quantile(x, np.linspace(0.0, 1.0, RATIO_BINS + 1)))
    index = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, max(len(edges) - 2, 0))
    bins = [index == b for b in np.unique(index)]
    error = np.zeros(len(bins))
    if noise is not None:
        correlated = CorrelatedNoise(noise, dataset)
        error = np.array([correlated.variance_of_sum(inside / inside.sum()) ** 0.5 for inside in bins])
    return Binned(np.array([x[b].mean() for b in bins]), np.array([values[b].mean() for b in bins]), error)


def _drawn_models(addition: Addition, index: int, number: int) -> list[Model]:
    """Copies of the model, in which one effect has the parameters of some of the bootstrap draws."""
    free = free_parameters(addition.model)
    own = [i for i, f in enumerate(free) if f.effect == index]
    draws = addition.fit_after.draws[:number]
    return [with_values(addition.model, [free[i] for i in own], draw[own]) for draw in draws]


def _predicted(model: Model, dataset: Dataset, group: str = "total") -> Floats:
    """Prediction of a measured group, shape (n, 3); the flights are aligned for the model."""
    return dataset.aligned_for(model).predicted_group(model, group)


def ratio_at(effect: Effect, height_m: Floats, model: Model) -> Floats:
    if not isinstance(effect, NearGround):
        raise TypeError(f"{effect.name} has no thrust ratio over height")
    conditions = Conditions(height_m, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    return np.asarray(effect.ratio(conditions, model.vehicle) + 0.0 * height_m)


def _variable(dataset: Dataset, name: str) -> Floats:
    found = dataset.variable(name)
    return np.zeros(len(dataset.measured)) if found is None else found


def _in_heading(values: Floats, dataset: Dataset) -> Floats:
    """Turn north, east, up to forward, right, up of a level vehicle with the heading of the flights."""
    heading = np.concatenate([flight.heading_rad for flight in dataset.flights])
    return np.column_stack([turned_by(values[:, :2], -heading), values[:, 2]])


def _pushed(push: Floats) -> list[int]:
    """Numbers of the axes along which an effect is at least 0.3 of its largest."""
    size = np.sqrt(np.mean(push**2, axis=0))
    return [a for a in range(3) if size[a] >= 0.3 * size.max()]
