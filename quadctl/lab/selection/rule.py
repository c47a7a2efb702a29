"""The decision rule: every threshold by which an effect is called missing, harmful, distinct, material or alike.

A candidate holds data (`Candidate`) and a `Rule` the thresholds; the predicates of this module decide.
`docs/decision-rule.md` shows what happens on hidden-effect cases when a threshold is moved.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from quadctl.effects import Effect
from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.significance import difference_p_value
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.flights.prediction import GROUPS, MOMENTS, concerns
from quadctl.lab.selection.candidate import LEAST_ERROR, Candidate
from quadctl.lab.selection.coincidence import coincides, is_of_wrong_height
from quadctl.model import Model


@dataclass(frozen=True)
class Rule:
    """Thresholds of the decision."""

    # there at all
    significant: float = 0.01
    """Largest p-value of a significant effect, corrected for autocorrelation and for the number of candidates
    (Bonferroni)."""
    material: float = 0.05
    """Least relative drop of the held-out error of one axis by a missing effect: unknown trims and coefficients of any
    real vehicle cause drops up to this."""
    material_m_s2: float = 0.1
    """Acceleration explained on one axis above which an effect is material however noisy the log is: 1 % of g, as trims
    of 0.6 degrees or a thrust that is off by 1 % make."""
    least_m_s2: float = 0.03
    """Least acceleration that counts on any axis, 0.3 % of g: attitudes are off by 0.2 degrees, and rotor speeds by
    0.15 %, as the motion goes, and quiet logs show what this does."""
    most: float = 0.5
    """Share from which on a part is most of the whole. Of the error of an axis: an effect that explains it is missing
    even if it is as small as on any vehicle; a lag that explains it is no delay; a prediction from time alone that
    explains it is no noise, as real flights drift by less. Of the squared acceleration of an effect: what explains as
    much is its rival. Of the explainable error: effects that leave as much are rejected, and all is unexplained."""

    # moments
    visible: float = 0.01
    """Least relative change of the held-out error of a moment that counts: a drop shows the effect, where it must show
    in several; a rise makes it harmful."""
    beside: float = 0.2
    """Share of the largest drop that a change of another axis is compared to. An effect that raises the error of a
    moment by more stands in for another one. One that lowers the error of a moment in which it must show by less
    belongs to another family: nuisances can explain as much of a moment. The same for the thrust, of an effect that
    must show there and whose moments others have, too; and of the whole error, where it must show in one moment
    only."""
    least_share_of_moment: float = 0.1
    """Least error of a moment, as a share of the error of all three, to which a change of it is compared."""

    # alike
    alike: float = 0.05
    """Least p-value of the difference between the held-out errors of two candidates that the data do not
    distinguish."""
    equal_score: float = 0.01
    """Largest difference of the scores (logarithms of the held-out error) of candidates that count as equally good: the
    simplest of them is taken."""

    # unexplained
    trim_m_s2: float = 0.07
    """Acceleration by a trim of 0.4 degrees, the standard deviation of those of real vehicles (`KINDS`), and more than
    a thrust that is off by 0.5 % makes: attitudes that are off by as much depend on speed, acceleration and heading,
    and so does the error that they leave. A smaller dependence is not called unexplained."""
    large: float = 0.1
    """Relative drop of an axis' error that a regression on noise never reaches by chance: a larger one is unexplained
    even without an expression."""


RULE = Rule()
"""Rule by which all results are made; a study passes another one."""


def is_significant(p_value: float, rule: Rule = RULE) -> bool:
    """Tell whether a corrected p-value is significant."""
    return p_value < rule.significant


def is_material(effect: Effect, largest_drop: float, explained_m_s2: float, rule: Rule = RULE) -> bool:
    """Tell whether an effect that lowers the error of an axis by this share, and explains this acceleration, matters.

    What shows in the moments or in the accelerometer, and a lag, of which a delay explains most, may explain little.
    """
    may_be_small = shows_elsewhere(effect) or effect.adds_lag
    counts = may_be_small or explained_m_s2 > rule.least_m_s2
    return (counts and largest_drop > rule.material) or explained_m_s2 > rule.material_m_s2


def shows_elsewhere(effect: Effect) -> bool:
    """Tell whether an effect shows in the moments or in the accelerometer, too."""
    return concerns(effect, "turning") or concerns(effect, "sensing")


def is_harmful(c: Candidate, rule: Rule = RULE) -> bool:
    """Tell whether a candidate that acts on the moments makes one of them worse.

    Either in all flights together, or in one flight by more than it helps in all, as a stand-in for another effect
    does.
    """
    drops = _moment_drops(c, rule)
    overall = min(drops) < -max(rule.visible, rule.beside * max(drops))
    return c.effect.affects_moment and (overall or c.worst_flight < -max(rule.visible, *drops))


def moment_drops(before: Mapping[str, float], after: Mapping[str, float], rule: Rule = RULE) -> dict[str, float]:
    """Drop of the error of each moment by a change, relative to that error, or to `least_share_of_moment` of the error
    of all three where that is larger; a rise also relative to the moment that the change explains. So a moment that was
    right to a fraction of the others has no veto."""
    least = max(rule.least_share_of_moment * before["turning"], LEAST_ERROR)
    explained = math.sqrt(sum(max(before[axis] ** 2 - after[axis] ** 2, 0.0) for axis in MOMENTS))
    scale = {axis: max(before[axis], least, explained if after[axis] > before[axis] else 0.0) for axis in MOMENTS}
    return {axis: (before[axis] - after[axis]) / scale[axis] for axis in MOMENTS}


def _moment_drops(c: Candidate, rule: Rule = RULE) -> list[float]:
    """Drop of the held-out error of each moment (see `moment_drops`); 0 where the effect acts on none."""
    acts = "turning" in c.after and any(axis in c.drops for axis in MOMENTS)
    return list(moment_drops(c.before, c.after, rule).values()) if acts else [0.0, 0.0, 0.0]


def shows_in_moments(c: Candidate, rule: Rule = RULE) -> bool:
    """Tell whether a candidate lowers the error of every moment that its physics must show in, and worsens neither roll
    nor pitch; and that of the thrust, where it must show there too: by `beside` of its largest drop where it
    need not show in a certain moment. What a nuisance takes of a moment beyond the usual counts as its error: a centre
    of mass that is off by millimetres could stand for every fault of a vehicle with short arms.

    Of several moments a centre of mass that is off may hide all but one, where the thrust shows the effect as well. Yaw
    may get a little worse (see `is_harmful`): a damaged propeller loses another share of its drag than of its thrust.
    """
    axes, up = c.effect.shows_in(c.model.vehicle), c.drops.get("up", 0.0)
    shown = [max(c.drops.get(axis, 0.0), c.unusual.get(axis, 0.0)) for axis in axes if axis in MOMENTS]
    least = rule.visible if shown else max(rule.visible, rule.beside * c.largest_drop)
    if "up" in axes and up < least:
        return False
    if not shown:
        return True
    enough = max(rule.visible if len(shown) > 1 else rule.beside, rule.beside * c.largest_drop)
    one_is_hidden = len(shown) > 1 and max(shown) > rule.beside and up > rule.material
    return (min(shown) > enough or one_is_hidden) and min(_moment_drops(c, rule)[:2]) > -rule.visible


def is_there(c: Candidate, rule: Rule = RULE) -> bool:
    """Tell whether held-out data show the effect of a candidate, even if it is too small to be called missing: it
    helps, and its parameters are possible."""
    helps = c.held_out_drop > 0.0 and not is_harmful(c, rule) and shows_in_moments(c, rule)
    return is_significant(c.p_value, rule) and helps and c.believable and c.determined and not c.at_bound


def is_trim(c: Candidate, rule: Rule = RULE) -> bool:
    """Tell whether a candidate is significant, but no larger than the per-flight biases of any real vehicle."""
    return c.held_out_drop > 0.0 and is_significant(c.p_value, rule) and is_usual(c, rule)


def is_usual(c: Candidate, rule: Rule = RULE) -> bool:
    """Tell whether an effect is as small as on any vehicle, and not most of the error of the acceleration."""
    return c.effect.negligible() and max(c.drops.get(axis, 0.0) for axis in GROUPS["total"]) < rule.most


def is_plausible(c: Candidate, rule: Rule = RULE) -> bool:
    """Tell whether a candidate would be supported if the data distinguished it from its confounded effects."""
    material = is_material(c.effect, c.largest_drop, c.explained_m_s2, rule)
    return is_there(c, rule) and material and not is_usual(c, rule) and not c.implied


def is_supported(c: Candidate, rule: Rule = RULE) -> bool:
    """Tell whether held-out data support a candidate: it is there, larger than a trim, and not a confounded effect."""
    return c.distinct and is_plausible(c, rule)


def is_measured(c: Candidate, rule: Rule = RULE) -> bool:
    """Tell whether a candidate is there and distinguished from its confounded effects, even if too small to be called
    missing."""
    return c.distinct and is_there(c, rule)


def without_stand_ins(supported: Sequence[Candidate], tried: Sequence[Candidate], rule: Rule = RULE) -> list[Candidate]:
    """Supported candidates that explain more of the acceleration than any that is there, but too small to be missing.

    Where the best explanation is an exponent of the thrust within the usual, a battery that explains less stands in for
    it. What shows in the moments or in the accelerometer is judged by these.
    """
    small = [c for c in tried if is_measured(c, rule) and not is_supported(c, rule)]
    least = min((score(c.residual[:, :3], rule) for c in small), default=math.inf)
    elsewhere = [c for c in supported if shows_elsewhere(c.effect)]
    return [c for c in supported if c in elsewhere or score(c.residual[:, :3], rule) < least]


def are_alike(one: Floats, other: Floats, dataset: Dataset, rule: Rule = RULE) -> bool:
    """Tell whether the data do not distinguish two held-out residuals."""
    return difference_p_value(one, other, dataset) > rule.alike


def is_as_good(one: Floats, other: Floats, dataset: Dataset, rule: Rule = RULE) -> bool:
    """Tell whether the held-out residual `one` is not significantly larger than `other`."""
    worse_by = score(one, rule) - score(other, rule)
    return worse_by < 0.0 or (worse_by < rule.equal_score and are_alike(other, one, dataset, rule))


def is_unexplained(residual: Floats, flexible: Floats, p_value: float, rule: Rule = RULE) -> bool:
    """Tell whether the logged variables explain a significant and material part of a held-out residual: more than the
    trims of any flight.

    `flexible` is the held-out prediction of the residual by a regression on the variables, shape (n, 3).
    """
    left = residual - flexible
    more_than_trims = explained_m_s2(residual, left) > rule.trim_m_s2
    return is_significant(p_value, rule) and largest_gain(residual, left) > rule.material and more_than_trims


def is_large(residual: Floats, flexible: Floats, rule: Rule = RULE) -> bool:
    """Tell whether a regression explains more of the residual than is possible by chance."""
    return largest_gain(residual, residual - flexible) > rule.large


def is_mostly_drift(residual: Floats, drift: Floats, rule: Rule = RULE) -> bool:
    """Tell whether most of the error of an axis is a function of time: noise does not drift by so much.

    `drift` is the held-out prediction of the residual from time, shape (n, 3).
    """
    return largest_gain(residual, residual - drift) > rule.most


def is_mostly_left(first: Floats, residual: Floats, flexible: Floats, rule: Rule = RULE) -> bool:
    """Tell whether the effects found leave most of what could be explained of the `first` residual."""
    floor = float(np.sum((residual - flexible) ** 2))
    left = (float(np.sum(residual**2)) - floor) / max(float(np.sum(first**2)) - floor, 1e-12)
    return left > rule.most


def score(residual: Floats, rule: Rule = RULE) -> float:
    """Logarithm of the held-out RMSE of the acceleration, plus the mean logarithms of the other measured groups.

    Logarithms make forces and moments, which have different units, comparable. An axis counts as no less than
    `least_share_of_moment` of its group: a yaw moment that is right to a hundredth of the others would decide alone.
    """
    return score_of_power(np.mean(residual**2, axis=0), rule)


def score_of_power(power: Floats, rule: Rule = RULE) -> float:
    """Score of the mean square of each axis (see `score`), shape (axes,)."""
    power = np.maximum(power, 1e-12)
    groups = [power[i : i + 3] for i in range(3, len(power), 3)]
    others = [float(np.log(np.maximum(p, rule.least_share_of_moment**2 * p.sum())).mean()) for p in groups]
    return 0.5 * (float(np.log(power[:3].sum())) + sum(others))


def largest_gain(before: Floats, after: Floats) -> float:
    """Largest relative drop of the RMSE of an axis."""
    return float(np.max(1.0 - np.sqrt(np.mean(after**2, axis=0) / np.maximum(np.mean(before**2, axis=0), 1e-18))))


def explained_m_s2(before: Floats, after: Floats) -> float:
    """Root mean square of the acceleration by which a residual is smaller, on the axis where it is largest."""
    explained = np.mean(before[:, :3] ** 2 - after[:, :3] ** 2, axis=0)
    return math.sqrt(max(float(explained.max()), 0.0))


def unbelievable(model: Model, dataset: Dataset) -> set[str]:
    """Names of the effects of a fitted model whose parameters are not physically plausible."""
    flights = [flight.conditions for flight in dataset.flights]
    return {effect.name for effect in model.acting if not effect.believable(flights, model.vehicle)}


def indistinct(model: Model, dataset: Dataset) -> set[str]:
    """Names of the effects of a fitted model that `dataset` does not distinguish from their confounded effects."""
    flights = [flight.conditions for flight in dataset.flights]
    return {
        effect.name
        for effect in model.acting
        if not effect.distinct(flights, model.vehicle)
        or coincides(effect, dataset)
        or is_of_wrong_height(effect, dataset)
    }
