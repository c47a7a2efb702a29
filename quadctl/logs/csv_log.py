"""CSV flight logs (data contracts, section 2): our own, with a header, and the headerless ones of the RAPTOR flights.

Real files are dirty: rows before the first fix, a last line cut by a power cut, damaged lines, a clock that jumps. What
can be left out is left out and said in the log's `notes`; what cannot is one sentence in a `LogError`.
"""

import bisect
import csv
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import polars as pl
import yaml
from numpy.typing import NDArray

from quadctl.errors import LogError
from quadctl.logs.columns import (
    MOTOR_QUANTITIES,
    OPTIONAL_COLUMNS,
    PHASE_COLUMN,
    STATE_COLUMNS,
    motor_columns,
    rpm_columns,
)
from quadctl.logs.flight_log import POSITION, FlightLog, Floats, did_you_mean

MAX_STANDSTILL_ROWS = 50
"""More consecutive rows than this without time going on are no glitch: two flights in one file, or no clock."""

MAX_RPM, MAX_VALUE, MAX_TIME = 3e5, 1e12, 1e19
"""What no rotor, nothing else in a log and no clock (nanoseconds since 1970 included) ever reaches: a damaged value."""

_Rows: TypeAlias = tuple[pl.DataFrame, NDArray[np.int64]]
"""Values, and the number in the file of the line that each row comes from."""

_SEPARATORS = {";": "semicolons", "\t": "tabs", " ": "blanks"}
"""What other programs write where we expect commas."""
_MOTOR_COLUMN = re.compile(rf"motor([1-9]\d*)_({'|'.join(MOTOR_QUANTITIES)})")
_COMMANDS_OF_17 = ("roll_cmd_deg", "pitch_cmd_deg", "yaw_cmd_deg", "throttle_cmd")
_HEADERLESS = (
    "17 columns (state and 4 commands) or 13 + 3 per rotor (state, rpm, voltages, currents: 25 for 4 rotors, 31 for 6)"
)


def read_csv(path: Path | str) -> FlightLog:
    """Read a CSV flight log, with our header or headerless; safe on a file that is still being written.

    Raises
    ------
    LogError
        The file is missing, empty, not text, not a flight log, or damaged for the most part.
    """
    path = Path(path)
    raw = _read_lines(path)
    layout = _layout(path, raw)
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
    names = sorted(log.columns, key=_column_order)
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
        raise LogError(f"{path}: cannot be written ({_reason(error)})") from None


def meta_path(path: Path) -> Path:
    """The sidecar file of a log: `hover.csv` has `hover.meta.yaml`."""
    return path.with_suffix(".meta.yaml")


# --- lines ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Lines:
    text: list[str]
    """Lines that are complete and not blank."""
    number: NDArray[np.int64]
    """Their numbers in the file, from 1, shape (n,)."""
    notes: list[str]


def _read_lines(path: Path) -> _Lines:
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
    return _Lines([text for _, text in kept], np.array([number for number, _ in kept]), notes)


def _read_bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise LogError(f"{path}: there is no such file") from None
    except IsADirectoryError:
        raise LogError(f"{path}: is a directory, expected a CSV flight log") from None
    except OSError as error:
        raise LogError(f"{path}: cannot be read ({_reason(error)})") from None


def _reason(error: OSError) -> str:
    return error.strerror or (os.strerror(error.errno) if error.errno else str(error))


# --- columns ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Layout:
    names: tuple[str | None, ...]
    """Name of each field of a line, None for one that is left out."""
    has_header: bool
    notes: list[str] = field(default_factory=list)


def _layout(path: Path, raw: _Lines) -> _Layout:
    for separator, name in _SEPARATORS.items():
        if sum(map(_is_known, raw.text[0].split(separator))) > 1:
            where = f"{path}, line {raw.number[0]}"
            raise LogError(f"{where}: separates columns by {name}, expected commas between them and decimal points")
    first = [name.strip() for name in _fields(raw.text[0])]
    if any(map(_is_known, first)) or (sum(map(_is_number, first)) * 2 < len(first) and len(first) > 1):
        return _layout_of_header(path, int(raw.number[0]), first)
    return _layout_of_headerless(path, raw)


def _layout_of_header(path: Path, line: int, names: list[str]) -> _Layout:
    repeated = next((name for name in names if _is_known(name) and names.count(name) > 1), None)
    if repeated:
        raise LogError(f"{path}, line {line}: column '{repeated}' is there twice, expected each name once")
    unknown = [name for name in names if not _is_known(name)]
    missing = [name for name in STATE_COLUMNS if name not in names]
    if missing:
        listed = ", ".join(name + did_you_mean(name, unknown) for name in missing)
        raise LogError(f"{path}, line {line}: the header lacks {listed}, expected a flight log's columns")
    rpm = [name for name in names if name.endswith("_rpm") and _is_known(name)]
    absent = next((name for name in rpm_columns(len(rpm)) if name not in rpm), None)
    if absent:
        raise LogError(
            f"{path}, line {line}: the header lacks {absent}, expected motor1_rpm to motorN_rpm, none left out"
        )
    known = _known_columns(max(len(rpm), 4))
    notes = [f"column '{name}' is not a flight log's and was left out{did_you_mean(name, known)}" for name in unknown]
    return _Layout(tuple(name if _is_known(name) else None for name in names), True, notes)


def _layout_of_headerless(path: Path, raw: _Lines) -> _Layout:
    counts, how_often = np.unique([line.count(",") + 1 for line in raw.text], return_counts=True)
    n = int(counts[np.argmax(how_often)])
    if n == 17:
        if _holds_throttle(raw.text):
            note = (
                "17 columns and no header: the last four were read as commanded attitude and throttle, not rotor speeds"
            )
            return _Layout((*STATE_COLUMNS, *_COMMANDS_OF_17), False, [note])
        note = "17 columns and no header: the last four were read as rotor speeds, being too large for a throttle"
        return _Layout((*STATE_COLUMNS, *rpm_columns(4)), False, [note])
    n_rotors, rest = divmod(n - len(STATE_COLUMNS), 3)
    if n_rotors < 4 or rest:
        separator = next((f", separated by '{s}'" for s in ";\t" if n == 1 and s in raw.text[0]), "")
        found = f"{n} column{'s' if n > 1 else ''}{separator}"
        raise LogError(f"{path}: has no header and {found}, expected our header, or separated by commas {_HEADERLESS}")
    motors = (*motor_columns(n_rotors, "voltage_v"), *motor_columns(n_rotors, "current_a"))
    return _Layout((*STATE_COLUMNS, *rpm_columns(n_rotors), *motors), False)


def _holds_throttle(lines: Sequence[str]) -> bool:
    """Whether the last column lies in 0..1, as a throttle does and the speed of a rotor does not."""
    last = pl.Series(lines).str.split(",").list.last().str.strip_chars().cast(pl.Float64, strict=False)
    values = last.drop_nulls().drop_nans().to_numpy()
    return len(values) == 0 or bool(np.median(np.abs(values)) <= 1.0)


def _is_known(name: str) -> bool:
    return (
        name in STATE_COLUMNS or name in OPTIONAL_COLUMNS or name == PHASE_COLUMN or bool(_MOTOR_COLUMN.fullmatch(name))
    )


def _known_columns(n_rotors: int) -> list[str]:
    """All names that a log's header may hold, in their order in the file."""
    motors = [name for quantity in MOTOR_QUANTITIES for name in motor_columns(n_rotors, quantity)]
    return [*STATE_COLUMNS, *motors, *OPTIONAL_COLUMNS, PHASE_COLUMN]


def _column_order(name: str) -> tuple[int, int]:
    """Sorting key for the order in the file; what the contracts do not name goes last."""
    if name in STATE_COLUMNS:
        return 0, STATE_COLUMNS.index(name)
    if motor := _MOTOR_COLUMN.fullmatch(name):
        return 1 + MOTOR_QUANTITIES.index(motor[2]), int(motor[1])
    return (8, OPTIONAL_COLUMNS.index(name)) if name in OPTIONAL_COLUMNS else (9, 0)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return not text
    return True


# --- values -----------------------------------------------------------------------------------------------------------


def _parse(path: Path, raw: _Lines, layout: _Layout, notes: list[str]) -> _Rows:
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
        rows = [_fields(line) for line in lines]
        cut = [[*row[:n_fields], *[None] * (n_fields - len(row))] for row in rows]
        schema = {f"field_{i}": pl.String for i in range(n_fields)}
        return pl.DataFrame(cut, schema=schema, orient="row"), np.array([len(row) for row in rows])
    n_found = lines.str.count_matches(",", literal=True).to_numpy().astype(np.int64) + 1
    return lines.str.split_exact(",", n_fields - 1).struct.unnest(), n_found


def _fields(line: str) -> list[str]:
    if '"' not in line:
        return line.split(",")
    try:
        return next(csv.reader([line]))
    except csv.Error:  # a field beyond the library's limit: whatever this is, it is no number
        return line.split(",")


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
    """Whether the last line of a headerless file was cut and then filled up with commas."""
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
