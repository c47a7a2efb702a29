"""Trial of one effect: fit on top of a fitted model, and its held-out error."""

from dataclasses import replace

import numpy as np

from quadctl.effects import Effect
from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.fitted_model import FittedModel
from quadctl.lab.fitting.fitter import Fitter
from quadctl.lab.fitting.form_errors import FormErrors
from quadctl.lab.fitting.initial_guesses import Unmodelled, best_guesses
from quadctl.lab.fitting.nuisances import AGE, BOUND
from quadctl.lab.fitting.significance import improvement_p_value
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.flights.prediction import MOMENTS, rmse
from quadctl.lab.flights.timing import comes_too_early
from quadctl.lab.selection.candidate import LEAST_ERROR, Candidate
from quadctl.lab.selection.rule import RULE, Rule, indistinct, moment_drops, unbelievable
from quadctl.lab.threads import one_blas_thread

REALIGNED = 3
"""Largest number of iterations between the fit of a lag and the alignment of the flights for it."""


@one_blas_thread
def try_effect(effect: type[Effect], left: Unmodelled, n_tried: int, rule: Rule = RULE) -> Candidate:
    """Fit `effect` on top of the fitted model of `left`; `n_tried` is the number of candidates tried on these data."""
    fit, independent = fit_on_top(effect, left)
    return judged(fit, effect.family(), left, left.forms, n_tried * independent, rule)


@one_blas_thread
def judged(
    fit: FittedModel, family: str, left: Unmodelled, forms: FormErrors, n_tried: int, rule: Rule = RULE
) -> Candidate:
    """The effect of a family in a fitted model, judged beside the others; `left` is what the model leaves without it,
    `forms` the errors that the forms of the others may have, and `n_tried` the number of candidates, guesses included,
    that it was chosen from."""
    dataset, before, after, stack = left.dataset, left.residual, fit.held_out_residual, fit.model.stack
    place = [item.effect.family() for item in stack].index(family)
    effect, others = stack[place].effect, [*stack[:place], *stack[place + 1 :]]
    p_value = improvement_p_value(before, before - after, dataset, forms)
    flights = [flight.conditions for flight in dataset.flights]
    return Candidate(
        effect=effect,
        model=replace(fit.model, stack=(*others, stack[place])),
        ci95=fit.ci95(place),
        before=rmse(before, dataset.groups),
        after=rmse(after, dataset.groups),
        p_value=min(1.0, p_value * n_tried),
        residual=after,
        worst_flight=_worst_flight(before, after, dataset, rule),
        unusual=drops_of_unusual(left.unusual_moments, fit.unusual_moments),
        remarks=fit.remarks(place),
        believable=unbelievable(fit.model, dataset) <= unbelievable(left.model, dataset),
        distinct=effect.name not in indistinct(fit.model, dataset)
        and (not effect.adds_lag or _is_no_delay(before, after, dataset, rule)),
        implied=effect.implied_by([item.effect for item in others], flights, fit.model.vehicle),
        at_bound=fit.at_bound(place),
        determined=fit.determined(place),
        solution=fit.solution,
    )


def not_fitted(effect: type[Effect], left: Unmodelled) -> Candidate:
    """Candidate that explains nothing to first order on top of the fitted model of `left`: it changes no error."""
    start = effect.starts([flight.conditions for flight in left.dataset.flights], left.model.vehicle)[0]
    errors = rmse(left.residual, left.dataset.groups)
    return Candidate(
        effect=start,
        model=left.model.plus(start),
        ci95={},
        before=errors,
        after=errors,
        p_value=1.0,
        residual=left.residual,
        remarks=[],
        fitted=False,
        determined=False,
    )


def fit_on_top(effect: type[Effect], left: Unmodelled) -> tuple[FittedModel, int]:
    """Fit the model of `left` with `effect` on top, from the best initial guesses; also return the number of
    independent guesses.

    A motor lag and the delay of a log shift the thrust alike: where a fit has changed the delay much, the flights are
    aligned again for the lag that was found, and the fit is repeated.
    """
    guesses, independent = best_guesses(effect, left)
    fitters = [Fitter(left.model.plus(guess), left.dataset) for guess in guesses]
    fits = [fitter.fit() for fitter in fitters]
    objectives = [fitter.objective(fitted, left.scale) for fitter, fitted in zip(fitters, fits, strict=True)]
    best = objectives.index(min(objectives))
    fitter, fitted = fitters[best], fits[best]
    for _ in range(REALIGNED if effect.adds_lag else 0):
        if np.abs(fitted.nuisances[:, AGE]).max() < 0.5 * BOUND[AGE]:
            break
        fitter = Fitter(fitted.model, left.dataset)
        fitted = fitter.fit()
    return FittedModel(fitter, fitted, left.dataset.targets - fitter.held_out(fitted)), independent


def _is_no_delay(before: Floats, after: Floats, dataset: Dataset, rule: Rule) -> bool:
    """Tell whether a lag is told from the delays and the noise of sensors.

    Either the signals come too early for these, or the lag explains most of what a delay leaves of the vertical
    acceleration: a lag also weakens the noise in the rotor signal, and explains some of it by that alone.
    """
    most = rmse(after, dataset.groups)["up"] < rule.most * rmse(before, dataset.groups)["up"]
    return most or comes_too_early(dataset.flights[0].timing)


def drops_of_unusual(before: Floats | None, after: Floats | None) -> dict[str, float]:
    """Relative drop of the error of each moment (see `FittedModel.unusual_moments`); empty without moments."""
    if before is None or after is None:
        return {}
    sizes = (np.sqrt(np.mean(moments**2, axis=0)) for moments in (before, after))
    return {
        axis: 1.0 - float(new) / max(float(old), LEAST_ERROR) for axis, old, new in zip(MOMENTS, *sizes, strict=True)
    }


def _worst_flight(before: Floats, after: Floats, dataset: Dataset, rule: Rule) -> float:
    """Smallest drop of the error of a moment in a single flight (see `moment_drops`); 0 where none is negative."""
    if "turning" not in dataset.groups:
        return 0.0
    errors = [(rmse(before[part], dataset.groups), rmse(after[part], dataset.groups)) for part in dataset.parts]
    return min([0.0, *(drop for had, left in errors for drop in moment_drops(had, left, rule).values())])
