"""Diagnosis: every effect of the catalogue is tried on top of the model, and judged on held-out data."""

import math
from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal

from rich import box
from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from quadctl import __version__
from quadctl.effects import Effect
from quadctl.lab.comparison.open_loop import OFF_M, off_after_s
from quadctl.lab.comparison.wording import on_terminal, parameter_lines
from quadctl.lab.finding import Finding, Kind, parameters_of
from quadctl.lab.fitting.fitted_model import FittedModel, fit_model
from quadctl.lab.fitting.fitter import BOOTSTRAP_SEED
from quadctl.lab.fitting.nuisances import captured_leans_deg
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.flights.flight import SPAN_UNITS, UNKNOWN_TIMING, Timing
from quadctl.lab.flights.timing import of_timing
from quadctl.lab.results import Result
from quadctl.lab.selection.candidate import Candidate
from quadctl.lab.selection.choice import choose_effects
from quadctl.lab.selection.rule import RULE, Rule, is_supported, is_trim
from quadctl.lab.selection.search import Selection, SelectionStep, judged_beside
from quadctl.lab.selection.single_flights import of_single_flights
from quadctl.lab.selection.small import measured_of, small_beside
from quadctl.lab.selection.unseen import UnseenError, held_out_errors, nested_errors, of_unseen
from quadctl.lab.selection.wording import UNITS as ERROR_UNITS
from quadctl.lab.selection.wording import (
    candidate_to_dict,
    error_in_table,
    measured_to_dict,
    p_in_table,
    reason_against,
    rival_of,
)
from quadctl.lab.symbolic.formula import Symbolic
from quadctl.lab.threads import one_blas_thread
from quadctl.lab.words import Answer, in_words
from quadctl.model import Model
from quadctl.words import Fact, count, fact

UNITS = {"total": "", "turning": " N m", "sensing": " (IMU)"}

MOST_SEARCHED = 6000
"""Number of samples of a search, some nine minutes of flight: every candidate is fitted many times, and a material
effect shows in fewer. Parameters are fitted to all samples."""

Verdict = Literal["missing", "small", "none", "unexplained"]


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
    small: list[list[Candidate]] = field(default_factory=list)
    """Groups of small effects in the order of adding (see `small_beside`)."""
    confounded: list[list[str]] = field(default_factory=list)
    apart: list[Finding] = field(default_factory=list)
    """Parameters of what is missing in which single flights differ (see `of_single_flights`)."""
    suggested_mission: str | None = None
    untried: list[Finding] = field(default_factory=list)
    """Effects that were not tried because these data do not distinguish them from their confounded effects, with the
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
            "small": [simplest.family for simplest, *_ in self.small],
            "confounded": self.confounded,
            "suggested_mission": self.suggested_mission,
            "symbolic": self.symbolic.to_dict() if self.symbolic else None,
            "ladder": [{"family": s.family, "effect": s.effect, "rmse": s.rmse} for s in self.steps],
            "unexplained": self.unexplained,
            "untried": [on_terminal(in_words(reason)) for reason in self.untried],
            "findings": [finding.to_dict() for finding in (*self.answer, *self.notes, *self.untried)],
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
        """Candidates that the data show, but that are too small to be called missing (see `measured_of`)."""
        return measured_of(self.ranking, self.missing)

    @property
    def chosen(self) -> list[Candidate]:
        """Candidates for the missing effects, in the order of adding."""
        return self.ranking[: len(self.missing)]

    @property
    def timing(self) -> Timing:
        """Timing of the channels of these flights; unknown where the diagnosis was read from a session."""
        return self.dataset.flights[0].timing if self.dataset.flights else UNKNOWN_TIMING

    @property
    def answer(self) -> list[Finding]:
        """Verdict; what is missing or small, with the error before and after; what these data leave open; the next
        flight."""
        if self.verdict == "small":
            families = [simplest.family for simplest, *_ in self.small]
            found = [Finding(Kind.ONLY_SMALL, {"families": families}), *self._of_small]
        else:
            facts = {"families": self.missing, "alternatives": self._alternatives} if self.missing else {}
            found = [Finding(Kind(self.verdict), facts)]
        found += [Finding(Kind.EFFECT, parameters_of(c.effect, c.ci95)) for c in self.chosen]
        if len(self.steps) > 1:
            before, after = self.steps[0].rmse["total"], self.steps[-1].rmse["total"]
            found.append(Finding(Kind.ERROR, {"before": before, "after": after, "drop": 1.0 - after / before}))
        elif self.steps and self.verdict != "small":
            found.append(Finding(Kind.ERROR_LEFT, {"rmse": self.steps[0].rmse["total"]}))
        if self.verdict == "missing" and self.unexplained:
            found.append(Finding(Kind.PART_UNEXPLAINED))
        found += [
            Finding(Kind.CONFOUNDED, {"family": f, "others": others})
            for f, others in self._alternatives.items()
            if others
        ]
        found += self.apart
        if self.suggested_mission:
            found.append(Finding(Kind.NEXT_FLIGHT, {"mission": self.suggested_mission}))
        return found

    @property
    def _alternatives(self) -> dict[str, list[str]]:
        """Families that these data do not distinguish from each that is missing; empty where all are distinguished."""
        if not self.confounded:
            return {}
        alternatives: dict[str, list[str]] = {family: [] for family in self.missing}
        for family, other in self.confounded:
            alternatives.setdefault(family, []).append(other)
        return alternatives

    @property
    def considered(self) -> list[Candidate]:
        """Candidates beside those that are missing which the data support, or do not distinguish from one that is."""
        missing = {c.effect.name for c in self.chosen}
        alike = {other for _, other in self.confounded}
        rest = [c for c in self.ranking if c.effect.name not in missing]
        return [c for c in rest if is_supported(c) or c.family in alike]

    @property
    def notes(self) -> list[Finding]:
        """Findings on the data behind the errors, on small effects, and on the record."""
        found = of_unseen(self.unseen, any_missing=bool(self.missing))
        if self.dataset.flights and 0 < self.searched < len(self.dataset.targets):
            found.append(Finding(Kind.PART_SEARCHED, {"searched": self.searched, "all": len(self.dataset.targets)}))
        if self.verdict != "small":
            found += self._of_small
        small = {c.effect.name for group in self.small for c in group}
        for c in self.ranking:
            if is_trim(c) and c.family not in self.missing and c.effect.name not in small:
                found.append(Finding(Kind.USUAL, {**parameters_of(c.effect, c.ci95), "p": c.p_value}))
        return [*found, *of_timing(self.timing), *_of_attitudes(self.fit)]

    @cached_property
    def _of_small(self) -> list[Finding]:
        """Findings on what is small."""
        found = []
        for simplest, *alike in self.small:
            without = replace(simplest.model, stack=simplest.model.stack[:-1])
            facts = {
                **parameters_of(simplest.effect, simplest.ci95),
                "alternatives": [c.effect.name for c in alike],
                "before": simplest.before[simplest.measure],
                "after": simplest.after[simplest.measure],
                "unit": ERROR_UNITS[simplest.measure],
                "off_m": OFF_M,
                "off_after_s": off_after_s(simplest.model, without, self.dataset.flights),
                "depends_on": list(simplest.effect.depends_on),
                "distinguished_by": simplest.effect.distinguished_by,
            }
            found.append(Finding(Kind.SMALL, facts))
        return found

    def lines(self) -> list[str]:
        """Answer and notes in words."""
        return [in_words(finding) for finding in (*self.answer, *self.notes)]

    def __rich__(self) -> RenderableType:
        missing = {step.effect for step in self.steps}
        supported = [*self.chosen, *self.considered]
        title = (
            "Missing (*), in the order of adding; below: alternatives, each added alone"
            if self.missing
            else "Significant alone, but they do not explain the error that is left"
        )
        tables = [_table(title, supported, missing)] if supported else []
        rest = len(self.ranking) - len(supported)
        more = f"Not missing: {count(rest, 'other effect')}; not tried: {len(self.untried)}. --all says why."
        return Group(
            Text(on_terminal(_told(self.answer))),
            *([self.symbolic] if self.symbolic else []),
            *tables,
            Text(on_terminal("\n".join([*map(in_words, self.notes), more]))),
        )

    def details(self) -> RenderableType:
        """Every candidate, with parameters and intervals, and the reasons why others were not tried."""
        title = f"All candidates (* missing, in the order of adding; significant: p < {RULE.significant:g})"
        missing = {step.effect for step in self.steps}
        against = {c.effect.name: in_words(reason_against(c, rival_of(c, self.chosen))) for c in self.ranking}
        table = _table(title, [c for c in self.ranking if c.fitted], missing, against)
        left_out = map(str, self.not_fitted)
        untried = (f"Not tried: {in_words(reason)}." for reason in self.untried)
        return Group(table, Text(on_terminal("\n".join([*left_out, *untried]))))

    @property
    def not_fitted(self) -> list[Fact]:
        """The candidates that were not fitted, as one fact; none where all were."""
        names = [c.effect.name for c in self.ranking if not c.fitted]
        return [fact(Answer.NOT_FITTED, effects=names)] if names else []


def _of_attitudes(fit: FittedModel | None) -> list[Finding]:
    """Finding on the attitudes of a motion capture that are off; none where the diagnosis was read from a session."""
    leans = {} if fit is None else captured_leans_deg(fit.flights, fit.optimum.nuisances)
    if fit is None or not leans:
        return []
    facts = {
        "flights": {name: {"roll_deg": roll, "pitch_deg": pitch} for name, (roll, pitch) in leans.items()},
        "largest_deg": max(math.hypot(*lean) for lean in leans.values()),
    }
    return [Finding(Kind.ATTITUDE_OFF if "sensing" in fit.dataset.groups else Kind.ATTITUDE_OR_TILT, facts)]


def _told(answer: Sequence[Finding]) -> str:
    """The answer, an effect indented below the verdict."""
    return "\n".join(f"  {in_words(f)}" if f.kind in (Kind.EFFECT, Kind.SMALL) else in_words(f) for f in answer)


def _table(
    title: str, candidates: Iterable[Candidate], missing: Container[str], against: Mapping[str, str] | None = None
) -> Table:
    """Table of candidates with parameters and intervals, for 80 columns; the effects `missing` are marked, below the
    others stands what is `against` them, by their names."""
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAVY, show_edge=False, padding=0)
    table.add_column("effect, and its parameters [95 %]")
    for heading in ("held-out error", "change", "by axis", "p"):
        table.add_column(heading, justify="right", no_wrap=True)
    for c in candidates:
        is_missing = c.effect.name in missing
        name = Text(f"{'* ' if is_missing else ''}{c.effect.name}", style="bold" if is_missing else "")
        parameters = parameter_lines(parameters_of(c.effect, c.ci95)["parameters"]) if c.ci95 else []
        why_not = [] if is_missing or against is None else [f"no: {on_terminal(against[c.effect.name])}"]
        table.add_row(
            Group(name, *([Padding(Text("\n".join([*parameters, *why_not])), (0, 1, 0, 2))])),
            f"{error_in_table(c.before[c.measure])} -> {error_in_table(c.after[c.measure])}" + UNITS[c.measure],
            f"{-c.held_out_drop:+.1%}",
            f"{-c.largest_drop:+.0%} {c.axis}",
            p_in_table(c.p_value),
        )
    return table


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
    selection = choice.selection
    if searched is dataset:
        found = selection.current
    else:
        progress("fitting what was found to all data")
        found = fit_model(selection.current.model, dataset) if selection.missing else fit
    ranking = _ranking(selection, found)
    small = small_beside(selection, measured_of(ranking, selection.missing))
    otherwise: Verdict = "unexplained" if choice.unexplained else "small" if small else "none"
    return Diagnosis(
        model=model,
        dataset=dataset,
        verdict="missing" if selection.missing else otherwise,
        ranking=ranking,
        missing=list(selection.missing),
        steps=list(selection.steps),
        best=found.model,
        small=small,
        confounded=[
            list(pair)
            for pair in dict.fromkeys((*selection.confounded, *_inseparable(selection.missing, ranking, dataset.span)))
        ],
        apart=of_single_flights(found, selection.missing),
        suggested_mission=_suggestion(selection.latest, selection.confounded, choice.unfit),
        unexplained=choice.unexplained,
        untried=_reasons(choice.unfit, dataset),
        symbolic=choice.symbolic,
        unseen=nested_errors(model, searched, candidates, progress) if nested else held_out_errors(fit, found),
        searched=len(searched.targets),
        fit=found,
    )


def _ranking(selection: Selection, found: FittedModel) -> list[Candidate]:
    """Missing candidates, with parameters and intervals of the fit of all of them; then the others by their
    improvement. `found` is the fit of what was selected to all data."""
    first = list(selection.chosen)
    shown = {candidate.effect.name for candidate in first}
    others = [candidate for name, candidate in selection.latest.items() if name not in shown]
    if len(first) > 1 or (first and found is not selection.current):
        fit = found.refined() if found is selection.current else found
        places = {effect.family(): place for place, effect in enumerate(fit.model.effects)}
        first = [judged_beside(_refitted(candidate, fit, places[candidate.family]), selection) for candidate in first]
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
    """Mission that best answers what these data leave open: confounded effects first, then those not tried."""
    by_family = {candidate.family: candidate.effect.mission for candidate in reversed(list(tried.values()))}
    missions = [by_family[pair[-1]] for pair in confounded] + [effect.mission for effect in unfit]
    return missions[0] if missions else None


def _reasons(unfit: list[type[Effect]], dataset: Dataset) -> list[Finding]:
    """Reasons why effects were not tried."""
    found = []
    for effect in unfit:
        for variable, span in effect.needs.items():
            flown = dataset.span(variable)
            if flown < span:
                needs = {"effect": effect.name, "variable": variable, "needed": span, "unit": SPAN_UNITS[variable]}
                follows = variable == "thrust_share" and not dataset.is_flown("thrust")
                found.append(
                    Finding(Kind.UNTRIED_FOLLOWS, needs) if follows else Finding(Kind.UNTRIED, {**needs, "span": flown})
                )
    return found
