"""Search over subsets (prototype)."""

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from quadctl.effects import Effect
from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.fitted_model import FittedModel
from quadctl.lab.fitting.fitter import Fitter
from quadctl.lab.fitting.initial_guesses import MAX_GUESSES, Unmodelled, is_hopeless
from quadctl.lab.fitting.nuisances import AGE, BOUND
from quadctl.lab.fitting.significance import improvement_p_value
from quadctl.lab.flights.prediction import rmse
from quadctl.lab.selection.candidate import Candidate
from quadctl.lab.selection.linear import Form, Linearised
from quadctl.lab.selection.rule import (
    RULE,
    Rule,
    are_alike,
    indistinct,
    is_look_alike,
    is_plausible,
    is_supported,
    score,
    unbelievable,
)
from quadctl.lab.selection.search import Path, SelectionStep, begun_at
from quadctl.lab.selection.trial import (
    REALIGNED,
    _is_no_delay,
    _worst_flight,
    drops_of_unusual,
    fit_on_top,
    not_fitted,
)

DEBUG = bool(os.environ.get("SUBSETS_DEBUG"))
MOST_FITTED = 10
MOST_EXCHANGED = 6
Key = frozenset[type[Effect]]


class Subsets:
    """Fits of subsets of the pool, on top of a start, with what the rule judges them by."""

    def __init__(self, start: FittedModel, pool: Sequence[type[Effect]], rule: Rule) -> None:
        self.start, self.pool, self.rule = start, pool, rule
        self.dataset = start.dataset
        self.fits: dict[Key, FittedModel] = {frozenset(): start}
        self.with_implied: dict[Key, Key] = {}
        self.independent: dict[type[Effect], int] = {}
        self._left: dict[Key, Unmodelled] = {}
        self._beside: dict[tuple[Key, type[Effect]], Candidate] = {}
        self.conditions = [f.conditions for f in self.dataset.flights]
        self.n_starts = {k: len(k.starts(self.conditions, start.model.vehicle)) for k in pool}

    def left(self, key: Key) -> Unmodelled:
        if key not in self._left:
            self._left[key] = Unmodelled(self.fit(key))
        return self._left[key]

    def fit(self, key: Key, forms: Sequence[Form] = ()) -> FittedModel:
        if key not in self.fits:
            kinds = sorted(key, key=lambda k: (self.n_starts[k], self.pool.index(k)))
            last = kinds[-1]
            if True:
                fit, independent = fit_on_top(last, self.left(key - {last}))
                self.independent.setdefault(last, independent)
            self.fits[key] = fit
        return self.fits[key]

    def beside(self, key: Key, kind: type[Effect]) -> Candidate:
        """Candidate: an effect of a subset beside the others."""
        if (key, kind) not in self._beside:
            fit, left = self.fit(key), self.left(key - {kind})
            independent = self.independent.get(kind, min(self.n_starts[kind], len(np.unique(self.dataset.block))))
            self._beside[key, kind] = judged(fit, kind, left, len(self.pool) * len(key) * independent, self.rule)
        return self._beside[key, kind]

    def holds(self, key: Key, test: Callable[[Candidate, Rule], bool] = is_supported) -> bool:
        return all(test(self.beside(key, kind), self.rule) for kind in sorted(key, key=self.pool.index))

    def pruned(self, key: Key) -> Key:
        """The part of a subset that is left when the effects that do not help beside the others are taken out."""
        whole = key
        while key and not self.holds(key):
            failing = [k for k in key if not is_supported(self.beside(key, k), self.rule)]
            implied = [k for k in failing if is_supported(replace(self.beside(key, k), implied=False), self.rule)]
            out = min([k for k in failing if k not in implied] or implied, key=lambda k: self.score(key - {k}))
            key, whole = key - {out}, whole if out in implied else whole - {out}
        self.with_implied.setdefault(key, whole)
        return key

    def score(self, key: Key) -> float:
        return score(self.fit(key).held_out_residual, self.rule)

    def residual(self, key: Key) -> Floats:
        """Held-out residual of a subset and of what it implies."""
        return self.fit(self.with_implied.get(key, key)).held_out_residual

    def rank(self, key: Key) -> float:
        return score(self.residual(key), self.rule)


def judged(fit: FittedModel, kind: type[Effect], left: Unmodelled, n_tried: int, rule: Rule) -> Candidate:
    """Candidate: an effect of a fitted model, judged beside the fit without it."""
    dataset, residual, after = left.dataset, left.residual, fit.held_out_residual
    (place,) = [i for i, e in enumerate(fit.model.effects) if e.family() == kind.family()]
    effect = fit.model.effects[place]
    others = [e for i, e in enumerate(fit.model.effects) if i != place]
    stack = fit.model.stack
    model = replace(fit.model, stack=(*stack[:place], *stack[place + 1 :], stack[place]))
    return Candidate(
        effect=effect,
        model=model,
        ci95=fit.ci95(place),
        before=rmse(residual, dataset.groups),
        after=rmse(after, dataset.groups),
        p_value=min(1.0, improvement_p_value(residual, residual - after, dataset, left.forms) * n_tried),
        residual=after,
        worst_flight=_worst_flight(residual, after, dataset, rule),
        unusual=drops_of_unusual(left.unusual_moments, fit.unusual_moments),
        remarks=fit.remarks(place),
        believable=unbelievable(fit.model, dataset) <= unbelievable(left.model, dataset),
        distinct=effect.name not in indistinct(fit.model, dataset)
        and (not effect.adds_lag or _is_no_delay(residual, after, dataset, rule)),
        implied=effect.implied_by(others, [f.conditions for f in dataset.flights], fit.model.vehicle),
        at_bound=fit.at_bound(place),
        determined=fit.determined(place),
        solution=fit.solution,
    )


def worth_fitting(linear: Linearised, left: Unmodelled, rule: Rule) -> Iterator[tuple[float, Key]]:
    """Subsets all of whose effects help beside the others, to first order, the best first."""
    residuals: dict[tuple[int, ...], Floats] = {}

    def residual(subset: Sequence[Form]) -> Floats:
        key = tuple(f.fixed for f in subset)
        if key not in residuals:
            residuals[key] = linear.residual(subset)
        return residuals[key]

    def helps(subset: Sequence[Form], e: Form) -> bool:
        before, after = residual([f for f in subset if f is not e]), residual(subset)
        return improvement_p_value(before, before - after, left.dataset, left.forms) < rule.significant

    seen: set[frozenset[str]] = set()
    simplest_first = sorted(material(linear, rule), key=lambda x: x[0] + rule.equal_score * len(x[1]))
    for sc, s in simplest_first:
        named = frozenset(f.kind.family() for f in s)
        if named not in seen and all(helps(s, e) for e in s):
            seen.add(named)
            yield sc, frozenset(f.kind for f in s)


def material(linear: Linearised, rule: Rule) -> list[tuple[float, tuple[Form, ...]]]:
    """Subsets all of whose effects are material beside the others, to first order, the best first."""
    ranked = linear.best()
    subs: dict[tuple[int, ...], tuple[Form, ...]] = {}
    for _, s in ranked:
        for part in (s, *(tuple(f for f in s if f is not e) for e in s)):
            subs[tuple(f.fixed for f in part)] = part
    powers = dict(zip(subs, linear.powers(list(subs.values())), strict=True))

    def matters(s: tuple[Form, ...]) -> bool:
        after = powers[tuple(f.fixed for f in s)]
        for e in s:
            before = powers[tuple(f.fixed for f in s if f is not e)]
            drop = float(np.max(1.0 - np.sqrt(after / before)))
            gain = float(np.sqrt(max(np.max(before[:3] - after[:3]), 0.0)))
            if not (drop > 0.5 * rule.material or gain > 0.5 * rule.material_m_s2):
                return False
        return True

    return [(sc, s) for sc, s in ranked if matters(s)]


def families(key: Key) -> frozenset[str]:
    return frozenset(k.family() for k in key)


def search(start: FittedModel, pool: Sequence[type[Effect]], progress: Callable[[str], None], rule: Rule = RULE) -> Path:
    """Search the pool for the subset that the start is missing."""
    subsets = Subsets(start, pool, rule)
    linear = Linearised(start, pool)
    best: Key = frozenset()
    held: list[Key] = [best]
    fitted, first_order = 0, subsets.score(best)
    for sc, key in worth_fitting(linear, subsets.left(best), rule):
        if best and best < key or key in held:
            continue
        if fitted >= MOST_FITTED or sc > max(first_order, subsets.rank(best)) + 2 * rule.equal_score:
            break
        fitted += 1
        kept = subsets.pruned(key)
        if DEBUG:
            print("  tried", f"{sc:.3f} {subsets.score(key):.3f}", [k.name for k in key], [k.name for k in kept], round(subsets.score(kept), 3))
        if kept not in held:
            held.append(kept)
            if subsets.rank(kept) < subsets.rank(best):
                best, first_order = kept, sc
    best = simplest(subsets, held)
    tried: list[Candidate] = []
    for _ in range(6):
        held += exchanged(subsets, linear, best)
        best = simplest(subsets, held)
        left = subsets.left(best)
        kinds = [kind for kind in pool if kind.family() not in families(best)]
        tried = []
        for kind in kinds:
            if best | {kind} not in subsets.fits and is_hopeless(kind, left):
                tried.append(not_fitted(kind, left))
            else:
                tried.append(subsets.beside(best | {kind}, kind))
        more = [best | {kind} for kind, c in zip(kinds, tried, strict=True) if is_supported(c, rule)]
        more = [key for key in map(subsets.pruned, more) if key and key not in held]
        if DEBUG:
            print("  on top of", [k.name for k in best], [[k.name for k in m] for m in more])
        if not more:
            break
        held += more
        best = simplest(subsets, held)
    return path_to(subsets, best, held, tried)


def exchanged(subsets: Subsets, linear: Linearised, best: Key) -> list[Key]:
    """Subsets that differ from the best in one effect and do as well, to first order."""
    if not best:
        return []
    limit = linear.first_order(best) + 2 * subsets.rule.equal_score
    found = []
    for kind in best:
        rest = best - {kind}
        for other in subsets.pool:
            if other in best or other.family() in families(rest):
                continue
            key = rest | {other}
            sc = -np.inf if kind.if_constant == other.name else linear.first_order(key)
            if sc < limit:
                found.append((sc, key))
    kept = [subsets.pruned(key) for _, key in sorted(found, key=lambda x: x[0])[:MOST_EXCHANGED]]
    if DEBUG:
        print("  exchanged", [([k.name for k in key], round(subsets.rank(key), 3)) for key in kept])
    return [key for key in kept if key]


def simplest(subsets: Subsets, held: Sequence[Key]) -> Key:
    """The best of the subsets that hold, or a simpler one that the data do not tell from it."""
    rule = subsets.rule
    held = [key for key in held if not any(key < other for other in held)]
    best = min(held, key=subsets.rank)
    residual = subsets.residual(best)

    def n_seen(key: Key) -> int:
        return sum(subsets.beside(key, kind).n_seen for kind in key)

    def varying(key: Key) -> int:
        return sum(bool(kind.if_constant) for kind in key)

    def is_alike(key: Key) -> bool:
        if key == best:
            return True
        if len(key) > len(best) or not are_alike(residual, subsets.residual(key), subsets.dataset, rule):
            return False
        as_good = subsets.rank(key) < subsets.rank(best) + rule.equal_score
        return len(key) < len(best) or varying(key) < varying(best) or as_good

    alike = [key for key in held if is_alike(key)]
    if DEBUG:
        print("  alike", [([k.name for k in key], round(subsets.rank(key), 3)) for key in alike])
    return min(alike, key=lambda key: (len(key), varying(key), n_seen(key), subsets.rank(key)))


def path_to(subsets: Subsets, best: Key, held: Sequence[Key], tried: Sequence[Candidate]) -> Path:
    start, rule = subsets.start, subsets.rule
    path = begun_at(start, rule)
    alone = {k: subsets.beside(frozenset({k}), k) for k in best}
    order = sorted(best, key=lambda k: -alone[k].explained_m_s2)
    key: Key = frozenset()
    for kind in order:
        key = key | {kind}
        c = subsets.beside(key, kind)
        step = SelectionStep(c.family, c.effect.name, rmse(c.residual, path.dataset.groups))
        path = replace(path, current=subsets.fit(key), steps=(*path.steps, step), missing=(*path.missing, c.family), chosen=(*path.chosen, c))
    latest = {**{c.effect.name: c for c in path.chosen}, **{c.effect.name: c for c in tried}}
    return replace(path, latest=latest, confounded=tuple(confounded(subsets, best, order)))


def confounded(subsets: Subsets, best: Key, order: Sequence[type[Effect]]) -> list[tuple[str, str]]:
    rule, found = subsets.rule, {}
    residual = subsets.fit(best).held_out_residual
    for key in list(subsets.fits):
        mine, other = best - key, key - best
        if len(key) != len(best) or len(other) != 1:
            continue
        (a,), (b,) = mine, other
        if a.family() == b.family():
            continue
        if are_alike(residual, subsets.fit(key).held_out_residual, subsets.dataset, rule) and subsets.holds(key, is_plausible):
            more = best | {b}
            if subsets.holds(more, is_plausible) or set(a.corrects) & set(b.corrects):
                continue
            found[a.family(), b.family()] = None
    return list(found)
