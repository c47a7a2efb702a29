"""The decision rule: every threshold by which an effect is called missing, harmful, distinct, material or alike.

A candidate holds data (`Candidate`); the predicates of this module decide. `docs/decision-rule.md` shows what happens
on hidden-effect cases when a threshold is moved.
"""

from collections.abc import Sequence

import numpy as np

from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.parameters import free_parameters
from quadctl.lab.fitting.significance import difference_p_value
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.flights.prediction import MOMENTS
from quadctl.lab.selection.candidate import Candidate
from quadctl.model import Model

# --- there at all -----------------------------------------------------------------------------------------------------

SIGNIFICANT = 0.01
"""Largest p-value of an effect that is there, after the correction for autocorrelation and for the number of candidates
(Bonferroni)."""
MATERIAL = 0.05
"""Least share that a missing effect takes off the held-out error of one axis: unknown trims and coefficients of any
real vehicle do as much as less."""

# --- moments ----------------------------------------------------------------------------------------------------------

HARMLESS = 0.01
"""Largest share that an effect on the moments may add to the held-out error of any of them,"""
HARMLESS_BESIDE = 0.2
"""or this share of what it takes off another moment: more is a stand-in for another effect."""
SHOWN = 0.01
"""Least share that an effect takes off the error of each moment that it must show in,"""
SHOWN_ALONE = 0.2
"""or this share where it must show in one moment only,"""
SHOWN_BESIDE = 0.2
"""and this share of what it takes off any axis: nuisances can hide as much of one moment as of another, and what lowers
the error of the thrust alone is another family."""

# --- alike ------------------------------------------------------------------------------------------------------------

ALIKE = 0.05
"""Least p-value of the difference between the held-out errors of two candidates that the data cannot tell apart."""
EQUAL_SCORE = 0.01
"""Largest difference of the scores (logarithms of the held-out error) of candidates that count as equally good: the
simplest of them is taken."""
REPLACED = 2
"""Number of found effects that one look-alike can replace when it explains as much alone. One for one is settled by the
score; beside three and more, a single effect that matches them all has more freedom than they have."""

# --- search -----------------------------------------------------------------------------------------------------------

PROMISING = 0.05
"""Largest p-value of an effect that is tried in every round: one that was above it twice running is tried again only
when all others have been (saves time, not a matter of the verdict)."""

# --- unexplained ------------------------------------------------------------------------------------------------------

LARGE = 0.1
"""Share of the error of an axis that a regression on noise never takes off by chance: so much is unexplained even where
no expression says it."""
MOSTLY = 0.5
"""Share of the explainable error beyond which the effects that were found are not what is there: nothing is called
missing then, all is unexplained."""


def is_significant(p_value: float) -> bool:
    """Tell whether a corrected p-value is small enough to speak of an effect."""
    return p_value < SIGNIFICANT


def is_material(before: Floats, after: Floats) -> bool:
    """Tell whether a change of the held-out residual, shape (n, axes), takes a material share off an axis."""
    return largest_gain(before, after) > MATERIAL


def is_harmful(c: Candidate) -> bool:
    """Tell whether a candidate that acts on the moments makes one of them worse.

    In all flights together, or in one flight by more than it helps in all of them, as a stand-in for another does.
    """
    drops = [c.drops.get(axis, 0.0) for axis in MOMENTS]
    overall = min(drops) < -max(HARMLESS, HARMLESS_BESIDE * max(drops))
    return c.effect.turns and (overall or c.worst_flight < -max(HARMLESS, *drops))


def shows_in_moments(c: Candidate) -> bool:
    """Tell whether a candidate lowers the error of every moment that its physics must show in, and worsens none."""
    shown = [c.drops.get(axis, 0.0) for axis in c.effect.shows_in(c.model.vehicle)]
    moments = [c.drops.get(axis, 0.0) for axis in MOMENTS]
    enough = max(SHOWN if len(shown) > 1 else SHOWN_ALONE, SHOWN_BESIDE * c.largest_drop)
    return not shown or (min(shown) > enough and min(moments) > -HARMLESS)


def is_determined(c: Candidate) -> bool:
    """Tell whether the data determine at least one parameter of a candidate, and none of them ran into a bound."""
    at_bound = any("bound" in remark for remark in c.remarks)
    undetermined = sum("not determined" in remark for remark in c.remarks)
    return not at_bound and (not c.ci95 or undetermined < len(c.ci95))


def is_there(c: Candidate) -> bool:
    """Tell whether held-out data show the effect of a candidate, be it as little as what is off in every vehicle."""
    helps = c.held_out_drop > 0.0 and not is_harmful(c) and is_significant(c.p_value)
    return helps and shows_in_moments(c) and c.believable and is_determined(c)


def is_plausible(c: Candidate) -> bool:
    """Tell whether a candidate would be supported if the data told it from its look-alikes."""
    return is_there(c) and c.largest_drop > MATERIAL and not c.effect.negligible()


def is_supported(c: Candidate) -> bool:
    """Tell whether held-out data support a candidate: it is there, more than a trim, and told from its look-alikes."""
    return c.distinct and is_plausible(c)


def is_look_alike(c: Candidate) -> bool:
    """Tell whether a candidate is plausible, but not told from something else by these data."""
    return is_plausible(c) and not c.distinct


def is_measured(c: Candidate) -> bool:
    """Tell whether a candidate is there and told from its look-alikes, be it too small to be called missing."""
    return c.distinct and is_there(c)


def is_promising(p_value: float) -> bool:
    """Tell whether an effect with this p-value in the last round is worth trying in the next."""
    return p_value <= PROMISING


def is_replaceable(missing: Sequence[str]) -> bool:
    """Tell whether one look-alike may replace all the families that were found."""
    return len(missing) == REPLACED


def is_needed(without: Floats, residual: Floats, p_value: float) -> bool:
    """Tell whether an effect is still needed beside the others, from the held-out residuals without and with it."""
    return is_significant(p_value) and is_material(without, residual)


def are_alike(one: Floats, other: Floats, dataset: Dataset) -> bool:
    """Tell whether the data cannot tell two held-out residuals apart."""
    return difference_p_value(one, other, dataset) > ALIKE


def is_as_good(one: Floats, other: Floats, dataset: Dataset) -> bool:
    """Tell whether the held-out residual `one` is no larger than `other`, as far as data can tell."""
    worse_by = score(one) - score(other)
    return worse_by < 0.0 or (worse_by < EQUAL_SCORE and are_alike(other, one, dataset))


def choose(
    supported: Sequence[Candidate], look_alikes: Sequence[Candidate], dataset: Dataset
) -> tuple[Candidate, list[str]]:
    """The candidate to add, and the other families that do as well, `look_alikes` among them.

    Each family stands with its best variant. Of families that are as good as the best, the one with the fewest
    parameters is taken. `supported` comes with the best first.
    """
    best = supported[0]
    every = [*supported, *look_alikes]
    leaders = [c for i, c in enumerate(every) if c.family not in {other.family for other in every[:i]}]
    alike = [c for c in leaders if c is best or are_alike(best.residual, c.residual, dataset)]
    as_good = [c for c in alike if is_supported(c) and score(c.residual) < score(best.residual) + EQUAL_SCORE]
    chosen = min(as_good, key=lambda c: (len(free_parameters(c.model)), score(c.residual)))
    return chosen, sorted({c.family for c in alike} - {chosen.family})


def is_unexplained(residual: Floats, flexible: Floats, p_value: float) -> bool:
    """Tell whether the logged variables explain a significant and material part of a held-out residual.

    `flexible` is the held-out prediction of the residual by a regression on the variables, shape (n, 3).
    """
    return is_significant(p_value) and is_material(residual, residual - flexible)


def is_large(residual: Floats, flexible: Floats) -> bool:
    """Tell whether a regression explains more of the residual than it ever does by chance."""
    return largest_gain(residual, residual - flexible) > LARGE


def is_mostly_left(first: Floats, residual: Floats, flexible: Floats) -> bool:
    """Tell whether the effects found leave most of what could be explained of the `first` residual."""
    floor = float(np.sum((residual - flexible) ** 2))
    left = (float(np.sum(residual**2)) - floor) / max(float(np.sum(first**2)) - floor, 1e-12)
    return left > MOSTLY


def score(residual: Floats) -> float:
    """Logarithm of the held-out RMSE of the acceleration, plus the mean logarithms of the other measured groups.

    Logarithms, so that forces and moments, with units of their own, add up.
    """
    power = np.maximum(np.mean(residual**2, axis=0), 1e-12)
    others = [float(np.log(power[i : i + 3]).mean()) for i in range(3, len(power), 3)]
    return 0.5 * (float(np.log(power[:3].sum())) + sum(others))


def largest_gain(before: Floats, after: Floats) -> float:
    """Largest share taken off the RMSE of an axis."""
    return float(np.max(1.0 - np.sqrt(np.mean(after**2, axis=0) / np.maximum(np.mean(before**2, axis=0), 1e-18))))


def unbelievable(model: Model, dataset: Dataset) -> set[str]:
    """Names of the effects of a fitted model whose parameters are not what they can be."""
    flights = [flight.conditions for flight in dataset.flights]
    return {effect.name for effect in model.acting if not effect.believable(flights, model.vehicle)}


def indistinct(model: Model, dataset: Dataset) -> set[str]:
    """Names of the effects of a fitted model that `dataset` does not tell from their look-alikes."""
    flights = [flight.conditions for flight in dataset.flights]
    return {effect.name for effect in model.acting if not effect.distinct(flights, model.vehicle)}
