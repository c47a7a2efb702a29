"""Result of a table of thrusts near the ground: lines for the terminal, numbers for scripts, a model for flight."""

import math
from dataclasses import dataclass
from enum import unique
from functools import cached_property
from pathlib import Path
from typing import Any

from quadctl import __version__
from quadctl.effects import Effect
from quadctl.effects.ground_effect import Surface
from quadctl.effects.ground_effect_surfaces import PREFIX, Surfaces
from quadctl.errors import QuadctlError
from quadctl.ground_curve.curves import SIGNIFICANCE, Fit, fit_all, p_same
from quadctl.ground_curve.measurement import Measurement
from quadctl.model import Model, Provenance
from quadctl.vehicle import Vehicle
from quadctl.words import Fact, Kinds, Words, estimate, fact, nearest, plain

POLE = "it is not finite at a height measured"
AT_BOUND = "(at its bound)"


def _numbers(fit: Fit) -> str:
    """Numbers of a fit with their 95 % intervals."""
    parts = []
    for name, number in zip(fit.formula.names, fit.values, strict=True):
        ci = fit.ci95.get(name)
        value, interval = (f"{number:.4g}", AT_BOUND) if ci is None else estimate(number, ci)
        parts.append(f"{name} = {value} {interval}")
    return ", ".join(parts)


def _percent(share: float) -> str:
    shown = f"{100.0 * share:.3g}" if math.isfinite(share) else "pole"
    return f"{shown:>8}"


_WORDS = Words(
    {"percent": _percent, "numbers": _numbers, "newtons": lambda far_n: ", ".join(f"{value:.4g} N" for value in far_n)}
)


@unique
class Kind(Kinds, words=_WORDS):
    """Kinds of findings, each with the template of its words."""

    READINGS = (
        "{readings} readings at {heights} heights. Error of thrust on heights that the fit has not seen, % of the "
        "thrust far from the ground:"
    )
    BEST = "  {name}  {fit.held_out:percent}  best        {fit:numbers}"
    OTHER = "  {name}  {fit.held_out:percent}  p = {p:<6.2g}  {fit:numbers}"
    NOT_DISTINCT = (
        "These data cannot tell {best} from {others:list} (p > {level:g}): measure lower, at more heights, or with "
        "more repeats."
    )
    DISTINCT = "{best} is better than every other formula (p <= {level:g})."
    NOT_SEEN = "A ground effect is not seen in these data."
    POLES = "Not finite at a height measured: {names:list}."
    FAR = "Thrust far from the ground, fitted with {best}: {far_n:newtons}."


@dataclass(frozen=True)
class GroundCurve:
    """All formulas fitted to one table, the best on unseen heights first."""

    measurement: Measurement
    vehicle: Vehicle
    fits: tuple[Fit, ...]
    source: str
    """Name of the table."""

    @cached_property
    def p_values(self) -> tuple[float, ...]:
        """Probability, for each fit, that its held-out error differs from the best one's by chance."""
        return tuple(p_same(fit, self.fits[0]) for fit in self.fits)

    @property
    def best(self) -> Fit:
        return self.fits[0]

    @property
    def equals(self) -> tuple[Fit, ...]:
        """Formulas that these data cannot tell from the best one."""
        return tuple(f for f, p in zip(self.fits[1:], self.p_values[1:], strict=True) if p > SIGNIFICANCE)

    def chosen(self, word: str | None) -> Fit:
        """The fit of the formula `word` (full name or variant), or the best one that may fly.

        Raises
        ------
        QuadctlError
            There is no such formula in this result, or it must not fly.
        """
        by_name = {fit.formula.name: fit for fit in self.fits if fit.formula.effect is not None}
        if word is None:
            return next(fit for fit in by_name.values() if not _grounded(fit))
        for name, fit in by_name.items():
            if word in (name, name.partition(".")[2]):
                if reason := _grounded(fit):
                    raise QuadctlError(f"--formula {word}: {reason}, expected another formula to fly with")
                return fit
        variants = [name.partition(".")[2] for name in by_name]
        hint = nearest(word, variants) or f", expected one of: {', '.join(variants)}"
        raise QuadctlError(f"--formula is '{word}'{hint}")

    def model(self, fit: Fit, surface: str | None, vehicle_path: Path) -> Model:
        """The vehicle with one fitted formula; the controller fades it out beyond the heights measured.

        A formula that has a value for each surface gives `ground_effect.surfaces`, or the effect over `surface` alone.

        Raises
        ------
        QuadctlError
            `surface` is none of the formula's surfaces, or one of their names cannot stand in a model.
        """
        surfaces = fit.formula.per_surface
        if surface is not None and surfaces and surface not in surfaces:
            raise QuadctlError(f"--surface is '{surface}', expected one of: {', '.join(surfaces)}")
        if surfaces and surface is None:
            effect, ci95 = self._over_all(fit)
        else:
            made = fit.formula.with_values(fit.values, surface or "")
            assert made is not None
            suffix = f"[{surface}]" if surfaces else ""
            own = {name: ci for name, ci in fit.ci95.items() if name.endswith(suffix)}
            effect, ci95 = made, {name.removesuffix(suffix): ci for name, ci in own.items()}
        heights = [point.height_m for point in self.measurement.points]
        fitted = Provenance(
            logs=(self.source,),
            ci95=ci95,
            height_m=(min(heights), max(heights)),
            software=f"quadctl {__version__}",
        )
        return Model(self.vehicle, name=effect.name, vehicle_path=vehicle_path).plus(effect, fitted)

    def _over_all(self, fit: Fit) -> tuple[Effect, dict[str, tuple[float, float]]]:
        """The effect with a weight for each surface, and the intervals of these weights."""
        values, ci95 = {}, {}
        for name in fit.formula.per_surface:
            if not name.isidentifier() or name != name.lower():
                raise QuadctlError(
                    f"{self.source}: surface is '{name}', expected lower-case letters, digits and underscores, "
                    "or one of the surfaces with --surface"
                )
            effect = fit.formula.with_values(fit.values, name)
            assert isinstance(effect, Surface)
            values["k_b"], values[PREFIX + name] = effect.k_b, effect.k_s
            if (interval := fit.ci95.get(f"k_s[{name}]")) is not None:
                ci95[PREFIX + name] = interval
        return Surfaces.from_values(values, self.source), ci95

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        radius_m = self.vehicle.rotor.radius_m
        told = {
            "table": self.source,
            "readings": len(self.measurement.points),
            "heights": len(self.measurement.height_groups(radius_m)),
            "surfaces": [surface for surface in self.measurement.surfaces if surface],
            "formulas": [self._fit_dict(fit, p) for fit, p in zip(self.fits, self.p_values, strict=True)],
            "not_told_apart": [fit.formula.name for fit in (self.best, *self.equals)] if self.equals else [],
        }
        found: dict[str, Any] = plain(told)
        return found

    def _fit_dict(self, fit: Fit, p: float) -> dict[str, Any]:
        ci95 = fit.ci95
        return {
            "formula": fit.formula.name,
            "rmse_held_out": fit.held_out,
            "rmse_fit": fit.rmse,
            "p_same_as_best": p,
            "parameters": {
                name: {"value": float(value), "ci95": ci95.get(name)}
                for name, value in zip(fit.formula.names, fit.values, strict=True)
            },
            "thrust_far_n": None if self.measurement.is_ratio else fit.far.tolist(),
        }

    def findings(self) -> list[Fact]:
        """Findings in the order in which they are told."""
        width = max(len(fit.formula.name) for fit in self.fits)
        errors = [
            fact(Kind.BEST if fit is self.best else Kind.OTHER, fit=fit, p=p, name=f"{fit.formula.name:{width}}")
            for fit, p in zip(self.fits, self.p_values, strict=True)
        ]
        return [
            fact(Kind.READINGS, readings=len(self.measurement.points), heights=len(self.best.height_errors)),
            *errors,
            *self._remarks(),
        ]

    def _remarks(self) -> list[Fact]:
        best = self.best.formula.name
        if self.equals:
            others = [fit.formula.name for fit in self.equals]
            found = [fact(Kind.NOT_DISTINCT, best=best, others=others, level=SIGNIFICANCE)]
        else:
            found = [fact(Kind.DISTINCT, best=best, level=SIGNIFICANCE)]
        if any(fit.formula.effect is None for fit in (self.best, *self.equals)):
            found.append(Fact(Kind.NOT_SEEN))
        if poles := [fit.formula.name for fit in self.fits if math.isinf(fit.held_out)]:
            found.append(fact(Kind.POLES, names=poles))
        if not self.measurement.is_ratio:
            found.append(fact(Kind.FAR, best=best, far_n=self.best.far))
        return found


def evaluate(measurement: Measurement, vehicle: Vehicle, source: str) -> GroundCurve:
    """Fit and rank all formulas; `source` names the table."""
    return GroundCurve(measurement, vehicle, tuple(fit_all(measurement, vehicle)), source)


def _grounded(fit: Fit) -> str:
    """Reason why the formula must not fly; empty where it may."""
    effect = fit.formula.effect
    assert effect is not None
    return POLE if math.isinf(fit.rmse) else effect.not_for_flight
