"""Names of the fields of a CSV flight log: by its header, or by how many there are."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import polars as pl

from quadctl.errors import LogError
from quadctl.logs.cleaning import check_columns
from quadctl.logs.columns import STATE_COLUMNS, is_column, motor_columns, rpm_columns
from quadctl.logs.csv_lines import RawText, split_line
from quadctl.logs.findings import Finding, Kind

_SEPARATORS = {";": "semicolons", "\t": "tabs", " ": "blanks"}
"""Separators of other programs, in place of commas."""
_COMMANDS_OF_17 = ("roll_cmd_deg", "pitch_cmd_deg", "yaw_cmd_deg", "throttle_cmd")
_HEADERLESS = (
    "17 columns (state and 4 commands) or 13 + 3 per rotor (state, rpm, voltages, currents: 25 for 4 rotors, 31 for 6)"
)


@dataclass(frozen=True)
class Layout:
    """Names of the fields of each line."""

    names: tuple[str | None, ...]
    """Name of each field of a line, None for one that is left out."""
    has_header: bool
    findings: list[Finding] = field(default_factory=list)


def layout_of(path: Path, raw: RawText) -> Layout:
    """By the header, or by the number of fields; raises LogError where it is no flight log's."""
    number, text = raw.first
    for separator, name in _SEPARATORS.items():
        if sum(map(is_column, text.split(separator))) > 1:
            where = f"{path}, line {number}"
            raise LogError(f"{where}: separates columns by {name}, expected commas between them and decimal points")
    first = [name.strip() for name in split_line(text)]
    if any(map(is_column, first)) or (sum(map(_is_number, first)) * 2 < len(first) and len(first) > 1):
        return _by_header(path, number, first)
    return _by_count(path, raw)


def _by_header(path: Path, line: int, names: list[str]) -> Layout:
    repeated = next((name for name in names if is_column(name) and names.count(name) > 1), None)
    if repeated:
        raise LogError(f"{path}, line {line}: column '{repeated}' is there twice, expected each name once")
    findings = check_columns(names, f"{path}, line {line}: the header")
    return Layout(tuple(name if is_column(name) else None for name in names), True, findings)


def _by_count(path: Path, raw: RawText) -> Layout:
    commas = [part.text.str.count_matches(",", literal=True).to_numpy() for part in raw.parts()]
    counts, how_often = np.unique(np.concatenate(commas).astype(np.int64) + 1, return_counts=True)
    n = int(counts[np.argmax(how_often)])
    if n == 17:
        if _holds_throttle(raw):
            return Layout((*STATE_COLUMNS, *_COMMANDS_OF_17), False, [_seventeen("throttle")])
        return Layout((*STATE_COLUMNS, *rpm_columns(4)), False, [_seventeen("rpm")])
    n_rotors, rest = divmod(n - len(STATE_COLUMNS), 3)
    if n_rotors < 4 or rest:
        separator = next((f", separated by '{s}'" for s in ";\t" if n == 1 and s in raw.first[1]), "")
        found = f"{n} column{'s' if n > 1 else ''}{separator}"
        raise LogError(f"{path}: has no header and {found}, expected our header, or separated by commas {_HEADERLESS}")
    motors = (*motor_columns(n_rotors, "voltage_v"), *motor_columns(n_rotors, "current_a"))
    return Layout((*STATE_COLUMNS, *rpm_columns(n_rotors), *motors), False)


def _seventeen(read_as: str) -> Finding:
    return Finding(Kind.SEVENTEEN_COLUMNS, {"as": read_as})


def _holds_throttle(raw: RawText) -> bool:
    """True where the last column lies in 0..1, as a throttle does and the speed of a rotor does not."""
    last = [
        part.text.str.split(",").list.last().str.strip_chars().cast(pl.Float64, strict=False).drop_nulls().drop_nans()
        for part in raw.parts()
    ]
    values = np.concatenate([part.to_numpy() for part in last])
    return len(values) == 0 or bool(np.median(np.abs(values)) <= 1.0)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return not text
    return True
