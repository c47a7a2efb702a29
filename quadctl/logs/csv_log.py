"""CSV flight logs (docs/log-format.md): our own, with a header, and the headerless ones of the RAPTOR flights.

Damaged lines, and a last line that a power cut left incomplete, are left out here; `cleaning` does the rest.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import polars as pl
import yaml
from numpy.typing import NDArray

from quadctl.errors import LogError
from quadctl.files import write_text, written_aside
from quadctl.logs.cleaning import clean_log
from quadctl.logs.columns import PHASE_COLUMN, column_order
from quadctl.logs.csv_layout import Layout, layout_of
from quadctl.logs.csv_lines import Lines, read_text, split_line
from quadctl.logs.findings import Finding, Kind, finding
from quadctl.logs.flight_log import FlightLog, Floats
from quadctl.logs.sidecar import meta_path

_Rows: TypeAlias = tuple[dict[str, NDArray[Any]], NDArray[np.int64]]
"""Columns, and the number in the file of the line that each row comes from."""


def read_csv(path: Path | str) -> FlightLog:
    """Read a CSV flight log, with our header or headerless; safe on a file that is still being written.

    Raises
    ------
    LogError
        The file is missing, empty, not text, not a flight log, or damaged for the most part.
    """
    path = Path(path)
    findings: list[Finding] = []
    columns, line = _table(path, findings)
    return clean_log(path, columns, findings=findings, line_numbers=line)


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
    with written_aside(path) as aside:
        table.write_csv(aside, null_value="nan")
    if log.meta:
        write_text(meta_path(path), yaml.safe_dump(log.meta, sort_keys=False, allow_unicode=True), LogError)


# --- values -----------------------------------------------------------------------------------------------------------


def _table(path: Path, findings: list[Finding]) -> _Rows:
    """Columns and line numbers of the undamaged lines: NaN where a value is missing, text only in `phase`."""
    raw = read_text(path)
    layout = layout_of(path, raw)
    findings += [*raw.findings, *layout.findings]
    damage: dict[int, str] = {}
    parts, skip = [], layout.has_header
    for lines in raw.parts():
        rows = lines.without_first() if skip else lines
        parts.append(_plain_part(rows, layout) or _part(rows.text, rows.number, layout, damage))
        skip = False
    count = sum(part.n_lines for part in parts)
    if not count:
        raise LogError(f"{path}: has a header and no complete row of data")
    number = np.concatenate([part.number for part in parts])
    for name in parts[0].wrong:
        wrong = np.concatenate([part.wrong[name] for part in parts])
        if len(wrong) > len(number) / 2:
            line, text = next(part.first_wrong[name] for part in parts if name in part.first_wrong)
            raise LogError(f"{path}, line {line}: column '{name}' holds {_shown(text)}, expected a number")
    undamaged = ~np.isin(number, list(damage))
    if not undamaged.any() or len(damage) > count / 2:
        line, what = min(damage.items())
        raise LogError(
            f"{path}: {len(damage)} of {count} lines are damaged (line {line}: {what}), expected a few at most"
        )
    if not layout.has_header and _is_padded([field for part in parts for field in part.last_field]):
        undamaged[-1] = False
        findings.append(finding(Kind.LAST_LINE_CUT, line=int(number[-1])))
    if damage:
        line, what = min(damage.items())
        findings.append(finding(Kind.DAMAGED_LINES, lines=len(damage), line=line, what=what))
    columns = {}
    for name in list(parts[0].columns):
        values = np.concatenate([part.columns.pop(name) for part in parts])
        columns[name] = values if undamaged.all() else values[undamaged]
    return columns, number[undamaged]


@dataclass(frozen=True)
class _Part:
    """Values of a part of the lines, those whose number of fields is right."""

    n_lines: int
    columns: dict[str, NDArray[Any]]
    number: NDArray[np.int64]
    wrong: dict[str, NDArray[np.intp]]
    """Rows of each column that hold text instead of a number."""
    first_wrong: dict[str, tuple[int, str]]
    """Line and text of the first of these."""
    last_field: list[str]
    """Last field of the last two lines."""


def _plain_part(lines: Lines, layout: Layout) -> _Part | None:
    """Values of some lines, by the fast reader of the library; None where any of them may be blank or damaged."""
    if not lines.count or _is_unusual(lines.data):
        return None
    kinds = [pl.String if name in (None, PHASE_COLUMN) else pl.Float64 for name in layout.names]
    schema = {f"field_{i}": kind for i, kind in enumerate(kinds)}
    try:
        table = pl.read_csv(lines.data, has_header=False, schema=schema, quote_char=None)
    except (pl.exceptions.PolarsError, ValueError):
        return None
    # The last field of a line that is cut short, or blank, is missing.
    if len(table) != lines.count or table[:, -1].null_count():
        return None
    columns: dict[str, NDArray[Any]] = {}
    for name, field in zip(layout.names, table.get_columns(), strict=True):
        if name == PHASE_COLUMN:
            columns[name] = field.fill_null("").to_numpy()
        elif name is not None:
            columns[name] = field.to_numpy()  # nan where a value is missing
    nothing_wrong = {name: np.empty(0, dtype=np.intp) for name in columns if name != PHASE_COLUMN}
    number = np.arange(lines.before + 1, lines.before + 1 + lines.count)
    last = [str(value) for value in table[:, -1].tail(2)]
    return _Part(lines.count, columns, number, nothing_wrong, {}, last)


def _is_unusual(data: bytes) -> bool:
    """Tell whether lines hold quotes, or blanks that are stripped from their ends: these are read the slow way."""
    return b'"' in data or b"\r" in data or (b" " in data and b" \n" in data)


def _part(lines: pl.Series, number: NDArray[np.int64], layout: Layout, damage: dict[int, str]) -> _Part:
    """Values of some lines; damaged ones are entered in `damage`."""
    n_fields = len(layout.names)
    fields, n_found = _split(lines, n_fields)
    whole = n_found == n_fields
    damage |= {
        int(line): f"{n} fields instead of {n_fields}" for line, n in zip(number[~whole], n_found[~whole], strict=True)
    }
    fields, number = fields.filter(pl.Series(whole)), number[whole]
    columns: dict[str, NDArray[Any]] = {}
    wrong: dict[str, NDArray[np.intp]] = {}
    first_wrong = {}
    for name, field in zip(layout.names, fields.get_columns(), strict=True):
        if name == PHASE_COLUMN:
            columns[name] = field.fill_null("").to_numpy()
        elif name is not None:
            text = field.str.strip_chars()
            columns[name], wrong[name] = _numbers(text)
            for row in wrong[name]:
                damage.setdefault(int(number[row]), f"{name} is {_shown(text[int(row)])} instead of a number")
            if len(wrong[name]):
                first = int(wrong[name][0])
                first_wrong[name] = int(number[first]), str(text[first])
    last = fields[:, -1].fill_null("").tail(2).to_list()
    return _Part(len(lines), columns, number, wrong, first_wrong, last)


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


def _numbers(text: pl.Series) -> tuple[Floats, NDArray[np.intp]]:
    """The values of a column, NaN where one is missing, and the rows that hold text."""
    values = text.cast(pl.Float64, strict=False)
    wrong = np.flatnonzero((values.is_null() & (text.fill_null("") != "")).to_numpy())
    return values.fill_null(float("nan")).to_numpy(), wrong


def _is_padded(last_field: Sequence[str]) -> bool:
    """True where the last line of a headerless file was cut and then filled up with commas: its last field is empty,
    that of the line before is not."""
    return len(last_field) > 1 and last_field[-1] == "" and last_field[-2] != ""


def _shown(text: str) -> str:
    return repr(text if len(text) <= 40 else text[:37] + "...")
