"""Search for missing effects: the subset of the effects that explains most, all of them supported beside the others.

A linearised problem (`FirstOrder`) tells how well every subset would predict held-out data, so that the promising ones
alone are fitted. Of the subsets that hold, the best is taken, or a simpler one that the data do not tell from it; then
those that differ from it in one effect are fitted, and the best forms of every other family are tried on top of it and
of those that do about as well.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from quadctl.effects import Effect
from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.fitted_model import FittedModel, Solution, fit_model
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.flights.prediction import concerns, rmse
from quadctl.lab.selection.candidate import Candidate
from quadctl.lab.selection.first_order import FirstOrder
from quadctl.lab.selection.rule import (
    RULE,
    Rule,
    is_as_good,
    is_measured,
    is_plausible,
    is_significant,
    is_supported,
    score,
    shows_elsewhere,
    without_stand_ins,
)
from quadctl.lab.selection.subsets import Subset, Subsets, families
from quadctl.lab.selection.trial import not_fitted
from quadctl.model import Model

MOST_FITTED = 10
"""Largest number of subsets that are fitted because they explain most to first order."""
MOST_EXCHANGED = 6
"""Largest number of subsets that are fitted because they differ from the best in one effect, and explain as much to
first order."""
MOST_TURNS = 6
"""Largest number of exchanges of the best subset for a better one."""
HOPELESS = 0.1
"""p-value to first order, uncorrected, from which on an effect is not fitted on top of the best subset; a lag is in any
case, as a change of it is far from linear."""

Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class SelectionStep:
    """Selection step: the family added, and the held-out error with it."""

    family: str
    effect: str
    rmse: dict[str, float]


@dataclass(frozen=True, eq=False)
class Selection:
    """Effects that a fitted model is missing, with every trial."""

    start: FittedModel
    current: FittedModel
    """Fit of the start with all effects that were found."""
    steps: tuple[SelectionStep, ...]
    """Start, then one selection step for each missing family in the order of adding."""
    chosen: tuple[Candidate, ...] = ()
    """The effects that were found, each on top of those before it."""
    latest: Mapping[str, Candidate] = field(default_factory=dict)
    """Last trial of each effect, by its name."""
    beside: Mapping[str, float] = field(default_factory=dict)
    """p-value of each effect that was found beside all others, by its family."""
    confounded: tuple[tuple[str, str], ...] = ()
    """Pairs of families that these data do not distinguish: the one that was found, and the other."""
    rule: Rule = RULE

    @property
    def missing(self) -> tuple[str, ...]:
        return tuple(c.family for c in self.chosen)

    @property
    def dataset(self) -> Dataset:
        return self.start.dataset

    @property
    def residual(self) -> Floats:
        """Held-out residual of the current model, shape (n, 3 * groups)."""
        return self.current.held_out_residual


def search(start: FittedModel, pool: Sequence[type[Effect]], progress: Progress, rule: Rule = RULE) -> Selection:
    """Search `pool` for the effects that the fitted model `start` is missing."""
    subsets, first_order = Subsets(start, pool, rule), FirstOrder(start, pool, rule)
    held = _promising(subsets, first_order, progress)
    best, extended = _simplest(subsets, held), set[Subset]()
    for _ in range(MOST_TURNS):
        before = best
        progress(f"comparing with {_named(best)}")
        held += _exchanged(subsets, first_order, best)
        for subset in _as_good(subsets, held, _simplest(subsets, held)):
            if subset not in extended:
                extended.add(subset)
                held += _on_top(subsets, subset, progress)
        best = _simplest(subsets, held)
        if best == before:
            break
    return _with_one_for_two(subsets, first_order, _selection_of(subsets, best), best)


def _promising(subsets: Subsets, first_order: FirstOrder, progress: Progress) -> list[Subset]:
    """Subsets that hold, of those that explain most to first order, one of each set of families; the empty one is the
    first."""
    best: Subset = frozenset()
    held, least, tried = [best], subsets.rank(best), set[frozenset[str]]()
    for expected, subset in first_order.promising():
        enough = subsets.rank(best) + subsets.rule.equal_score
        if any(kept and families(kept) <= families(subset) and subsets.rank(kept) < enough for kept in held):
            continue  # what is left is tried on top of the best
        if len(tried) == MOST_FITTED:
            break
        is_worse = expected > max(least, subsets.rank(best)) + 2.0 * subsets.rule.equal_score
        if is_worse or families(subset) in tried or not first_order.all_help(subset):
            continue
        tried.add(families(subset))
        progress(f"fitting {_named(subset)}")
        kept = subsets.pruned(subset)
        held.append(kept)
        if subsets.rank(kept) < subsets.rank(best):
            best, least = kept, expected
    return held


def _exchanged(subsets: Subsets, first_order: FirstOrder, best: Subset) -> list[Subset]:
    """Subsets that hold, of those that differ from the best in one effect and do as well to first order, and of those
    with a constant in the place of an effect of a variable.

    An effect that explains less of the acceleration than another one in its place that is there, but too small to be
    missing, stands in for that.
    """
    rule, found = subsets.rule, []
    limit = first_order.score(best) + 2.0 * rule.equal_score
    for kind in subsets.in_order(best):
        rest = best - {kind}
        for other in subsets.pool:
            if other not in best and other.family() not in families(rest):
                constant = kind.if_constant == other.name
                expected = -math.inf if constant else first_order.score(rest | {other})
                found += [(expected, kind, other)] if expected < limit else []
    found = sorted(found, key=lambda each: each[0])[:MOST_EXCHANGED]
    error = score(subsets.fit(best).held_out_residual[:, :3], rule)
    for _, kind, other in found:
        instead = subsets.beside(best - {kind} | {other}, other)
        small = is_measured(instead, rule) and not is_supported(instead, rule)
        if small and not shows_elsewhere(subsets.beside(best, kind).effect):
            subsets.stand_ins |= {best} if score(instead.residual[:, :3], rule) < error else set()
    return [subsets.pruned(subset) for subset in (best, *(best - {kind} | {other} for _, kind, other in found))]


def _on_top(subsets: Subsets, best: Subset, progress: Progress) -> list[Subset]:
    """Subsets that hold, with one more effect than the best: of each family the forms that do best to first
    order, where that is better than noise. Of forms that do alike, one may be significant where another is not."""
    others = _others(subsets, best)
    first_order = FirstOrder(subsets.fit(best), others, subsets.rule)
    score_of = {kind: first_order.score(frozenset({kind})) for kind in others}
    least: dict[str, float] = {}
    for kind in sorted(others, key=score_of.__getitem__):
        least.setdefault(kind.family(), score_of[kind] + subsets.rule.equal_score)
    likely = [kind for kind in others if score_of[kind] < least[kind.family()]]
    tried = {}
    for number, kind in enumerate(likely, start=1):
        if kind.adds_lag or best | {kind} in subsets or first_order.p_value(kind) < HOPELESS:
            progress(f"trying {kind.name} beside {_named(best)}, {number} of {len(likely)}")
            tried[kind] = subsets.beside(best | {kind}, kind)
    supported = [c for c in tried.values() if is_supported(c, subsets.rule)]
    found = without_stand_ins(supported, list(tried.values()), subsets.rule)
    return [subsets.pruned(best | {kind}) for kind, c in tried.items() if c in found]


def _as_good(subsets: Subsets, held: Sequence[Subset], best: Subset) -> list[Subset]:
    """The best subset, and those of as many effects that do about as well: one more effect may part them."""
    limit = subsets.rank(best) + 2.0 * subsets.rule.equal_score
    as_large = (s for s in held if len(s) == len(best) and s not in subsets.stand_ins)
    return list(dict.fromkeys([best, *(subset for subset in as_large if subsets.rank(subset) < limit)]))


def _others(subsets: Subsets, best: Subset) -> list[type[Effect]]:
    """Effects of other families than those of a subset."""
    return [kind for kind in subsets.pool if kind.family() not in families(best)]


def _simplest(subsets: Subsets, held: Sequence[Subset]) -> Subset:
    """The best of the subsets that hold, or one of fewer effects or parameters, or with a constant in the place of an
    effect of a variable, that the data do not tell from it."""
    held = [subset for subset in held if subset not in subsets.stand_ins]
    widest = [subset for subset in held if not any(subset < other for other in held)]
    best = min(widest, key=subsets.rank)

    def does_as_well(subset: Subset) -> bool:
        equal = len(subset) == len(best) and subsets.rank(subset) < subsets.rank(best) + subsets.rule.equal_score
        return subset == best or ((len(subset) < len(best) or equal) and subsets.alike(best, subset))

    as_good = [subset for subset in widest if does_as_well(subset)]
    simplest = min(as_good, key=lambda s: (len(s), subsets.n_seen(s), subsets.rank(s)))
    constant = [s for s in widest if _is_constant_of(s, simplest) and subsets.alike(simplest, s)]
    return constant[0] if constant else simplest


def _is_constant_of(one: Subset, other: Subset) -> bool:
    """Tell whether a subset is another one with a constant in the place of an effect of a variable."""
    return one != other and [kind.name for kind in one - other] == [kind.if_constant for kind in other - one]


def _selection_of(subsets: Subsets, best: Subset) -> Selection:
    """Selection of a subset: the plausible effect that explains most beside those before it comes next."""
    start, rule = subsets.fit(frozenset()), subsets.rule
    steps = [SelectionStep("", start.fitter.model.name, start.held_out_rmse)]
    chosen: list[Candidate] = []
    added, left = frozenset[type[Effect]](), subsets.in_order(best)
    while left:
        tried = {kind: subsets.beside(added | {kind}, kind) for kind in left}
        kind = max(left, key=lambda kind: (is_plausible(tried[kind], rule), tried[kind].explained_m_s2))
        added |= {kind}
        left.remove(kind)
        chosen.append(tried[kind])
        steps.append(SelectionStep(kind.family(), tried[kind].effect.name, subsets.fit(added).held_out_rmse))
    return Selection(
        start,
        _in_order(subsets.fit(best), [c.family for c in chosen]),
        tuple(steps),
        tuple(chosen),
        {c.effect.name: c for c in [*_tried(subsets, best), *chosen]},
        {kind.family(): subsets.beside(best, kind).p_value for kind in subsets.in_order(best)},
        _confounded(subsets, best),
        rule,
    )


def _with_one_for_two(subsets: Subsets, first_order: FirstOrder, selection: Selection, best: Subset) -> Selection:
    """Selection, or that of a single effect that does as well as two, though these data do not distinguish it."""
    limit = first_order.score(best) + 2.0 * subsets.rule.equal_score
    singles = [frozenset({kind}) for kind in (_others(subsets, best) if len(best) == 2 else [])]
    for single in sorted(singles, key=first_order.score):
        (kind,) = single
        if (
            first_order.score(single) < limit
            and is_as_good(subsets.residual(single), selection.residual, selection.dataset, selection.rule)
            and is_plausible(c := subsets.beside(single, kind), selection.rule)
            and not c.distinct
        ):
            other = _selection_of(subsets, single)
            return replace(other, confounded=(*other.confounded, (c.family, selection.missing[-1])))
    return selection


def _in_order(fit: FittedModel, added: Sequence[str]) -> FittedModel:
    """The same fit with these families at the end of its stack, in this order."""

    def ordered(model: Model) -> Model:
        place = {family: number for number, family in enumerate(added)}
        return replace(model, stack=tuple(sorted(model.stack, key=lambda item: place.get(item.effect.family(), -1))))

    if not added:
        return fit
    optimum = replace(fit.optimum, model=ordered(fit.model))
    return Solution(ordered(fit.fitter.model), optimum, fit.held_out_residual).on(fit.dataset)


def _tried(subsets: Subsets, best: Subset) -> list[Candidate]:
    """Every effect that was not found: on top of a subset, or in the place of the one of its family."""
    found = []
    for kind in subsets.pool:
        rest = frozenset(own for own in best if own.family() != kind.family())
        fitted = rest | {kind} in subsets
        found.append(subsets.beside(rest | {kind}, kind) if fitted else not_fitted(kind, subsets.left(rest)))
    return found


def _confounded(subsets: Subsets, best: Subset) -> tuple[tuple[str, str], ...]:
    """Pairs of families that do as well in each other's place, and of which one makes the other needless."""
    found = []
    for kind in subsets.in_order(best):
        for other in _others(subsets, best):
            instead, both = best - {kind} | {other}, best | {other}
            if instead not in subsets or set(kind.corrects) & set(other.corrects) or not subsets.alike(best, instead):
                continue
            needed = both in subsets and is_plausible(subsets.beside(both, other), subsets.rule)
            if subsets.holds(instead, is_plausible) and not needed:
                found.append((kind.family(), other.family()))
    return tuple(dict.fromkeys(found))


def judged_beside(c: Candidate, selection: Selection) -> Candidate:
    """Candidate that was found; one that another effect hides has its p-value beside the others, and says so."""
    if is_significant(c.p_value, selection.rule):
        return c
    alone = f"alone it would not be significant (p {c.p_value:.2g}); beside the others it is"
    return replace(c, p_value=selection.beside[c.family], remarks=[*c.remarks, alone])


def _named(subset: Subset) -> str:
    return " + ".join(sorted(kind.name for kind in subset)) or "the model as it is"


def emptied(selection: Selection) -> Selection:
    """Selection without what was found but the errors of the accelerometer: the other effects do not explain the
    residual. Trials are kept."""
    kept = {effect.family() for effect in selection.current.model.effects if concerns(effect, "sensing")}
    chosen = tuple(c for c in selection.chosen if c.family in kept)
    missing = tuple(c.family for c in chosen)
    if missing == selection.missing:
        return selection
    stack = tuple(
        i
        for i in selection.current.model.stack
        if i.effect.family() not in selection.missing or i.effect.family() in kept
    )
    current = (
        fit_model(replace(selection.start.fitter.model, stack=stack), selection.dataset) if missing else selection.start
    )
    errors = rmse(current.held_out_residual, selection.dataset.groups)
    steps = (selection.steps[0], *(replace(step, rmse=errors) for step in selection.steps if step.family in missing))
    confounded = tuple(pair for pair in selection.confounded if pair[0] in missing)
    return replace(selection, current=current, steps=steps, chosen=chosen, confounded=confounded)
