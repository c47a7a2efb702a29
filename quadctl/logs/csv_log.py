"""CSV flight logs (docs/log-format.md): our own, with a header, and the headerless ones of the RAPTOR flights.

Real files are dirty: rows before the first fix, a last line cut by a power cut, damaged lines, a clock that jumps. What
can be left out is left out and said in the log's `notes`; what cannot is one sentence in a `LogError`.
"""

import bisect
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import polars as pl
import yaml
from numpy.typing import NDArray

from quadctl.errors import LogError
from quadctl.logs.columns import (
    PHASE_COLUMN,
)
from quadctl.logs.csv_layout import Layout, column_order, layout_of
from quadctl.logs.csv_lines import Lines, read_lines, reason_of, split_line
from quadctl.logs.flight_log import POSITION, FlightLog, Floats

MAX_STANDSTILL_ROWS = 50
"""More consecutive rows than this without time going on are no glitch: two flights in one file, or no clock."""

MAX_RPM, MAX_VALUE, MAX_TIME = 3e5, 1e12, 1e19
"""Limits of rotor speeds, other values and clocks (nanoseconds since 1970 included): beyond them a value is damaged."""

_Rows: TypeAlias = tuple[pl.DataFrame, NDArray[np.int64]]
"""Values, and the number in the file of the line that each row comes from."""


def read_csv(path: Path | str) -> FlightLog:
    """Read a CSV flight log, with our header or headerless; safe on a file that is still being written.

    Raises
    ------
    LogError
        The file is missing, empty, not text, not a flight log, or damaged for the most part.
    """
    path = Path(path)
    raw = read_lines(path)
    layout = layout_of(path, raw)
    notes = [*raw.notes, *layout.notes]
    table, line = _parse(path, raw, layout, notes)
    table, line = _without_rows_before_first_position(path, table, line, notes)
    table, line = _with_increasing_time(path, table, line, notes)
    columns = {name: _finite(table[name], notes) for name in table.columns if name != PHASE_COLUMN}
    phase = table[PHASE_COLUMN].to_numpy().astype(np.str_) if PHASE_COLUMN in table.columns else None
    return FlightLog(path.name, path, columns, phase, _read_meta(path, notes), notes)


def write_csv(log: FlightLog, path: Path | str) -> None:
    """Write `log` with our header, every digit of its values kept, and its `meta`, if any, beside it.

    Raises
    ------
    LogError
        The file cannot be written there.
    """
    path = Path(path)
    names = sorted(log.columns, key=column_order)
    table = pl.DataFrame({name: log.columns[name] for name in names}).fill_nan(None)
    if log.phase is not None:
        table = table.with_columns(pl.Series(PHASE_COLUMN, log.phase.tolist(), dtype=pl.String))
    aside = path.with_name(path.name + ".part")
    try:
        # Written aside and moved into place: a reader never meets half a file.
        table.write_csv(aside, null_value="nan")
        aside.replace(path)
        if log.meta:
            meta_path(path).write_text(yaml.safe_dump(log.meta, sort_keys=False, allow_unicode=True), encoding="utf-8")
    except OSError as error:
        aside.unlink(missing_ok=True)
        raise LogError(f"{path}: cannot be written ({reason_of(error)})") from None


def meta_path(path: Path) -> Path:
    """The sidecar file of a log: `hover.csv` has `hover.meta.yaml`."""
    return path.with_suffix(".meta.yaml")


# --- values -----------------------------------------------------------------------------------------------------------


def _parse(path: Path, raw: Lines, layout: Layout, notes: list[str]) -> _Rows:
    """Values and line numbers of the undamaged lines: NaN where a value is missing, text only in `phase`."""
    skip = 1 if layout.has_header else 0
    if len(raw.text) == skip:
        raise LogError(f"{path}: has a header and no complete row of data")
    lines, number = pl.Series(raw.text[skip:], dtype=pl.String), raw.number[skip:]
    n_fields = len(layout.names)
    fields, n_found = _split(lines, n_fields)
    whole = n_found == n_fields
    damage: dict[int, str] = {
        int(line): f"{n} fields instead of {n_fields}" for line, n in zip(number[~whole], n_found[~whole], strict=True)
    }
    fields, number = fields.filter(pl.Series(whole)), number[whole]

    table = {}
    for name, text in zip(layout.names, fields.get_columns(), strict=True):
        if name == PHASE_COLUMN:
            table[name] = text.fill_null("")
        elif name is not None:
            table[name] = _numbers(path, name, text, number, damage)
    undamaged = ~np.isin(number, list(damage))
    if not undamaged.any() or len(damage) > len(lines) / 2:
        line, what = min(damage.items())
        raise LogError(
            f"{path}: {len(damage)} of {len(lines)} lines are damaged (line {line}: {what}), expected a few at most"
        )
    if not layout.has_header and _is_padded(fields):
        undamaged[-1] = False
        notes.append(f"the last line ({number[-1]}) is cut short and was left out")
    if damage:
        line, what = min(damage.items())
        notes.append(f"{_count(len(damage), 'damaged line')} left out (line {line}: {what})")
    return pl.DataFrame(table).filter(pl.Series(undamaged)), number[undamaged]


def _split(lines: pl.Series, n_fields: int) -> tuple[pl.DataFrame, NDArray[np.int64]]:
    """The fields of each line, of which the first `n_fields` are kept, and how many there were."""
    if lines.str.contains('"', literal=True).any():
        # Quoted text may hold commas: rare, and worth the slower way.
        rows = [split_line(line) for line in lines]
        cut = [[*row[:n_fields], *[None] * (n_fields - len(row))] for row in rows]
        schema = {f"field_{i}": pl.String for i in range(n_fields)}
        return pl.DataFrame(cut, schema=schema, orient="row"), np.array([len(row) for row in rows])
    n_found = lines.str.count_matches(",", literal=True).to_numpy().astype(np.int64) + 1
    return lines.str.split_exact(",", n_fields - 1).struct.unnest(), n_found


def _numbers(path: Path, name: str, text: pl.Series, number: NDArray[np.int64], damage: dict[int, str]) -> pl.Series:
    """The values of one column; lines with text in it are entered in `damage`."""
    text = text.str.strip_chars()
    values = text.cast(pl.Float64, strict=False)
    wrong = np.flatnonzero((values.is_null() & (text.fill_null("") != "")).to_numpy())
    if len(wrong) > len(text) / 2:
        first = wrong[0]
        raise LogError(
            f"{path}, line {number[first]}: column '{name}' holds {_shown(text[int(first)])}, expected a number"
        )
    for row in wrong:
        damage.setdefault(int(number[row]), f"{name} is {_shown(text[int(row)])} instead of a number")
    return values.fill_null(float("nan"))


def _finite(values: pl.Series, notes: list[str]) -> Floats:
    """The values as an array of its own, an infinite or impossible one made a missing one."""
    array = np.array(values.to_numpy(), dtype=np.float64)
    infinite = np.isinf(array)
    largest = MAX_RPM if values.name.endswith("_rpm") else MAX_TIME if values.name == "time_s" else MAX_VALUE
    impossible = (np.abs(array) > largest) & ~infinite
    for which, kind in ((infinite, "infinite value"), (impossible, "impossible value")):
        if which.any():
            limit = "" if which is infinite else f" (beyond {largest:g})"
            notes.append(f"{_count(int(which.sum()), kind)} of {values.name}{limit} read as missing")
            array[which] = np.nan
    return array


def _is_padded(fields: pl.DataFrame) -> bool:
    """True where the last line of a headerless file was cut and then filled up with commas."""
    last_field = fields[:, -1].fill_null("")
    return len(last_field) > 1 and last_field[-1] == "" and last_field[-2] != ""


# --- rows -------------------------------------------------------------------------------------------------------------


def _without_rows_before_first_position(
    path: Path, table: pl.DataFrame, line: NDArray[np.int64], notes: list[str]
) -> _Rows:
    known = np.logical_and.reduce([np.isfinite(table[name].to_numpy()) for name in ("time_s", *POSITION)])
    if not known.any():
        raise LogError(f"{path}: no row has time and position, expected finite time_s, x_m, y_m and z_m")
    first = int(np.argmax(known))
    if first:
        notes.append(f"{_count(first, 'row')} before the first known position left out (from line {line[0]})")
    return table[first:], line[first:]


def _with_increasing_time(path: Path, table: pl.DataFrame, line: NDArray[np.int64], notes: list[str]) -> _Rows:
    time_s = table["time_s"].to_numpy()
    time_s = np.where(np.abs(time_s) < MAX_TIME, time_s, np.nan)
    keep = increasing(time_s)
    if keep.all():
        return table, line
    dropped = np.flatnonzero(~keep)
    first, longest = int(dropped[0]), _longest_run(dropped)
    where = f"line {line[first]} (time_s = {time_s[first]:g})"
    if longest > MAX_STANDSTILL_ROWS or len(dropped) > len(keep) / 2:
        raise LogError(
            f"{path}: time does not increase in {_count(len(dropped), 'row')} of {len(keep)}, the first is {where}, "
            "expected the increasing clock of one flight"
        )
    notes.append(f"{_count(len(dropped), 'row')} in which time does not increase left out, the first is {where}")
    return table.filter(pl.Series(keep)), line[keep]


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


def _longest_run(rows: NDArray[np.intp]) -> int:
    """Length of the longest run of consecutive numbers in `rows`, which is sorted and not empty."""
    breaks = np.flatnonzero(np.diff(rows) > 1)
    return int(np.diff(np.concatenate([[-1], breaks, [len(rows) - 1]])).max())


def _shown(text: str) -> str:
    return repr(text if len(text) <= 40 else text[:37] + "...")


def _count(n: int, what: str) -> str:
    return f"{n} {what}{'s' if n != 1 else ''}"


# --- sidecar ----------------------------------------------------------------------------------------------------------


def _read_meta(path: Path, notes: list[str]) -> dict[str, Any]:
    """The sidecar, {} if there is none; a damaged one costs a note, not the flight."""
    sidecar = meta_path(path)
    try:
        meta = yaml.safe_load(sidecar.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    except (OSError, UnicodeDecodeError, yaml.YAMLError, RecursionError):
        meta = None
    if isinstance(meta, dict):
        return meta
    notes.append(f"{sidecar.name} beside it is not a readable YAML mapping and was left out")
    return {}
