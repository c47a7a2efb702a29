"""The expansion of a mission's phases: parameters are inserted, groups repeated and unrolled.

`$name` or `${name}` stands for a parameter, or for the value of a `for_each` around it. A phase, or a group of
`phases`, is flown `repeat` times, and once for each value of `for_each: {name: [values]}`.
"""

import re
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, NamedTuple

from pydantic import Field

from quadctl.errors import SettingsError
from quadctl.settings import Settings, validate
from quadctl.words import nearest

Value = float | str | list[float | str]
Values = Mapping[str, Any]

MAX_PHASES = 10_000
"""Largest number of phases: more is a mistake in a `repeat`."""
MAX_VALUES = 100_000
"""Largest number of values in a file: YAML's nested aliases can make a short file huge, or endless."""
_REFERENCE = re.compile(r"\$(?:([A-Za-z_]\w*)|\{([A-Za-z_]\w*)\})")


class RawPhase(NamedTuple):
    """One phase, before its trajectory is made of it."""

    keys: dict[str, Any]
    source: str
    """Its place in the file, for messages."""


class _Loop(Settings):
    """Keys that make several phases of one entry of `phases`."""

    repeat: int = Field(default=1, ge=1, le=1000)
    for_each: dict[str, Annotated[list[Value], Field(min_length=1)]] = Field(default={}, max_length=1)


def check_size(data: Any, source: str) -> None:
    """Refuse a file with too many values, or endless ones; raises SettingsError."""
    left, seen = [data], 0
    while left:
        item = left.pop()
        seen += 1
        if seen > MAX_VALUES:
            raise SettingsError(f"{source}: holds more than {MAX_VALUES} values with all its aliases, expected fewer")
        left.extend(item.values() if isinstance(item, dict) else item if isinstance(item, list) else ())


def expanded(entries: list[dict[str, Any]], repeat: int, values: Values, source: str) -> list[RawPhase]:
    """All phases in the order in which they are flown, `repeat` times.

    Raises
    ------
    SettingsError
        A `$name` that nothing stands for, a loop that is none, or far too many phases.
    """
    found: list[RawPhase] = []
    for raw in _expanded(entries, values, {}, source):
        found.append(raw)
        if len(found) * repeat > MAX_PHASES:
            raise SettingsError(f"{source} are more than {MAX_PHASES} with all that is repeated, expected fewer")
    return found * repeat


def put_in(item: Any, values: Values, source: str) -> Any:
    """`item`, with every `$name` in it replaced; alone it becomes the value itself, within a text its text."""
    if isinstance(item, dict):
        return {key: put_in(value, values, f"{source}.{key}") for key, value in item.items()}
    if isinstance(item, list):
        return [put_in(value, values, f"{source}[{i}]") for i, value in enumerate(item, start=1)]
    if not isinstance(item, str):
        return item
    alone = _REFERENCE.fullmatch(item)
    if alone:
        return _value(alone, values, source)
    return _REFERENCE.sub(lambda match: _text(_value(match, values, source)), item)


def names_in(item: Any) -> set[str]:
    """The names of all parameters that `item` refers to."""
    if isinstance(item, dict):
        return set().union(*map(names_in, item.values()))
    if isinstance(item, list):
        return set().union(*map(names_in, item))
    return {a or b for a, b in _REFERENCE.findall(item)} if isinstance(item, str) else set()


def _expanded(entries: Any, values: Values, inherited: Values, source: str) -> Iterator[RawPhase]:
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries) or not entries:
        raise SettingsError(f"{source} is {entries!r:.60}, expected a list of phases with at least one")
    for i, entry in enumerate(entries, start=1):
        place = f"{source}[{i}]"
        loop_keys = {key: entry[key] for key in _Loop.model_fields if key in entry}
        loop = validate(put_in(loop_keys, values, place), _Loop, place)
        rest = {key: value for key, value in entry.items() if key not in loop_keys}
        for scope in _scopes(loop, values):
            if "phases" in rest:
                yield from _group(rest, scope, inherited, place)
            else:
                yield RawPhase({**inherited, **put_in(rest, scope, place)}, place)


def _group(keys: dict[str, Any], values: Values, inherited: Values, source: str) -> Iterator[RawPhase]:
    own = {key: value for key, value in keys.items() if key != "phases"}
    unknown = own.keys() - {"yaw_deg"}
    if unknown:
        raise SettingsError(
            f"{source}: unknown key '{min(unknown)}' of a group, expected: for_each, phases, repeat, yaw_deg"
        )
    yield from _expanded(keys["phases"], values, {**inherited, **put_in(own, values, source)}, f"{source}.phases")


def _scopes(loop: _Loop, values: Values) -> Iterator[Values]:
    for _ in range(loop.repeat):
        if not loop.for_each:
            yield values
        for name, each in loop.for_each.items():
            for value in each:
                yield {**values, name: value}


def _value(match: re.Match[str], values: Values, source: str) -> Any:
    name = match[1] or match[2]
    if name not in values:
        raise SettingsError(f"{source}: there is no parameter '{name}'{known(name, values)}")
    return values[name]


def known(name: str, values: Values) -> str:
    """Hint at the parameter that an unknown name may stand for."""
    listed = f", expected one of: {', '.join(sorted(values))}" if values else ", the mission declares none"
    return nearest(name, values) + listed


def _text(value: Any) -> str:
    return f"{value:g}" if isinstance(value, int | float) else str(value)
