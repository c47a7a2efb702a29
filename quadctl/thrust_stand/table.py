"""Tables of measured thrusts: CSV, one row for each reading."""

import csv
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

from quadctl.errors import LogError
from quadctl.files import reading
from quadctl.frames import GRAVITY_M_S2

NEWTONS_PER = {"n": 1.0, "g": 0.001 * GRAVITY_M_S2, "kg": GRAVITY_M_S2}
"""Newtons in one unit of thrust."""
MAX_ROWS = 10_000


@dataclass(frozen=True)
class Row:
    """One line of a table, by the names of its columns."""

    where: str
    """File and line, for messages."""
    cells: dict[str, str]

    def number(self, column: str, default: float | None = None) -> float:
        """The number of a column, `default` where it is empty; nan is a number where the default is nan.

        Raises
        ------
        LogError
            It is no number.
        """
        text = self.cells.get(column, "")
        if not text and default is not None:
            return default
        try:
            value = float(text)
        except ValueError:
            value = math.inf
        if math.isinf(value) or (math.isnan(value) and not math.isnan(default or 0.0)):
            raise LogError(f"{self.where}: {column} is '{text}', expected a number")
        return value


def read_rows(path: Path, each: str) -> tuple[list[str], list[Row]]:
    """Names of the columns, and the rows that are not blank; a row stands for `each`, in messages.

    Raises
    ------
    LogError
        The file cannot be read, is not text, or is far too long.
    """
    try:
        with reading(path, LogError), path.open(encoding="utf-8-sig", newline="") as file:
            lines = csv.reader(file)
            header = [cell.strip() for cell in next(lines, [])]
            rows = [(lines.line_num, [cell.strip() for cell in row]) for row in lines if any(map(str.strip, row))]
    except (UnicodeDecodeError, csv.Error):
        raise LogError(f"{path}: is not a text file, expected CSV") from None
    if len(rows) > MAX_ROWS:
        raise LogError(f"{path}: holds {len(rows)} rows, expected one for each {each}: is it a flight log?")
    return header, [
        Row(f"{path}, line {line}", dict(zip_longest(header, row[: len(header)], fillvalue=""))) for line, row in rows
    ]


def thrust_column(path: Path, header: Sequence[str], needed: str, columns: Iterable[str], expected: str) -> str:
    """The one of the `columns` that the header has, beside the `needed` one.

    Raises
    ------
    LogError
        There is none, or several; `expected` says what the columns should be.
    """
    found = [column for column in columns if column in header]
    if needed not in header or not found:
        raise LogError(f"{path}: its columns are {', '.join(header)[:80] or 'none'}; expected {expected}")
    if len(found) > 1:
        raise LogError(f"{path}: has {' and '.join(found)}, expected one column of thrust")
    return found[0]
