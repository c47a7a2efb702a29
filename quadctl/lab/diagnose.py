"""What is missing? Every effect of the catalogue is tried on top of the model and judged on data its fit did not see.

`missing` is built step by step: the best significant candidate is added, all parameters are refitted together, and the
rest are tried again, until nothing significant is left; then each family that has become superfluous once the others
are in is taken out again. Where an effect that these data do not tell from another would have needed fewer beside it,
it is taken.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from joblib import Parallel, delayed
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from quadctl.effects import Effect, every_effect
from quadctl.lab.arrays import Floats
from quadctl.lab.candidate import (
    MATERIAL,
    SIGNIFICANT,
    Candidate,
    indistinct,
    parameters_in_words,
    try_effect,
    unbelievable,
    unseen_score,
)
from quadctl.lab.data import Dataset, rmse
from quadctl.lab.fit import Fitter, judged
from quadctl.lab.flexible import flexible_residual
from quadctl.lab.flight import SPAN_UNITS
from quadctl.lab.formula import Symbolic
from quadctl.lab.parameters import free_parameters, intervals
from quadctl.lab.significance import difference_p_value, improvement_p_value
from quadctl.lab.starts import Unmodelled
from quadctl.lab.symbolic import explain
from quadctl.lab.tables import Result
from quadctl.lab.threads import one_blas_thread
from quadctl.model import Model

ALIKE = 0.05
"""Candidates whose held-out errors differ with a larger p-value cannot be told apart by these data."""
AS_GOOD = 0.01
"""Of families that cannot be told apart and come within this share of the best error, the simplest is taken."""
PROMISING = 0.05
"""Effects whose p-value was larger twice running are tried again only at the end, when all others are in."""
LARGE = 0.1
"""A share of the error of an axis that no noise lets a regression take off by chance."""
MOSTLY = 0.5
"""Where the effects found leave more than this share of what could be explained, they are not what is there."""

UNITS = {"total": "", "turning": " N m", "sensing": " (IMU)"}

Verdict = Literal["missing", "none", "unexplained"]


@dataclass(frozen=True, eq=False)
class Step:
    """One rung of the ladder: the family added, and the held-out error once it is in."""

    family: str
    effect: str
    rmse: dict[str, float]


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(Result):
    """What `diagnose` found."""

    model: Model
    dataset: Dataset
    verdict: Verdict
    ranking: list[Candidate]
    """First what is missing, each on top of those before it; then the others, each on top of what had been found when
    it was tried last."""
    missing: list[str]
    steps: list[Step]
    """The error ladder: the model as it is, then each missing family in the order of adding."""
    best: Model
    """The model with all missing effects, fitted on all data."""
    confounded: list[list[str]] = field(default_factory=list)
    suggested_mission: str | None = None
    untried: list[str] = field(default_factory=list)
    """Effects that these data could not tell from their look-alikes, and why."""
    unexplained: bool = False
    """After all missing effects are in, the logged variables still explain a part of the error that is worth it."""
    symbolic: Symbolic | None = None
    """The sparse expression of what is unexplained."""

    def to_dict(self) -> dict[str, Any]:
        return {
            "verdict": self.verdict,
            "ranking": [candidate.to_dict() for candidate in self.ranking],
            "missing": self.missing,
            "confounded": self.confounded,
            "suggested_mission": self.suggested_mission,
            "symbolic": self.symbolic.to_dict() if self.symbolic else None,
            "ladder": [{"family": s.family, "effect": s.effect, "rmse": s.rmse} for s in self.steps],
            "unexplained": self.unexplained,
            "untried": self.untried,
        }

    def __rich__(self) -> RenderableType:
        table = Table(title="What could be missing: what was found first, the rest on top of it", title_justify="left")
        table.add_column("effect", no_wrap=True)
        table.add_column("parameters [95 %]")
        table.add_column("held-out error", justify="right")
        table.add_column("change", justify="right", no_wrap=True)
        table.add_column("p", justify="right", no_wrap=True)
        for c in self.ranking:
            table.add_row(
                f"[bold]{c.effect.name}[/]" if c.supported else c.effect.name,
                parameters_in_words(c.effect, c.ci95),
                f"{c.before[c.measure]:.3f} -> {c.after[c.measure]:.3f}" + UNITS[c.measure],
                f"{-c.held_out_drop:+.1%}",
                "< 1e-4" if c.p_value < 1e-4 else f"{c.p_value:.2g}",
            )
        return Group(table, Text("\n".join(self.lines())), *([self.symbolic] if self.symbolic else []))

    def lines(self) -> list[str]:
        """The verdict in sentences."""
        lines = []
        if self.verdict == "none":
            lines.append("Nothing significant is missing: what is left is noise.")
        elif self.verdict == "unexplained":
            lines.append("Something is there, but no effect of the catalogue explains it.")
        else:
            lines.append("Missing, in the order of adding (held-out error, m/s^2):")
            before = self.steps[0].rmse["total"]
            for step in self.steps[1:]:
                total = step.rmse["total"]
                lines.append(f"  {step.effect}: {before:.4f} -> {total:.4f}")
                before = total
            if self.unexplained:
                lines.append("Even so, something is left that the variables explain and these effects do not.")
        lines += [f"These data cannot tell apart: {' and '.join(pair)}." for pair in self.confounded]
        lines += [f"Not tried: {reason}." for reason in self.untried]
        if self.suggested_mission:
            lines.append(f"To tell more, fly {self.suggested_mission}; `quadctl suggest` weighs all missions.")
        return lines


@one_blas_thread
def diagnose(
    model: Model,
    dataset: Dataset,
    candidates: Iterable[type[Effect]] | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> Diagnosis:
    """Rank what could be missing from `model`, judged on the parts of `dataset` that each fit did not see.

    `candidates` are by default the catalogue's effects and those of the model's own files; families that the model
    holds already are not tried again. `progress` is told in a few words what is being done.
    """
    pool = list(candidates if candidates is not None else every_effect(model.effect_files).values())
    present = {effect.family() for effect in model.effects}
    pool = [e for e in pool if e.family() not in present and e.candidate and e.applies_to(model.vehicle)]
    unfit = [e for e in pool if any(dataset.span(variable) < span for variable, span in e.needs.items())]
    search = _searched(_Search(model, dataset, [effect for effect in pool if effect not in unfit], progress))
    progress("looking at what is left")
    # What a small effect explains, less than what is called missing, is not unexplained.
    trims = [candidate.residual for candidate in search.latest.values() if candidate.seen and not candidate.supported]
    residual = min([search.residual, *trims], key=unseen_score)[:, :3]
    flexible = flexible_residual(residual, dataset)
    matters = _matters(residual, flexible, improvement_p_value(residual, flexible, dataset))
    symbolic = explain(residual, dataset) if matters else None
    # Many variables together find a little in noise now and then; what is there also has an expression, or is large.
    unexplained = matters and (symbolic is not None or _largest_gain(residual, residual - flexible) > LARGE)
    if unexplained and search.missing and _share_left(search.first_residual[:, :3], residual, flexible) > MOSTLY:
        search.forget()
    missing = search.missing
    first = [candidate for candidate in search.chosen if candidate.family in missing]
    shown = {candidate.effect.name for candidate in first}
    others = [candidate for name, candidate in search.latest.items() if name not in shown]
    return Diagnosis(
        model=model,
        dataset=dataset,
        verdict="missing" if missing else "unexplained" if unexplained else "none",
        ranking=[*_beside_each_other(first, search.current, dataset), *sorted(others, key=lambda c: -c.held_out_drop)],
        missing=missing,
        steps=search.steps,
        best=search.current,
        confounded=search.confounded,
        suggested_mission=_suggestion(search.latest, search.confounded, unfit),
        unexplained=unexplained,
        untried=_reasons(unfit, dataset),
        symbolic=symbolic,
    )


def _beside_each_other(chosen: list[Candidate], best: Model, dataset: Dataset) -> list[Candidate]:
    """The candidates with parameters and intervals as they come out of one fit of all of them."""
    if len(chosen) < 2:
        return chosen
    fitter = Fitter(best, dataset)
    fitted = fitter.fit()
    ci = intervals(fitter.free, fitter.bootstrap(fitted))
    families = [effect.family() for effect in fitted.model.effects]
    found = []
    for candidate in chosen:
        index = families.index(candidate.family)
        own = {f.parameter.name: c for f, c in zip(fitter.free, ci, strict=True) if f.effect == index}
        found.append(replace(candidate, effect=fitted.model.effects[index], ci95=own))
    return found


class _Search:
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
            # Look-alikes are those that did as well as the one chosen and are not needed once it is in.
            self._note(alike, {candidate.family for candidate in supported})
            chosen, alike = _choose(supported, self._look_alikes, self.dataset)
            self.passed_over = self.passed_over if self.chosen else self._look_alikes
            self.take(chosen)
        self._note(alike, set())
        for family in self.missing[:-1]:
            self._drop_if_superfluous(family)

    def begun_with(self, candidate: Candidate) -> "_Search":
        """Another search, with `candidate` taken first."""
        other = _Search(self.start, self.dataset, self.pool, self.progress)
        other.latest = dict(self.latest)
        other.take(candidate)
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

    def take(self, chosen: Candidate) -> None:
        self.current, self.residual = chosen.model, chosen.residual
        self.missing.append(chosen.family)
        self.chosen.append(chosen)
        self.steps.append(Step(chosen.family, chosen.effect.name, rmse(self.residual, self.dataset.groups)))

    def _note(self, alike: list[str], still_needed: set[str]) -> None:
        self.confounded += [[self.missing[-1], other] for other in alike if other not in still_needed]

    def _drop_if_superfluous(self, family: str) -> None:
        """Take a family out again where it is no longer needed now that the others are in."""
        kept = tuple(item for item in self.current.stack if item.effect.family() != family)
        smaller, without = judged(replace(self.start, stack=kept), self.dataset)
        p_value = improvement_p_value(without, without - self.residual, self.dataset)
        needed = p_value < SIGNIFICANT and _largest_gain(without, self.residual) > MATERIAL
        doubtful = unbelievable(smaller, self.dataset) | indistinct(smaller, self.dataset)
        doubtful -= unbelievable(self.current, self.dataset) | indistinct(self.current, self.dataset)
        if needed or doubtful:
            return
        self.current, self.residual = smaller, without
        self.missing = [name for name in self.missing if name != family]
        last = Step(self.steps[-1].family, self.steps[-1].effect, rmse(without, self.dataset.groups))
        self.steps = [*(step for step in self.steps[:-1] if step.family != family), last]


def _searched(search: _Search) -> _Search:
    """The search, run, or one that begins with what it passed over and explains as much by fewer effects."""
    search.run()
    for candidate in sorted(search.passed_over, key=lambda c: c.score):
        if len(search.missing) < 2 or candidate.family in search.missing:
            continue
        other = search.begun_with(candidate)
        if len(search.missing) > 2 or _as_good(other, search):  # in place of two it must do alone
            other.run()
        if len(other.missing) < len(search.missing) and _as_good(other, search):
            replaced = [family for family in search.missing if family not in other.missing]
            other.confounded.append([candidate.family, replaced[-1]])
            return other
    return search


def _as_good(one: _Search, other: _Search) -> bool:
    """Whether `one` leaves no more unseen error than `other`, to the percent and to what the data can tell."""
    worse_by = unseen_score(one.residual) - unseen_score(other.residual)
    alike = difference_p_value(other.residual, one.residual, other.dataset) > ALIKE
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


def _matters(residual: Floats, flexible: Floats, p_value: float) -> bool:
    """The flexible regression finds structure that is significant and worth explaining."""
    return p_value < SIGNIFICANT and _largest_gain(residual, residual - flexible) > MATERIAL


def _largest_gain(before: Floats, after: Floats) -> float:
    """Largest share taken off the RMSE of an axis."""
    return float(np.max(1.0 - np.sqrt(np.mean(after**2, axis=0) / np.maximum(np.mean(before**2, axis=0), 1e-18))))


def _suggestion(tried: dict[str, Candidate], confounded: list[list[str]], unfit: list[type[Effect]]) -> str | None:
    """The mission that shows best what these data leave open: look-alikes first, then what could not be tried."""
    by_family = {candidate.family: candidate.effect.mission for candidate in reversed(tried.values())}
    missions = [by_family[pair[-1]] for pair in confounded] + [effect.mission for effect in unfit]
    return missions[0] if missions else None


def _share_left(first: Floats, residual: Floats, flexible: Floats) -> float:
    """Of what could be explained of the first residual: the share that the effects found leave unexplained."""
    floor = float(np.sum((residual - flexible) ** 2))
    return (float(np.sum(residual**2)) - floor) / max(float(np.sum(first**2)) - floor, 1e-12)


def _reasons(unfit: list[type[Effect]], dataset: Dataset) -> list[str]:
    """Why these effects were not tried."""
    return [
        f"{effect.name} (to be told from others it takes {variable} over {span:g} {SPAN_UNITS[variable]}, "
        f"these data have {dataset.span(variable):.2g})"
        for effect in unfit
        for variable, span in effect.needs.items()
        if dataset.span(variable) < span
    ]
