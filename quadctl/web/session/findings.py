"""Findings of a search, without the samples of the flights: small enough for a session file, and all that the page, the
report and the choice of the next flight need."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from pydantic import ConfigDict, Field, model_validator

from quadctl.effects import Effect, every_effect, find_effect
from quadctl.lab.arrays import Floats
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.selection.candidate import Candidate
from quadctl.lab.selection.diagnosis import Diagnosis, Verdict
from quadctl.lab.selection.effect_curves import Binned, Sketch
from quadctl.lab.selection.search import Step
from quadctl.lab.symbolic.effect_file import CODE
from quadctl.lab.symbolic.formula import Formula, Law, Symbolic
from quadctl.model import EffectEntry, Model, StackedEffect
from quadctl.settings import Settings

Range = tuple[float, float]
Errors = dict[str, float]

_FUNCTIONS = {"abs", "exp", "sqrt"}
_ARITHMETIC = re.compile(r"[\w\s.*/+(){}-]*", re.ASCII)
_NUMBER = re.compile(r"\b\d+(\.\d+)?(e-?\d+)?")
_WORD = re.compile(r"\{\w*\}?|\w+|[{}]|\.")
_COEFFICIENT = re.compile(r"[a-z]\d*")
_NO_SAMPLES: Floats = np.empty(0)


class _Saved(Settings):
    """Settings in which nan (unknown) and infinity (no bound) are allowed."""

    model_config = ConfigDict(allow_inf_nan=True, ser_json_inf_nan="constants")


class SavedFormula(_Saved):
    """A `Formula` without its values at the samples."""

    parts: tuple[str, ...]
    variables: tuple[str, ...]
    coefficients: dict[str, float]
    ci95: dict[str, Range]
    bounds: dict[str, Range]
    held_out_share: float

    @model_validator(mode="after")
    def _nothing_but_a_formula(self) -> "SavedFormula":
        """Refuse anything but a formula: it becomes Python when saved as an effect, and anybody may write a session."""
        known = {*CODE, *_FUNCTIONS, *(f"{{{name}}}" for name in self.coefficients)}
        for part in self.parts:
            words = set(_WORD.findall(_NUMBER.sub("", part)))
            if not _ARITHMETIC.fullmatch(part) or not words <= known:
                raise ValueError(f"'{part}' is no formula of {', '.join(CODE)}")
        if not set(self.variables) <= set(CODE) or not all(map(_COEFFICIENT.fullmatch, self.coefficients)):
            raise ValueError("variables or coefficients have names that no formula has")
        return self

    @classmethod
    def of(cls, formula: Formula) -> "SavedFormula":
        return cls(
            parts=formula.parts,
            variables=formula.variables,
            coefficients=formula.coefficients,
            ci95=formula.ci95,
            bounds=formula.bounds,
            held_out_share=formula.held_out_share,
        )

    def formula(self) -> Formula:
        return Formula(
            self.parts, self.variables, self.coefficients, self.ci95, self.bounds, self.held_out_share, _NO_SAMPLES
        )


class SavedLaw(_Saved):
    axis: str = Field(pattern="^(north|east|up|forward|right|top)$")
    sparse: SavedFormula
    compact: SavedFormula
    p_value: float


class SavedSymbolic(_Saved):
    """A `Symbolic`."""

    frame: Literal["world", "body"]
    laws: tuple[SavedLaw, ...]
    ranges: dict[str, Range]

    @classmethod
    def of(cls, symbolic: Symbolic) -> "SavedSymbolic":
        laws = [
            SavedLaw(
                axis=law.axis,
                sparse=SavedFormula.of(law.sparse),
                compact=SavedFormula.of(law.compact),
                p_value=law.p_value,
            )
            for law in symbolic.laws
        ]
        return cls(frame=symbolic.frame, laws=tuple(laws), ranges=symbolic.ranges)

    def symbolic(self) -> Symbolic:
        laws = [Law(law.axis, law.sparse.formula(), law.compact.formula(), law.p_value) for law in self.laws]
        return Symbolic(self.frame, tuple(laws), self.ranges)


class SavedSketch(_Saved):
    """A `Sketch`: places and heights of its dots, and of its line."""

    variable: str
    component: str
    dots: tuple[tuple[float, ...], tuple[float, ...]]
    line: tuple[tuple[float, ...], tuple[float, ...]]

    @classmethod
    def of(cls, sketch: Sketch) -> "SavedSketch":
        dots, line = ((_rounded(binned.x), _rounded(binned.mean)) for binned in (sketch.residual, sketch.effect))
        return cls(variable=sketch.variable, component=sketch.component, dots=dots, line=line)

    def sketch(self) -> Sketch:
        dots, line = (Binned(np.array(x), np.array(mean), np.zeros(len(x))) for x, mean in (self.dots, self.line))
        return Sketch(self.variable, self.component, dots, line)


class SavedCandidate(_Saved):
    """A `Candidate` without its residual; the last effect of `stack` is the one that was tried."""

    stack: tuple[EffectEntry, ...]
    ci95: dict[str, Range]
    before: Errors
    after: Errors
    p_value: float
    remarks: tuple[str, ...]
    worst_flight: float
    believable: bool
    distinct: bool = True  # sessions of before hold none
    sketch: SavedSketch | None = None

    @classmethod
    def of(cls, candidate: Candidate, sketch: Sketch | None) -> "SavedCandidate":
        return cls(
            stack=_entries(candidate.model),
            ci95=candidate.ci95,
            before=_short(candidate.before),
            after=_short(candidate.after),
            p_value=candidate.p_value,
            remarks=tuple(candidate.remarks),
            worst_flight=candidate.worst_flight,
            believable=candidate.believable,
            distinct=candidate.distinct,
            sketch=None if sketch is None else SavedSketch.of(sketch),
        )

    def candidate(self, model: Model) -> Candidate:
        return Candidate(
            effect=model.effects[-1],
            model=model,
            ci95=dict(self.ci95),
            before=self.before,
            after=self.after,
            p_value=self.p_value,
            residual=_NO_SAMPLES,
            remarks=list(self.remarks),
            worst_flight=self.worst_flight,
            believable=self.believable,
            distinct=self.distinct,
        )


@dataclass(frozen=True, eq=False)
class Diagnosed:
    """A diagnosis, with a sketch of every candidate that can be drawn, by the name of its effect."""

    diagnosis: Diagnosis
    sketches: dict[str, Sketch]


class SavedStep(_Saved):
    family: str
    effect: str
    rmse: Errors


class Findings(_Saved):
    """A `Diagnosed` that can be saved."""

    verdict: Verdict
    ranking: tuple[SavedCandidate, ...]
    missing: tuple[str, ...]
    steps: tuple[SavedStep, ...]
    best: tuple[EffectEntry, ...]
    confounded: tuple[tuple[str, str], ...]
    suggested_mission: str | None
    untried: tuple[str, ...]
    unexplained: bool
    symbolic: SavedSymbolic | None

    @classmethod
    def of(cls, diagnosis: Diagnosis, sketches: Mapping[str, Sketch]) -> "Findings":
        """`sketches` by the name of the effect."""
        return cls(
            verdict=diagnosis.verdict,
            ranking=tuple(SavedCandidate.of(c, sketches.get(c.effect.name)) for c in diagnosis.ranking),
            missing=tuple(diagnosis.missing),
            steps=tuple(SavedStep(family=s.family, effect=s.effect, rmse=s.rmse) for s in diagnosis.steps),
            best=_entries(diagnosis.best),
            confounded=tuple((one, other) for one, other in diagnosis.confounded),
            suggested_mission=diagnosis.suggested_mission,
            untried=tuple(diagnosis.untried),
            unexplained=diagnosis.unexplained,
            symbolic=None if diagnosis.symbolic is None else SavedSymbolic.of(diagnosis.symbolic),
        )

    def diagnosed(self, model: Model, dataset: Dataset) -> Diagnosed:
        """The diagnosis with its sketches, for the model and flights of the search; raises as `diagnosis` does."""
        sketches = {c.stack[-1].effect: c.sketch.sketch() for c in self.ranking if c.sketch is not None}
        return Diagnosed(self.diagnosis(model, dataset), sketches)

    def diagnosis(self, model: Model, dataset: Dataset) -> Diagnosis:
        """The diagnosis as it was made of `model` on `dataset`, without its values at the samples.

        Raises
        ------
        SettingsError
            It names an effect, or a parameter, that there is none of.
        """
        known = every_effect(model.effect_files)
        return Diagnosis(
            model=model,
            dataset=dataset,
            verdict=self.verdict,
            ranking=[c.candidate(_model(model, c.stack, known)) for c in self.ranking],
            missing=list(self.missing),
            steps=[Step(step.family, step.effect, step.rmse) for step in self.steps],
            best=_model(model, self.best, known),
            confounded=[list(pair) for pair in self.confounded],
            suggested_mission=self.suggested_mission,
            untried=list(self.untried),
            unexplained=self.unexplained,
            symbolic=None if self.symbolic is None else self.symbolic.symbolic(),
        )


def _entries(model: Model) -> tuple[EffectEntry, ...]:
    return tuple(EffectEntry(effect=effect.name, parameters=effect.values()) for effect in model.effects)


def _model(like: Model, stack: Iterable[EffectEntry], known: Mapping[str, type[Effect]]) -> Model:
    source = "the results in the session"
    effects = [find_effect(e.effect, source, known).from_values(e.parameters, source) for e in stack]
    return replace(like, stack=tuple(StackedEffect(effect) for effect in effects))


def _short(errors: Mapping[str, float]) -> Errors:
    """Errors rounded to seven digits."""
    return {name: float(f"{value:.7g}") for name, value in errors.items()}


def _rounded(values: Floats) -> tuple[float, ...]:
    return tuple(float(f"{value:.4g}") for value in values)
