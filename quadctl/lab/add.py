"""Add an effect to a model: refit the stack, say how sure its parameters are, judge it on data it has not seen."""

from dataclasses import dataclass
from typing import Any

from rich.console import Group, RenderableType
from rich.text import Text

from quadctl import __version__
from quadctl.effects import Effect
from quadctl.errors import SettingsError
from quadctl.lab.data import Dataset, rmse
from quadctl.lab.diagnose import parameters_in_words
from quadctl.lab.fit import Fitter, intervals, remarks, values_of
from quadctl.lab.prepare import Floats
from quadctl.lab.tables import errors_table
from quadctl.model import Model, Provenance, StackedEffect


@dataclass(frozen=True, eq=False)
class Addition:
    """The model before and after, with held-out errors, m/s^2."""

    before_model: Model
    model: Model
    dataset: Dataset
    before: dict[str, float]
    after: dict[str, float]
    draws: Floats
    """Bootstrap draws of all free parameters of the stack, shape (draws, p), in the order of `Fitter.free`."""
    remarks: list[str]

    @property
    def held_out_drop(self) -> float:
        return 1.0 - self.after["total"] / self.before["total"]

    def to_dict(self) -> dict[str, Any]:
        return {
            "effects": [
                {
                    "effect": item.effect.name,
                    "parameters": item.effect.values(),
                    "ci95": {k: list(v) for k, v in item.fitted.ci95.items()} if item.fitted else {},
                }
                for item in self.model.stack
            ],
            "flights": self.dataset.names,
            "rmse_before": self.before,
            "rmse_after": self.after,
            "held_out_drop": self.held_out_drop,
            "held_out": self.dataset.hold_out,
            "remarks": self.remarks,
        }

    def __rich__(self) -> RenderableType:
        added = self.model.stack[-1].effect.name
        title = f"Error on data the fit did not see, with {added}"
        table = errors_table(title, (("before", self.before), ("after", self.after)))
        lines = [f"The held-out error changes by {-self.held_out_drop:+.1%}. The model now holds:"]
        for item in self.model.stack:
            words = parameters_in_words(item.effect, item.fitted.ci95 if item.fitted else {})
            lines.append(f"  {item.effect.name}: {words}")
        lines += [f"Note: {remark}." for remark in self.remarks]
        if self.held_out_drop <= 0.0:
            lines.append("The effect does not help on unseen data: it is better left out.")
        return Group(table, Text("\n".join(lines)))


def add(effect: type[Effect], model: Model, dataset: Dataset) -> Addition:
    """Fit `model` with `effect` on top of its stack.

    Raises
    ------
    SettingsError
        The model holds an effect of that family already.
    """
    if effect.family() in {present.family() for present in model.effects}:
        raise SettingsError(f"{model.name}: holds a {effect.family()} already, expected another family to add")
    base = Fitter(model, dataset)
    before = rmse(dataset.measured - base.held_out(base.fit()))
    fitter = Fitter(model.plus(effect()), dataset)
    fitted = fitter.fit()
    after = rmse(dataset.measured - fitter.held_out(fitted))
    draws = fitter.bootstrap(fitted)
    ci = intervals(fitter.free, draws)
    stack = []
    for i, item in enumerate(fitted.model.stack):
        own = {f.parameter.name: c for f, c in zip(fitter.free, ci, strict=True) if f.effect == i}
        last = i == len(fitted.model.stack) - 1
        old = item.fitted or Provenance()
        fresh = Provenance(
            logs=tuple(dataset.names),
            rmse_before=before["total"] if last else old.rmse_before,
            rmse_after=after["total"] if last else old.rmse_after,
            held_out=True,
            ci95=own,
            height_m=dataset.heights_m,
            software=f"quadctl {__version__}",
        )
        stack.append(StackedEffect(item.effect, fresh))
    result = Model(model.vehicle, tuple(stack), model.name, model.vehicle_path)
    notes = remarks(fitter.free, values_of(fitted.model, fitter.free), ci)
    return Addition(model, result, dataset, before, after, draws, notes)
