"""YAML files to validated settings; every error names the file, the field, the value and what was expected."""

import math
import re
import reprlib
import types
import typing
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, Self, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError, ValidationInfo, field_validator
from pydantic_core import PydanticKnownError

from quadctl.errors import SettingsError
from quadctl.words import nearest


class Settings(BaseModel):
    """Base class of all settings: unknown keys and non-finite numbers are refused, values never change."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    @field_validator("*", mode="before")
    @classmethod
    def _no_truth_for_a_number(cls, value: Any, info: ValidationInfo) -> Any:
        """`mass_kg: yes` is not one kilogram, as pydantic has it."""
        if _holds_bool(value) and _is_numeric(cls.model_fields[str(info.field_name)].annotation):
            raise PydanticKnownError("float_type")
        return value

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Copy as pydantic does, without the values that the original had computed and cached."""
        copy = super().model_copy(update=update, deep=deep)
        for name in copy.__dict__.keys() - type(self).model_fields.keys():
            del copy.__dict__[name]
        return copy


MAX_YAML_BYTES = 1_000_000
"""Largest settings file. A larger one is for example a flight log by mistake, on which YAML would take minutes."""

S = TypeVar("S", bound=BaseModel)


def read_yaml(path: Path) -> dict[str, Any]:
    """The mapping that a YAML file holds.

    Raises
    ------
    SettingsError
        The file is missing, empty, not text, not YAML, or not a mapping.
    """
    try:
        if path.exists() and not (path.is_file() or path.is_dir()):
            raise SettingsError(f"{path}: is a device or a pipe, expected a YAML file")
        if path.is_file() and path.stat().st_size > MAX_YAML_BYTES:
            raise SettingsError(f"{path}: is larger than {MAX_YAML_BYTES / 1e6:g} MB, expected settings in YAML")
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise SettingsError(f"{path}: there is no such file") from None
    except IsADirectoryError:
        raise SettingsError(f"{path}: is a directory, expected a YAML file") from None
    except UnicodeDecodeError:
        raise SettingsError(f"{path}: is not a text file, expected YAML") from None
    except OSError as error:
        raise SettingsError(f"{path}: cannot be read ({error.strerror})") from None
    return parse_yaml(text, path)


def parse_yaml(text: str, path: Path) -> dict[str, Any]:
    """Read text as `read_yaml` reads a file; `path` names it in error messages."""
    data = read_value(text, str(path))
    if data is None:
        raise SettingsError(f"{path}: is empty, expected settings in YAML")
    if not isinstance(data, dict):
        raise SettingsError(f"{path}: holds {_shown(data)}, expected a mapping of keys to values")
    return data


def read_value(text: str, source: str) -> Any:
    """Value that a piece of YAML holds; raises SettingsError, naming `source`, where it is not valid YAML."""
    try:
        return yaml.load(text, Loader=_StrictLoader)
    except (yaml.YAMLError, ValueError) as error:  # ValueError: what looks like a date or a whole number but is none
        raise SettingsError(f"{source}{_yaml_problem(error)}") from None
    except RecursionError:
        raise SettingsError(f"{source}: is nested too deeply to be settings") from None


def load(path: Path | str, kind: type[S]) -> S:
    """Read `path` and validate it as `kind`."""
    return validate(read_yaml(Path(path)), kind, str(path))


def validate(data: Any, kind: type[S], source: str) -> S:
    """`data` as `kind`; `source` names it in error messages."""
    try:
        return kind.model_validate(data)
    except ValidationError as error:
        raise SettingsError(f"{source}: {_first_problem(error, kind, data)}") from None


def limits(kind: type[BaseModel], field: str) -> tuple[float, float]:
    """Lowest and highest value between which a number of a settings class must lie; infinite where it has no limit."""
    metadata = kind.model_fields[field].metadata
    lows = [float(getattr(limit, name)) for limit in metadata for name in ("gt", "ge") if hasattr(limit, name)]
    highs = [float(getattr(limit, name)) for limit in metadata for name in ("lt", "le") if hasattr(limit, name)]
    return max(lows, default=-math.inf), min(highs, default=math.inf)


class _StrictLoader(yaml.SafeLoader):
    """YAML's SafeLoader, but a key given twice is an error, not a silent choice of the last; keys are text; 1e-7 is a
    number although it has no point."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen = set()
        for key_node, _ in node.value:
            problem = None
            if key_node.tag not in _KEY_TAGS:
                problem = "this key is not text, put it in quotes"
            elif key_node.value in seen:
                problem = f"the key '{key_node.value}' is given twice"
            if problem:
                raise yaml.constructor.ConstructorError(None, None, problem, key_node.start_mark)
            seen.add(key_node.value)
        return super().construct_mapping(node, deep)


_KEY_TAGS = ("tag:yaml.org,2002:str", "tag:yaml.org,2002:merge")
_StrictLoader.add_implicit_resolver(
    "tag:yaml.org,2002:float", re.compile(r"[-+]?[0-9]+(\.[0-9]*)?[eE][-+]?[0-9]+$"), list("-+0123456789")
)


def _holds_bool(value: Any) -> bool:
    return isinstance(value, bool) or (isinstance(value, list) and any(isinstance(item, bool) for item in value))


def _is_numeric(annotation: Any) -> bool:
    """True where a field of this type holds numbers, alone or in a list."""
    if isinstance(annotation, type) and not typing.get_args(annotation):
        return annotation in (int, float)
    return any(_is_numeric(argument) for argument in typing.get_args(annotation))


def _yaml_problem(error: Exception) -> str:
    mark = getattr(error, "problem_mark", None)
    problem = getattr(error, "problem", None) or str(error).partition("\n")[0]
    where = f", line {mark.line + 1}, column {mark.column + 1}" if mark else ""
    return f"{where}: is not valid YAML: {problem}"


def _first_problem(error: ValidationError, kind: type[BaseModel], data: Any) -> str:
    problems = error.errors(include_url=False)
    locations = [_location(problem, data) for problem in problems]
    # Of the alternatives that a field has, the one that fits best is meant: its problem lies deepest. But an unknown
    # key is usually the cause of a missing one: say it first.
    deepest = max(range(len(problems)), key=lambda i: len(locations[i]))
    worst = next((i for i, p in enumerate(problems) if p["type"] == "extra_forbidden"), deepest)
    problem, location = problems[worst], locations[worst]
    field = _field_name(location)
    if problem["type"] == "extra_forbidden":
        known = sorted(_known_keys(kind, location[:-1]))
        if len(location) == 1 and (theirs := _kind_of(data)) != (ours := _kind_of(known)) and theirs and ours:
            return f"is {theirs}, expected {ours}"
        hint = nearest(str(location[-1]), known)
        return f"unknown key '{field}'{hint or ', expected one of: ' + ', '.join(known)}"
    if problem["type"] == "missing":
        return f"{field} is missing"
    if problem["type"] == "value_error":
        return f"{field + ': ' if field else ''}{problem['ctx']['error']}"
    words = _EXPECTATIONS.get(problem["type"])
    expectation = words.format(**problem.get("ctx", {})) if words else problem["msg"].removeprefix("Input should be ")
    return f"{field or 'the file'} is {_shown(problem['input'])}, expected {expectation}"


_EXPECTATIONS = {
    "model_type": "keys and values",
    "dict_type": "keys and values",
    "list_type": "a list",
    "tuple_type": "a list",
    "string_type": "text",
    "float_type": "a number",
    "float_parsing": "a number",
    "int_type": "a whole number",
    "int_parsing": "a whole number",
    "int_from_float": "a whole number",
    "bool_type": "true or false",
    "bool_parsing": "true or false",
    "too_short": "at least {min_length} entries, not {actual_length}",
    "too_long": "at most {max_length} entries, not {actual_length}",
}
"""pydantic's kinds of problem in the words of someone who edits YAML; it says the others well enough itself."""


_MARKS = {
    "effects": "a model",
    "phases": "a mission",
    "mass_kg": "a vehicle file",
    "guards": "a flight configuration",
}
"""Keys by which the kind of a file is known."""


def _kind_of(keys: Collection[str]) -> str | None:
    """Kind of the file with these keys at its top; None where none of them tells."""
    return next((kind for key, kind in _MARKS.items() if key in keys), None)


def _location(problem: Mapping[str, Any], data: Any) -> list[int | str]:
    """Keys and indices that lead to the problem in `data`; pydantic also names alternatives of a field's type."""
    location = []
    for part in problem["loc"]:
        inside = isinstance(data, list | tuple) and isinstance(part, int) and part < len(data)
        if inside or (isinstance(data, dict) and part in data):
            data = data[part]
            location.append(part)
    return [*location, problem["loc"][-1]] if problem["type"] == "missing" else location


def _field_name(location: list[int | str]) -> str:
    name = ""
    for part in location:
        name += f"[{part + 1}]" if isinstance(part, int) else f".{part}" if name else str(part)
    return name


def _known_keys(kind: Any, location: list[int | str]) -> set[str]:
    """Keys that the settings class reached by `location` from `kind` accepts."""
    for candidate in _settings_classes(kind):
        if not location:
            return {field.alias or name for name, field in candidate.model_fields.items()}
        head, *rest = location
        if isinstance(head, int):
            return _known_keys(kind, rest)
        if head in candidate.model_fields:
            field = candidate.model_fields[str(head)]
            keys = _known_keys(field.annotation, [part for part in rest if not isinstance(part, int)])
            if keys:
                return keys
    return set()


def _settings_classes(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    if typing.get_origin(annotation) in (list, tuple, dict, typing.Union, types.UnionType, typing.Annotated):
        return [c for argument in typing.get_args(annotation) for c in _settings_classes(argument)]
    return []


_BRIEF = reprlib.Repr()  # aliases within aliases make a short file a huge value
_BRIEF.maxlevel = 3


def _shown(value: Any) -> str:
    if value is None:
        return "empty"
    text = (
        repr(value) if isinstance(value, str) else _BRIEF.repr(value) if isinstance(value, list | dict) else str(value)
    )
    return text if len(text) <= 60 else text[:57] + "..."
