"""Files that are read and written: a failure is one sentence."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from quadctl.errors import LogError, QuadctlError


def reason_of(error: OSError) -> str:
    """The reason of a failure, in words."""
    return error.strerror or (os.strerror(error.errno) if error.errno else str(error))


@contextmanager
def reading(path: Path, kind: type[QuadctlError]) -> Iterator[None]:
    """Context in which a file is read: where it cannot be, an error of this kind says so."""
    try:
        yield
    except FileNotFoundError:
        raise kind(f"{path}: there is no such file") from None
    except OSError as error:
        raise kind(f"{path}: cannot be read ({reason_of(error)})") from None


@contextmanager
def writing(path: Path, kind: type[QuadctlError], expected: str = "") -> Iterator[None]:
    """Context in which a file is written: where it cannot be, an error of this kind says so, and what is expected.

    A figure whose suffix is none of a picture is a ValueError of the library, and is told in the same way.
    """
    try:
        yield
    except (OSError, ValueError) as error:
        reason = reason_of(error) if isinstance(error, OSError) else error
        raise kind(f"{path}: cannot be written ({reason}){expected and f', expected {expected}'}") from None


def write_text(path: Path, text: str, kind: type[QuadctlError] = QuadctlError, expected: str = "") -> None:
    """Write a text file, in a folder that is made where needed; raises an error of this kind where it cannot be."""
    with writing(path, kind, expected):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")


@contextmanager
def written_aside(path: Path) -> Iterator[Path]:
    """A file that is written beside `path` and moved into its place at the end: a reader never meets half a log.

    Raises
    ------
    LogError
        The file cannot be written there; nothing is left behind.
    """
    part = path.with_name(path.name + ".part")
    try:
        with writing(path, LogError):
            yield part
            part.replace(path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise
