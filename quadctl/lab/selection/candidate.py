"""Candidate: one effect tried on top of a model, with the data on which the decision rule judges it."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

from quadctl.effects import Effect
from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.fitted_model import FittedModel, Solution
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.flights.prediction import GROUPS, concerns
from quadctl.model import Model

IDLE = 0.005
"""Relative change of the acceleration error below which an effect counts as having no influence on it."""
LEAST_ERROR = 1e-9
"""Least error in a denominator; only synthetic logs have less."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """One effect tried on top of a model, fitted together with it."""

    effect: Effect
    """Effect with its fitted parameters."""
    model: Model
    """Refitted model; the effect is the last of its stack."""
    ci95: dict[str, tuple[float, float]]
    """95 % intervals of the effect's parameters."""
    before: dict[str, float]
    """Held-out RMSE per axis and group without the effect."""
    after: dict[str, float]
    """Held-out RMSE per axis and group with the effect."""
    p_value: float
    """One-sided p-value of the held-out improvement, corrected for autocorrelation and for the candidates tried."""
    residual: Floats
    """Held-out residual with the effect, shape (n, 3 * groups)."""
    remarks: list[str]
    """Remarks on the fitted parameters: at a bound, not determined."""
    worst_flight: float = 0.0
    """Smallest relative drop of the error of a moment in a single flight; 0 where none is negative."""
    unusual: Mapping[str, float] = field(default_factory=dict)
    """Relative drop of the error of each moment, with what the nuisances take of it beyond the usual; empty without
    moments."""
    believable: bool = True
    """False where fitted parameters of this effect, or of others because of it, are not physically plausible."""
    distinct: bool = True
    """False where these data do not distinguish the effect from its confounded effects."""
    implied: bool = False
    """True where the other effects of the model imply this one, so that it is no discovery of its own."""
    fitted: bool = True
    """False where the effect explains no more than noise to first order, so that it was not fitted."""
    at_bound: bool = False
    """True where a parameter of the effect ran into a bound."""
    determined: bool = True
    """False where the data determine none of the effect's parameters, or none of its essential ones."""
    solution: Solution | None = None
    """Fit of the model; None when the candidate was read from a session."""

    @property
    def family(self) -> str:
        return self.effect.family()

    @property
    def measure(self) -> str:
        """Name of the error by which the effect is judged: the acceleration's, unless the effect does not change it
        (see `GROUPS`)."""
        return measure_of([self.effect], self.before, self.after)

    @property
    def held_out_drop(self) -> float:
        """Relative drop of the held-out error `measure`."""
        return 1.0 - self.after[self.measure] / self.before[self.measure]

    @cached_property
    def drops(self) -> dict[str, float]:
        """Relative drop of the held-out error of each axis that the effect acts on."""
        about = [group for group in GROUPS if group in self.after and concerns(self.effect, group)]
        axes = [axis for group in about for axis in GROUPS[group]]
        return {axis: 1.0 - self.after[axis] / max(self.before[axis], LEAST_ERROR) for axis in axes}

    @property
    def axis(self) -> str:
        """Axis on which the effect helps most."""
        return max(self.drops, key=self.drops.__getitem__)

    @property
    def largest_drop(self) -> float:
        """Relative drop on the axis on which the effect helps most."""
        return max(self.drops.values())

    @property
    def explained_m_s2(self) -> float:
        """Root mean square of the acceleration that the effect explains on held-out data, on the axis where it is
        largest."""
        squares = [self.before[axis] ** 2 - self.after[axis] ** 2 for axis in GROUPS["total"] if axis in self.drops]
        return math.sqrt(max([0.0, *squares]))

    @property
    def n_seen(self) -> int:
        """Number of the effect's parameters that these data show: their intervals reach no bound."""
        bounds = {p.name: (p.low, p.high) for p in self.effect.parameters()}
        return sum(low > bounds[name][0] and high < bounds[name][1] for name, (low, high) in self.ci95.items())

    def fit(self, dataset: Dataset) -> FittedModel:
        """Fitted model of this candidate; `dataset` is the one that it was fitted to.

        Raises
        ------
        ValueError
            The candidate was read from a session, which does not hold its fit.
        """
        if self.solution is None:
            raise ValueError(f"{self.effect.name}: has no fit, expected a candidate that was not read from a session")
        return self.solution.on(dataset)


def measure_of(effects: Iterable[Effect], before: Mapping[str, float], after: Mapping[str, float]) -> str:
    """Name of the error by which a change of `effects` is judged: the acceleration's, unless they do not change it."""
    changed = list(effects)
    for group in GROUPS:
        possible = group == "total" or any(concerns(effect, group) for effect in changed)
        if possible and group in after and abs(after[group] / max(before[group], LEAST_ERROR) - 1.0) >= IDLE:
            return group
    return "total"
