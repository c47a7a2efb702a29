"""Discovery: compare, diagnose and add until no significant effect is missing."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from rich.console import Group, RenderableType
from rich.text import Text

from quadctl.effects import Effect
from quadctl.lab.comparison.comparison import Comparison, compare
from quadctl.lab.fitting.fitted_model import fit_model
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.results import Result, errors_table
from quadctl.lab.selection.addition import Addition, add_to_fit
from quadctl.lab.selection.diagnosis import Diagnosis, diagnose_fit
from quadctl.model import Model


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
        }

    def __rich__(self) -> RenderableType:
        ladder = [(f"+ {step.effect}" if step.family else step.effect, step.rmse) for step in self.diagnosis.steps]
        floor = ("noise floor", self.before.noise_floor)
        table = errors_table("Held-out acceleration error after each selection step", [*ladder, floor])
        return Group(table, Text("\n".join(self.diagnosis.lines())))


def discover(
    model: Model,
    dataset: Dataset,
    candidates: Iterable[type[Effect]] | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> Discovery:
    """Add to `model` each missing effect of the `candidates` (as in `diagnose`), one family at a time."""
    progress("comparing")
    before = compare(model, dataset)
    fit = fit_model(model, dataset)
    diagnosis = diagnose_fit(fit, candidates, progress)
    kinds = {effect.family(): type(effect) for effect in diagnosis.best.effects}
    additions: list[Addition] = []
    for family in diagnosis.missing:
        progress(f"adding {kinds[family].name}")
        last = (additions[-1].model, additions[-1].fit_after) if additions else (model, fit)
        additions.append(add_to_fit(kinds[family], *last))
    return Discovery(before, diagnosis, additions)
