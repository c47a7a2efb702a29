"""What is missing? Every effect of the catalogue is tried on top of the model; data that no fit saw decide."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from rich import box
from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from quadctl.effects import Effect, every_effect
from quadctl.lab.arrays import Floats
from quadctl.lab.comparison.noise_floor import flexible_residual
from quadctl.lab.fitting.fitter import Fitter
from quadctl.lab.fitting.parameters import intervals
from quadctl.lab.fitting.significance import improvement_p_value
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.flights.flight import SPAN_UNITS
from quadctl.lab.results import Result
from quadctl.lab.selection.candidate import (
    MATERIAL,
    SIGNIFICANT,
    Candidate,
    parameters_in_words,
    unseen_score,
)
from quadctl.lab.selection.search import Search, Step, largest_gain, searched
from quadctl.lab.symbolic.formula import Symbolic
from quadctl.lab.symbolic.identification import explain
from quadctl.lab.threads import one_blas_thread
from quadctl.model import Model

LARGE = 0.1
"""A share of the error of an axis that no noise lets a regression take off by chance."""
MOSTLY = 0.5
"""Where the effects found leave more than this share of what could be explained, they are not what is there."""

UNITS = {"total": "", "turning": " N m", "sensing": " (IMU)"}

Verdict = Literal["missing", "none", "unexplained"]


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
        title = "What could be missing: what was found first, the rest on top of it"
        table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAVY, show_edge=False, padding=0)
        table.add_column("effect, and its parameters [95 %]")
        table.add_column("held-out error", justify="right", no_wrap=True)
        table.add_column("change", justify="right", no_wrap=True)
        table.add_column("p", justify="right", no_wrap=True)
        for c in self.ranking:
            name = Text(c.effect.name, style="bold" if c.supported else "")
            parameters = parameters_in_words(c.effect, c.ci95).replace("], ", "]\n")  # one a line
            table.add_row(
                Group(name, *([Padding(Text(parameters), (0, 1, 0, 2))] if c.ci95 else [])),
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
    search = searched(Search(model, dataset, [effect for effect in pool if effect not in unfit], progress))
    progress("looking at what is left")
    # What a small effect explains, less than what is called missing, is not unexplained.
    trims = [candidate.residual for candidate in search.latest.values() if candidate.seen and not candidate.supported]
    residual = min([search.residual, *trims], key=unseen_score)[:, :3]
    flexible = flexible_residual(residual, dataset)
    matters = _matters(residual, flexible, improvement_p_value(residual, flexible, dataset))
    symbolic = explain(residual, dataset) if matters else None
    # Many variables together find a little in noise now and then; what is there also has an expression, or is large.
    unexplained = matters and (symbolic is not None or largest_gain(residual, residual - flexible) > LARGE)
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


def _matters(residual: Floats, flexible: Floats, p_value: float) -> bool:
    """The flexible regression finds structure that is significant and worth explaining."""
    return p_value < SIGNIFICANT and largest_gain(residual, residual - flexible) > MATERIAL


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
