"""Diagnosis: every effect of the catalogue is tried on top of the model, and judged on held-out data."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from rich import box
from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from quadctl import __version__
from quadctl.effects import Effect
from quadctl.lab.comparison.wording import listed, parameter_lines, parameters_in_words
from quadctl.lab.fitting.fitted_model import FittedModel, fit_model
from quadctl.lab.fitting.fitter import BOOTSTRAP_SEED
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.flights.flight import SPAN_NAMES, SPAN_UNITS, UNKNOWN_TIMING, Timing
from quadctl.lab.flights.timing import timing_in_words
from quadctl.lab.results import Result
from quadctl.lab.selection.candidate import Candidate
from quadctl.lab.selection.choice import choose_effects
from quadctl.lab.selection.rule import RULE, Rule, alternatives, is_measured, is_supported, is_trim
from quadctl.lab.selection.search import Path, SelectionStep, judged_beside
from quadctl.lab.selection.unseen import UnseenError, held_out_errors, nested_errors, unseen_in_words
from quadctl.lab.selection.wording import candidate_to_dict, error_in_table, measured_to_dict, p_in_table
from quadctl.lab.symbolic.formula import Symbolic
from quadctl.lab.threads import one_blas_thread
from quadctl.model import Model

UNITS = {"total": "", "turning": " N m", "sensing": " (IMU)"}

MOST_SEARCHED = 6000
"""Number of samples of a search, some nine minutes of flight: every candidate is fitted many times, and a material
effect shows in fewer. Parameters are fitted to all samples."""

Verdict = Literal["missing", "none", "unexplained"]


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(Result):
    """Result of `diagnose`."""

    model: Model
    dataset: Dataset
    verdict: Verdict
    ranking: list[Candidate]
    """Candidates: first the missing ones in the order of adding, each on top of those before it; then the others, each
    on top of the effects found when it was tried last."""
    missing: list[str]
    steps: list[SelectionStep]
    """Selection steps: the model as given, then each missing family in the order of adding."""
    best: Model
    """Model with all missing effects, fitted to all data."""
    confounded: list[list[str]] = field(default_factory=list)
    suggested_mission: str | None = None
    untried: list[str] = field(default_factory=list)
    """Effects that were not tried because these data do not distinguish them from their look-alikes, with the
    reason."""
    unexplained: bool = False
    """True where the logged variables still explain a significant and material part of the error after all missing
    effects are added."""
    symbolic: Symbolic | None = None
    """Sparse expression of the unexplained part."""
    unseen: list[UnseenError] = field(default_factory=list)
    """Errors on blocks of time and, of several flights, on whole flights."""
    searched: int = 0
    """Number of samples that the search has seen; parameters and intervals of what is missing are of a fit to all."""
    fit: FittedModel | None = None
    """Fit of `best`; None where the diagnosis was read from a session."""

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
            "unseen": [error.to_dict() for error in self.unseen],
            "samples": {"searched": self.searched, "all": len(self.dataset.targets) if self.dataset.flights else 0},
            "measured": [measured_to_dict(candidate) for candidate in self.measured],
            "timing": self.timing.to_dict(),
            "record": self.dataset.record,
            "provenance": {
                "version": __version__,
                "logs": {flight.name: flight.sha256 for flight in self.dataset.flights},
                "seed": BOOTSTRAP_SEED,
            },
        }

    @property
    def searched_part(self) -> Dataset:
        """Part of the dataset that the search has seen, on which candidates have their residuals."""
        return self.dataset.spread_out(MOST_SEARCHED) if self.dataset.flights else self.dataset

    @property
    def measured(self) -> list[Candidate]:
        """Candidates that the data show, but that are too small to be called missing; the best of each family.

        An effect of variables on which an effect that was found depends is none of them: it may be the error of the
        form of that effect. Nor is one of which bounds hold every parameter: what is fitted is that it is not there.
        """
        found: dict[str, Candidate] = {}
        explained = {name for c in self.ranking if c.family in self.missing for name in c.effect.depends_on}
        for c in sorted(self.ranking, key=lambda c: c.p_value):
            of_a_form = c.effect.depends_on and set(c.effect.depends_on) <= explained
            at_bounds = [getattr(c.effect, name) in ci for name, ci in c.ci95.items()]
            if c.family in self.missing or of_a_form or (at_bounds and all(at_bounds)):
                continue
            if is_measured(c) and not is_supported(c):
                found.setdefault(c.family, c)
        return list(found.values())

    @property
    def timing(self) -> Timing:
        """Timing of the channels of these flights; unknown where the diagnosis was read from a session."""
        return self.dataset.flights[0].timing if self.dataset.flights else UNKNOWN_TIMING

    def __rich__(self) -> RenderableType:
        title = f"Candidate effects (* missing, in the order of adding; significant: p < {RULE.significant:g})"
        table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAVY, show_edge=False, padding=0)
        table.add_column("effect, and its parameters [95 %]")
        table.add_column("held-out error", justify="right", no_wrap=True)
        table.add_column("change", justify="right", no_wrap=True)
        table.add_column("p", justify="right", no_wrap=True)
        for c in self.ranking:
            missing = c.family in self.missing
            name = Text(f"{'* ' if missing else ''}{c.effect.name}", style="bold" if missing else "")
            parameters = "\n".join(parameter_lines(c.effect, c.ci95))
            table.add_row(
                Group(name, *([Padding(Text(parameters), (0, 1, 0, 2))] if c.ci95 else [])),
                f"{error_in_table(c.before[c.measure])} -> {error_in_table(c.after[c.measure])}" + UNITS[c.measure],
                f"{-c.held_out_drop:+.1%}",
                p_in_table(c.p_value),
            )
        return Group(table, Text("\n".join(self.lines())), *([self.symbolic] if self.symbolic else []))

    def lines(self) -> list[str]:
        """Sentences that state the verdict."""
        lines = []
        if self.verdict == "none":
            lines.append("No known effect is missing: none lowers the held-out error enough to matter.")
        elif self.verdict == "unexplained":
            lines.append(
                "Part of the error depends on the logged variables, but no effect of the catalogue explains it."
            )
        else:
            lines.append("Missing, in the order of adding (held-out acceleration error, m/s^2):")
            before = self.steps[0].rmse["total"]
            for step in self.steps[1:]:
                total = step.rmse["total"]
                lines.append(f"  {step.effect}: {before:.4f} -> {total:.4f}")
                before = total
            if self.unexplained:
                lines.append(
                    "Part of the remaining error depends on the logged variables, but these effects do not explain it."
                )
        lines += unseen_in_words(self.unseen, any_missing=bool(self.missing))
        if self.dataset.flights and 0 < self.searched < len(self.dataset.targets):
            lines.append(
                f"The search has seen {self.searched} of {len(self.dataset.targets)} samples, in stretches spread over "
                "the flights, and so have its errors; the parameters of what is missing are fitted to all samples."
            )
        lines += [_small_in_words(*one_of) for one_of in alternatives(self.measured, self.searched_part)]
        lines += [
            f"There (p {p_in_table(c.p_value)}), but no larger than the trim errors of any real vehicle: "
            f"{c.effect.name}, {parameters_in_words(c.effect, c.ci95)}."
            for c in self.ranking
            if is_trim(c) and c.family not in self.missing and c not in self.measured
        ]
        lines += [f"These data do not distinguish {' and '.join(pair)}." for pair in self.confounded]
        lines += timing_in_words(self.timing)
        lines += [f"Not tried: {reason}." for reason in self.untried]
        if self.suggested_mission:
            lines.append(f"To learn more, fly {self.suggested_mission}; `quadctl suggest` compares all missions.")
        return lines


def diagnose(
    model: Model,
    dataset: Dataset,
    candidates: Iterable[type[Effect]] | None = None,
    progress: Callable[[str], None] = lambda text: None,
    nested: bool = False,
) -> Diagnosis:
    """Find the effects that are missing from `model`, judged on held-out parts of `dataset`.

    `candidates` are by default the catalogue's effects and those of the model's own files; families that the model
    already holds are not tried again. `progress` is called with short texts. With `nested` the search is repeated
    without each part of the data on which its result is judged.
    """
    return diagnose_fit(fit_model(model, dataset), candidates, progress, nested)


@one_blas_thread
def diagnose_fit(
    fit: FittedModel,
    candidates: Iterable[type[Effect]] | None = None,
    progress: Callable[[str], None] = lambda text: None,
    nested: bool = False,
    rule: Rule = RULE,
) -> Diagnosis:
    """Find the effects that are missing from a fitted model (see `diagnose`)."""
    model, dataset = fit.fitter.model, fit.dataset
    searched = dataset.spread_out(MOST_SEARCHED)
    choice = choose_effects(fit if searched is dataset else fit_model(model, searched), candidates, progress, rule)
    path = choice.path
    if searched is dataset:
        found = path.current
    else:
        progress("fitting what was found to all data")
        found = fit_model(path.current.model, dataset) if path.missing else fit
    ranking = _ranking(path, found)
    return Diagnosis(
        model=model,
        dataset=dataset,
        verdict="missing" if path.missing else "unexplained" if choice.unexplained else "none",
        ranking=ranking,
        missing=list(path.missing),
        steps=list(path.steps),
        best=found.model,
        confounded=[
            list(pair) for pair in dict.fromkeys((*path.confounded, *_inseparable(path.missing, ranking, dataset.span)))
        ],
        suggested_mission=_suggestion(path.latest, path.confounded, choice.unfit),
        unexplained=choice.unexplained,
        untried=_reasons(choice.unfit, dataset),
        symbolic=choice.symbolic,
        unseen=nested_errors(model, searched, candidates, progress) if nested else held_out_errors(fit, found),
        searched=len(searched.targets),
        fit=found,
    )


def _ranking(path: Path, found: FittedModel) -> list[Candidate]:
    """Missing candidates, with parameters and intervals of the fit of all of them; then the others by their
    improvement. `found` is the fit of what the path found to all data."""
    first = [candidate for candidate in path.chosen if candidate.family in path.missing]
    shown = {candidate.effect.name for candidate in first}
    others = [candidate for name, candidate in path.latest.items() if name not in shown]
    if len(first) > 1 or len(path.chosen) > len(first) or (first and found is not path.current):
        fit = found.refined() if found is path.current else found
        places = {effect.family(): place for place, effect in enumerate(fit.model.effects)}
        first = [judged_beside(_refitted(candidate, fit, places[candidate.family]), path) for candidate in first]
    return [*first, *sorted(others, key=lambda c: -c.held_out_drop)]


def _refitted(candidate: Candidate, fit: FittedModel, place: int) -> Candidate:
    """Candidate with the parameters, intervals and remarks of `fit`, in whose stack its effect has this place."""
    model = replace(fit.model, stack=fit.model.stack[: place + 1])
    return replace(candidate, effect=model.effects[-1], model=model, ci95=fit.ci95(place), remarks=fit.remarks(place))


def _inseparable(
    missing: Sequence[str], ranking: Sequence[Candidate], span: Callable[[str], float]
) -> list[tuple[str, str]]:
    """Pairs of families that hardly any flight separates, each beginning with one that was found."""
    found = ranking[: len(missing)]
    return [(c.family, other) for c in found for other in c.effect.inseparable_from(missing, c.ci95, span)]


def _suggestion(
    tried: Mapping[str, Candidate], confounded: Sequence[tuple[str, str]], unfit: list[type[Effect]]
) -> str | None:
    """Mission that best answers what these data leave open: look-alikes first, then effects that could not be tried."""
    by_family = {candidate.family: candidate.effect.mission for candidate in reversed(list(tried.values()))}
    missions = [by_family[pair[-1]] for pair in confounded] + [effect.mission for effect in unfit]
    return missions[0] if missions else None


def _reasons(unfit: list[type[Effect]], dataset: Dataset) -> list[str]:
    """Reasons why effects were not tried."""
    return [
        f"{effect.name} (to distinguish it from others, {SPAN_NAMES.get(variable, variable)} must span {span:g} "
        f"{SPAN_UNITS[variable]}; {_span_in_words(variable, dataset)})"
        for effect in unfit
        for variable, span in effect.needs.items()
        if dataset.span(variable) < span
    ]


def _span_in_words(variable: str, dataset: Dataset) -> str:
    if variable == "thrust_share" and not dataset.is_flown("thrust"):
        return "in these data the thrust follows disturbances more than the motion"
    return f"in these data it spans {dataset.span(variable):.2g}"


def _small_in_words(simplest: Candidate, *alike: Candidate) -> str:
    """Sentence on an effect that is measured but small, and on those that may stand for it."""
    others = f"; or, explaining as much, {listed([c.effect.name for c in alike])}" if alike else ""
    words = parameters_in_words(simplest.effect, simplest.ci95)
    return f"Measured, but small in these flights: {simplest.effect.name}, {words}{others}."
