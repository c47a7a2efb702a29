"""YAML files to validated settings; every error names the file, the field, the value and what was expected."""

import difflib
import types
import typing
from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError

from quadctl.errors import SettingsError


class Settings(BaseModel):
    """Base of all that is read from YAML: unknown keys and non-finite numbers are refused, values never change."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


S = TypeVar("S", bound=BaseModel)


def read_yaml(path: Path) -> dict[str, Any]:
    """The mapping that a YAML file holds.

    Raises
    ------
    SettingsError
        The file is missing, empty, not text, not YAML, or not a mapping.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise SettingsError(f"{path}: there is no such file") from None
    except IsADirectoryError:
        raise SettingsError(f"{path}: is a directory, expected a YAML file") from None
    except UnicodeDecodeError:
        raise SettingsError(f"{path}: is not a text file, expected YAML") from None
    except OSError as error:
        raise SettingsError(f"{path}: cannot be read ({error.strerror})") from None
    try:
        data = yaml.load(text, Loader=_StrictLoader)
    except yaml.YAMLError as error:
        raise SettingsError(f"{path}{_yaml_problem(error)}") from None
    except RecursionError:
        raise SettingsError(f"{path}: is nested too deeply to be settings") from None
    if data is None:
        raise SettingsError(f"{path}: is empty, expected settings in YAML")
    if not isinstance(data, dict):
        raise SettingsError(f"{path}: holds {_shown(data)}, expected a mapping of keys to values")
    return data


def load(path: Path | str, kind: type[S]) -> S:
    """Read `path` and validate it as `kind`."""
    return validate(read_yaml(Path(path)), kind, str(path))


def validate(data: Any, kind: type[S], source: str) -> S:
    """`data` as `kind`; `source` names it in error messages."""
    try:
        return kind.model_validate(data)
    except ValidationError as error:
        raise SettingsError(f"{source}: {_first_problem(error, kind)}") from None


class _StrictLoader(yaml.SafeLoader):
    """YAML's SafeLoader, except that a key given twice is an error and not a silent choice of the last."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen = set()
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
            if isinstance(key, str) and key in seen:
                raise yaml.constructor.ConstructorError(
                    None, None, f"the key '{key}' is given twice", key_node.start_mark
                )
            if isinstance(key, str):
                seen.add(key)
        return super().construct_mapping(node, deep)


def nearest(word: str, known: typing.Iterable[str]) -> str:
    """ " (did you mean 'x'?)", or nothing when no known word is near."""
    matches = difflib.get_close_matches(word, list(known), n=1, cutoff=0.5)
    return f" (did you mean '{matches[0]}'?)" if matches else ""


def _yaml_problem(error: yaml.YAMLError) -> str:
    mark = getattr(error, "problem_mark", None)
    problem = getattr(error, "problem", None) or str(error)
    where = f", line {mark.line + 1}, column {mark.column + 1}" if mark else ""
    return f"{where}: is not valid YAML: {problem}"


def _first_problem(error: ValidationError, kind: type[BaseModel]) -> str:
    problems = error.errors(include_url=False)
    # An unknown key is usually the cause of a missing one: say it first.
    problem = next((p for p in problems if p["type"] == "extra_forbidden"), problems[0])
    location = [part for part in problem["loc"] if not _is_union_tag(part)]
    field = _field_name(location)
    if problem["type"] == "extra_forbidden":
        known = sorted(_known_keys(kind, location[:-1]))
        hint = nearest(str(location[-1]), known)
        return f"unknown key '{field}'{hint or ', expected one of: ' + ', '.join(known)}"
    if problem["type"] == "missing":
        return f"{field} is missing"
    if problem["type"] == "value_error":
        return f"{field + ': ' if field else ''}{problem['ctx']['error']}"
    expectation = problem["msg"].removeprefix("Input should be ").removeprefix("a valid ")
    return f"{field or 'the file'} is {_shown(problem['input'])}, expected {expectation}"


def _is_union_tag(part: int | str) -> bool:
    return isinstance(part, str) and ("[" in part or part[:1].isupper())


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


def _shown(value: Any) -> str:
    text = repr(value) if isinstance(value, str) else str(value)
    return text if len(text) <= 60 else text[:57] + "..."
