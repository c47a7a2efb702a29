"""Tables of other programs (CSV with any separator, Parquet), read by a map; and Parquet as quadctl writes it."""

import json
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
    north_east_up,
    quaternion_of,
    quaternion_of_matrix,
)
from quadctl.logs.cleaning import clean_log
from quadctl.logs.columns import PHASE_COLUMN, motor_columns
from quadctl.logs.findings import Finding, Kind, finding
from quadctl.logs.flight_log import ATTITUDE, IMU, POSITION, RATES, VELOCITY, FlightLog, Floats, did_you_mean
from quadctl.logs.formats import format_of_folder
from quadctl.logs.merge import Channel, Origin, held, merge
from quadctl.logs.table_map import (
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
    Several,
    Single,
    TableMap,
    Velocity,
    load_map,
    map_beside,
)

PARQUET_MAGIC = b"PAR1"
SEPARATORS = (",", ";", "\t")
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
        raise LogError(
            f"{path}: has no column time_s, expected a flight log's columns, or a map {path.stem}.map.yaml beside it"
        )
    columns: dict[str, Any] = {
        name: table[name].to_list() if name == PHASE_COLUMN else _numbers(path, table, name) for name in table.columns
    }
    about = pl.read_parquet_metadata(path)
    return clean_log(path, columns, meta=json.loads(about["quadctl.meta"]) if "quadctl.meta" in about else None)


def read_mapped(path: Path) -> FlightLog:
    """Read a table by the map that is beside it.

    Raises
    ------
    LogError
        There is no map, or the table cannot be read by it.
    """
    beside = map_beside(path)
    if beside is None:
        raise LogError(f"{path}: has no map beside it, expected {path.stem}.map.yaml")
    return read_by_map(path, beside)


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
    table = read_table(path)
    for field, column in by.named_columns():
        if column not in table.columns:
            hint = did_you_mean(column, table.columns)
            raise SettingsError(f"{map_path}: {field} names '{column}', expected a column of {path.name}{hint}")
    return mapped(table, by, path, [finding(Kind.READ_BY_MAP, file=map_path.name)])


def mapped(table: pl.DataFrame, by: TableMap, path: Path, findings: list[Finding]) -> FlightLog:
    """The flight log that `table` is by the map `by`; `path` is named in messages.

    Raises
    ------
    LogError
        A column holds no numbers, or there is no position, velocity or attitude.
    """
    cells = {column: _numbers(path, table, column) for _, column in by.named_columns()}
    named = {name: _updates(group, by, cells) for name, group in by.groups()}
    turn_s, turned = _attitude(by.attitude, *named["attitude"])
    channels = [Channel("attitude", turn_s, dict(zip(ATTITUDE, euler_deg(turned), strict=True)))]
    time_s, values = named["position"]
    position = north_east_up(_scaled(values, METRES[by.position.unit]), by.position.frame)
    channels.append(Channel("position", time_s, dict(zip(POSITION, position, strict=True))))
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
        speeds = [np.abs(factor * v) if quantity == "rpm" else factor * v for v in values]
        channels.append(Channel("motors", time_s, dict(zip(names, speeds, strict=True))))
    if by.battery is not None:
        time_s, (volts,) = named["battery"]
        channels.append(Channel("battery", time_s, {"battery_v": VOLTS[by.battery.unit] * volts}, makes_rows=False))
    if by.throttle is not None:
        time_s, (share,) = named["throttle"]
        channels.append(Channel("throttle", time_s, {"throttle_cmd": SHARES[by.throttle.unit] * share}))
    return merge(channels, Origin(path, "in its columns as the map names them", {}, findings, []))


def read_table(path: Path) -> pl.DataFrame:
    """All columns of a CSV or Parquet file; names are stripped of spaces and of a leading `#`.

    Raises
    ------
    LogError
        The file cannot be read, or is no table.
    """
    try:
        with path.open("rb") as file:
            head = file.read(65536)
        if is_parquet(head):
            table = pl.read_parquet(path)
        else:
            header = head.decode("utf-8-sig", errors="replace").splitlines()[:1] or [""]
            separator = max(SEPARATORS, key=header[0].count)
            if header[0].count(separator):  # names may hold spaces
                table = pl.read_csv(path, separator=separator, **_CSV)
            else:
                rows = pl.read_csv(path, separator=" ", has_header=False, skip_rows=1, **_CSV)
                table = _named(path, rows, header[0].lstrip("#").split())
    except OSError as error:
        raise LogError(f"{path}: cannot be read ({error.strerror or error})") from None
    except pl.exceptions.PolarsError as error:
        raise LogError(f"{path}: is no table ({str(error).splitlines()[0]}), expected CSV or Parquet") from None
    if table.is_empty():
        raise LogError(f"{path}: holds no rows, expected a table with a header")
    names = [name.strip().lstrip("#").strip() for name in table.columns]
    if len(set(names)) < len(names):
        raise LogError(f"{path}: names two columns alike, expected each name once")
    return table.rename(dict(zip(table.columns, names, strict=True)))


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


def _updates(group: Several | Single, by: TableMap, cells: dict[str, Floats]) -> tuple[Floats, list[Floats]]:
    """Times and values of the rows in which all columns of the group are known."""
    clock = group.time or by.time
    (columns,) = group.names.values()
    time_s, values = SECONDS[clock.unit] * cells[clock.column], [cells[column] for column in columns]
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
