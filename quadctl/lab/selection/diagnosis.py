"""What is missing? Every effect of the catalogue is tried on top of the model; data that no fit saw decide."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from rich import box
from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from quadctl.effects import Effect, every_effect
from quadctl.lab.comparison.noise_floor import flexible_residual
from quadctl.lab.comparison.wording import parameters_in_words
from quadctl.lab.fitting.fitter import FittedModel, fit_model
from quadctl.lab.fitting.significance import improvement_p_value
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.flights.flight import SPAN_UNITS
from quadctl.lab.results import Result
from quadctl.lab.selection.candidate import Candidate
from quadctl.lab.selection.rule import is_large, is_measured, is_mostly_left, is_supported, is_unexplained, score
from quadctl.lab.selection.search import Path, Step, emptied, search
from quadctl.lab.selection.wording import candidate_to_dict
from quadctl.lab.symbolic.formula import Symbolic
from quadctl.lab.symbolic.identification import explain
from quadctl.lab.threads import one_blas_thread
from quadctl.model import Model

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
    fit: FittedModel | None = None
    """The fit of `best`; None where the diagnosis was read from a session."""

    def to_dict(self) -> dict[str, Any]:
        return {
            "verdict": self.verdict,
            "ranking": [candidate_to_dict(candidate) for candidate in self.ranking],
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
            name = Text(c.effect.name, style="bold" if is_supported(c) else "")
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
    return diagnose_fit(fit_model(model, dataset), candidates, progress)


@one_blas_thread
def diagnose_fit(
    fit: FittedModel,
    candidates: Iterable[type[Effect]] | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> Diagnosis:
    """Rank what could be missing from a fitted model (see `diagnose`)."""
    model, dataset = fit.fitter.model, fit.dataset
    pool = list(candidates if candidates is not None else every_effect(model.effect_files).values())
    present = {effect.family() for effect in model.effects}
    pool = [e for e in pool if e.family() not in present and e.candidate and e.applies_to(model.vehicle)]
    unfit = [e for e in pool if any(dataset.span(variable) < span for variable, span in e.needs.items())]
    path = search(fit, [effect for effect in pool if effect not in unfit], progress)
    progress("looking at what is left")
    # A part that a small effect explains, smaller than what is called missing, is not unexplained.
    small = [c.residual for c in path.latest.values() if is_measured(c) and not is_supported(c)]
    residual = min([path.residual, *small], key=score)[:, :3]
    flexible = flexible_residual(residual, dataset)
    matters = is_unexplained(residual, flexible, improvement_p_value(residual, flexible, dataset))
    symbolic = explain(residual, dataset) if matters else None
    # Many variables together find a little in noise now and then; what is there also has an expression, or is large.
    unexplained = matters and (symbolic is not None or is_large(residual, flexible))
    if unexplained and path.missing and is_mostly_left(fit.held_out_residual[:, :3], residual, flexible):
        path = emptied(path)
    return Diagnosis(
        model=model,
        dataset=dataset,
        verdict="missing" if path.missing else "unexplained" if unexplained else "none",
        ranking=_ranking(path),
        missing=list(path.missing),
        steps=list(path.steps),
        best=path.current.model,
        confounded=[list(pair) for pair in path.confounded],
        suggested_mission=_suggestion(path.latest, path.confounded, unfit),
        unexplained=unexplained,
        untried=_reasons(unfit, dataset),
        symbolic=symbolic,
        fit=path.current,
    )


def _ranking(path: Path) -> list[Candidate]:
    """The candidates that are missing, with parameters and intervals of the fit of all of them; then the others."""
    first = [candidate for candidate in path.chosen if candidate.family in path.missing]
    shown = {candidate.effect.name for candidate in first}
    others = [candidate for name, candidate in path.latest.items() if name not in shown]
    if len(first) > 1 or len(path.chosen) > len(first):
        fit = path.current.refined()
        places = {effect.family(): place for place, effect in enumerate(fit.model.effects)}
        first = [replace(c, effect=fit.model.effects[places[c.family]], ci95=fit.ci95(places[c.family])) for c in first]
    return [*first, *sorted(others, key=lambda c: -c.held_out_drop)]


def _suggestion(
    tried: Mapping[str, Candidate], confounded: Sequence[tuple[str, str]], unfit: list[type[Effect]]
) -> str | None:
    """The mission that shows best what these data leave open: look-alikes first, then what could not be tried."""
    by_family = {candidate.family: candidate.effect.mission for candidate in reversed(list(tried.values()))}
    missions = [by_family[pair[-1]] for pair in confounded] + [effect.mission for effect in unfit]
    return missions[0] if missions else None


def _reasons(unfit: list[type[Effect]], dataset: Dataset) -> list[str]:
    """Why these effects were not tried."""
    return [
        f"{effect.name} (to be told from others it takes {variable} over {span:g} {SPAN_UNITS[variable]}, "
        f"these data have {dataset.span(variable):.2g})"
        for effect in unfit
        for variable, span in effect.needs.items()
        if dataset.span(variable) < span
    ]
