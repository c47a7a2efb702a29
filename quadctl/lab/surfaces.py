"""Comparison of the surfaces that flights passed over: does the ground effect differ between them, and by how much."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from quadctl.effects.ground_effect import Sanchez, quadrotor_ratio
from quadctl.effects.ground_effect_surfaces import PREFIX, Surfaces
from quadctl.errors import SettingsError
from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.fitted_model import fit_model
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.random_effects import Z95, Population
from quadctl.lab.selection.refit import Refit, refitted
from quadctl.lab.selection.rule import is_significant
from quadctl.lab.words import Answer
from quadctl.model import Model, StackedEffect
from quadctl.words import fact

HEIGHT_M = 0.2
"""Height of the rotor plane at which thrusts over the surfaces are compared."""


@dataclass(frozen=True, eq=False, repr=False)
class SurfaceComparison(Refit):
    """Models with one weight of the fountain for all surfaces (before) and with one for each (after)."""

    names: tuple[str, ...]
    weights: Floats
    """Weight of the fountain over each surface, k_b + k_s, by itself, shape (surfaces,)."""
    weight_ci95: Floats
    """95 % intervals of the weights, shape (surfaces, 2)."""
    population: Population

    @property
    def title(self) -> str:
        return str(fact(Answer.ONE_AND_EACH))

    @property
    def differ(self) -> bool:
        """True where the surfaces are told from each other on data that no fit has seen."""
        return self.held_out_drop > 0.0 and is_significant(self.p_value)

    @cached_property
    def thrust_ratios(self) -> dict[str, tuple[float, ...]]:
        """Thrust ratio over each surface in hover at `HEIGHT_M`, with its 95 % interval."""
        weights = np.maximum(np.column_stack([self.weights, self.weight_ci95]), 0.0)
        ratios = (tuple(float(quadrotor_ratio(HEIGHT_M, self.model.vehicle, w)) for w in own) for own in weights)
        return dict(zip(self.names, ratios, strict=True))

    @property
    def next_weight_ci95(self) -> tuple[float, float]:
        """95 % interval of the weight of a surface that was not measured; no weight is below 0."""
        low, high = self.population.next_ci95
        return max(low, 0.0), high

    @property
    def least_known(self) -> str:
        """The surface whose weight has the widest interval."""
        return self.names[int(np.argmax(np.ptp(self.weight_ci95, axis=1)))]

    @property
    def conclusion(self) -> str:
        ratios = [ratio for ratio, _, _ in self.thrust_ratios.values()]
        most = max(ratios) - min(ratios)
        kind = Answer.SURFACES_DIFFER if self.differ else Answer.SURFACES_ALIKE
        return str(fact(kind, p=self.p_value, most=most, height_m=HEIGHT_M))

    def to_dict(self) -> dict[str, Any]:
        low, high = self.next_weight_ci95
        return {
            **super().to_dict(),
            "surfaces_differ": self.differ,
            "surfaces": {
                name: {
                    "weight": float(self.weights[i]),
                    "ci95": self.weight_ci95[i].tolist(),
                    "thrust_ratio": self.thrust_ratios[name][0],
                    "thrust_ratio_ci95": list(self.thrust_ratios[name][1:]),
                }
                for i, name in enumerate(self.names)
            },
            "height_m": HEIGHT_M,
            "new_surface": {"weight": self.population.mean, "ci95": [low, high]},
            "least_known": self.least_known,
        }

    def __rich__(self) -> RenderableType:
        table = Table(title=f"Surfaces, 95 % intervals; thrust over that far away, rotor plane at {HEIGHT_M:g} m")
        for heading in ("surface", "weight of the fountain", "thrust ratio"):
            table.add_column(heading)
        for name, weight, ci95 in zip(self.names, self.weights, self.weight_ci95, strict=True):
            ratio = "{:.3f} [{:.3f}, {:.3f}]".format(*self.thrust_ratios[name])
            table.add_row(name, "{:.3g} [{:.3g}, {:.3g}]".format(weight, *ci95), ratio)
        low, high = self.next_weight_ci95
        table.add_row("a new surface", f"{self.population.mean:.3g} [{low:.3g}, {high:.3g}]", "", style="dim")
        one, each = self.before[self.measure], self.after[self.measure]
        lines = [
            f"Held-out acceleration error: {one:.4g} m/s^2 with one weight, {each:.4g} with one for each surface.",
            self.conclusion,
            f"Least known: {self.least_known}. To learn more, fly {Surfaces.mission} over it.",
            *(f"Note: {remark}." for remark in self.remarks),
        ]
        return Group(table, Text("\n".join(lines)))


def compare_surfaces(model: Model, dataset: Dataset) -> SurfaceComparison:
    """Fit the ground effect of `model` anew: with one weight of the fountain, and with one for each surface.

    The model of the result has the weights drawn toward their mean by the errors of their measurement; k_b is the mean,
    with which a surface begins that was not measured.

    Raises
    ------
    SettingsError
        The flights say less than two surfaces, or the vehicle is no quadrotor.
    """
    names = tuple(dict.fromkeys(name for flight in dataset.flights for name, _ in flight.conditions.surfaces))
    if len(names) < 2:
        flown = f"only {names[0]}" if names else "none"
        raise SettingsError(
            f"{', '.join(dataset.names)}: say {flown} of the surfaces below them, expected two or more "
            "(surface: NAME in the mission or in the log's meta file)"
        )
    if not Surfaces.applies_to(model.vehicle):
        raise SettingsError(f"{model.name}: has {model.vehicle.n_rotors} rotors, expected a quadrotor")
    rest = replace(model, stack=tuple(item for item in model.stack if item.effect.family() != Surfaces.family()))
    one = fit_model(rest.plus(Sanchez(Surfaces().k_b)), dataset)
    each = fit_model(rest.plus(Surfaces.over(names)()), dataset)
    effect = each.model.effects[-1]
    assert isinstance(effect, Surfaces)
    columns = [i for i, free in enumerate(each.free) if free.parameter.name.startswith(PREFIX)]
    draws = np.maximum(effect.k_b + each.draws[:, columns[-len(names) :]], 0.0)
    weights = np.array([effect.weight(name) for name in names])
    variances = np.maximum(draws.var(axis=0, ddof=1), 1e-12)
    population = Population.of(weights, variances)
    ci95 = np.quantile(draws, (0.025, 0.975), axis=0).T
    found: dict[str, Any] = {"names": names, "weights": weights, "weight_ci95": ci95, "population": population}
    result = refitted(SurfaceComparison, one.model, one, each, **found)
    return replace(result, model=_with_population(result.model, names, weights, variances, population))


def _with_population(
    model: Model, names: tuple[str, ...], weights: Floats, variances: Floats, population: Population
) -> Model:
    """The model with the mean over surfaces for k_b, and each surface's weight drawn toward it."""
    mean = max(population.mean, 0.0)
    values = {"k_b": mean}
    reach = Z95 * population.standard_error
    intervals = {"k_b": (mean - reach, mean + reach)}
    for name, weight, variance in zip(names, weights, variances, strict=True):
        shrunk, deviation = population.shrunk(float(weight), float(variance))
        values[PREFIX + name] = shrunk - mean
        intervals[PREFIX + name] = (shrunk - mean - Z95 * deviation, shrunk - mean + Z95 * deviation)
    last = model.stack[-1]
    fitted = last.fitted.model_copy(update={"ci95": intervals}) if last.fitted else None
    return replace(model, stack=(*model.stack[:-1], StackedEffect(Surfaces.over(names)(**values), fitted)))
