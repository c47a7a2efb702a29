"""Removal of an effect from a model: refit of the rest, and the held-out error."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from quadctl.effects import Effect
from quadctl.errors import SettingsError
from quadctl.lab.fitting.fitted_model import FittedModel, fit_model
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.selection.refit import Refit, refitted
from quadctl.lab.selection.rule import is_significant
from quadctl.lab.words import Answer
from quadctl.model import Model
from quadctl.words import fact, nearest


@dataclass(frozen=True, eq=False, repr=False)
class Removal(Refit):
    """Refits of a model with an effect and without it."""

    removed: Effect

    @property
    def changed(self) -> Sequence[Effect]:
        return [self.removed]

    @property
    def title(self) -> str:
        return str(fact(Answer.WITH_AND_WITHOUT, effect=self.removed.name))

    @property
    def conclusion(self) -> str:
        worse = is_significant(self.p_value) and self.held_out_drop < 0.0
        return str(fact(Answer.WORSE_WITHOUT if worse else Answer.NO_WORSE_WITHOUT, effect=self.removed.name))

    def to_dict(self) -> dict[str, Any]:
        return {"removed": self.removed.name, **super().to_dict()}


def remove(word: str, model: Model, dataset: Dataset, fit: FittedModel | None = None) -> Removal:
    """Remove the effect called `word` (see `held_effect`) from `model`, and refit the rest; `fit` is that of the model
    to these flights, where it is known.

    Raises
    ------
    SettingsError
        The model does not hold it.
    """
    effect = held_effect(word, model)
    before = fit_model(model, dataset) if fit is None else fit
    return refitted(Removal, model, before, fit_model(model.without(effect), before.dataset), removed=effect)


def held_effect(word: str, model: Model) -> Effect:
    """Find the effect of `model` called `word`: by its full name, its family, or its variant alone.

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
