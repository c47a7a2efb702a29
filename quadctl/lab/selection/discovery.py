"""Discovery: compare, diagnose and add until no significant effect is missing."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from quadctl.effects import Effect
from quadctl.lab.comparison.comparison import Comparison, compare, floor_on
from quadctl.lab.comparison.wording import on_terminal, parameter_lines
from quadctl.lab.finding import Finding, Kind, parameters_of
from quadctl.lab.fitting.fitted_model import fit_model
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.results import Result, errors_table
from quadctl.lab.selection.addition import Addition, add
from quadctl.lab.selection.diagnosis import Diagnosis, diagnose_fit
from quadctl.lab.selection.wording import p_in_table
from quadctl.lab.words import Answer, in_words
from quadctl.model import Model
from quadctl.words import Fact, fact


@dataclass(frozen=True, eq=False, repr=False)
class Discovery(Result):
    """Result of `discover`: the comparison before, the diagnosis, and the additions."""

    before: Comparison
    diagnosis: Diagnosis
    additions: list[Addition]
    """Additions, one for each missing family, in the order of adding."""

    @property
    def model(self) -> Model:
        """Model with all effects found; the given model where none was found."""
        return self.additions[-1].model if self.additions else self.diagnosis.model

    def to_dict(self) -> dict[str, Any]:
        return {
            "before": self.before.to_dict(),
            "diagnosis": self.diagnosis.to_dict(),
            "additions": [addition.to_dict() for addition in self.additions],
            "effects": [
                {**item.to_dict(), "p_value": self.p_values.get(item.effect.family())} for item in self.model.stack
            ],
        }

    @cached_property
    def noise_floor(self) -> dict[str, float]:
        """Reference error as RMSE per axis, the lower of two: of the model as given, and of the model found. So it is
        never above the error of the model found."""
        floors = [self.before.noise_floor]
        if self.diagnosis.fit is not None:
            floors.append(floor_on(self.diagnosis.fit.dataset, self.diagnosis.fit.held_out_residual[:, :3]))
        return min(floors, key=lambda floor: floor["total"])

    @property
    def p_values(self) -> dict[str, float]:
        """p-value with which each missing family was found, by family; none of those that the model held before."""
        missing = self.diagnosis.missing
        return {c.family: c.p_value for c in reversed(self.diagnosis.ranking) if c.family in missing}

    def __rich__(self) -> RenderableType:
        sequence = [(f"+ {step.effect}" if step.family else step.effect, step.rmse) for step in self.diagnosis.steps]
        floor = ("reference error", self.noise_floor)
        table = errors_table("Held-out acceleration error of each model of the sequence", [*sequence, floor])
        effects = [self._effects_table()] if self.model.stack else []
        answer, notes = (
            Text(on_terminal("\n".join(map(in_words, found)))) for found in (self._answer(), self.diagnosis.notes)
        )
        return Group(answer, *effects, table, notes)

    def _answer(self) -> list[Finding | Fact]:
        """Findings of the diagnosis without the effects, which have a table; what it calls missing is added now."""
        told = [found for found in self.diagnosis.answer if found.kind is not Kind.EFFECT]
        return [fact(Answer.FOUND_AND_ADDED, **f.facts) if f.kind is Kind.MISSING else f for f in told]

    def _effects_table(self) -> Table:
        """Parameters with which the model is saved; on a terminal of 80 columns one parameter a line."""
        table = Table(title="Effects of the model", title_justify="left")
        table.add_column("effect, and its parameters [95 %]")
        table.add_column("p", justify="right", no_wrap=True)
        for item in self.model.stack:
            parameters = "\n".join(parameter_lines(parameters_of(item.effect, item.ci95)["parameters"])) or "-"
            p_value = self.p_values.get(item.effect.family())
            table.add_row(
                Group(item.effect.name, Padding(Text(parameters), (0, 0, 0, 2))),
                "-" if p_value is None else p_in_table(p_value),
            )
        return table


def discover(
    model: Model,
    dataset: Dataset,
    candidates: Iterable[type[Effect]] | None = None,
    progress: Callable[[str], None] = lambda text: None,
    nested: bool = False,
) -> Discovery:
    """Add to `model` each missing effect of the `candidates`, one family at a time; `candidates` and `nested` are those
    of `diagnose`."""
    progress("comparing")
    before = compare(model, dataset)
    fit = fit_model(model, dataset)
    diagnosis = diagnose_fit(fit, candidates, progress, nested)
    kinds = {effect.family(): type(effect) for effect in diagnosis.best.effects}
    additions: list[Addition] = []
    for family in diagnosis.missing:
        progress(f"adding {kinds[family].name}")
        last, fitted = (additions[-1].model, additions[-1].fit_after) if additions else (model, fit)
        additions.append(add(kinds[family], last, dataset, fitted))
    return Discovery(before, diagnosis, additions)
