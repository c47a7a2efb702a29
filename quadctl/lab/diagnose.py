"""What is missing? Every effect of the catalogue is tried on top of the model and judged on data its fit did not see.

`missing` is built step by step: the best significant candidate is added, all parameters are refitted together, and the
rest are tried again, until nothing significant is left; then each family that has become superfluous once the others
are in is taken out again.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any, Literal

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from quadctl.effects import CATALOG, Effect
from quadctl.lab.data import AXES, Dataset, rmse
from quadctl.lab.fit import Fitter, free_parameters, intervals, remarks, values_of
from quadctl.lab.flexible import flexible_residual
from quadctl.lab.prepare import SPAN_UNITS, Floats
from quadctl.lab.significance import difference_p_value, improvement_p_value
from quadctl.model import Model

SIGNIFICANT = 0.01
"""After multiplication with the number of candidates tried (Bonferroni)."""
MATERIAL = 0.05
"""A family is called missing only when It takes this share off the held-out error of one axis: less is within what
unknown trims and coefficients of any real vehicle do."""
ALIKE = 0.05
"""Candidates whose held-out errors differ with a larger p-value cannot be told apart by these data."""

Verdict = Literal["missing", "none", "unexplained"]


@dataclass(frozen=True, eq=False)
class Candidate:
    """One effect tried on top of a model."""

    effect: Effect
    """With its fitted parameters."""
    model: Model
    """The whole stack, refitted."""
    ci95: dict[str, tuple[float, float]]
    before: dict[str, float]
    after: dict[str, float]
    """Held-out RMSE per axis and total, without and with the effect."""
    p_value: float
    """Corrected for autocorrelation and for the number of candidates."""
    residual: Floats
    """Held out, with the effect, shape (n, 3)."""
    remarks: list[str]

    @property
    def family(self) -> str:
        return self.effect.family()

    @property
    def held_out_drop(self) -> float:
        return 1.0 - self.after["total"] / self.before["total"]

    @property
    def largest_drop(self) -> float:
        """On the axis where the effect helps most."""
        return max(1.0 - self.after[axis] / self.before[axis] for axis in AXES)

    @property
    def supported(self) -> bool:
        helps = self.held_out_drop > 0.0 and self.largest_drop > MATERIAL
        within = not any("bound" in remark for remark in self.remarks)  # else the form is a stand-in for another
        return helps and self.p_value < SIGNIFICANT and within and not self.effect.negligible()

    @property
    def text(self) -> str:
        axis = max(AXES, key=lambda a: 1.0 - self.after[a] / self.before[a])
        verdict = (
            f"It takes {self.held_out_drop:.0%} off the unseen error, {self.largest_drop:.0%} on the {axis} axis."
            if self.supported
            else "It is within the trims of any real vehicle."
            if self.effect.negligible() and self.p_value < SIGNIFICANT
            else "The unseen data do not support it."
        )
        return " ".join([self.effect.physics, verdict, *(f"Note: {remark}." for remark in self.remarks)])

    def to_dict(self) -> dict[str, Any]:
        return {
            "family": self.family,
            "effect": self.effect.name,
            "parameters": self.effect.values(),
            "ci95": {name: list(ci) for name, ci in self.ci95.items()},
            "rmse_before": self.before["total"],
            "rmse_after": self.after["total"],
            "held_out_drop": self.held_out_drop,
            "p_value": self.p_value,
            "text": self.text,
        }


@dataclass(frozen=True, eq=False)
class Step:
    """One rung of the ladder: the family added, and the held-out error once it is in."""

    family: str
    effect: str
    rmse: dict[str, float]


@dataclass(frozen=True, eq=False)
class Diagnosis:
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

    def to_dict(self) -> dict[str, Any]:
        return {
            "verdict": self.verdict,
            "ranking": [candidate.to_dict() for candidate in self.ranking],
            "missing": self.missing,
            "confounded": self.confounded,
            "suggested_mission": self.suggested_mission,
            "symbolic": None,
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
                f"{c.before['total']:.3f} -> {c.after['total']:.3f}",
                f"{-c.held_out_drop:+.1%}",
                "< 1e-4" if c.p_value < 1e-4 else f"{c.p_value:.2g}",
            )
        return Group(table, Text("\n".join(self.lines())))

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
            lines.append(f"To tell more, fly {self.suggested_mission}.")
        return lines


def diagnose(
    model: Model,
    dataset: Dataset,
    candidates: Iterable[type[Effect]] | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> Diagnosis:
    """Rank what could be missing from `model`, judged on the parts of `dataset` that each fit did not see.

    `candidates` are the catalogue's effects by default; families that the model holds already are not tried again.
    `progress` is told in a few words what is being done.
    """
    pool = list(candidates if candidates is not None else CATALOG.values())
    present = {effect.family() for effect in model.effects}
    pool = [e for e in pool if e.family() not in present and e.candidate and e.applies_to(model.vehicle)]
    unfit = [e for e in pool if any(dataset.span(variable) < span for variable, span in e.needs.items())]
    untried = [
        f"{effect.name} (to be told from others it takes {variable} over {span:g} {SPAN_UNITS[variable]}, "
        f"these data have {dataset.span(variable):.2g})"
        for effect in unfit
        for variable, span in effect.needs.items()
        if dataset.span(variable) < span
    ]
    pool = [effect for effect in pool if effect not in unfit]
    current, residual = _refitted(model, dataset)
    steps = [Step("", model.name, rmse(residual))]
    chosen_ones: list[Candidate] = []
    latest: dict[str, Candidate] = {}
    confounded: list[list[str]] = []
    alike: list[str] = []
    missing: list[str] = []
    while pool:
        tried = [_try(effect, current, residual, dataset, len(pool), progress) for effect in pool]
        tried.sort(key=lambda candidate: candidate.after["total"])
        latest |= {candidate.effect.name: candidate for candidate in tried}
        supported = [candidate for candidate in tried if candidate.supported]
        # Look-alikes are those that did as well as the one chosen and are not needed once it is in.
        confounded += [[missing[-1], other] for other in alike if other not in {c.family for c in supported}]
        if not supported:
            break
        chosen, alike = _choose(supported, dataset)
        current, residual = chosen.model, chosen.residual
        missing.append(chosen.family)
        chosen_ones.append(chosen)
        steps.append(Step(chosen.family, chosen.effect.name, rmse(residual)))
        pool = [effect for effect in pool if effect.family() != chosen.family]
    current, residual, missing, steps = _without_superfluous(model, current, residual, missing, steps, dataset)
    flexible = flexible_residual(residual, dataset)
    left = improvement_p_value(residual, flexible, dataset)
    unexplained = _matters(residual, flexible, left)
    verdict: Verdict = "missing" if missing else "unexplained" if unexplained else "none"
    first = [candidate for candidate in chosen_ones if candidate.family in missing]
    others = [candidate for candidate in latest.values() if candidate not in first]
    return Diagnosis(
        model=model,
        dataset=dataset,
        verdict=verdict,
        ranking=[*first, *sorted(others, key=lambda c: -c.held_out_drop)],
        missing=missing,
        steps=steps,
        best=current,
        confounded=confounded,
        suggested_mission=_suggestion(latest, confounded, unfit),
        unexplained=unexplained,
        untried=untried,
    )


def _refitted(model: Model, dataset: Dataset) -> tuple[Model, Floats]:
    """The model fitted on all data, and its held-out residual."""
    fitter = Fitter(model, dataset)
    fitted = fitter.fit()
    return fitted.model, dataset.measured - fitter.held_out(fitted)


def _try(
    effect: type[Effect],
    current: Model,
    residual: Floats,
    dataset: Dataset,
    n_tried: int,
    progress: Callable[[str], None],
) -> Candidate:
    progress(f"trying {effect.name}")
    extended = current.plus(effect())
    fitter = Fitter(extended, dataset)
    fitted = fitter.fit()
    after = dataset.measured - fitter.held_out(fitted)
    p = improvement_p_value(residual, residual - after, dataset)
    effects = fitted.model.effects
    last = len(effects) - 1
    ci = intervals(fitter.free, fitter.bootstrap(fitted))
    own = [(f, c) for f, c in zip(fitter.free, ci, strict=True) if f.effect == last]
    values = values_of(fitted.model, [f for f, _ in own])
    return Candidate(
        effect=effects[last],
        model=fitted.model,
        ci95={f.parameter.name: c for f, c in own},
        before=rmse(residual),
        after=rmse(after),
        p_value=min(1.0, p * n_tried),
        residual=after,
        remarks=remarks([f for f, _ in own], values, [c for _, c in own]),
    )


def _choose(supported: list[Candidate], dataset: Dataset) -> tuple[Candidate, list[str]]:
    """The best candidate, and the other families that do as well.

    Each family stands with its best variant. Of families that do as well as the best, to the percent and to what these
    data can tell, the one with the fewest parameters is taken.
    """
    best = supported[0]
    leaders = [c for i, c in enumerate(supported) if c.family not in {other.family for other in supported[:i]}]
    alike = [c for c in leaders if c is best or difference_p_value(best.residual, c.residual, dataset) > ALIKE]
    as_good = [c for c in alike if c.after["total"] < 1.01 * best.after["total"]]
    chosen = min(as_good, key=lambda c: (len(free_parameters(c.model)), c.after["total"]))
    return chosen, sorted({c.family for c in alike} - {chosen.family})


def _without_superfluous(
    start: Model, current: Model, residual: Floats, missing: list[str], steps: list[Step], dataset: Dataset
) -> tuple[Model, Floats, list[str], list[Step]]:
    """Take out what is no longer needed now that the other families are in."""
    for family in missing[:-1]:
        kept = tuple(item for item in current.stack if item.effect.family() != family)
        smaller, without = _refitted(Model(start.vehicle, kept, start.name, start.vehicle_path), dataset)
        before, after = rmse(without), rmse(residual)
        gains = max(1.0 - after[axis] / before[axis] for axis in AXES)
        needed = improvement_p_value(without, without - residual, dataset) < SIGNIFICANT and gains > MATERIAL
        if not needed:
            current, residual = smaller, without
            missing = [name for name in missing if name != family]
            steps = [*(s for s in steps[:-1] if s.family != family), Step(steps[-1].family, steps[-1].effect, before)]
    return current, residual, missing, steps


def _matters(residual: Floats, flexible: Floats, p_value: float) -> bool:
    """The flexible regression finds structure that is significant and worth explaining."""
    before, after = rmse(residual), rmse(residual - flexible)
    return p_value < SIGNIFICANT and max(1.0 - after[axis] / before[axis] for axis in AXES) > MATERIAL


def _suggestion(tried: dict[str, Candidate], confounded: list[list[str]], unfit: list[type[Effect]]) -> str | None:
    """The mission that shows best what these data leave open: look-alikes first, then what could not be tried."""
    by_family = {candidate.family: candidate.effect.mission for candidate in reversed(tried.values())}
    missions = [by_family[pair[-1]] for pair in confounded] + [effect.mission for effect in unfit]
    return missions[0] if missions else None


def parameters_in_words(effect: Effect, ci95: dict[str, tuple[float, float]]) -> str:
    """`a = 0.114 [0.10, 0.12], b = 5.4 [5.0, 5.8]`; fixed parameters are left out."""
    values = effect.values()
    return (
        ", ".join(f"{name} = {values[name]:.4g} [{low:.4g}, {high:.4g}]" for name, (low, high) in ci95.items()) or "-"
    )
