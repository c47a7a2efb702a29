"""Errors on data that a fit has not seen and, where the search is repeated without them, that the choice has not seen.

A search that tries many effects finds those that suit its data, held-out parts included: the error of its result on
these parts is too small (Cawley & Talbot 2010, J. Mach. Learn. Res. 11). An outer cross-validation repeats the whole
search for each part that it judges, so that its error has seen neither the fit nor the choice (Varma & Simon 2006, BMC
Bioinformatics 7). What it judges is the way in which the model was found, not the one model that was found.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from quadctl.effects import Effect
from quadctl.lab.arrays import Floats, Mask
from quadctl.lab.finding import Finding, Kind
from quadctl.lab.fitting.fitted_model import FittedModel, fit_model
from quadctl.lab.fitting.fitter import Fitter
from quadctl.lab.fitting.nuisances import KINDS, predicted_with
from quadctl.lab.flights.dataset import Dataset, HoldOut
from quadctl.lab.flights.prediction import measured_targets, rmse
from quadctl.lab.selection.choice import choose_effects
from quadctl.model import Model

DATA = {"blocks": "blocks of time", "flights": "whole flights"}
"""Held-out data in words."""


@dataclass(frozen=True)
class UnseenError:
    """Held-out error of a model, without and with the effects that it is missing."""

    hold_out: HoldOut
    """Data that each fit has not seen."""
    before: dict[str, float]
    """RMSE of the model as given, per axis and group."""
    after: dict[str, float]
    """RMSE with the effects found."""
    searches: int = 0
    """Number of searches, each without the data on which it was judged; 0: the choice has seen all data."""
    found: dict[str, int] = field(default_factory=dict)
    """Number of these searches that found each family."""

    @property
    def change(self) -> dict[str, float]:
        """Error of the acceleration before and after, m/s^2."""
        return {"before": self.before["total"], "after": self.after["total"]}

    def to_dict(self) -> dict[str, Any]:
        return {
            "hold_out": self.hold_out,
            "choice_repeated": self.searches > 0,
            "rmse_before": self.before["total"],
            "rmse_after": self.after["total"],
            "unit": "m/s^2",
            "searches": self.searches,
            "found": self.found,
        }


def held_out_errors(start: FittedModel, found: FittedModel) -> list[UnseenError]:
    """Errors of two models, without and with what was found, on blocks of time and, of several flights, on whole
    flights.

    The choice of the effects has seen all data.
    """
    errors = {
        h: [rmse(_held_out(fit, h), fit.dataset.groups) for fit in (start, found)] for h in _hold_outs(start.dataset)
    }
    return [UnseenError(h, before, after) for h, (before, after) in errors.items()]


def nested_errors(
    model: Model, dataset: Dataset, candidates: Iterable[type[Effect]] | None, progress: Callable[[str], None]
) -> list[UnseenError]:
    """Errors of `model`, and of the model that a search finds without the data on which it is judged.

    The parts of the data are the folds of `dataset`; of several flights both the blocks and the flights. The timing of
    the channels is that of all flights.
    """
    kinds = None if candidates is None else list(candidates)
    return [_nested(model, replace(dataset, hold_out=h), kinds, progress) for h in _hold_outs(dataset)]


def of_unseen(errors: Sequence[UnseenError], any_missing: bool) -> list[Finding]:
    """Findings on the errors; about a choice that has seen all data only where it found something."""
    repeated = [error for error in errors if error.searches]
    if any_missing and not repeated:
        of_flights = [Finding(Kind.WHOLE_FLIGHTS, e.change) for e in errors if e.hold_out == "flights"]
        return [*of_flights, Finding(Kind.SEEN_BY_CHOICE)]
    return [
        Finding(Kind.UNSEEN_BY_CHOICE, {**e.change, "data": DATA[e.hold_out], "searches": e.searches, "found": e.found})
        for e in repeated
    ]


def _hold_outs(dataset: Dataset) -> list[HoldOut]:
    return ["blocks", "flights"] if len(dataset.flights) > 1 else ["blocks"]


def _held_out(fit: FittedModel, hold_out: HoldOut) -> Floats:
    """Held-out residual of a fit; folds of another kind than those of its dataset are fitted."""
    dataset = replace(fit.dataset, hold_out=hold_out)
    if dataset.whole_flights == fit.dataset.whole_flights:
        return fit.held_out_residual
    return np.asarray(dataset.targets - Fitter(fit.fitter.model, dataset).held_out(fit.optimum))


def _nested(
    model: Model, dataset: Dataset, candidates: Sequence[type[Effect]] | None, progress: Callable[[str], None]
) -> UnseenError:
    before, after = np.empty_like(dataset.targets), np.empty_like(dataset.targets)
    found: Counter[str] = Counter()
    for turn, number in enumerate(dataset.folds, start=1):
        held = dataset.fold == number
        progress(f"search {turn} of {len(dataset.folds)} without {DATA[dataset.hold_out]}")
        selection = choose_effects(fit_model(model, dataset.samples(~held)), candidates, lambda text: None).selection
        found.update(selection.missing)
        for residual, fit in ((before, selection.start), (after, selection.current)):
            residual[held] = _residual_of(fit, dataset, held)
    errors = [rmse(residual, dataset.groups) for residual in (before, after)]
    return UnseenError(dataset.hold_out, errors[0], errors[1], len(dataset.folds), dict(found.most_common()))


def _residual_of(fit: FittedModel, dataset: Dataset, held: Mask) -> Floats:
    """Residual of the samples `held` of `dataset`, which `fit` has not seen, shape (n, 3 * groups).

    A flight of which the fit has seen a part keeps the nuisances found there; those of another flight are at the mean
    of their prior.
    """
    has_lag = bool(fit.fitter.model.late().stack)
    in_fit = zip(fit.flights, fit.optimum.nuisances, strict=True)
    residuals = []
    for flight, part in zip(dataset.flights, dataset.parts, strict=True):
        own = held[part]
        as_seen, nuisance = (None, np.zeros(len(KINDS))) if own.all() else next(in_fit)
        if not own.any():
            continue
        delay_s = flight.delay_s
        if has_lag:  # The delay beside a motor lag is that of the fit; without one it is that of the preparation.
            delay_s = fit.flights[0].timing.rotor.value if as_seen is None else as_seen.delay_s
        unseen = flight.with_rotor_delay(max(delay_s, fit.flights[0].timing.earliest_s)).some(own)
        predicted = predicted_with(fit.model, unseen, nuisance, dataset.groups)
        residuals.append(measured_targets(unseen, dataset.groups) - predicted)
    return np.concatenate(residuals)
