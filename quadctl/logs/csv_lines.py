"""The lines of a CSV file, whole or damaged, and their fields."""

import csv
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl
from numpy.typing import NDArray

from quadctl.errors import LogError

CHUNK_BYTES = 1 << 23
"""Size of the parts in which a file is read: of a large one only its text is kept, not also its bytes."""


@dataclass(frozen=True)
class Lines:
    """The lines of a file that can be read."""

    text: pl.Series
    """Lines that are complete and not blank."""
    number: NDArray[np.int64]
    """Their numbers in the file, from 1, shape (n,)."""
    notes: list[str]


def read_lines(path: Path) -> Lines:
    """The complete lines of a file; raises LogError where it cannot be read, is empty or not text."""
    text, number = [pl.Series([], dtype=pl.String)], [np.empty(0, dtype=np.int64)]
    count, blank, rest = 0, True, b""
    for chunk in _chunks(path):
        blank = blank and not chunk.strip()
        whole, newline, rest = (rest + chunk).rpartition(b"\n")
        if not newline:
            continue
        if not count and b"\0" in whole.partition(b"\n")[0]:
            break
        # Bytes that are no text, as a power cut leaves them, damage their line and not the file.
        lines = whole.decode("utf-8" if count else "utf-8-sig", errors="replace").split("\n")
        kept = [(at, stripped) for at, line in enumerate(lines, count + 1) if (stripped := line.strip("\r \t"))]
        text.append(pl.Series([line for _, line in kept], dtype=pl.String))
        number.append(np.array([at for at, _ in kept], dtype=np.int64))
        count += len(lines)
    else:
        return _complete(path, Lines(pl.concat(text), np.concatenate(number), []), count, blank, rest)
    raise LogError(f"{path}: is not a text file, expected a CSV flight log")


def _complete(path: Path, lines: Lines, count: int, blank: bool, rest: bytes) -> Lines:
    """The lines, with a note on the `rest` of the file after its `count` lines; raises LogError where there is none."""
    if blank:
        raise LogError(f"{path}: is empty, expected a CSV flight log")
    if not count and b"\0" in rest:
        raise LogError(f"{path}: is not a text file, expected a CSV flight log")
    if not count and b"\r" in rest:
        raise LogError(f"{path}: ends its lines by carriage returns alone, expected line feeds")
    if rest.decode("utf-8" if count else "utf-8-sig", errors="replace").strip("\r \t\0"):
        # Even if it parses: nobody can tell whether its last number is whole.
        lines.notes.append(f"the last line ({count + 1}) is cut short and was left out")
    if not len(lines.text):
        raise LogError(f"{path}: has no complete line yet, expected a CSV flight log")
    return lines


def _chunks(path: Path) -> Iterator[bytes]:
    try:
        with path.open("rb") as file:
            while chunk := file.read(CHUNK_BYTES):
                yield chunk
    except FileNotFoundError:
        raise LogError(f"{path}: there is no such file") from None
    except IsADirectoryError:
        raise LogError(f"{path}: is a directory, expected a CSV flight log") from None
    except OSError as error:
        raise LogError(f"{path}: cannot be read ({reason_of(error)})") from None


def reason_of(error: OSError) -> str:
    """The reason of a failure, in words."""
    return error.strerror or (os.strerror(error.errno) if error.errno else str(error))


def split_line(line: str) -> list[str]:
    """The fields of a line; quoted ones may hold commas."""
    if '"' not in line:
        return line.split(",")
    try:
        return next(csv.reader([line]))
    except csv.Error:  # a field beyond the library's limit: whatever this is, it is no number
        return line.split(",")
