"""Search results as JSON, without the flights they were found in: small enough for a session file.

The lab's own results are written and read field by field (`cattrs`); only what differs from that is said here.
"""

import json
import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from cattrs import ClassValidationError, Converter, transform_error
from cattrs.gen import make_dict_structure_fn, make_dict_unstructure_fn, override

from quadctl.effects import every_effect, find_effect
from quadctl.errors import SettingsError
from quadctl.lab.arrays import Floats
from quadctl.lab.effect_curves import Binned, Sketch
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.selection.candidate import Candidate
from quadctl.lab.selection.diagnosis import Diagnosis
from quadctl.lab.symbolic.effect_file import CODE
from quadctl.lab.symbolic.formula import Formula
from quadctl.model import Model, StackedEffect

_FUNCTIONS = {"abs", "exp", "sqrt"}
_ARITHMETIC = re.compile(r"[\w\s.*/+(){}-]*", re.ASCII)
_NUMBER = re.compile(r"\b\d+(\.\d+)?(e-?\d+)?")
_WORD = re.compile(r"\{\w*\}?|\w+|[{}]|\.")
_COEFFICIENT = re.compile(r"[a-z]\d*")
_NO_SAMPLES: Floats = np.empty(0)
_SOURCE = "the results in the session"


class OtherCatalogueError(SettingsError):
    """The results name an effect or a parameter that is not known."""


@dataclass(frozen=True, eq=False)
class Diagnosed:
    """A diagnosis, with a sketch of every candidate that can be drawn, by the name of its effect."""

    diagnosis: Diagnosis
    sketches: dict[str, Sketch]


@dataclass(frozen=True, eq=False)
class Findings:
    """A diagnosis and its sketches, as JSON holds them."""

    content: dict[str, Any]

    @classmethod
    def of(cls, diagnosis: Diagnosis, sketches: Mapping[str, Sketch]) -> "Findings":
        """Findings of a diagnosis, with `sketches` by the name of the effect."""
        content = _writer().unstructure(diagnosis)
        for entry in content["ranking"]:
            sketch = sketches.get(entry["stack"][-1]["effect"])
            entry["sketch"] = None if sketch is None else _sketch_to_dict(sketch)
        return cls(content)

    @property
    def confounded(self) -> list[tuple[str, str]]:
        """Pairs of families that the data do not distinguish (see `Diagnosis`)."""
        return [(str(one), str(other)) for one, other in self.content.get("confounded", [])]

    def to_json(self) -> str:
        return json.dumps(self.content)

    @classmethod
    def from_json(cls, text: str, model: Model) -> "Findings":
        """Findings of a search for what `model` is missing.

        Raises
        ------
        SettingsError
            The text is no JSON, or a field is missing or wrong.
        """
        try:
            content = json.loads(text)
        except ValueError as error:
            raise SettingsError(f"is not valid JSON: {error}") from None
        if not isinstance(content, dict):
            raise SettingsError(f"is {type(content).__name__}, expected the results of a search")
        findings = cls(content)
        with suppress(OtherCatalogueError):  # then it is looked for again
            findings.diagnosed(model, Dataset(()))
        return findings

    def diagnosed(self, model: Model, dataset: Dataset) -> Diagnosed:
        """The diagnosis of `model` on `dataset` as it was made, without its values at the samples.

        Raises
        ------
        OtherCatalogueError
            The results name an effect or a parameter that is not known.
        SettingsError
            A field is missing or wrong.
        """
        context = {"model": None, "dataset": None}
        try:
            diagnosis = _reader(model, dataset).structure(self.content | context, Diagnosis)
            sketches = {
                entry["stack"][-1]["effect"]: _sketch(entry["sketch"])
                for entry in self.content["ranking"]
                if entry.get("sketch") is not None
            }
        except ClassValidationError as error:
            raise _first_settings_error(error) or SettingsError(transform_error(error)[0]) from None
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise SettingsError(f"the results are damaged ({error!r}), expected those of a search") from None
        return Diagnosed(diagnosis, sketches)


def require_formula(formula: Formula) -> Formula:
    """The formula, if it is arithmetic of known variables: it becomes Python when it is saved as an effect.

    Raises
    ------
    SettingsError
        It could be another program: a session may come from anybody.
    """
    known = {*CODE, *_FUNCTIONS, *(f"{{{name}}}" for name in formula.coefficients)}
    for part in formula.parts:
        words = set(_WORD.findall(_NUMBER.sub("", part)))
        if not _ARITHMETIC.fullmatch(part) or not words <= known:
            raise SettingsError(f"'{part}' is no formula of {', '.join(CODE)}")
    if not set(formula.variables) <= set(CODE) or not all(map(_COEFFICIENT.fullmatch, formula.coefficients)):
        raise SettingsError("variables or coefficients have names that no formula has")
    return formula


def _writer() -> Converter:
    """Converter from results to JSON; a class is registered before those that hold it."""
    converter = Converter()
    left_out = override(omit=True)
    converter.register_unstructure_hook(Model, _entries)
    converter.register_unstructure_hook(Formula, make_dict_unstructure_fn(Formula, converter, predicted=left_out))
    of_candidate = make_dict_unstructure_fn(
        Candidate,
        converter,
        model=override(rename="stack"),
        before=override(unstruct_hook=_short),
        after=override(unstruct_hook=_short),
        effect=left_out,
        residual=left_out,
        solution=left_out,
    )
    converter.register_unstructure_hook(Candidate, of_candidate)
    of_diagnosis = make_dict_unstructure_fn(Diagnosis, converter, model=left_out, dataset=left_out, fit=left_out)
    converter.register_unstructure_hook(Diagnosis, of_diagnosis)
    return converter


def _reader(model: Model, dataset: Dataset) -> Converter:
    """Converter from JSON to the results of a search for what `model` is missing in `dataset`."""
    converter = Converter()
    known = every_effect(model.effect_files)

    def read_model(entries: list[dict[str, Any]], kind: Any = Model) -> Model:
        try:
            effects = [find_effect(e["effect"], _SOURCE, known).from_values(e["parameters"], _SOURCE) for e in entries]
        except SettingsError as error:
            raise OtherCatalogueError(str(error)) from None
        return replace(model, stack=tuple(StackedEffect(effect) for effect in effects))

    def no_samples(value: Any, kind: Any) -> Floats:
        return _NO_SAMPLES

    converter.register_structure_hook(Model, read_model)
    of_formula = make_dict_structure_fn(Formula, converter, predicted=override(rename="parts", struct_hook=no_samples))
    converter.register_structure_hook(Formula, lambda value, kind: require_formula(of_formula(value, kind)))
    of_candidate = make_dict_structure_fn(
        Candidate,
        converter,
        model=override(rename="stack"),
        effect=override(rename="stack", struct_hook=lambda entries, kind: read_model(entries).effects[-1]),
        residual=override(rename="stack", struct_hook=no_samples),
        solution=override(omit=True),
    )
    converter.register_structure_hook(Candidate, of_candidate)
    of_diagnosis = make_dict_structure_fn(
        Diagnosis,
        converter,
        model=override(struct_hook=lambda value, kind: model),
        dataset=override(struct_hook=lambda value, kind: dataset),
        fit=override(omit=True),
    )
    converter.register_structure_hook(Diagnosis, of_diagnosis)
    return converter


def _entries(model: Model) -> list[dict[str, Any]]:
    return [{"effect": effect.name, "parameters": effect.values()} for effect in model.effects]


def _sketch_to_dict(sketch: Sketch) -> dict[str, Any]:
    """Places and heights of the dots of a sketch and of its line."""
    dots, line = ([_rounded(binned.x), _rounded(binned.mean)] for binned in (sketch.residual, sketch.effect))
    return {"variable": sketch.variable, "component": sketch.component, "dots": dots, "line": line}


def _sketch(entry: dict[str, Any]) -> Sketch:
    dots, line = (Binned(np.array(x), np.array(mean), np.zeros(len(x))) for x, mean in (entry["dots"], entry["line"]))
    return Sketch(entry["variable"], entry["component"], dots, line)


def _short(errors: Mapping[str, float]) -> dict[str, float]:
    """Errors rounded to seven digits."""
    return {name: float(f"{value:.7g}") for name, value in errors.items()}


def _rounded(values: Floats) -> list[float]:
    return [float(f"{value:.4g}") for value in values]


def _first_settings_error(error: BaseException) -> SettingsError | None:
    """The first sentence that was meant for the user among nested errors."""
    if isinstance(error, SettingsError):
        return error
    inner = error.exceptions if isinstance(error, BaseExceptionGroup) else ()
    return next((found for one in inner if (found := _first_settings_error(one)) is not None), None)
