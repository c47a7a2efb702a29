"""The walk from a model to one that lacks nothing the data can show.

Every effect is tried on top of the model and judged on data its fit did not see. The best significant one is added, all
parameters are refitted together, and the rest are tried again, until nothing significant is left; then each family that
has become superfluous once the others are in is taken out again. Where one effect, which these data do not tell from
another, explains as much as the two that were found, it is taken.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from joblib import Parallel, delayed

from quadctl.effects import Effect
from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.fitter import judged
from quadctl.lab.fitting.initial_guesses import Unmodelled
from quadctl.lab.fitting.parameters import free_parameters
from quadctl.lab.fitting.significance import difference_p_value, improvement_p_value
from quadctl.lab.flights.dataset import Dataset, rmse
from quadctl.lab.selection.candidate import (
    MATERIAL,
    SIGNIFICANT,
    Candidate,
    indistinct,
    try_effect,
    unbelievable,
    unseen_score,
)
from quadctl.model import Model

ALIKE = 0.05
"""Candidates whose held-out errors differ with a larger p-value cannot be told apart by these data."""
AS_GOOD = 0.01
"""Of families that cannot be told apart and come within this share of the best error, the simplest is taken."""
PROMISING = 0.05
"""Effects whose p-value was larger twice running are tried again only at the end, when all others are in."""


@dataclass(frozen=True, eq=False)
class Step:
    """One rung of the ladder: the family added, and the held-out error once it is in."""

    family: str
    effect: str
    rmse: dict[str, float]


class Search:
    """The walk from a model to one that lacks nothing the data can show."""

    def __init__(
        self, model: Model, dataset: Dataset, pool: list[type[Effect]], progress: Callable[[str], None]
    ) -> None:
        self.start = model
        self.dataset = dataset
        self.pool = pool
        self.progress = progress
        self.current, self.residual = judged(model, dataset)
        self.first_residual = self.residual
        self.steps = [Step("", model.name, rmse(self.residual, dataset.groups))]
        self.missing: list[str] = []
        self.chosen: list[Candidate] = []
        """Also those that turned out to be superfluous."""
        self.latest: dict[str, Candidate] = {}
        """Each effect as it was tried last, by name."""
        self._failures: dict[str, int] = {}
        """How often running each effect was of no use."""
        self.confounded: list[list[str]] = []
        self._look_alikes: list[Candidate] = []
        """Of the last round: what would be supported, if these data could tell it from something else."""
        self.passed_over: list[Candidate] = []
        """Those of the first round."""

    def run(self) -> None:
        """Add what is missing, take out what has become superfluous."""
        alike: list[str] = []
        while supported := self._supported():
            self._note(alike, supported)
            chosen, alike = _choose(supported, self._look_alikes, self.dataset)
            self.passed_over = self.passed_over if self.chosen else self._look_alikes
            self._take(chosen)
        self._note(alike, [])
        for family in self.missing[:-1]:
            self._drop_if_superfluous(family)

    def begun_with(self, candidate: Candidate) -> "Search":
        """Another search, with `candidate` taken first."""
        other = Search(self.start, self.dataset, self.pool, self.progress)
        other.latest = dict(self.latest)
        other._take(candidate)
        return other

    def forget(self) -> None:
        """Back to the beginning: what was found is not what is there."""
        self.current, self.residual = judged(self.start, self.dataset)
        self.steps, self.missing, self.confounded = self.steps[:1], [], []

    def _supported(self) -> list[Candidate]:
        """The candidates that the data support on top of the current model, the best first."""
        pool = [effect for effect in self.pool if effect.family() not in self.missing]
        left = Unmodelled(self.current, self.residual, self.dataset)
        self._look_alikes = []
        promising = [effect for effect in pool if self._failures.get(effect.name, 0) < 2]
        for effects in (promising, [effect for effect in pool if effect not in promising]):
            tried = self._try(effects, left)
            self._look_alikes += [c for c in tried if c.plausible and not c.distinct]
            supported = [candidate for candidate in tried if candidate.supported]
            if supported:
                return sorted(supported, key=lambda candidate: candidate.score)
        return []

    def _try(self, effects: list[type[Effect]], left: Unmodelled) -> list[Candidate]:
        """Try `effects`, each by itself: spread as `joblib.parallel_config` says, one after the other without."""
        work = Parallel(return_as="generator")(delayed(try_effect)(effect, left, len(self.pool)) for effect in effects)
        tried = []
        for effect, candidate in zip(effects, work, strict=True):
            self.progress(f"tried {effect.name}")
            self.latest[effect.name] = candidate
            failures = self._failures.get(effect.name, 0)
            self._failures[effect.name] = failures + 1 if candidate.p_value > PROMISING else 0
            tried.append(candidate)
        return tried

    def _take(self, chosen: Candidate) -> None:
        self.current, self.residual = chosen.model, chosen.residual
        self.missing.append(chosen.family)
        self.chosen.append(chosen)
        self.steps.append(Step(chosen.family, chosen.effect.name, rmse(self.residual, self.dataset.groups)))

    def _note(self, alike: list[str], supported: list[Candidate]) -> None:
        """Look-alikes are those that did as well as the one chosen and are not needed once it is in."""
        still_needed = {candidate.family for candidate in [*supported, *self._look_alikes]}
        self.confounded += [[self.missing[-1], other] for other in alike if other not in still_needed]

    def _drop_if_superfluous(self, family: str) -> None:
        """Take a family out again where it is no longer needed now that the others are in."""
        kept = tuple(item for item in self.current.stack if item.effect.family() != family)
        smaller, without = judged(replace(self.start, stack=kept), self.dataset)
        p_value = improvement_p_value(without, without - self.residual, self.dataset)
        needed = p_value < SIGNIFICANT and largest_gain(without, self.residual) > MATERIAL
        doubtful = unbelievable(smaller, self.dataset) | indistinct(smaller, self.dataset)
        doubtful -= unbelievable(self.current, self.dataset) | indistinct(self.current, self.dataset)
        if needed or doubtful:
            return
        self.current, self.residual = smaller, without
        self.missing = [name for name in self.missing if name != family]
        last = Step(self.steps[-1].family, self.steps[-1].effect, rmse(without, self.dataset.groups))
        self.steps = [*(step for step in self.steps[:-1] if step.family != family), last]


def searched(search: Search) -> Search:
    """The search, run, or one that found, in place of two effects, one it passed over that explains as much alone.

    Of two and no more: beside several others it would make up for what it is not: on real flights, for a thrust scale.
    """
    search.run()
    for candidate in sorted(search.passed_over, key=lambda c: c.score):
        if len(search.missing) != 2 or candidate.family in search.missing:
            continue
        other = search.begun_with(candidate)
        if _as_good(other.residual, search.residual, search.dataset):
            other.run()
            if other.missing == [candidate.family]:
                other.confounded.append([candidate.family, search.missing[-1]])
                return other
    return search


def _as_good(one: Floats, other: Floats, dataset: Dataset) -> bool:
    """Whether the unseen residual `one` is no larger than the `other`, to the percent and to what the data can tell."""
    worse_by = unseen_score(one) - unseen_score(other)
    alike = difference_p_value(other, one, dataset) > ALIKE
    return worse_by < 0.0 or (worse_by < AS_GOOD and alike)


def _choose(supported: list[Candidate], look_alikes: list[Candidate], dataset: Dataset) -> tuple[Candidate, list[str]]:
    """The best candidate, and the other families that do as well, `look_alikes` among them.

    Each family stands with its best variant. Of families that do as well as the best, to the percent and to what these
    data can tell, the one with the fewest parameters is taken.
    """
    best = supported[0]
    every = [*supported, *look_alikes]
    leaders = [c for i, c in enumerate(every) if c.family not in {other.family for other in every[:i]}]
    alike = [c for c in leaders if c is best or difference_p_value(best.residual, c.residual, dataset) > ALIKE]
    as_good = [c for c in alike if c.supported and c.score < best.score + AS_GOOD]
    chosen = min(as_good, key=lambda c: (len(free_parameters(c.model)), c.score))
    return chosen, sorted({c.family for c in alike} - {chosen.family})


def largest_gain(before: Floats, after: Floats) -> float:
    """Largest share taken off the RMSE of an axis."""
    return float(np.max(1.0 - np.sqrt(np.mean(after**2, axis=0) / np.maximum(np.mean(before**2, axis=0), 1e-18))))
