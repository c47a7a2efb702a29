"""Search for missing effects: a path from a fitted model to one in which no supported effect is missing.

Forward selection tries every effect on top of the model, judges it on held-out data, adds the best supported one, and
repeats until none is supported. Pruning then removes effects that the later ones made superfluous. The search is
repeated without each effect found that has a rival, and a pair is replaced where one confounded effect explains as much
alone. A path is a value: each of these is a function from a path to a path.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from joblib import Parallel, delayed

from quadctl.effects import Effect
from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.fitted_model import FittedModel, fit_model
from quadctl.lab.fitting.form_errors import FormErrors
from quadctl.lab.fitting.initial_guesses import Unmodelled, is_hopeless
from quadctl.lab.fitting.significance import improvement_p_value
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.flights.prediction import concerns, rmse
from quadctl.lab.selection.candidate import Candidate
from quadctl.lab.selection.rule import (
    RULE,
    Rule,
    are_alike,
    choose,
    indistinct,
    is_as_good,
    is_look_alike,
    is_masked,
    is_needed,
    is_significant,
    is_supported,
    score,
    shows_in_moments,
    unbelievable,
    without_needless_differences,
    without_stand_ins,
)
from quadctl.lab.selection.trial import drops_of_unusual, not_fitted, try_effect

MOST_MASKED = 2
"""Largest number of effects with which a search begins although they are not significant alone."""

Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class SelectionStep:
    """Selection step: the family added, and the held-out error with it."""

    family: str
    effect: str
    rmse: dict[str, float]


@dataclass(frozen=True, eq=False)
class Path:
    """Path from a fitted model to one with more effects, with every trial."""

    start: FittedModel
    current: FittedModel
    """Fit of the start with all effects of the path."""
    steps: tuple[SelectionStep, ...]
    """Start, then one selection step for each missing family in the order of adding."""
    missing: tuple[str, ...] = ()
    chosen: tuple[Candidate, ...] = ()
    """All candidates that were added, including those that became superfluous later."""
    latest: Mapping[str, Candidate] = field(default_factory=dict)
    """Last trial of each effect, by its name."""
    at_start: Mapping[str, Candidate] = field(default_factory=dict)
    """Trial of each effect alone, on top of the start, by its name; empty before the first round."""
    confounded: tuple[tuple[str, str], ...] = ()
    """Pairs of families that these data do not distinguish: the one that was added, and the other."""
    implied: frozenset[str] = frozenset()
    """Families that were taken out because the other effects imply them, or explain all but a moment of them, though
    their part of a moment is left."""

    rule: Rule = RULE

    @property
    def dataset(self) -> Dataset:
        return self.start.dataset

    @property
    def passed_over(self) -> list[Candidate]:
        """Confounded effects of the first round: plausible, but not distinguished from another effect."""
        return [c for c in self.at_start.values() if is_look_alike(c, self.rule)]

    @property
    def first(self) -> list[Candidate]:
        """Supported candidates of the first round, the best first, and those that lack nothing but significance."""
        tried = list(self.at_start.values())
        return [*_supported_of(tried, self.rule), *(c for c in tried if is_masked(c, self.rule))]

    @property
    def n_seen(self) -> int:
        """Number of parameters, of all effects found, that these data show."""
        return sum(c.n_seen for c in self.chosen if c.family in self.missing)

    def restarted(self) -> "Path":
        """Path back at its start, with its trials."""
        return replace(begun_at(self.start, self.rule), latest=self.latest, at_start=self.at_start)

    @property
    def residual(self) -> Floats:
        """Held-out residual of the current model, shape (n, 3 * groups)."""
        return self.current.held_out_residual

    @property
    def score(self) -> float:
        return score(self.residual, self.rule)


class _Round(NamedTuple):
    """One round of trials on top of a path's current model."""

    path: Path
    """Path with the results of the trials."""
    supported: list[Candidate]
    """Supported candidates, the best first."""
    look_alikes: list[Candidate]


def search(start: FittedModel, pool: Sequence[type[Effect]], progress: Progress, rule: Rule = RULE) -> Path:
    """Search `pool` for the effects that the fitted model `start` is missing."""
    path = pruned(forward(begun_at(start, rule), pool, progress))
    path = with_one_dropped(with_masked_first(path, pool, progress), pool, progress)
    path = with_pair_replaced(path, pool, progress)
    return largest_first(with_other_variant(path, pool), len(pool))


def begun_at(start: FittedModel, rule: Rule = RULE) -> Path:
    """Path without any step."""
    name, errors = start.fitter.model.name, rmse(start.held_out_residual, start.dataset.groups)
    return Path(start, start, (SelectionStep("", name, errors),), rule=rule)


def forward(path: Path, pool: Sequence[type[Effect]], progress: Progress) -> Path:
    """Forward selection: add the best supported effect of `pool`, and try again, until none is supported."""
    alike: list[str] = []
    while True:
        told = _in_round(len(path.missing) + 1, progress)
        path, supported, look_alikes = _tried(path, pool, told)
        path = _with_confounded(path, alike, [*supported, *look_alikes])
        if not supported:
            return path
        chosen, alike = choose(supported, look_alikes, path.dataset, path.rule)
        path = taken(path, chosen)


def taken(path: Path, chosen: Candidate) -> Path:
    """Path with `chosen` added."""
    step = SelectionStep(chosen.family, chosen.effect.name, rmse(chosen.residual, path.dataset.groups))
    return replace(
        path,
        current=chosen.fit(path.dataset),
        steps=(*path.steps, step),
        missing=(*path.missing, chosen.family),
        chosen=(*path.chosen, chosen),
    )


def pruned(path: Path) -> Path:
    """Path without the effects that are no longer needed beside the others; the one added last stays."""
    for family in path.missing[:-1]:
        path = _without_superfluous(path, family)
    return path


def with_masked_first(path: Path, pool: Sequence[type[Effect]], progress: Progress) -> Path:
    """Path, or a better one that begins with an effect that is not significant alone.

    Two effects may each be the noise that hides the other one, such as a battery that sags and a ground effect. Where
    an effect explains more of the acceleration than any that is supported, and lacks nothing but significance, it is
    taken first, and stays only if it is needed beside what is found on top of it.
    """
    seen = [path.start.held_out_residual, *(c.residual for c in path.first if not is_masked(c, path.rule))]
    least = min(score(residual[:, :3], path.rule) for residual in seen)
    masked = [c for c in path.first if is_masked(c, path.rule) and score(c.residual[:, :3], path.rule) < least]
    for candidate in sorted(masked, key=lambda c: score(c.residual, path.rule))[:MOST_MASKED]:
        told = _prefixed(f"beginning with {candidate.effect.name}", progress)
        other = pruned(forward(taken(path.restarted(), candidate), pool, told))
        if candidate.family in other.missing and len(other.missing) > 1 and is_better(other, path):
            return pruned(forward(other, pool, progress))
    return path


def with_one_dropped(path: Path, pool: Sequence[type[Effect]], progress: Progress) -> Path:
    """Path, or a better one to which the search leads without one of the effects that were found.

    The effect that explains most alone may have a little of each of two others: a thrust that is too low everywhere and
    grows near the ground is first taken for a cable. The effect that was added last has had its rivals already.
    """
    for family in path.missing[:-1] or path.missing:
        if not _has_rival(path, family):
            continue
        others = [effect for effect in pool if effect.family() != family]
        other = path.restarted()
        for kind in (type(c.effect) for c in path.chosen if c.family in path.missing and c.family != family):
            other = taken(other, _trial(other, kind, len(pool)))
        other = pruned(forward(other, others, _prefixed(f"without {family}", progress)))
        if other.missing and is_better(other, path):
            return _with_exchange_in_doubt(pruned(forward(other, pool, progress)), path)
    return path


def _with_exchange_in_doubt(other: Path, path: Path) -> Path:
    """Path `other`, which took the place of `path`, with the one effect in which they differ, where the data do not
    tell the two apart."""
    new, old = set(other.missing) - set(path.missing), set(path.missing) - set(other.missing)
    if len(new) != 1 or len(old) != 1 or not are_alike(*_comparable(other, path), path.dataset, path.rule):
        return other
    pair = new.pop(), old.pop()
    known = pair in other.confounded or _correct_the_same(*pair, path)
    return other if known else replace(other, confounded=(*other.confounded, pair))


def _correct_the_same(one: str, other: str, path: Path) -> bool:
    """Tell whether two families that were tried correct the same number of the vehicle, one with a parameter more: that
    they do equally well is no doubt."""
    numbers = {c.family: set(c.effect.corrects) for c in path.latest.values()}
    return bool(numbers.get(one, set()) & numbers.get(other, set()))


def is_better(other: Path, path: Path) -> bool:
    """Tell whether one path explains more than another by effects that are all plausible, and significant beside each
    other, corrected for the number tried; with more effects, where the data tell the two apart. One that explains as
    much by fewer parameters is better, too."""
    found = (c for c in other.chosen if c.family in other.missing)
    if not _is_plausible(other) or not all(is_significant(judged_beside(c, other).p_value, path.rule) for c in found):
        return False
    new, old = _comparable(other, path)
    if 0 < len(path.missing) < len(other.missing) and are_alike(new, old, path.dataset, path.rule):
        return False
    simpler = len(other.missing) == len(path.missing) and other.n_seen < path.n_seen
    margin = path.rule.equal_score if simpler else -path.rule.equal_score
    return score(new, path.rule) < score(old, path.rule) + margin


def _comparable(one: Path, other: Path) -> tuple[Floats, Floats]:
    """Residuals of two paths that are compared: of the acceleration alone, where one path holds an effect that the
    other one only implies."""
    implied_by_other, implied_by_one = other.implied & set(one.missing), one.implied & set(other.missing)
    part = slice(0, 3) if implied_by_one or implied_by_other else slice(None)
    return one.residual[:, part], other.residual[:, part]


def _has_rival(path: Path, family: str) -> bool:
    """Tell whether another family explains at least half as much of the acceleration, alone, as one that was found."""
    explained = {c.family: c.explained_m_s2**2 for c in reversed(path.first)}
    least = path.rule.most * explained.get(family, 0.0)
    return any(other > least for name, other in explained.items() if name != family)


def with_pair_replaced(path: Path, pool: Sequence[type[Effect]], progress: Progress) -> Path:
    """Path, or a path to a single confounded effect of the first round that explains as much as the pair found."""
    for candidate in sorted(path.passed_over, key=lambda c: score(c.residual, path.rule)):
        if len(path.missing) != 2 or candidate.family in path.missing:
            continue
        other = taken(path.restarted(), candidate)
        if not is_as_good(other.residual, path.residual, path.dataset, path.rule):
            continue
        instead = f"with {candidate.effect.name} instead of {' and '.join(path.missing)}"
        other = pruned(forward(other, pool, _prefixed(instead, progress)))
        if other.missing == (candidate.family,):
            return replace(other, confounded=(*other.confounded, (candidate.family, path.missing[-1])))
    return path


def with_other_variant(path: Path, pool: Sequence[type[Effect]]) -> Path:
    """Path, or a path in which another variant of one effect makes one that was added later needless.

    The variant that explains most alone may be chosen by what else is missing: of a wind, the form of its drag. What it
    lacks then looks like an effect of its own.
    """
    for place, found in enumerate(path.chosen):
        others = [e for e in pool if e.family() == found.family and e is not type(found.effect)]
        if found.family not in path.missing or not others:
            continue
        for needless in [c.family for c in path.chosen[place + 1 :] if c.family in path.missing]:
            kept = [c for c in path.chosen if c.family in path.missing and c.family != needless]
            for variant in others:
                other = path.restarted()
                for kind in (variant if c is found else type(c.effect) for c in kept):
                    other = taken(other, _trial(other, kind, len(pool)))
                if other.score < path.score + path.rule.equal_score and _holds(other):
                    return other
    return path


def largest_first(path: Path, n_tried: int) -> Path:
    """Path with the same effects, those that explain most of the acceleration alone first, where the first explains
    less than half of what another one does.

    The search may come by a detour. An effect that is found beside the error of a thrust that is off would seem to
    explain a part of that error, or raise it.
    """
    found = [c for c in path.chosen if c.family in path.missing]
    alone = {c.family: path.at_start[c.effect.name].explained_m_s2 ** 2 for c in found}
    ordered = sorted(found, key=lambda c: alone[c.family], reverse=True)
    if not found or alone[found[0].family] >= path.rule.most * alone[ordered[0].family]:
        return path
    other = path.restarted()
    for kind in (type(c.effect) for c in ordered):
        other = taken(other, _trial(other, kind, n_tried))
    if other.score > path.score + path.rule.equal_score:  # that way leads to another minimum
        return path
    return replace(other, confounded=path.confounded, implied=path.implied)


def _holds(path: Path) -> bool:
    """Tell whether all effects of a path are plausible and needed beside each other, be each supported alone or not."""
    return _is_plausible(path) and all(_without_superfluous(path, family) is path for family in path.missing)


def _is_plausible(path: Path) -> bool:
    """Tell whether all effects of a path, beside each other, have parameters that are possible and determined."""
    fit, dataset = path.current, path.dataset
    if unbelievable(fit.model, dataset) | indistinct(fit.model, dataset):
        return False
    added = [i for i, effect in enumerate(fit.model.effects) if effect.family() in path.missing]
    return all(fit.determined(i) and not fit.at_bound(i) for i in added)


def emptied(path: Path) -> Path:
    """Path back at its start, with its trials, but for the errors of the accelerometer: the other effects found do not
    explain the residual."""
    kept = {effect.family() for effect in path.current.model.effects if concerns(effect, "sensing")}
    missing = tuple(family for family in path.missing if family in kept)
    if missing == path.missing:
        return path
    stack = tuple(
        i for i in path.current.model.stack if i.effect.family() not in path.missing or i.effect.family() in kept
    )
    current = fit_model(replace(path.start.fitter.model, stack=stack), path.dataset) if missing else path.start
    errors = rmse(current.held_out_residual, path.dataset.groups)
    steps = (path.steps[0], *(replace(step, rmse=errors) for step in path.steps if step.family in missing))
    confounded = tuple(pair for pair in path.confounded if pair[0] in missing)
    return replace(path, current=current, steps=steps, missing=missing, confounded=confounded)


def _tried(path: Path, pool: Sequence[type[Effect]], progress: Progress) -> _Round:
    """Try the families of `pool` that are not in the model: all of them on top of the start; later those that explain
    something to first order."""
    open_ = [effect for effect in pool if effect.family() not in path.missing]
    n_tried = len(pool) * (len(path.chosen) + 1)
    if path.current is path.start:
        begun = [] if path.at_start else _trials(open_, Unmodelled(path.start), n_tried, progress, path.rule)
        known = path.at_start or {c.effect.name: c for c in begun}
        tried = [known[effect.name] for effect in open_]
        path = replace(path, at_start=known)
    else:
        left = Unmodelled(path.current)
        hopeless = [effect for effect in open_ if is_hopeless(effect, left)]
        likely = [effect for effect in open_ if effect not in hopeless]
        tried = _trials(likely, left, n_tried, progress, path.rule) + [not_fitted(effect, left) for effect in hopeless]
    path = replace(path, latest={**path.latest, **{c.effect.name: c for c in tried}})
    return _Round(path, _supported_of(tried, path.rule), [c for c in tried if is_look_alike(c, path.rule)])


def _supported_of(tried: Sequence[Candidate], rule: Rule) -> list[Candidate]:
    """Supported candidates of a round, the best first."""
    supported = without_stand_ins([c for c in tried if is_supported(c, rule)], tried, rule)
    return sorted(without_needless_differences(supported, tried, rule), key=lambda c: score(c.residual, rule))


def _trial(path: Path, effect: type[Effect], n_tried: int) -> Candidate:
    """Trial of one effect on top of the current model of a path."""
    if path.current is path.start and effect.name in path.at_start:
        return path.at_start[effect.name]
    return try_effect(effect, Unmodelled(path.current), n_tried, path.rule)


def _trials(
    effects: Sequence[type[Effect]], left: Unmodelled, n_tried: int, progress: Progress, rule: Rule
) -> list[Candidate]:
    """Try each of `effects` by itself; parallel as `joblib.parallel_config` says, serial by default."""
    work = Parallel(return_as="generator")(delayed(try_effect)(effect, left, n_tried, rule) for effect in effects)
    tried = []
    began_s = time.monotonic()
    for number, (effect, candidate) in enumerate(zip(effects, work, strict=True), start=1):
        left_s = (time.monotonic() - began_s) / number * (len(effects) - number)
        progress(tried_in_words(effect.name, number, len(effects), left_s))
        tried.append(candidate)
    return tried


def tried_in_words(effect: str, number: int, count: int, left_s: float) -> str:
    """Progress within a round. Only the time of the round is known: whether another follows is decided at its end."""
    done = f"tried {effect}, {number} of {count}"
    return f"{done}; about {left_s:.0f} s left of this round, another may follow" if left_s >= 1.0 else done


def _in_round(number: int, progress: Progress) -> Progress:
    """Progress that names its round: the first, and one more after each effect that was found."""
    return _prefixed(f"round {number}", progress)


def _prefixed(what: str, progress: Progress) -> Progress:
    return lambda text: progress(f"{what}: {text}")


def _with_confounded(path: Path, alike: Sequence[str], still_needed: Sequence[Candidate]) -> Path:
    """Path with the pairs that did equally well, where the one left out is not needed once the other is in."""
    needed = {candidate.family for candidate in still_needed}
    others = [o for o in alike if o not in needed and not _correct_the_same(path.missing[-1], o, path)]
    return replace(path, confounded=(*path.confounded, *((path.missing[-1], other) for other in others)))


def _without_superfluous(path: Path, family: str) -> Path:
    """Path without `family`; unchanged where it is needed, or where other effects would become implausible without
    it."""
    dataset, model = path.dataset, path.current.model
    smaller, p_value = _beside(path, family)
    without = smaller.held_out_residual
    doubtful = unbelievable(smaller.model, dataset) | indistinct(smaller.model, dataset)
    doubtful -= unbelievable(model, dataset) | indistinct(model, dataset)
    (effect,) = (effect for effect in model.effects if effect.family() == family)
    needed = is_needed(effect, without, path.residual, p_value, path.rule)
    shows = _shows_beside(path, smaller, effect)
    implied = effect.implied_by(smaller.model.effects, [f.conditions for f in dataset.flights], model.vehicle)
    if (needed and shows and not implied) or doubtful:
        return path
    first, last = path.steps[:-1], path.steps[-1]
    steps = (*(step for step in first if step.family != family), replace(last, rmse=rmse(without, dataset.groups)))
    missing = tuple(name for name in path.missing if name != family)
    taken_out = path.implied | {family} if needed else path.implied
    return replace(path, current=smaller, steps=steps, missing=missing, implied=taken_out)


def _shows_beside(path: Path, smaller: FittedModel, effect: Effect) -> bool:
    """Tell whether an effect of the path shows in the moments beside the others, as it must: a thrust that it seemed to
    explain alone may be another one's. `smaller` is the fit without it."""
    tried = next(c for c in reversed(path.chosen) if c.family == effect.family())
    groups = path.dataset.groups
    beside = replace(
        tried,
        before=rmse(smaller.held_out_residual, groups),
        after=rmse(path.residual, groups),
        unusual=drops_of_unusual(smaller.unusual_moments, path.current.unusual_moments),
    )
    return shows_in_moments(beside, path.rule)


def _beside(path: Path, family: str) -> tuple[FittedModel, float]:
    """Fit without one effect of the path, and the p-value of that effect beside the others."""
    kept = tuple(item for item in path.current.model.stack if item.effect.family() != family)
    smaller = fit_model(replace(path.start.fitter.model, stack=kept), path.dataset)
    without = smaller.held_out_residual
    return smaller, improvement_p_value(without, without - path.residual, path.dataset, FormErrors.of(smaller))


def judged_beside(c: Candidate, path: Path) -> Candidate:
    """Candidate of a path: one that another effect hides has the p-value that it has beside the others, and says so."""
    if is_significant(c.p_value, path.rule):
        return c
    alone = f"alone it would not be significant (p {c.p_value:.2g}); beside the others it is"
    p_value = min(1.0, _beside(path, c.family)[1] * len(path.latest) * len(path.missing))
    return replace(c, p_value=p_value, remarks=[*c.remarks, alone])
