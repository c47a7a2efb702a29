"""Take an effect out of a model, refit the rest, and see on data the fits did not see what it was worth."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from quadctl.effects import Effect
from quadctl.errors import SettingsError
from quadctl.lab.fitting.fitter import FittedModel, fit_model
from quadctl.lab.fitting.significance import improvement_p_value
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.selection.refit import Refit, refitted
from quadctl.lab.selection.rule import is_significant
from quadctl.model import Model
from quadctl.settings import nearest


@dataclass(frozen=True, eq=False, repr=False)
class Removal(Refit):
    """A model with an effect and without it, both refitted."""

    removed: Effect

    @property
    def changed(self) -> Sequence[Effect]:
        return [self.removed]

    @cached_property
    def p_value(self) -> float:
        """Of the hypothesis that the effect does not help on unseen data."""
        return improvement_p_value(self.residual_after, self.residual_after - self.residual_before, self.dataset)

    @property
    def title(self) -> str:
        return f"Error on data the fit did not see, with {self.removed.name} and without it"

    @property
    def conclusion(self) -> str:
        if is_significant(self.p_value) and self.held_out_drop < 0.0:
            return f"The unseen data support {self.removed.name}: the model is worse without it."
        return f"The unseen data do not support {self.removed.name}: it is better left out."

    def to_dict(self) -> dict[str, Any]:
        return {"removed": self.removed.name, **super().to_dict()}


def remove(word: str, model: Model, dataset: Dataset) -> Removal:
    """Take the effect called `word` (see `held_effect`) out of `model`, and refit what is left.

    Raises
    ------
    SettingsError
        The model does not hold it.
    """
    effect = held_effect(word, model)
    return remove_from_fit(effect, model, fit_model(model, dataset))


def remove_from_fit(effect: Effect, model: Model, fit: FittedModel) -> Removal:
    """Take `effect`, one of the stack, out of `model`, whose fit is given, and refit what is left."""
    return refitted(Removal, model, fit, fit_model(without(effect, model), fit.dataset), removed=effect)


def without(effect: Effect, model: Model) -> Model:
    """`model` without `effect`; the others keep their parameters."""
    return replace(model, stack=tuple(item for item in model.stack if item.effect is not effect))


def held_effect(word: str, model: Model) -> Effect:
    """The effect of `model` called `word`: by its full name, its family, or its variant alone.

    Raises
    ------
    SettingsError
        The model holds no such effect, or several whose variant has that name.
    """
    names = [effect.name for effect in model.effects]
    found = [
        effect for effect in model.effects if word in (effect.name, effect.family(), effect.name.partition(".")[2])
    ]
    if len(found) == 1:
        return found[0]
    if found:
        both = " and ".join(effect.name for effect in found)
        raise SettingsError(f"{model.name}: '{word}' is a variant of {both}, expected one of these names in full")
    if not names:
        raise SettingsError(f"{model.name}: holds no effect, so '{word}' cannot be taken out")
    hint = nearest(word, [*names, *(part for name in names for part in name.split("."))])
    expected = f", expected one of: {', '.join(names)}"
    raise SettingsError(f"{model.name}: holds no effect '{word}'{hint or expected}")
