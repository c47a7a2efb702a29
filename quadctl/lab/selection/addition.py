"""Addition of an effect to a model: refit of the stack with intervals, and the held-out error."""

from collections.abc import Sequence
from dataclasses import dataclass

from quadctl.effects import Effect
from quadctl.errors import SettingsError
from quadctl.lab.fitting.fitted_model import FittedModel, fit_model
from quadctl.lab.fitting.initial_guesses import Unmodelled
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.selection.refit import Refit, refitted
from quadctl.lab.selection.rule import is_significant
from quadctl.lab.selection.trial import fit_on_top
from quadctl.lab.words import Answer
from quadctl.model import Model
from quadctl.words import fact


@dataclass(frozen=True, eq=False, repr=False)
class Addition(Refit):
    """Refits of a model without an effect and with it, the last of its stack."""

    @property
    def added(self) -> Effect:
        return self.model.effects[-1]

    @property
    def changed(self) -> Sequence[Effect]:
        return [self.added]

    @property
    def title(self) -> str:
        return str(fact(Answer.WITHOUT_AND_WITH, effect=self.added.name))

    @property
    def conclusion(self) -> str:
        helps = self.held_out_drop > 0.0 and is_significant(self.p_value)
        return "" if helps else str(fact(Answer.DOES_NOT_LOWER))


def add(effect: type[Effect], model: Model, dataset: Dataset, fit: FittedModel | None = None) -> Addition:
    """Fit `model` with `effect` on top of its stack; `fit` is that of the model to these flights, where it is known.

    Raises
    ------
    SettingsError
        The model holds an effect of that family already.
    """
    if effect.family() in {present.family() for present in model.effects}:
        raise SettingsError(f"{model.name}: holds a {effect.family()} already, expected another family to add")
    before = fit_model(model, dataset) if fit is None else fit
    on_top, _ = fit_on_top(effect, Unmodelled(before.relabelled(model)))
    return refitted(Addition, model, before, on_top.refined(), added=True)
