"""Refit of a model to flights: all parameters together, their intervals, and the held-out error."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from quadctl import __version__
from quadctl.effects import Effect
from quadctl.errors import SettingsError
from quadctl.lab.comparison.wording import ERRORS
from quadctl.lab.finding import Finding, Kind, parameters_of
from quadctl.lab.fitting.bootstrap import drop_interval
from quadctl.lab.fitting.fitted_model import FittedModel, fit_as_it_stands, fit_model, is_fitted_to
from quadctl.lab.fitting.fitter import Fitter, Optimum
from quadctl.lab.fitting.parameters import free_parameters, intervals, undetermined, values_of
from quadctl.lab.fitting.significance import improvement_p_value
from quadctl.lab.flights.channels import ROTOR_SPEED
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.results import Result, errors_table
from quadctl.lab.selection.candidate import measure_of
from quadctl.lab.words import in_words
from quadctl.model import Model, Provenance, StackedEffect


@dataclass(frozen=True, eq=False, repr=False)
class Refit(Result):
    """Model before and after a refit, with the held-out error of both."""

    before_model: Model
    """Model as given."""
    model: Model
    """Refitted model, with the provenance of its parameters."""
    fit_before: FittedModel
    fit_after: FittedModel
    remarks: list[str]
    """Remarks on the fitted parameters, and on flights that do not determine them."""

    @property
    def dataset(self) -> Dataset:
        """Dataset of the fit."""
        return self.fit_after.dataset

    @property
    def before(self) -> dict[str, float]:
        """Held-out RMSE per axis and group before; the acceleration's in m/s^2."""
        return self.fit_before.held_out_rmse

    @property
    def after(self) -> dict[str, float]:
        """Held-out RMSE per axis and group after."""
        return self.fit_after.held_out_rmse

    @property
    def changed(self) -> Sequence[Effect]:
        """Effects in which the two models differ."""
        return self.model.effects

    @property
    def measure(self) -> str:
        """Name of the error by which the change is judged: the acceleration's, unless the change does not concern
        it."""
        return measure_of(self.changed, self.before, self.after)

    @property
    def held_out_drop(self) -> float:
        return 1.0 - self.after[self.measure] / self.before[self.measure]

    @cached_property
    def drop_ci95(self) -> tuple[float, float]:
        return drop_between(self.fit_before, self.fit_after, self.measure)

    @cached_property
    def p_value(self) -> float:
        """p-value of the hypothesis that the larger of the two models does not help on unseen data."""
        fits = sorted((self.fit_before, self.fit_after), key=lambda fit: len(fit.model.stack))
        smaller, larger = (fit.held_out_residual for fit in fits)
        return improvement_p_value(smaller, smaller - larger, self.dataset)

    @property
    def title(self) -> str:
        return f"Held-out acceleration error of {self.model.name}, before and after the refit"

    @property
    def conclusion(self) -> str:
        """Conclusion where the refit does not reduce the held-out error; empty where it does."""
        if self.held_out_drop > 0.0:
            return ""
        return "The refit does not lower the held-out error: keep the previous parameters."

    @property
    def is_repetition(self) -> bool:
        """True where the model had the same effects and was fitted to these flights before, and no parameter has moved
        by more than a small part of its interval."""
        names = [[effect.name for effect in model.effects] for model in (self.before_model, self.model)]
        if names[0] != names[1] or not is_fitted_to(self.before_model, self.dataset.names):
            return False
        before, after = (values_of(model, self.fit_after.free) for model in (self.before_model, self.model))
        widths = np.array([high - low for low, high in self.fit_after.intervals])
        return bool(np.all(np.abs(after - before) <= SAME_FIT * widths))

    def to_dict(self) -> dict[str, Any]:
        return {
            "effects": [item.to_dict() for item in self.model.stack],
            "flights": self.dataset.names,
            "rmse_before": self.before,
            "rmse_after": self.after,
            "held_out_drop": self.held_out_drop,
            "held_out_drop_ci95": list(self.drop_ci95),
            "p_value": self.p_value,
            "held_out": self.dataset.hold_out,
            "remarks": self.remarks,
        }

    def __rich__(self) -> RenderableType:
        table = errors_table(self.title, (("before", self.before), ("after", self.after)))
        low, high = self.drop_ci95
        p = "< 1e-4" if self.p_value < 1e-4 else f"= {self.p_value:.2g}"
        change = f"{-self.held_out_drop:+.1%} [{-high:+.1%}, {-low:+.1%}], p {p}"
        lines = [f"The held-out {ERRORS[self.measure]} changes by {change}."]
        lines.append(
            "The model now contains:" if self.model.stack else "The model now contains no effect: the rigid body."
        )
        found = [Finding(Kind.EFFECT, parameters_of(item.effect, item.ci95)) for item in self.model.stack]
        lines += [f"  {in_words(finding)}" for finding in found]
        lines += [f"Note: {remark}." for remark in self.remarks]
        if self.conclusion:
            lines.append(self.conclusion)
        return Group(table, Text("\n".join(lines)))


def drop_between(before: FittedModel, after: FittedModel, measure: str) -> tuple[float, float]:
    """95 % interval of the relative drop of a held-out error from one fit to another."""
    first = 3 * before.dataset.groups.index(measure)
    old, new = (fit.held_out_residual[:, first : first + 3] for fit in (before, after))
    return drop_interval(old, new, before.dataset.block)


SAME_FIT = 0.05
"""Largest move of a parameter, as a share of the width of its interval, where a fit is repeated on the same flights."""

_Refit = TypeVar("_Refit", bound=Refit)


def fit(model: Model, dataset: Dataset) -> Refit:
    """Refit all parameters of `model` together; `before` is the model with its present parameters and fitted nuisances.

    Raises
    ------
    SettingsError
        The model holds no parameter that can be fitted.
    """
    if not free_parameters(model):
        held = ", ".join(effect.name for effect in model.effects) or "no effect"
        raise SettingsError(f"{model.name}: holds {held}, expected an effect with a parameter to fit")
    return refitted(Refit, model, fit_as_it_stands(model, dataset), fit_model(model, dataset))


def refitted(
    kind: type[_Refit],
    before_model: Model,
    before: FittedModel,
    after: FittedModel,
    added: bool = False,
    **further: Any,
) -> _Refit:
    """Build the result, of class `kind`, from the fits before and after a change of the model.

    With `added`, the last effect of the stack is new: its provenance has the errors without and with it. The others
    keep those of their own addition to these flights; after any other change, the error without an effect is not known.
    `further` are fields of the result.
    """
    dataset = after.dataset
    errors = before.held_out_rmse["total"], after.held_out_rmse["total"]
    known = {item.effect.name: item.fitted for item in before_model.stack}
    stack = []
    for i, effect in enumerate(after.model.effects):
        old = known.get(effect.name)
        without, with_it = None, errors[1]
        if added and effect is after.model.effects[-1]:
            without = errors[0]
        elif added and old is not None and old.logs == tuple(dataset.names) and old.rmse_after is not None:
            without, with_it = old.rmse_before, old.rmse_after
        provenance = Provenance(
            logs=tuple(dataset.names),
            rmse_before=without,
            rmse_after=with_it,
            held_out=True,
            ci95=after.ci95(i),
            height_m=dataset.heights_m,
            command_delay_s=_command_delay_s(dataset),
            software=f"quadctl {__version__}",
        )
        stack.append(StackedEffect(effect, provenance))
    model = replace(before_model, stack=tuple(stack))
    notes = after.remarks()
    if dataset.whole_flights:
        notes += _blind_folds(after)
    return kind(before_model, model, before, after, notes, **further)


def _command_delay_s(dataset: Dataset) -> tuple[float, float, float] | None:
    """Time from a command of the rotors to their thrust, with its 95 % interval, s; None where no flight has commands,
    but their speeds."""
    if any(flight.thrust_source == ROTOR_SPEED for flight in dataset.flights):
        return None
    late = dataset.flights[0].timing.rotor
    low, high = late.ci95
    return -late.value, -high, -low


def _blind_folds(fit: FittedModel) -> list[str]:
    """Remarks on folds of flights: parameters that all flights determine, but the fit without that fold does not."""
    dataset, effects = fit.dataset, fit.model.effects
    told = [f for f in fit.free if f not in undetermined(fit.free, fit.intervals)]
    values = values_of(fit.model, fit.free)
    found = []
    for number in dataset.folds:
        held = np.unique(dataset.flight_index[dataset.fold == number])
        others = np.setdiff1d(np.arange(len(dataset.flights)), held)
        draws = Fitter(fit.model, dataset.some(others)).bootstrap(Optimum(fit.model, fit.optimum.nuisances[others]))
        missed = [f for f in undetermined(fit.free, intervals(fit.free, values, draws)) if f in told]
        if missed:
            flights = " and ".join(dataset.names[i] for i in held)
            names = " and ".join(f"{f.parameter.name} of {effects[f.effect].name}" for f in missed)
            found.append(
                f"without {flights} the other flights do not determine {names}, so the held-out error of "
                f"{flights} is no test of {'it' if len(missed) == 1 else 'them'}"
            )
    return found
