"""Overwriting: no output of a command may be one of its inputs, or a flight log. A flight cannot be flown again.

Each parameter that names a file carries a mark, `Annotated[Path, Writes(), typer.Option(...)]`, and every command of an
`App` is checked by its marks before it begins.
"""

import functools
import inspect
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

import typer
import yaml

from quadctl.errors import QuadctlError
from quadctl.logs.formats import MAP_SUFFIX, format_of_folder, suffixes

LOG_SUFFIXES = suffixes()
"""A flight cannot be flown again: no result is ever written to a file that is named like a flight log."""
READ_WITH = (".meta.yaml", MAP_SUFFIX)
"""Suffixes of the files beside a log that are read with it."""
MOST_YAML_BYTES, LONGEST_NAME = 1_000_000, 255
ANOTHER = "expected another file to write the result to"


@dataclass(frozen=True)
class Reads:
    """Mark of a parameter that names files, or a folder, to read."""


@dataclass(frozen=True)
class Writes:
    """Mark of a parameter that names a file to write."""

    a_log: bool = False
    """True: what is written is a measurement, which may be named like a log."""


@dataclass(frozen=True)
class WritesInto:
    """Mark of a parameter that names a folder to write into."""

    files: tuple[str, ...] = ()
    """Names of the files, where they are always the same."""


Mark = Reads | Writes | WritesInto
Command = TypeVar("Command", bound=Callable[..., Any])

_outputs: ContextVar[tuple[Path, ...]] = ContextVar("outputs", default=())
"""Files that the command which runs will write."""


class App(typer.Typer):
    """An application whose commands refuse to write over what they read."""

    def command(self, name: str | None = None, **options: Any) -> Callable[[Command], Command]:
        register = super().command(name, **options)

        def checked(command: Command) -> Command:
            register(_checked(command))
            return command

        return checked


def marks(command: Callable[..., Any]) -> dict[str, Mark]:
    """Marks of a command's parameters, by their names."""
    hints = get_type_hints(command, include_extras=True)
    return {
        name: mark
        for name, hint in hints.items()
        for mark in getattr(hint, "__metadata__", ())
        if isinstance(mark, Mark)
    }


def _checked(command: Callable[..., Any]) -> Callable[..., Any]:
    """The command, which refuses its parameters before it begins where an output would destroy something."""

    @functools.wraps(command)
    def run(*arguments: Any, **values: Any) -> Any:
        given = inspect.signature(command).bind(*arguments, **values).arguments
        outputs = _check(marks(command), given)
        token = _outputs.set(outputs)
        try:
            return command(*arguments, **values)
        finally:
            _outputs.reset(token)

    return run


def _check(marked: Mapping[str, Mark], given: Mapping[str, Any]) -> tuple[Path, ...]:
    """Check the values of the marked parameters, and return the files that will be written."""
    inputs: list[Path] = []
    outputs: list[Path] = []
    measurements: list[Path] = []
    for name, mark in marked.items():
        for path in _paths(given.get(name)):
            match mark:
                case Reads():
                    inputs.append(path)
                case Writes():
                    (measurements if mark.a_log else outputs).append(path)
                case WritesInto():
                    if path.exists() and not path.is_dir():
                        raise QuadctlError(f"{path}: is a file, expected a folder to write into")
                    outputs += [path / file for file in mark.files]
    check_outputs(inputs, *outputs, measurements=measurements)
    return (*outputs, *measurements)


def check_outputs(inputs: Sequence[Path | None], *outputs: Path | None, measurements: Sequence[Path] = ()) -> None:
    """Refuse an output file that would destroy something, or that cannot be one, before any work is done.

    Raises
    ------
    QuadctlError
        An output is a directory, named like a flight log (unless it is one of the `measurements`), one of the inputs or
        of the files read with them, or the same as another output.
    """
    taken = {place: "is read by this command" for path in inputs if path is not None for place in _places(path)}
    for path in (*outputs, *measurements):
        if path is None:
            continue
        if path.is_dir():
            raise QuadctlError(f"{path}: is a directory, expected the name of a file to write")
        if path.suffix.lower() in LOG_SUFFIXES and path not in measurements:
            raise QuadctlError(f"{path}: is the name of a flight log, {ANOTHER}")
        for place in _identities(path):
            if place in taken:
                raise QuadctlError(f"{path}: {taken[place]}, {ANOTHER}")
        taken |= dict.fromkeys(_identities(path), "is written by this command already")


def refuse_existing(force: bool, *outputs: Path | None) -> None:
    """Refuse to overwrite what an earlier run has written, unless --force is given.

    Raises
    ------
    QuadctlError
        One of the files is there already.
    """
    for path in outputs:
        if path is not None and path.exists() and not force:
            raise QuadctlError(f"{path}: is there already, expected a new file (or --force)")


def check_read(path: Path) -> None:
    """Refuse a file that a command reads without having been given it, where it is one that the command will write.

    Raises
    ------
    QuadctlError
        It is one of the outputs.
    """
    for output in _outputs.get():
        if set(_identities(output)) & set(_identities(path)):
            raise QuadctlError(f"{output}: is read by this command, {ANOTHER}")


def _paths(value: Any) -> Iterator[Path]:
    """Paths in the value of a parameter: one, several, or a text that may name a file, as FILE.py:NAME does."""
    if isinstance(value, list | tuple):
        for each in value:
            yield from _paths(each)
    elif isinstance(value, Path):
        yield value
    elif isinstance(value, str):
        file, colon, _ = value.partition(".py:")
        yield Path(f"{file}.py" if colon else value)


def _places(path: Path) -> Iterator[Any]:
    """Identities of a file and of all that is read with it: what is beside a log or in its folder, and what a YAML file
    names."""
    seen: set[Path] = set()
    waiting = [path]
    while waiting:
        here = waiting.pop()
        if here in seen:
            continue
        seen.add(here)
        yield from _identities(here)
        if here.name:  # the present folder, `.`, and the root have none
            waiting += [beside for suffix in READ_WITH if (beside := here.with_suffix(suffix)).is_file()]
        if here.is_dir() and format_of_folder(here) is not None:
            waiting += [file for file in here.iterdir() if file.is_file()]
        waiting += _named_in(here)


def _identities(path: Path) -> Iterator[Any]:
    """The place of a file, wherever links lead, and what tells it from all others however it is called."""
    yield os.path.realpath(path)
    if path.is_file():
        about = path.stat()
        yield about.st_dev, about.st_ino


def _named_in(path: Path) -> list[Path]:
    """Files that a YAML file names, as a model names its vehicle."""
    if path.suffix not in (".yaml", ".yml") or not path.is_file() or path.stat().st_size > MOST_YAML_BYTES:
        return []
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError, RecursionError):
        return []  # whoever reads it says what is wrong
    named = (path.parent / text for text in _texts(content) if 0 < len(text) <= LONGEST_NAME)
    return [file for file in named if file.is_file()]


def _texts(content: Any) -> Iterator[str]:
    if isinstance(content, str):
        yield content
    elif isinstance(content, dict | list):
        for part in content.values() if isinstance(content, dict) else content:
            yield from _texts(part)
