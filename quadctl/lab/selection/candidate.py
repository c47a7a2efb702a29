"""One effect tried on top of a model: the data on which the decision rule judges it."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from quadctl.effects import Effect
from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.fitter import FittedModel, Fitter, Optimum
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.flights.prediction import GROUPS, concerns
from quadctl.model import Model

IDLE = 0.005
"""Largest relative change of the acceleration error by an effect that does nothing to it."""
LEAST_ERROR = 1e-9
"""Error below which a log was made up, not flown."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """One effect tried on top of a model, fitted together with it."""

    effect: Effect
    """The effect with its fitted parameters."""
    model: Model
    """The whole stack, refitted; the effect is its last."""
    ci95: dict[str, tuple[float, float]]
    """95 % intervals of the effect's parameters."""
    before: dict[str, float]
    """Held-out RMSE per axis and group without the effect."""
    after: dict[str, float]
    """Held-out RMSE with it."""
    p_value: float
    """One-sided p-value of the held-out improvement, corrected for autocorrelation and for the candidates tried."""
    residual: Floats
    """Held-out residual with the effect, shape (n, 3 * groups)."""
    remarks: list[str]
    """Remarks on the fitted parameters: at a bound, not determined."""
    worst_flight: float = 0.0
    """Least share taken off the error of a moment in a single flight; 0 where none is negative."""
    believable: bool = True
    """False where the parameters are not what the effect can be, or drive those of others there."""
    distinct: bool = True
    """False where these data do not tell the effect from its look-alikes."""
    start: Model | None = None
    """The model that the fit began with, for whose lag the flights were aligned; None: read from a session."""
    nuisances: Floats | None = None
    """Fitted nuisances of the flights, shape (flights, kinds)."""

    @property
    def family(self) -> str:
        return self.effect.family()

    @property
    def measure(self) -> str:
        """The error that the effect is about: of the acceleration unless it does nothing to it (see `GROUPS`)."""
        return measure_of([self.effect], self.before, self.after)

    @property
    def held_out_drop(self) -> float:
        """Share taken off the held-out error that the effect is about."""
        return 1.0 - self.after[self.measure] / self.before[self.measure]

    @cached_property
    def drops(self) -> dict[str, float]:
        """Share taken off the held-out error of each axis that the effect is about."""
        about = [group for group in GROUPS if group in self.after and concerns(self.effect, group)]
        axes = [axis for group in about for axis in GROUPS[group]]
        return {axis: 1.0 - self.after[axis] / max(self.before[axis], LEAST_ERROR) for axis in axes}

    @property
    def largest_drop(self) -> float:
        """Share taken off the axis on which the effect helps most."""
        return max(self.drops.values())

    def fit(self, dataset: Dataset) -> FittedModel:
        """The fit that the candidate came out of, for the `dataset` that it was fitted to.

        Raises
        ------
        ValueError
            The candidate comes from a saved session: its fit was not kept.
        """
        if self.start is None or self.nuisances is None:
            raise ValueError(f"{self.effect.name}: the fit was not kept, expected a candidate of this session")
        return FittedModel(Fitter(self.start, dataset), Optimum(self.model, np.asarray(self.nuisances)), self.residual)


def measure_of(effects: Iterable[Effect], before: Mapping[str, float], after: Mapping[str, float]) -> str:
    """The error that a change of `effects` is about: of the acceleration unless they do nothing to it."""
    changed = list(effects)
    turning, sensing = any(e.turns for e in changed), any(e.senses for e in changed)
    for group, possible in (("total", True), ("turning", turning), ("sensing", sensing)):
        if possible and group in after and abs(after[group] / max(before[group], LEAST_ERROR) - 1.0) >= IDLE:
            return group
    return "total"
