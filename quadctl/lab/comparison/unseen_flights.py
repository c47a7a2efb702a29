"""Judgement of two models, before and after, on flights that neither a fit nor a choice of effects has seen."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

from rich.console import RenderableType
from rich.text import Text

from quadctl.lab.comparison.comparison import Comparison, compare
from quadctl.lab.comparison.wording import change_in_words, listed, number, on_terminal, quantity, roughly
from quadctl.lab.fitting.bootstrap import drop_interval
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.results import Result
from quadctl.model import Model


@dataclass(frozen=True, eq=False, repr=False)
class Judgement(Result):
    """Comparisons of two models with the same unseen flights."""

    before: Comparison
    after: Comparison

    @property
    def drop(self) -> float:
        """Relative drop of the total error, 1 - RMSE after / RMSE before."""
        return 1.0 - self.after.rmse["total"] / self.before.rmse["total"]

    @cached_property
    def drop_ci95(self) -> tuple[float, float]:
        """95 % interval of the drop, by resampling blocks of time."""
        return drop_interval(self.before.residual, self.after.residual, self.after.dataset.block)

    def to_dict(self) -> dict[str, Any]:
        return {
            "flights": self.after.dataset.names,
            "rmse_before": self.before.rmse,
            "rmse_after": self.after.rmse,
            "noise_floor": self.after.noise_floor,
            "drop": self.drop,
            "drop_ci95": list(self.drop_ci95),
        }

    def __rich__(self) -> RenderableType:
        low, high = (change_in_words(drop) for drop in reversed(self.drop_ci95))
        said = (
            f"On {listed(self.after.dataset.names)}, which no fit has seen: {number(self.before.rmse['total'])} -> "
            f"{quantity(self.after.rmse['total'])} ({change_in_words(self.drop)} [{low}, {high}]; reference error "
            f"{roughly(self.after.noise_floor['total'])})."
        )
        return Text(on_terminal(said))


def judge(before: Model, after: Model, unseen: Dataset) -> Judgement:
    """Compare two models of one vehicle, as they stand, with flights that no fit has seen."""
    return Judgement(compare(before, unseen), compare(after, unseen))
