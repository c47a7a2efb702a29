"""A table of values as read from a file becomes a `FlightLog`: checked, and cleaned of what no reader can use.

Real files are dirty: rows before the first fix, a clock that jumps, values that cannot be. What can be left out is left
out and said in the log's `findings`; what cannot is one sentence in a `LogError`.
"""

import bisect
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from quadctl.errors import LogError
from quadctl.logs.column_meaning import is_it
from quadctl.logs.columns import PHASE_COLUMN, STATE_COLUMNS, is_column, known_columns, rpm_columns
from quadctl.logs.findings import Finding, Kind, finding
from quadctl.logs.flight_log import POSITION, FlightLog, Floats
from quadctl.logs.formats import A_MAP
from quadctl.logs.sidecar import read_meta
from quadctl.words import count, nearest

MAX_STANDSTILL_ROWS = 50
"""More consecutive rows than this without time going on are no glitch: two flights in one file, or no clock."""

MAX_RPM, MAX_VALUE, MAX_TIME = 3e5, 1e12, 1e19
"""Limits of rotor speeds, other values and clocks (nanoseconds since 1970 included): beyond them a value is damaged."""


def clean_log(
    path: Path,
    table: Mapping[str, ArrayLike],
    *,
    findings: Iterable[Finding] = (),
    meta: Mapping[str, Any] | None = None,
    line_numbers: NDArray[np.int64] | None = None,
) -> FlightLog:
    """Make a flight log of a table as read from a file: the last step of a reader of any format.

    Columns with unknown names, rows before the first known position, and rows in which time does not increase are left
    out; infinite and impossible values become NaN. Each of these adds a finding.

    Parameters
    ----------
    path
        File that the table comes from: its name is that of the log, and messages begin with it.
    table
        Columns by the names, units and frames of docs/log-format.md, shape (n,) each; numbers, NaN where a value is
        missing, and text in `phase`.
    findings
        What the reader itself left out or had to guess.
    meta
        Content of the log's sidecar; by default that of the file `NAME.meta.yaml` beside `path`, {} without one.
    line_numbers
        Line of the file that each row comes from, shape (n,); without it messages count the rows, from 1.

    Raises
    ------
    LogError
        A required column is missing, columns differ in length or hold no numbers, no row has time and position, or time
        stands still.
    """
    said = [*findings, *check_columns(table, f"{path}: the table")]
    columns = {
        name: _numbers(path, name, values) for name, values in table.items() if is_column(name) and name != PHASE_COLUMN
    }
    phase = np.asarray(table[PHASE_COLUMN]).astype(np.str_) if PHASE_COLUMN in table else None
    log = FlightLog(path.name, path, columns, phase)
    number = np.arange(1, len(log) + 1) if line_numbers is None else line_numbers
    word = "row" if line_numbers is None else "line"
    first = _first_position(path, log)
    if first:
        said.append(finding(Kind.LEADING_ROWS, rows=first, of=word, number=int(number[0])))
        log, number = log.rows(slice(first, None)), number[first:]
    keep = _increasing_rows(path, log, number, word, said)
    if not keep.all():
        log = log.rows(keep)
    columns = {name: _possible(name, values, said) for name, values in log.columns.items()}
    phase = log.phase
    return FlightLog(path.name, path, columns, phase, read_meta(path, said) if meta is None else dict(meta), said)


def check_columns(names: Iterable[str], holder: str) -> list[Finding]:
    """Check the names of a table's columns; return a finding on each one that is not a flight log's, to be left out.

    Parameters
    ----------
    holder
        Subject of the error messages: the file, and what in it names the columns.

    Raises
    ------
    LogError
        A required column, or the speed of one of the rotors, is missing.
    """
    names = list(names)
    unknown = [name for name in names if not is_column(name)]
    missing = [name for name in STATE_COLUMNS if name not in names]
    if missing:
        listed = ", ".join(name + is_it(name, unknown) for name in missing)
        raise LogError(f"{holder} lacks {listed}, expected a flight log's columns, {A_MAP}")
    rpm = [name for name in names if name.endswith("_rpm") and is_column(name)]
    absent = next((name for name in rpm_columns(len(rpm)) if name not in rpm), None)
    if absent:
        raise LogError(f"{holder} lacks {absent}, expected motor1_rpm to motorN_rpm, none left out")
    known = known_columns(max(len(rpm), 4))
    return [finding(Kind.UNKNOWN_COLUMN, column=name, hint=nearest(name, known)) for name in unknown]


def increasing(time_s: Floats) -> NDArray[np.bool_]:
    """Mask of the most rows that can be kept so that time strictly increases, shape (n,).

    A clock that jumps ahead or back for a few rows so costs those rows and not all that follow. Of rows with the same
    time the first is kept; a time that is not finite never is.
    """
    keep = np.isfinite(time_s)
    if np.all(np.diff(time_s) > 0.0):
        return keep
    ends: list[float] = []  # ends[k]: the smallest time at which a chain of k + 1 increasing rows can end
    rows: list[int] = []  # rows[k]: the row of ends[k]
    before: dict[int, int] = {}  # row: the one before it in its chain
    for row in np.flatnonzero(keep).tolist():
        time = float(time_s[row])
        k = bisect.bisect_left(ends, time)
        if k < len(ends) and ends[k] == time:
            continue
        ends[k : k + 1], rows[k : k + 1] = [time], [row]
        if k:
            before[row] = rows[k - 1]
    keep[:] = False
    row_or_none = rows[-1] if rows else None
    while row_or_none is not None:
        keep[row_or_none] = True
        row_or_none = before.get(row_or_none)
    return keep


def _numbers(path: Path, name: str, values: ArrayLike) -> Floats:
    try:
        return np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise LogError(f"{path}: column '{name}' holds no numbers, expected one for each row, nan if missing") from None


def _first_position(path: Path, log: FlightLog) -> int:
    """Number of rows before the first that has time and position."""
    known = np.logical_and.reduce([np.isfinite(log[name]) for name in ("time_s", *POSITION)])
    if not known.any():
        raise LogError(f"{path}: no row has time and position, expected finite time_s, x_m, y_m and z_m")
    return int(np.argmax(known))


def _increasing_rows(
    path: Path, log: FlightLog, number: NDArray[np.int64], word: str, findings: list[Finding]
) -> NDArray[np.bool_]:
    """Mask of the rows that are kept, shape (n,)."""
    time_s = np.where(np.abs(log.time_s) < MAX_TIME, log.time_s, np.nan)
    keep = increasing(time_s)
    if keep.all():
        return keep
    dropped = np.flatnonzero(~keep)
    first, longest = int(dropped[0]), _longest_run(dropped)
    where = f"{word} {number[first]} (time_s = {time_s[first]:g})"
    if longest > MAX_STANDSTILL_ROWS or len(dropped) > len(keep) / 2:
        raise LogError(
            f"{path}: time does not increase in {count(len(dropped), 'row')} of {len(keep)}, the first is {where}, "
            "expected the increasing clock of one flight"
        )
    findings.append(
        finding(
            Kind.TIME_STANDS_STILL,
            rows=len(dropped),
            of=word,
            number=int(number[first]),
            time_s=float(time_s[first]),
        )
    )
    return keep


def _longest_run(rows: Sequence[int] | NDArray[np.intp]) -> int:
    """Length of the longest run of consecutive numbers in `rows`, which is sorted and not empty."""
    breaks = np.flatnonzero(np.diff(rows) > 1)
    return int(np.diff(np.concatenate([[-1], breaks, [len(rows) - 1]])).max())


def _possible(name: str, values: Floats, findings: list[Finding]) -> Floats:
    """The values with NaN for those that are infinite or impossible."""
    largest = MAX_RPM if name.endswith("_rpm") else MAX_TIME if name == "time_s" else MAX_VALUE
    beyond = np.abs(values) > largest
    if not beyond.any():
        return values
    infinite = np.isinf(values)
    impossible = beyond & ~infinite
    if infinite.any():
        findings.append(finding(Kind.INFINITE_VALUES, column=name, values=int(infinite.sum())))
    if impossible.any():
        findings.append(finding(Kind.IMPOSSIBLE_VALUES, column=name, values=int(impossible.sum()), limit=largest))
    return np.where(beyond, np.nan, values)
