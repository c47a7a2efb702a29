"""Subsets of the effects that a model may be missing: their fits, and each effect judged beside the others."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace

import numpy as np

from quadctl.effects import Effect
from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.fitted_model import FittedModel
from quadctl.lab.fitting.form_errors import FormErrors
from quadctl.lab.fitting.initial_guesses import Unmodelled
from quadctl.lab.selection.candidate import Candidate
from quadctl.lab.selection.rule import Rule, are_alike, indistinct, is_supported, score, unbelievable
from quadctl.lab.selection.trial import fit_on_top, judged

Subset = frozenset[type[Effect]]


class Subsets:
    """Fits of subsets of `pool` on top of a fitted model; each is made once."""

    def __init__(self, start: FittedModel, pool: Sequence[type[Effect]], rule: Rule) -> None:
        self.pool, self.rule, self.dataset = pool, rule, start.dataset
        self.stand_ins: set[Subset] = set()
        """Subsets with an effect that stands in for a better one that is too small to be missing."""
        self._fits: dict[Subset, FittedModel] = {frozenset(): start}
        self._left: dict[Subset, Unmodelled] = {}
        self._judged: dict[tuple[Subset, type[Effect]], Candidate] = {}
        self._with_implied: dict[Subset, Subset] = {}
        flights = [flight.conditions for flight in self.dataset.flights]
        blocks = len(np.unique(self.dataset.block))
        self._starts = {kind: min(len(kind.starts(flights, start.model.vehicle)), blocks) for kind in pool}
        self._independent: dict[Subset, dict[type[Effect], int]] = {frozenset(): {}}

    def __contains__(self, subset: Subset) -> bool:
        return subset in self._fits

    def fit(self, subset: Subset) -> FittedModel:
        """Fit of a subset; the effect with most initial guesses is added last."""
        if subset not in self._fits:
            last = max(subset, key=lambda kind: (self._starts[kind], self.pool.index(kind)))
            before = subset - {last}
            self._fits[subset], independent = fit_on_top(last, self.left(before))
            self._independent[subset] = self._independent[before] | {last: independent}
        return self._fits[subset]

    def left(self, subset: Subset) -> Unmodelled:
        """Part of the data that a subset leaves."""
        if subset not in self._left:
            self._left[subset] = Unmodelled(self.fit(subset))
        return self._left[subset]

    def beside(self, subset: Subset, kind: type[Effect]) -> Candidate:
        """One effect of a subset, judged beside the others."""
        if (subset, kind) not in self._judged:
            fit, left = self.fit(subset), self.left(subset - {kind})
            n_tried = len(self.pool) * len(subset) * self._independent[subset][kind]
            # A constant is no error of the form of a variable's effect: how much of one is implied is known apart.
            varying = [other.name for other in subset if other.if_constant == kind.name]
            forms = FormErrors.of(self.fit(subset - {kind}), known=varying) if varying else left.forms
            self._judged[subset, kind] = judged(fit, kind.family(), left, forms, n_tried, self.rule)
        return self._judged[subset, kind]

    def holds(self, subset: Subset, test: Callable[[Candidate, Rule], bool] = is_supported) -> bool:
        """Tell whether every effect of a subset is supported, or passes another test, beside the others."""
        return all(self._passes(subset, kind, test) for kind in self.in_order(subset))

    def in_order(self, subset: Subset) -> list[type[Effect]]:
        """Effects of a subset in the order of the pool, which is the same in every run."""
        return [kind for kind in self.pool if kind in subset]

    def _passes(self, subset: Subset, kind: type[Effect], test: Callable[[Candidate, Rule], bool]) -> bool:
        passes = test(self.beside(subset, kind), self.rule) or self._passes_without_stand_ins(subset, kind, test)
        return passes and not self._differs_needlessly(subset, kind)

    def _passes_without_stand_ins(
        self, subset: Subset, kind: type[Effect], test: Callable[[Candidate, Rule], bool]
    ) -> bool:
        """Tell whether an effect passes beside those of the others that are as plausible without it: the rest explain
        what is its own where it is left out."""
        stand_ins = self._doubtful(subset - {kind}) - self._doubtful(subset)
        return bool(stand_ins) and test(self.beside(subset - stand_ins, kind), self.rule)

    def _doubtful(self, subset: Subset) -> Subset:
        """Effects of a subset whose values are not plausible, or not told from those of confounded effects."""
        model = self.fit(subset).model
        doubtful = unbelievable(model, self.dataset) | indistinct(model, self.dataset)
        return frozenset(kind for kind in subset if kind.name in doubtful)

    def _differs_needlessly(self, subset: Subset, kind: type[Effect]) -> bool:
        """Tell whether the values of an effect differ from flight to flight, where the same family, supported or not,
        does as well with values that are common to all flights."""
        if not kind.only_of_several_flights or not (alike := self._with_common(subset, kind)):
            return False
        return self.score(alike) < self.score(subset) + self.rule.equal_score

    def _with_common(self, subset: Subset, kind: type[Effect]) -> Subset:
        """Subset with common values in the place of those of each flight; empty where the family has no such effect."""
        common = [k for k in self.pool if k.family() == kind.family() and not k.only_of_several_flights]
        return min((subset - {kind} | {k} for k in common), key=self.score, default=frozenset())

    def pruned(self, subset: Subset) -> Subset:
        """The part of a subset that holds, when one after the other is taken out that does not; what the others imply
        is the last."""
        explains = subset
        while subset and (subset in self.stand_ins or not self.holds(subset)):
            needless = [kind for kind in subset if self._differs_needlessly(subset, kind)]
            if needless:
                subset = explains = self._with_common(subset, needless[0])
                continue
            failing = [k for k in self.in_order(subset) if not self._passes(subset, k, is_supported)]
            failing = failing or self.in_order(subset)
            implied = [k for k in failing if self._is_only_implied(self.beside(subset, k))]
            other = [k for k in failing if k not in implied]
            out = min(other or implied, key=lambda kind: self.score(subset - {kind}))
            subset = subset - {out}
            explains = subset if other else explains  # what implied the others may have gone
        self._with_implied.setdefault(subset, explains)
        return subset

    def _is_only_implied(self, c: Candidate) -> bool:
        return c.implied and is_supported(replace(c, implied=False), self.rule)

    def score(self, subset: Subset) -> float:
        """Score of the held-out residual of a subset (see `rule.score`)."""
        return score(self.fit(subset).held_out_residual, self.rule)

    def residual(self, subset: Subset) -> Floats:
        """Held-out residual of a subset with the effects that it implies, by which subsets are compared."""
        return self.fit(self._with_implied.get(subset, subset)).held_out_residual

    def rank(self, subset: Subset) -> float:
        """Score of a subset with the effects that it implies."""
        return score(self.residual(subset), self.rule)

    def alike(self, one: Subset, other: Subset) -> bool:
        """Tell whether the data do not distinguish two subsets."""
        return are_alike(self.residual(one), self.residual(other), self.dataset, self.rule)

    def n_seen(self, subset: Subset) -> int:
        """Number of parameters of a subset that these data show."""
        return sum(self.beside(subset, kind).n_seen for kind in subset)


def families(subset: Collection[type[Effect]]) -> frozenset[str]:
    return frozenset(kind.family() for kind in subset)
