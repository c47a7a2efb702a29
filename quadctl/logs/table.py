"""Tables of other programs (CSV with any separator, Parquet), read by a map; and Parquet as quadctl writes it."""

import functools
import json
import math
import os
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from quadctl.errors import LogError, SettingsError
from quadctl.frames import Quaternion
from quadctl.logs.axes import (
    Vectors,
    attitude,
    body_to_world,
    euler_deg,
    forward_right_down,
    local_position,
    north_east_up,
    quaternion_of,
    quaternion_of_matrix,
)
from quadctl.logs.cleaning import clean_log
from quadctl.logs.columns import PHASE_COLUMN, STATE_COLUMNS, motor_columns
from quadctl.logs.findings import Finding, Kind, finding
from quadctl.logs.flight_log import ATTITUDE, IMU, POSITION, RATES, VELOCITY, FlightLog, Floats
from quadctl.logs.formats import A_MAP, HEAD_BYTES, MAP_SUFFIX, format_of, format_of_folder
from quadctl.logs.merge import Channel, Origin, held, merge
from quadctl.logs.table_map import (
    DEGREES,
    METRES,
    METRES_PER_SECOND,
    METRES_PER_SECOND2,
    MOTORS,
    RADIANS,
    RADIANS_PER_SECOND,
    SECONDS,
    SHARES,
    VOLTS,
    Attitude,
    Clock,
    Motors,
    Position,
    Several,
    Single,
    TableMap,
    Velocity,
    load_map,
    maps_of_folder,
    unsigned,
)
from quadctl.words import nearest

PARQUET_MAGIC = b"PAR1"
SEPARATORS = (",", ";", "\t")
HEADER_BYTES = 65536
"""Length of a file's beginning in which its header ends."""
DAY_S = 86_400.0
DATES_TRIED = 100
"""Number of values of a column by which it is seen whether it holds dates."""
MAX_SHARE = 1.05
"""Share of full output above which a value is damaged, or on another scale."""
_MISSING = ["", "nan", "NaN", "NAN", "null", "None", "NA"]
_CSV: dict[str, Any] = {"null_values": _MISSING, "infer_schema_length": None, "truncate_ragged_lines": True}


def is_parquet(head: bytes) -> bool:
    """True for a file that begins with `head` as Parquet does."""
    return head.startswith(PARQUET_MAGIC)


def read_parquet(path: Path) -> FlightLog:
    """Read Parquet with the columns of docs/log-format.md, as `quadctl logs --to parquet` writes it.

    Raises
    ------
    LogError
        The file cannot be read, or its columns are others: these need a map.
    """
    with path.open("rb") as file:
        if not is_parquet(file.read(len(PARQUET_MAGIC))):
            raise LogError(f"{path}: does not begin as Parquet does, expected a {path.suffix} file")
    table = read_table(path)
    if "timestamp" in table.columns and format_of_folder(path.parent) is not None:
        raise LogError(f"{path}: is one topic of a flight, expected the folder {path.parent}")
    if "time_s" not in table.columns:
        raise LogError(f"{path}: has no column time_s, expected a flight log's columns, {A_MAP}")
    columns: dict[str, Any] = {
        name: table[name].to_list() if name == PHASE_COLUMN else _numbers(path, table, name) for name in table.columns
    }
    about = pl.read_parquet_metadata(path)
    return clean_log(path, columns, meta=json.loads(about["quadctl.meta"]) if "quadctl.meta" in about else None)


def read_mapped(path: Path) -> FlightLog:
    """Read a table by the map that is beside it: its own, or one for all tables of the folder that have its columns.

    Raises
    ------
    LogError
        The table cannot be read, with a map or without, or several maps suit it.
    """
    own = path.with_suffix(MAP_SUFFIX)
    if own.is_file():
        return read_by_map(path, own)
    names = set(_column_names(path))
    named = {beside: {column for _, column in load_map(beside).named_columns()} for beside in maps_of_folder(path)}
    suiting = [beside for beside, columns in named.items() if columns <= names]
    if len(suiting) > 1:
        listed = ", ".join(beside.name for beside in suiting)
        raise LogError(f"{path}: can be read by {listed}, expected one map, or its own named {own.name}")
    meant = suiting or [beside for beside, columns in named.items() if 2 * len(columns & names) > len(columns)]
    if meant and not names >= {*STATE_COLUMNS}:
        return read_by_map(path, meant[0])
    with path.open("rb") as file:
        return format_of(file.read(HEAD_BYTES), path.suffix).read(path)


def read_by_map(path: Path, map_path: Path) -> FlightLog:
    """Read the table at `path` by the map at `map_path`.

    Raises
    ------
    LogError
        The table cannot be read, or holds no position, velocity or attitude.
    SettingsError
        The map cannot be used, or names a column that the table does not have.
    """
    by = load_map(map_path)
    findings = [finding(Kind.READ_BY_MAP, file=map_path.name)]
    table = read_table(path, findings)
    for field, column in by.named_columns():
        if column not in table.columns:
            hint = nearest(column, table.columns)
            raise SettingsError(f"{map_path}: {field} names '{column}', expected a column of {path.name}{hint}")
    return mapped(table, by, path, findings)


def mapped(table: pl.DataFrame, by: TableMap, path: Path, findings: list[Finding]) -> FlightLog:
    """The flight log that `table` is by the map `by`; `path` is named in messages.

    Raises
    ------
    LogError
        A column holds no numbers, or there is no position, velocity or attitude.
    """
    clocks = {clock.column: clock for _, clock in by.clocks()}
    cells = {
        column: _clock(path, table, clocks[column]) if column in clocks else _numbers(path, table, column)
        for _, column in by.named_columns()
    }
    meta: dict[str, Any] = {} if by.attitude.by is None else {"attitude_by": by.attitude.by}
    named = {name: _updates(group, by, cells) for name, group in by.groups()}
    turn_s, turned = _attitude(by.attitude, *named["attitude"])
    channels = [Channel("attitude", turn_s, dict(zip(ATTITUDE, euler_deg(turned), strict=True)))]
    time_s, values = named["position"]
    if by.position.frame == "LLA":
        time_s, values = _with_fix(time_s, values)
        meta["origin_deg"] = [DEGREES[by.position.unit] * float(v[0]) for v in values[:2] if len(v)]
    channels.append(Channel("position", time_s, dict(zip(POSITION, _position(by.position, values), strict=True))))
    time_s, values = named["velocity"]
    velocity = _velocity(by.velocity, time_s, values, turn_s, turned)
    channels.append(Channel("velocity", time_s, dict(zip(VELOCITY, velocity, strict=True))))
    if by.rates is not None:
        time_s, values = named["rates"]
        rates = forward_right_down(_scaled(values, RADIANS_PER_SECOND[by.rates.unit]), by.rates.frame)
        channels.append(Channel("rates", time_s, dict(zip(RATES, rates, strict=True))))
    if by.imu is not None:
        time_s, values = named["imu"]
        force = forward_right_down(_scaled(values, METRES_PER_SECOND2[by.imu.unit]), by.imu.frame)
        channels.append(Channel("imu", time_s, dict(zip(IMU, force, strict=True)), makes_rows=False, averaged=True))
    if by.motors is not None:
        time_s, values = named["motors"]
        quantity, factor = MOTORS[by.motors.unit]
        names = motor_columns(len(values), quantity)
        scaled = [np.abs(factor * v) if quantity == "rpm" else factor * v for v in _shares(by.motors, values)]
        columns = dict(zip(names, scaled, strict=True))
        if quantity == "output":
            columns = {name: _possible(name, share, findings) for name, share in columns.items()}
        channels.append(Channel("motors", time_s, columns))
    if by.battery is not None:
        time_s, (volts,) = named["battery"]
        channels.append(Channel("battery", time_s, {"battery_v": VOLTS[by.battery.unit] * volts}, makes_rows=False))
    if by.throttle is not None:
        time_s, (share,) = named["throttle"]
        channels.append(Channel("throttle", time_s, {"throttle_cmd": SHARES[by.throttle.unit] * share}))
    return merge(channels, Origin(path, "in its columns as the map names them", meta, findings, []))


def read_table(path: Path, findings: list[Finding] | None = None) -> pl.DataFrame:
    """All columns of a CSV or Parquet file; names are stripped of spaces and of a leading `#`.

    A last line of text without an end is left out, which adds a finding.

    Raises
    ------
    LogError
        The file cannot be read, or is no table.
    """
    try:
        with path.open("rb") as file:
            head = file.read(HEADER_BYTES)
        if is_parquet(head):
            table = pl.read_parquet(path)
        else:
            header, separator = _header(head)
            if separator:  # names may hold spaces
                table = pl.read_csv(path, separator=separator, **_CSV)
            else:
                rows = pl.read_csv(path, separator=" ", has_header=False, skip_rows=1, **_CSV)
                table = _named(path, rows, header.lstrip("#").split())
            if not table.is_empty() and _has_open_end(path):
                table = table.head(-1)
                if findings is not None:
                    findings.append(finding(Kind.LAST_LINE_CUT, line=len(table) + 2))
    except OSError as error:
        raise LogError(f"{path}: cannot be read ({error.strerror or error})") from None
    except pl.exceptions.PolarsError as error:
        if is_parquet(head) and _end(path, len(PARQUET_MAGIC)) != PARQUET_MAGIC:
            raise LogError(
                f"{path}: ends in the middle, and Parquet has its index at the end, expected the whole file"
            ) from None
        raise LogError(f"{path}: is no table ({str(error).splitlines()[0]}), expected CSV or Parquet") from None
    if table.is_empty():
        raise LogError(f"{path}: holds no rows, expected a table with a header")
    names = [name.strip().lstrip("#").strip() for name in table.columns]
    if len(set(names)) < len(names):
        raise LogError(f"{path}: names two columns alike, expected each name once")
    return table.rename(dict(zip(table.columns, names, strict=True)))


def _column_names(path: Path) -> list[str]:
    """Names of the columns of a CSV or Parquet file, as `read_table` gives them."""
    with path.open("rb") as file:
        head = file.read(HEADER_BYTES)
    if is_parquet(head):
        return read_table(path).columns
    header, separator = _header(head)
    names = header.split(separator or None)
    return [name.strip().strip('"').lstrip("#").strip() for name in names]


def _header(head: bytes) -> tuple[str, str]:
    """First line of a table, and what separates its columns; "" for blanks."""
    header = (head.decode("utf-8-sig", errors="replace").splitlines() or [""])[0]
    separator = max(SEPARATORS, key=header.count)
    return header, separator if separator in header else ""


def _has_open_end(path: Path) -> bool:
    """Tell whether the last line of a text does not end: nobody can tell whether its last number is whole."""
    return _end(path, 1) not in (b"\n", b"\r")


def _end(path: Path, size: int) -> bytes:
    """The last bytes of a file."""
    with path.open("rb") as file:
        file.seek(-size, os.SEEK_END)
        return file.read()


# --- parts ------------------------------------------------------------------------------------------------------------


def _named(path: Path, rows: pl.DataFrame, names: list[str]) -> pl.DataFrame:
    """The rows with names for their columns; empty ones after a blank at the ends of the lines are left out."""
    kept, ends = rows.columns[: len(names)], rows.columns[len(names) :]
    if not names or len(kept) < len(names) or any(rows[column].null_count() < len(rows) for column in ends):
        raise LogError(
            f"{path}: its header names {len(names)} columns and its rows have {rows.width}, expected a table"
        )
    return rows.select(kept).rename(dict(zip(kept, names, strict=True)))


def _numbers(path: Path, table: pl.DataFrame, name: str) -> Floats:
    column = table[name]
    if column.dtype.is_numeric():
        return column.cast(pl.Float64).to_numpy().astype(np.float64)
    if column.dtype == pl.String:
        column = column.str.strip_chars()
    if column.dtype.is_temporal():
        raise LogError(f"{path}: column '{name}' holds dates, expected numbers")
    try:
        values = column.cast(pl.Float64, strict=False)
    except pl.exceptions.PolarsError:
        raise LogError(f"{path}: column '{name}' holds {column.dtype}, expected numbers") from None
    wrong = values.is_null() & column.is_not_null()
    if 2 * int(wrong.sum()) > len(values):
        shown = column.filter(wrong)[0]
        raise LogError(f"{path}: column '{name}' holds {str(shown)[:40]!r}, expected a number")
    return values.fill_null(np.nan).to_numpy().astype(np.float64)


def _clock(path: Path, table: pl.DataFrame, clock: Clock) -> Floats:
    """Values of a clock; of dates, seconds since 1970."""
    column = table[clock.column]
    if clock.unit == "date":
        values = dates_s(column)
        if values is None:
            raise LogError(f"{path}: column '{clock.column}' holds {_first(column)}, expected dates")
        return values
    if dates_s(column) is not None:
        raise LogError(
            f"{path}: column '{clock.column}' holds dates ({_first(column)}), expected numbers of {clock.unit}, or "
            "`unit: date` in the map"
        )
    return _numbers(path, table, clock.column)


def _first(column: pl.Series) -> str:
    """First value of a column, for messages."""
    return f"{str(next(iter(column.drop_nulls()), 'nothing'))[:40]!r}"


def dates_s(column: pl.Series) -> Floats | None:
    """Seconds since 1970 of a column of dates, or since a midnight of times of a day, ISO 8601's if they are text, nan
    where one is missing; None where fewer than half of the values are any."""
    if column.dtype == pl.Datetime:
        return 1e-9 * column.dt.epoch("ns").cast(pl.Float64).fill_null(np.nan).to_numpy()
    if column.dtype != pl.String:
        return None
    texts = column.drop_nulls()
    if not len(texts) or not np.isfinite([_date_s(text) for text in texts[:DATES_TRIED]]).any():
        return None
    values = np.array([np.nan if text is None else _date_s(text) for text in column])
    known = np.isfinite(values)
    if np.all(values[known] < DAY_S):
        values[known] = np.unwrap(values[known], period=DAY_S)
    return values if 2 * np.count_nonzero(np.isfinite(values)) > len(texts) else None


@functools.lru_cache(maxsize=100_000)  # a map is looked for by reading the same table a hundred times
def _date_s(text: str) -> float:
    text = text.strip().replace("/", "-")
    try:
        date = datetime.fromisoformat(f"1970-01-01T{text}" if text[2:3] == ":" else text)
    except ValueError:
        return math.nan
    return (date if date.tzinfo else date.replace(tzinfo=UTC)).timestamp()


def _position(group: Position, values: list[Floats]) -> Vectors:
    if group.frame != "LLA":
        return north_east_up(_scaled(values, METRES[group.unit]), group.frame)
    latitude, longitude = (DEGREES[group.unit] * v for v in values[:2])
    return local_position(latitude, longitude, METRES[group.height_unit or "m"] * values[2])


def _with_fix(time_s: Floats, values: list[Floats]) -> tuple[Floats, list[Floats]]:
    """The rows of latitude, longitude and height in which a receiver has a position: before, it says 0 and 0."""
    fixed = (values[0] != 0.0) | (values[1] != 0.0)
    return time_s[fixed], [v[fixed] for v in values]


def _shares(group: Motors, values: list[Floats]) -> list[Floats]:
    """Outputs as shares of full output; speeds as they are."""
    if group.unit not in ("pwm", "us"):
        return values
    low, high = group.ends
    return [np.clip((v - low) / (high - low), 0.0, None) for v in values]


def _possible(name: str, share: Floats, findings: list[Finding]) -> Floats:
    """Outputs that a motor can have, of which a little more than all is all; others become nan."""
    beyond = share > MAX_SHARE
    if beyond.any():
        findings.append(finding(Kind.IMPOSSIBLE_VALUES, column=name, values=int(beyond.sum()), limit=MAX_SHARE))
    return np.where(beyond, np.nan, np.minimum(share, 1.0))


def _updates(group: Several | Single, by: TableMap, cells: dict[str, Floats]) -> tuple[Floats, list[Floats]]:
    """Times and values of the rows in which all columns of the group are known."""
    clock = group.time or by.time
    (columns,) = group.names.values()
    time_s = SECONDS[clock.unit] * cells[clock.column]
    values = [cells[unsigned(column)] * (1.0 if column == unsigned(column) else -1.0) for column in columns]
    known = np.logical_and.reduce([np.isfinite(v) for v in (time_s, *values)])
    return time_s[known], [v[known] for v in values]


def _scaled(values: list[Floats], factor: float) -> Vectors:
    a, b, c = values
    return factor * a, factor * b, factor * c


def _attitude(group: Attitude, time_s: Floats, values: list[Floats]) -> tuple[Floats, Quaternion]:
    if group.unit is not None:
        given = quaternion_of(_scaled(values, RADIANS[group.unit]))
    elif len(values) == 9:
        a, b, c, d, e, f, g, h, i = values
        rows = ((a, b, c), (d, e, f), (g, h, i)) if group.order == "rows" else ((a, d, g), (b, e, h), (c, f, i))
        given = quaternion_of_matrix(rows)
    else:
        w, x, y, z = values if group.order == "wxyz" else (values[3], *values[:3])
        given = (w, x, y, z)
    turned = attitude(given, group.world, group.body, group.inverse)
    return time_s, turned


def _velocity(group: Velocity, time_s: Floats, values: list[Floats], turn_s: Floats, turned: Quaternion) -> Vectors:
    scaled = _scaled(values, METRES_PER_SECOND[group.unit])
    if group.frame == "FRD" or group.frame == "FLU":  # noqa: PLR1714 (mypy narrows by this alone)
        body = forward_right_down(scaled, group.frame)
    else:
        return north_east_up(scaled, group.frame)
    w, x, y, z = (held(time_s, turn_s, part) for part in turned)
    return body_to_world((w, x, y, z), body)
