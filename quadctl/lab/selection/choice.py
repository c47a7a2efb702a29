"""Choice of the effects that a fitted model is missing: the search, and what it leaves unexplained."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from quadctl.effects import Effect, every_effect
from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.fitted_model import FittedModel
from quadctl.lab.fitting.flexible_regression import drift_of, flexible_residual
from quadctl.lab.fitting.form_errors import FormErrors
from quadctl.lab.fitting.significance import improvement_p_value
from quadctl.lab.flights.channels import ROTOR_SPEED
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.selection.rule import (
    RULE,
    Rule,
    is_large,
    is_measured,
    is_mostly_drift,
    is_mostly_left,
    is_supported,
    is_unexplained,
    score,
)
from quadctl.lab.selection.search import Selection, emptied, search
from quadctl.lab.symbolic.formula import Symbolic
from quadctl.lab.symbolic.identification import explain


@dataclass(frozen=True, eq=False)
class Choice:
    """Effects that were chosen, with all that the choice rests on."""

    selection: Selection
    unfit: list[type[Effect]]
    """Effects that were not tried because these data do not distinguish them from their confounded effects."""
    unexplained: bool
    """True where the logged variables explain a significant and material part of what the effects leave."""
    symbolic: Symbolic | None
    """Sparse expression of that part."""


def choose_effects(
    fit: FittedModel, candidates: Iterable[type[Effect]] | None, progress: Callable[[str], None], rule: Rule = RULE
) -> Choice:
    """Choose the effects that a fitted model is missing, of `candidates` or of all that are known to the model."""
    model, dataset = fit.fitter.model, fit.dataset
    pool = list(candidates if candidates is not None else every_effect(model.effect_files).values())
    present = {effect.family() for effect in model.effects}
    pool = [e for e in pool if e.family() not in present and e.candidate and e.applies_to(model.vehicle)]
    if any(flight.thrust_source == ROTOR_SPEED for flight in dataset.flights):
        pool = [effect for effect in pool if not effect.only_without_rotor_speeds]
    if len(dataset.flights) == 1:
        pool = [effect for effect in pool if not effect.only_of_several_flights]
    unfit = [e for e in pool if any(dataset.span(variable) < span for variable, span in e.needs.items())]
    pool = [effect for effect in pool if effect not in unfit]
    selection = search(fit, pool, progress, rule)
    progress("analysing the remaining error")
    # The part explained by an effect that is too small to be called missing is not unexplained.
    small = [c.residual for c in selection.latest.values() if is_measured(c, rule) and not is_supported(c, rule)]
    left = min([selection.residual, *small], key=lambda residual: score(residual, rule))
    residual, sensed = left[:, :3], by_accelerometer(left, dataset)
    flexible = flexible_residual(residual, dataset, dataset.causes)
    forms = FormErrors.of(selection.current)
    drift = drift_of(residual, dataset)

    def is_sensed(explained: Floats) -> bool:
        return sensed is None or bool(np.var(sensed - explained, axis=0).sum() < np.var(sensed, axis=0).sum())

    matters = is_unexplained(residual, flexible, improvement_p_value(residual, flexible, dataset, forms), rule)
    matters = matters and is_sensed(flexible)
    drifts = is_mostly_drift(residual, drift, rule) and is_sensed(drift)
    symbolic = explain(residual, dataset) if matters or drifts else None
    # A regression on many variables may explain a little of pure noise; a real cause has an expression or is large.
    unexplained = drifts or (matters and (symbolic is not None or is_large(residual, flexible, rule)))
    if drifts:
        flexible = min(flexible, drift, key=lambda explained: score(residual - explained, rule))
    if unexplained and selection.missing and is_mostly_left(fit.held_out_residual[:, :3], residual, flexible, rule):
        selection = emptied(selection)
    return Choice(selection, unfit, unexplained, symbolic)


def by_accelerometer(residual: Floats, dataset: Dataset) -> Floats | None:
    """Residual of the acceleration where the accelerometer tells it, north, east, up, shape (n, 3), from that of all
    targets; None without one. What only the velocity shows is an error of it or of the attitude, and no force."""
    if "sensing" not in dataset.groups:
        return None
    first = 3 * dataset.groups.index("sensing")
    found = residual[:, :3].copy()
    for flight, part in zip(dataset.flights, dataset.parts, strict=True):
        told = flight.doubted_axes if not flight.tells_force else (0, 1, 2)
        by_velocity = [axis for axis in range(3) if axis not in told]
        found[part, by_velocity] += residual[part, first : first + 3][:, by_velocity]
    return found
