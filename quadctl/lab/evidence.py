"""Evidence for one effect of a model: the model fitted with it, and fitted again without it."""

from dataclasses import dataclass

from quadctl.effects import Effect
from quadctl.lab.comparison.wording import change_in_words
from quadctl.lab.effect_curves import EffectCurve, fitted_effect_curves
from quadctl.lab.fitting.fitted_model import FittedModel, fit_model
from quadctl.lab.selection.candidate import LEAST_ERROR, measure_of
from quadctl.lab.selection.refit import drop_between
from quadctl.lab.selection.removal import held_effect


@dataclass(frozen=True, eq=False)
class Evidence:
    """Evidence for an effect of a fitted model."""

    effect: Effect
    """The effect with the parameters of the fit."""
    beside: tuple[str, ...]
    """Families of the other effects of the model, which are fitted together with it."""
    curves: list[EffectCurve]
    """Curves of the fit with all effects, apart from bias and calibration of each flight; those of the `measure` come
    first."""
    before: dict[str, float]
    """Held-out RMSE per axis and group without the effect, all else fitted again."""
    after: dict[str, float]
    """Held-out RMSE per axis and group with it."""
    drop_ci95: tuple[float, float]
    """95 % interval of the relative drop of the held-out error `measure`."""

    @property
    def measure(self) -> str:
        """Name of the error by which the effect is judged (see `Candidate.measure`)."""
        return measure_of([self.effect], self.before, self.after)

    @property
    def drop_in_words(self) -> str:
        """Change of the held-out error `measure` with its interval: `-75% [-80%, -71%]`."""
        drop = 1.0 - self.after[self.measure] / max(self.before[self.measure], LEAST_ERROR)
        low, high = self.drop_ci95
        return f"{change_in_words(drop)} [{change_in_words(high)}, {change_in_words(low)}]"


def evidence_for(name: str, fit: FittedModel) -> Evidence:
    """Compare the fit of a model with that of the same model without the effect called `name`.

    Raises
    ------
    SettingsError
        The model holds no such effect.
    """
    effect = held_effect(name, fit.model)
    rest = fit_model(fit.model.without(effect), fit.dataset)
    found = rest.held_out_rmse, fit.held_out_rmse
    measure = measure_of([effect], *found)
    curves = fitted_effect_curves(fit, fit.model.effects.index(effect))
    return Evidence(
        effect=effect,
        beside=tuple(other.family() for other in rest.model.effects),
        curves=sorted(curves, key=lambda curve: curve.group != measure),
        before=found[0],
        after=found[1],
        drop_ci95=drop_between(rest, fit, measure),
    )
