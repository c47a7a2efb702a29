"""The value that a fit returns: a model fitted to flights, with its intervals and its held-out error."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.fitter import Fitter, Optimum
from quadctl.lab.fitting.nuisances import moments_beyond_usual
from quadctl.lab.fitting.parameters import (
    Free,
    free_parameters,
    intervals,
    is_at_bound,
    is_undetermined,
    leaves_out_zero,
    remarks,
    values_of,
)
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.flights.flight import Flight
from quadctl.lab.flights.prediction import rmse
from quadctl.model import Model


@dataclass(frozen=True, eq=False)
class Solution:
    """Result of a fit without its flights: small enough to be kept for many fits, and to be sent to another process."""

    start: Model
    """Model that the fit started from, for whose lag the flights were aligned."""
    optimum: Optimum
    held_out_residual: Floats
    """Held-out residual, shape (n, 3 * groups)."""

    def on(self, dataset: Dataset) -> "FittedModel":
        """The fitted model on the flights that it was fitted to."""
        return FittedModel(Fitter(self.start, dataset), self.optimum, self.held_out_residual)


@dataclass(frozen=True, eq=False)
class FittedModel:
    """Model fitted to flights: the value that adding, removing, searching and evaluating take and return.

    The bootstrap draws are computed at the first access, and kept.
    """

    fitter: Fitter
    optimum: Optimum
    held_out_residual: Floats
    """Held-out residual, shape (n, 3 * groups): targets minus predictions of refits that have not seen the sample."""

    @property
    def model(self) -> Model:
        """The model with its fitted parameters."""
        return self.optimum.model

    @property
    def dataset(self) -> Dataset:
        """Prepared flights, not yet aligned for a model."""
        return self.fitter.dataset.source

    @property
    def solution(self) -> Solution:
        """The fit without its flights."""
        return Solution(self.fitter.model, self.optimum, self.held_out_residual)

    @property
    def free(self) -> list[Free]:
        """The fitted parameters, in the order of `draws`."""
        return self.fitter.free

    @property
    def flights(self) -> tuple[Flight, ...]:
        """Flights as aligned for the fit."""
        return self.fitter.dataset.flights

    @property
    def predicted(self) -> Floats:
        """Prediction of every sample's targets, the flights' nuisances included, shape (n, 3 * groups)."""
        return self.optimum.predicted(self.fitter.dataset)

    @cached_property
    def held_out_rmse(self) -> dict[str, float]:
        """Held-out RMSE per axis and group (see `rmse`)."""
        return rmse(self.held_out_residual, self.dataset.groups)

    @cached_property
    def unusual_moments(self) -> Floats | None:
        """Held-out residual of the moments, with what the nuisances take of them beyond the usual, N m, shape (n, 3);
        None without moments."""
        groups = self.dataset.groups
        if "turning" not in groups:
            return None
        first = 3 * groups.index("turning")
        beyond = moments_beyond_usual(self.flights, self.optimum.nuisances)
        return np.asarray(self.held_out_residual[:, first : first + 3] + beyond)

    @cached_property
    def draws(self) -> Floats:
        """Bootstrap draws of the fitted parameters, shape (draws, p)."""
        return self.fitter.bootstrap(self.optimum)

    @cached_property
    def intervals(self) -> list[tuple[float, float]]:
        """95 % interval of each fitted parameter."""
        return intervals(self.free, values_of(self.model, self.free), self.draws)

    def relabelled(self, model: Model) -> "FittedModel":
        """The same fit as that of `model`, which differs in its name and files only."""
        start, found = (replace(model, stack=m.stack) for m in (self.fitter.model, self.model))
        return Solution(start, replace(self.optimum, model=found), self.held_out_residual).on(self.dataset)

    def refined(self) -> "FittedModel":
        """Continue the fit: where the minimum is flat, a fit stops a little before it (see `CONVERGED`)."""
        return fit_model(self.model, self.dataset)

    def ci95(self, effect: int) -> dict[str, tuple[float, float]]:
        """95 % intervals of the fitted parameters of one effect of the stack, by their names."""
        return {f.parameter.name: ci for f, _, ci in self._own(effect)}

    def remarks(self, effect: int | None = None) -> list[str]:
        """Remarks on the fitted parameters (see `parameters.remarks`); only those of one effect where `effect` is
        given."""
        return [said for own in self._own(effect) for said in remarks(*own)]

    def at_bound(self, effect: int) -> bool:
        """Tell whether a parameter of one effect of the stack ran into a bound."""
        return any(is_at_bound(f, value) for f, value, _ in self._own(effect))

    def determined(self, effect: int) -> bool:
        """Tell whether the data determine at least one parameter of one effect of the stack, or it has none; and show
        that one of its essential parameters is not 0, if it has such."""
        own = [(f, ci) for f, _, ci in self._own(effect)]
        essential = [(f, ci) for f, ci in own if f.parameter.name in self.model.effects[effect].essential]
        shown = not essential or any(leaves_out_zero(f, ci) for f, ci in essential)
        return shown and (not own or not all(is_undetermined(f, ci) for f, ci in own))

    def _own(self, effect: int | None) -> list[tuple[Free, float, tuple[float, float]]]:
        """Fitted parameters of one effect of the stack, or of all, each with its value and its interval."""
        every = zip(self.free, values_of(self.model, self.free).tolist(), self.intervals, strict=True)
        return [item for item in every if effect in (None, item[0].effect)]


def fit_model(model: Model, dataset: Dataset) -> FittedModel:
    """Fit the parameters of `model`, starting from their present values, and the nuisances of the flights of
    `dataset`."""
    fitter = Fitter(model, dataset)
    optimum = fitter.fit()
    return FittedModel(fitter, optimum, dataset.targets - fitter.held_out(optimum))


def fit_as_it_stands(model: Model, dataset: Dataset, freed: Collection[int] = ()) -> FittedModel:
    """Fit the nuisances of the flights of `dataset`: the parameters of `model` stay, but those of the effects whose
    places in the stack are `freed`."""
    stack = tuple(replace(item, held=i not in freed) for i, item in enumerate(model.stack))
    return fit_model(replace(model, stack=stack), dataset)


def is_fitted_to(model: Model, flights: Sequence[str]) -> bool:
    """Tell whether all parameters of `model` that can be fitted were fitted to the flights of these names, and maybe
    others."""
    items = (model.stack[effect] for effect in {free.effect for free in free_parameters(model)})
    return all(item.fitted is not None and set(flights) <= set(item.fitted.logs) for item in items)
