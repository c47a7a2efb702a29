"""The lines of a CSV file, whole or damaged, and their fields."""

import csv
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from quadctl.errors import LogError


@dataclass(frozen=True)
class Lines:
    """The lines of a file that can be read."""

    text: list[str]
    """Lines that are complete and not blank."""
    number: NDArray[np.int64]
    """Their numbers in the file, from 1, shape (n,)."""
    notes: list[str]


def read_lines(path: Path) -> Lines:
    """The complete lines of a file; raises LogError where it cannot be read, is empty or not text."""
    data = _read_bytes(path)
    if not data.strip():
        raise LogError(f"{path}: is empty, expected a CSV flight log")
    if b"\0" in data.partition(b"\n")[0]:
        raise LogError(f"{path}: is not a text file, expected a CSV flight log")
    if b"\r" in data and b"\n" not in data:
        raise LogError(f"{path}: ends its lines by carriage returns alone, expected line feeds")
    # Bytes that are no text, as a power cut leaves them, damage their line and not the file.
    *lines, rest = data.decode("utf-8-sig", errors="replace").split("\n")
    notes = []
    if rest.strip("\r \t\0"):
        # Even if it parses: nobody can tell whether its last number is whole.
        notes.append(f"the last line ({len(lines) + 1}) is cut short and was left out")
    kept = [(number, text) for number, line in enumerate(lines, 1) if (text := line.strip("\r \t"))]
    if not kept:
        raise LogError(f"{path}: has no complete line yet, expected a CSV flight log")
    return Lines([text for _, text in kept], np.array([number for number, _ in kept]), notes)


def _read_bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
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
