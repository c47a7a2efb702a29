"""One effect tried on top of a model: fitted, judged on data that its fit did not see, supported by them or not."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from quadctl.effects import Effect
from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.fitter import Fitted, Fitter
from quadctl.lab.fitting.initial_guesses import Unmodelled, best_starts
from quadctl.lab.fitting.nuisances import AGE, MOST
from quadctl.lab.fitting.parameters import intervals, remarks, values_of
from quadctl.lab.fitting.significance import improvement_p_value
from quadctl.lab.flights.dataset import GROUPS, MOMENTS, Dataset, concerns, rmse
from quadctl.lab.threads import one_blas_thread
from quadctl.model import Model

SIGNIFICANT = 0.01
"""After multiplication with the number of candidates tried (Bonferroni)."""
MATERIAL = 0.05
"""A family is called missing only when it takes this share off the held-out error of one axis: less is within what
unknown trims and coefficients of any real vehicle do."""
HARMLESS = 0.01
"""An effect that is about moments may add this share to the error of any of them,"""
HARMLESS_BESIDE = 0.2
"""or this share of what it takes off another."""
SHOWN = 0.01
"""Share that an effect must take off the error of each moment that it has to show in,"""
SHOWN_ALONE = 0.2
"""or this share where it has to show in one only,"""
SHOWN_BESIDE = 0.2
"""and this share of what it takes off any axis: the nuisances can hide as much of one moment as of another, and what
lowers the error of the thrust alone is another family."""
NOTHING = 1e-9
"""An error of a log that was made up, not flown."""
RETIMED = 3
"""So often, at most, a lag and how late the log is are found in turn."""
IDLE = 0.005
"""An effect that changes the error of the acceleration by less than this share does nothing to it."""


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
    """Held out, with the effect, of the dataset's targets."""
    remarks: list[str]
    worst_flight: float = 0.0
    """The least of the shares taken off the error of each moment in each flight, or 0 where none is negative."""
    believable: bool = True
    """The parameters are what the effect can be, and those of the others remain so; otherwise its form stands in for
    another."""
    distinct: bool = True
    """These data tell it from what looks like it."""

    @property
    def family(self) -> str:
        return self.effect.family()

    @property
    def measure(self) -> str:
        """The error that the effect is about: of the acceleration unless it does nothing to it (see `GROUPS`)."""
        return measure_of([self.effect], self.before, self.after)

    @property
    def held_out_drop(self) -> float:
        return 1.0 - self.after[self.measure] / self.before[self.measure]

    @property
    def drops(self) -> dict[str, float]:
        """Share of the unseen error that the effect takes off each axis that it is about."""
        about = [group for group in GROUPS if group in self.after and concerns(self.effect, group)]
        axes = [axis for group in about for axis in GROUPS[group]]
        return {axis: 1.0 - self.after[axis] / max(self.before[axis], NOTHING) for axis in axes}

    @property
    def largest_drop(self) -> float:
        """On the axis where the effect helps most."""
        return max(self.drops.values())

    @property
    def score(self) -> float:
        return unseen_score(self.residual)

    @property
    def harmful(self) -> bool:
        """It is about moments and makes one of them worse, or in one flight by more than it helps in all of them, as a
        stand-in for another effect does."""
        drops = [self.drops.get(axis, 0.0) for axis in MOMENTS]
        all_in_all = min(drops) < -max(HARMLESS, HARMLESS_BESIDE * max(drops))
        return self.effect.affects_moment and (all_in_all or self.worst_flight < -max(HARMLESS, *drops))

    @property
    def supported(self) -> bool:
        """The data that its fit did not see say that it is there, and it is more than a trim."""
        return self.distinct and self.plausible

    @property
    def plausible(self) -> bool:
        """Supported, be it that the data do not tell it from what looks like it."""
        return self._shown and self.largest_drop > MATERIAL and not self.effect.negligible()

    @property
    def seen(self) -> bool:
        """It is there, be it only as what is a little off in every vehicle."""
        return self.distinct and self._shown

    @property
    def _shown(self) -> bool:
        helps = self.held_out_drop > 0.0 and not self.harmful and self.p_value < SIGNIFICANT
        shown = [self.drops.get(axis, 0.0) for axis in self.effect.shows_in(self.model.vehicle)]
        turned = [self.drops.get(axis, 0.0) for axis in MOMENTS]
        enough = max(SHOWN if len(shown) > 1 else SHOWN_ALONE, SHOWN_BESIDE * self.largest_drop)
        shows = not shown or (min(shown) > enough and min(turned) > -HARMLESS)
        at_bound = any("bound" in remark for remark in self.remarks)
        undetermined = sum("not determined" in remark for remark in self.remarks)
        known = not self.ci95 or undetermined < len(self.ci95)
        return helps and shows and self.believable and known and not at_bound

    @property
    def text(self) -> str:
        axis = max(self.drops, key=self.drops.__getitem__)
        helps = f"It takes {self.held_out_drop:.0%} off the unseen error, {self.largest_drop:.0%} on the {axis} axis."
        verdict = (
            helps
            if self.supported
            else f"{helps} These data cannot tell it from what looks like it (told by {self.effect.distinguished_by})."
            if self.plausible
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
            "rmse_before": self.before[self.measure],
            "rmse_after": self.after[self.measure],
            "held_out_drop": self.held_out_drop,
            "p_value": self.p_value,
            "text": self.text,
        }


def measure_of(effects: Iterable[Effect], before: Mapping[str, float], after: Mapping[str, float]) -> str:
    """Which error a change of `effects` is about: of the acceleration unless they do nothing to it."""
    changed = list(effects)
    turning, sensing = any(e.affects_moment for e in changed), any(e.senses for e in changed)
    for group, possible in (("total", True), ("turning", turning), ("sensing", sensing)):
        if possible and group in after and abs(after[group] / max(before[group], NOTHING) - 1.0) >= IDLE:
            return group
    return "total"


@one_blas_thread
def try_effect(effect: type[Effect], left: Unmodelled, n_tried: int) -> Candidate:
    """Fit `effect` on top of the model that `left` is of; `n_tried` candidates are tried on these data."""
    dataset, residual = left.dataset, left.residual
    fitter, fitted, independent = fit_on_top(effect, left)
    after = dataset.targets - fitter.held_out(fitted)
    last = len(fitted.model.effects) - 1
    ci = intervals(fitter.free, fitter.bootstrap(fitted))
    own = [(f, c) for f, c in zip(fitter.free, ci, strict=True) if f.effect == last]
    values = values_of(fitted.model, [f for f, _ in own])
    return Candidate(
        effect=fitted.model.effects[last],
        model=fitted.model,
        ci95={f.parameter.name: c for f, c in own},
        before=rmse(residual, dataset.groups),
        after=rmse(after, dataset.groups),
        p_value=min(1.0, improvement_p_value(residual, residual - after, dataset) * n_tried * independent),
        residual=after,
        worst_flight=_worst_flight(residual, after, dataset),
        remarks=remarks([f for f, _ in own], values, [c for _, c in own]),
        believable=unbelievable(fitted.model, dataset) <= unbelievable(left.model, dataset),
        distinct=effect.name not in indistinct(fitted.model, dataset),
    )


def fit_on_top(effect: type[Effect], left: Unmodelled) -> tuple[Fitter, Fitted, int]:
    """The best fit of the model that `left` is of with `effect`, and how many independent starts it was chosen from."""
    starts, independent = best_starts(effect, left)
    fitters = [Fitter(left.model.plus(start), left.dataset) for start in starts]
    fits = [fitter.fit() for fitter in fitters]
    misfits = [fitter.misfit(fitted, left.scale) for fitter, fitted in zip(fitters, fits, strict=True)]
    best = misfits.index(min(misfits))
    fitter, fitted = fitters[best], fits[best]
    for _ in range(RETIMED if effect.adds_lag else 0):
        if np.abs(fitted.nuisances[:, AGE]).max() < 0.5 * MOST[AGE]:
            break
        # The log was timed for the lag that the fit began with, and that was too far off.
        fitter = Fitter(fitted.model, left.dataset)
        fitted = fitter.fit()
    return fitter, fitted, independent


def _worst_flight(before: Floats, after: Floats, dataset: Dataset) -> float:
    """The least of the shares taken off the error of each moment in each flight, or 0 where none is negative."""
    worst = 0.0
    for part in dataset.parts:
        had, left = rmse(before[part], dataset.groups), rmse(after[part], dataset.groups)
        worst = min([worst, *(1.0 - left[axis] / max(had[axis], NOTHING) for axis in MOMENTS if axis in had)])
    return worst


def unbelievable(model: Model, dataset: Dataset) -> set[str]:
    """Effects of a model fitted to `dataset` whose parameters are not what they can be, by name."""
    flights = [flight.conditions for flight in dataset.flights]
    return {effect.name for effect in model.acting if not effect.believable(flights, model.vehicle)}


def indistinct(model: Model, dataset: Dataset) -> set[str]:
    """Effects of a model fitted to `dataset` that it does not tell from what looks like them, by name."""
    flights = [flight.conditions for flight in dataset.flights]
    return {effect.name for effect in model.acting if not effect.distinct(flights, model.vehicle)}


def unseen_score(residual: Floats) -> float:
    """Logarithm of the held-out RMSE of the acceleration, plus the mean logarithms of what else is measured.

    Logarithms, so that forces and moments, with units of their own, add up.
    """
    power = np.maximum(np.mean(residual**2, axis=0), 1e-12)
    others = [float(np.log(power[i : i + 3]).mean()) for i in range(3, len(power), 3)]
    return 0.5 * (float(np.log(power[:3].sum())) + sum(others))


def parameters_in_words(effect: Effect, ci95: dict[str, tuple[float, float]]) -> str:
    """`a = 0.114 [0.10, 0.12], b = 5.4 [5.0, 5.8]`; fixed parameters are left out."""
    values = effect.values()
    return (
        ", ".join(f"{name} = {values[name]:.4g} [{low:.4g}, {high:.4g}]" for name, (low, high) in ci95.items()) or "-"
    )
