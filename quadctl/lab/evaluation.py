"""Evaluation of a model on flights: cross-validated, as it stands, or on flights held out of all fits."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

from quadctl.lab.arrays import Floats
from quadctl.lab.comparison.agreement import (
    Agreement,
    Errors,
    Fitted,
    agreement,
    flights_of_the_fit,
    least_alike,
    of_one_model,
)
from quadctl.lab.comparison.comparison import Comparison, compare, floor_on
from quadctl.lab.comparison.remainder import Remainder, remainder
from quadctl.lab.fitting.fitted_model import FittedModel, Solution, fit_as_it_stands, fit_model, is_fitted_to
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.flights.prediction import AXES, rmse
from quadctl.model import Model


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Errors of a model on flights: those that fits may use, and those held out of all fits."""

    comparison: Comparison
    """Comparison on the flights that fits may use, without a fit."""
    unseen: Comparison | None
    """Comparison on the flights held out of all fits."""
    kind: Literal["cross-validated", "as it stands", "held out"]
    """Kind of the error: cross-validated; of a model that was not fitted to all of the flights, as it stands; or on the
    flights held out of all fits."""
    errors_m_s2: dict[str, float]
    """Error by axis, and in total, m/s^2."""
    solution: Solution
    """Fit to the flights that fits may use."""
    by_flight: dict[str, dict[str, float]]
    """Error of each flight by its name, per axis and in total, m/s^2: of the same kind; where flights are held out of
    all fits, that of the model as it stands, on all flights alike."""
    agreement: Agreement | None
    """Agreement of the flights in these errors: of those held out of all fits with the others, else of the flight that
    differs most; None of a single flight."""
    remainder: Remainder
    """Explanation of `error_m_s2` by the logged variables."""

    @property
    def error_m_s2(self) -> float:
        """Total error."""
        return self.errors_m_s2["total"]

    @property
    def worst_axis(self) -> str:
        """Axis with the largest error."""
        return max(AXES, key=self.errors_m_s2.__getitem__)

    @property
    def floor_m_s2(self) -> float:
        judged = self.comparison if self.unseen is None else self.unseen
        return judged.noise_floor["total"]


def evaluate(model: Model, fit: FittedModel, unseen: Dataset | None = None) -> Evaluation:
    """Compute the errors of a model, with its fit to the flights that fits may use, there and on the `unseen`."""
    seen = compare(model, fit.dataset)
    on_unseen = None if unseen is None else compare(model, unseen)
    if on_unseen is not None:
        by_flight = _by_flight(seen.residual, seen.dataset) | _by_flight(on_unseen.residual, on_unseen.dataset)
        found = _held_out_agreement(model, seen, on_unseen)
        left = remainder(on_unseen.residual, on_unseen.dataset, on_unseen.noise_floor)
        return Evaluation(seen, on_unseen, "held out", on_unseen.rmse, fit.solution, by_flight, found, left)
    fitted = is_fitted_to(model, fit.dataset.names)
    judged = fit if fitted else fit_as_it_stands(model, fit.dataset)
    residual = judged.held_out_residual[:, :3]
    errors = Errors.of(residual, fit.dataset)
    predicts: Fitted = "others" if model.stack and fit.dataset.whole_flights else ""
    return Evaluation(
        seen,
        None,
        "cross-validated" if fitted else "as it stands",
        judged.held_out_rmse,
        fit.solution,
        _by_flight(residual, fit.dataset),
        least_alike(errors, predicts) if fitted else of_one_model(model, errors),
        remainder(residual, fit.dataset, seen.noise_floor),
    )


def errors_of(
    models: Sequence[Model],
    seen: Dataset,
    unseen: Dataset | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> list[tuple[float, float]]:
    """Error of each model, m/s^2, as `Evaluation.error_m_s2`, and its reference error on the same flights."""
    found = []
    for number, model in enumerate(models, start=1):
        progress(f"step {number} of {len(models)} on these flights")
        judged = (seen if unseen is None else unseen).aligned_for(model)
        residual = judged.residual(model)
        error = rmse(residual) if unseen is not None else _judging_fit(model, seen).held_out_rmse
        found.append((error["total"], floor_on(judged, residual)["total"]))
    return found


def _judging_fit(model: Model, seen: Dataset) -> FittedModel:
    """The fit whose held-out error is that of `model`: of all parameters, or of the per-flight biases alone where
    `model` was not fitted to these flights."""
    return fit_model(model, seen) if is_fitted_to(model, seen.names) else fit_as_it_stands(model, seen)


def _held_out_agreement(model: Model, seen: Comparison, unseen: Comparison) -> Agreement:
    """Agreement of the flights held out of all fits with the others, in the error of the model as it stands."""
    used, _ = flights_of_the_fit(model, ())
    known, new = (Errors.of(c.residual, c.dataset) for c in (seen, unseen))
    predicts = set(known.flights) <= set(used) and not set(new.flights) & set(used)
    return agreement(known, new, "these" if predicts else "")


def _by_flight(residual: Floats, dataset: Dataset) -> dict[str, dict[str, float]]:
    """Error of each flight, per axis and in total, m/s^2, from the residual acceleration, shape (n, at least 3)."""
    return {name: rmse(residual[part, :3]) for name, part in zip(dataset.names, dataset.parts, strict=True)}
