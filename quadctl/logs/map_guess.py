"""A map proposed from the names and the values of a table's columns, and the reading that would suit a map better.

Names say which columns are which; frames, and the direction of the quaternion, are those in which the channels agree.
"""

import itertools
import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias, get_args

import numpy as np
import polars as pl
import yaml
from pydantic import ValidationError

from quadctl.errors import LogError, QuadctlError
from quadctl.logs.column_meaning import meaning, plain
from quadctl.logs.consistency import complaints, misfit
from quadctl.logs.flight_log import FlightLog, Floats
from quadctl.logs.table import dates_s, mapped, read_table
from quadctl.logs.table_map import SECONDS, TableMap, load_map

MIN_GAIN = 0.6
"""Another reading is named where its disagreement is less than this share of the present one."""
MIN_MISFIT = 0.5
"""Sum of disagreements below which no other reading is looked for."""
PULSES_US = (800.0, 2300.0)
"""Range of pulses to motors that turn."""
FASTEST_RAD_S = 2500.0
"""Largest rotor speed that is taken for rad/s where names do not tell."""
FULL_COUNTS = (255.0, 1023.0, 4095.0, 65535.0)
"""Counts of full output, of 8, 10, 12 and 16 bits."""
FASTEST_RPM = 4e4
"""Largest number that is taken for a rotor speed where names do not tell."""
MIN_GOING_ON = 0.1
"""Least share of the rows in which a clock goes on: slow channels share the rows of a fast one."""
SINCE_1970_S = (1e9, 5e9)
"""Seconds since 1970 of the years 2001 to 2128."""
_CRAZYFLIE_MOTOR = re.compile(r"(^|_)motor_m\d$")
"""Name of the Crazyflie's outputs, which are counts of 16 bits."""


def proposed(path: Path) -> tuple[TableMap, FlightLog]:
    """A map of the table at `path`, and the log that it makes of it.

    Raises
    ------
    LogError
        The names do not tell time, position, velocity and attitude.
    """
    table = read_table(path)
    best: tuple[float, TableMap, FlightLog] | None = None
    problem: QuadctlError | None = None
    for variant in _variants(_by_name(path, table)):
        by = TableMap.model_validate(variant)
        try:
            log = mapped(table, by, path, [])
        except QuadctlError as error:
            problem = error
            continue
        score = misfit(log)
        if best is None or score < best[0] - 1e-6:
            best = (score, by, log)
    if best is None:
        raise problem or LogError(f"{path}: no map was found, expected columns of a flight")
    found = _best_alternative(path, table, best[1]) if best[0] >= MIN_MISFIT else None
    if found is None or found.misfit > MIN_GAIN * best[0]:
        return best[1], best[2]
    return found.by, mapped(table, found.by, path, [])


def better_reading(path: Path, map_path: Path, log: FlightLog) -> str | None:
    """The one field of the map, with the value that makes the channels agree; None where there is none."""
    by, table = load_map(map_path), read_table(path)
    present = misfit(log)
    if present < MIN_MISFIT and not complaints(log):
        return None
    found = _best_alternative(path, table, by)
    return None if found is None or found.misfit > MIN_GAIN * present else found.field


class _Alternative(NamedTuple):
    misfit: float
    field: str
    """With its value."""
    by: TableMap


def _best_alternative(path: Path, table: pl.DataFrame, by: TableMap) -> _Alternative | None:
    """Map with the least disagreement of those that differ from `by` in one field."""
    found: list[_Alternative] = []
    for field, value, other in _alternatives(by):
        try:
            found.append(_Alternative(misfit(mapped(table, other, path, [])), f"{field}: {value}", other))
        except QuadctlError:
            continue
    return min(found, key=lambda alternative: alternative.misfit, default=None)


def as_yaml(by: TableMap, note: str) -> str:
    """The map as a file; it begins with a note, and with what is doubtful."""
    if by.motors is not None and not any(_tells_unit(name) for name in by.motors.columns):
        note += "\n# motors.unit is told by the size of the numbers alone"
    data = by.model_dump(exclude_none=True, exclude_defaults=True, mode="json")
    return f"# {note}\n" + yaml.dump(data, sort_keys=False, default_flow_style=None, width=118, allow_unicode=True)


# --- names ------------------------------------------------------------------------------------------------------------

_Columns: TypeAlias = dict[str, str]
"""Columns of one group, by the part of it that they hold."""


def _by_name(path: Path, table: pl.DataFrame) -> dict[str, Any]:
    """The map without the frames that names do not tell."""
    found: dict[str, dict[tuple[str, str], _Columns]] = defaultdict(lambda: defaultdict(dict))
    for name in table.columns:
        if (of := meaning(name)) is not None and (table[name].dtype.is_numeric() or of.kind == "time"):
            found[of.kind][of.group, of.unit].setdefault(of.part, name)
    groups: dict[str, Any] = {"time": _clock(path, table)}
    for kind in ("position", "velocity", "imu", "rates"):
        # A gyro measures rates; others that bear the name are slopes of an attitude, or filtered.
        for (_, unit), columns in sorted(found[kind].items(), key=lambda item: "gyro" not in item[0][0]):
            if kind not in groups and (group := _triple(columns)) is not None:
                groups[kind] = group | ({"unit": unit} if unit else {})
    groups |= {} if "position" in groups else _place(table, found["place"])
    groups |= _attitude(table, found["attitude"])
    groups |= {} if "rates" in groups else _angle_rates(found["rates"])
    _size_units(table, groups)
    groups |= _motors(table, found["motor"])
    for (_, unit), columns in found["battery"].items():
        high = float(np.nanmedian(table[columns[""]].to_numpy())) > 1000.0
        groups.setdefault("battery", {"column": columns[""], "unit": unit or ("mV" if high else "V")})
    missing = [name for name in ("position", "velocity", "attitude") if name not in groups]
    if missing:
        raise LogError(
            f"{path}: the names of its columns do not tell {', '.join(missing)}, expected names such as pos_x, vel_x "
            f"and q_w; it has {', '.join(table.columns[:12])}"
        )
    return groups


def _triple(columns: _Columns) -> dict[str, Any] | None:
    """Group of three axes, with its frame where directions name them."""
    for parts, frame in (("xyz", None), (("north", "east", "down"), "NED"), (("north", "east", "up"), "NEU")):
        if set(parts) <= columns.keys():
            return {"columns": [columns[part] for part in parts]} | ({"frame": frame} if frame else {})
    return None


def _place(table: pl.DataFrame, found: dict[tuple[str, str], _Columns]) -> dict[str, Any]:
    """Position as latitude, longitude and height, of which the one above the begin is preferred."""
    parts: dict[str, list[tuple[str, str]]] = defaultdict(list)
    for (_, unit), columns in found.items():
        for part, name in columns.items():
            parts[part if part in ("latitude", "longitude") else "height"].append((name, unit))
    if len(parts) < 3:
        return {}
    latitude, longitude = parts["latitude"][0][0], parts["longitude"][0][0]
    height, unit = min(parts["height"], key=lambda item: "rel" not in item[0].lower())
    is_count = _largest(table, [latitude]) > 90.0
    position = {"columns": [latitude, longitude, height], "frame": "LLA", "unit": "degE7" if is_count else "deg"}
    return {"position": position | ({"height_unit": unit} if unit not in ("", "m") else {})}


def _attitude(table: pl.DataFrame, found: dict[tuple[str, str], _Columns]) -> dict[str, Any]:
    """A quaternion, else roll, pitch and yaw."""
    for columns in found.values():
        for parts in ("wxyz", "0123", "1234"):  # numbered, the scalar comes first
            if set(parts) <= columns.keys():
                return {"attitude": {"columns": [columns[part] for part in parts], "order": "wxyz"}}
    angles: dict[tuple[str, str], _Columns] = defaultdict(dict)
    for (_, unit), columns in found.items():  # the heading may come from a compass of its own
        for part, name in columns.items():
            angles["", unit].setdefault(part, name)
    for (_, unit), columns in (*found.items(), *angles.items()):
        if {"roll", "pitch", "yaw"} <= columns.keys():
            names = [columns[angle] for angle in ("roll", "pitch", "yaw")]
            return {"attitude": {"columns": names, "unit": unit or ("deg" if _largest(table, names) > 3.5 else "rad")}}
    return {}


def _angle_rates(found: dict[tuple[str, str], _Columns]) -> dict[str, Any]:
    for (_, unit), columns in found.items():
        if {"roll", "pitch", "yaw"} <= columns.keys():
            names = [columns[angle] for angle in ("roll", "pitch", "yaw")]
            return {"rates": {"columns": names} | ({"unit": unit} if unit else {})}
    return {}


def _size_units(table: pl.DataFrame, groups: dict[str, Any]) -> None:
    """Give rates and accelerations the unit that their size tells, where their names do not."""
    if "rates" in groups and "unit" not in groups["rates"]:
        groups["rates"]["unit"] = "deg/s" if _largest(table, groups["rates"]["columns"]) > 25.0 else "rad/s"
    if "imu" in groups and "unit" not in groups["imu"]:
        parts = [table[name].cast(pl.Float64).to_numpy() for name in groups["imu"]["columns"]]
        if 0.5 < float(np.nanmedian(np.linalg.norm(parts, axis=0))) < 2.0:
            groups["imu"]["unit"] = "g"


def _motors(table: pl.DataFrame, found: dict[tuple[str, str], _Columns]) -> dict[str, Any]:
    """Outputs or, rather, speeds of the motors."""
    several = {key: columns for key, columns in found.items() if len(columns) > 2}
    if not several:
        return {}
    (_, unit), columns = min(several.items(), key=lambda item: item[0][1] not in ("rpm", "rad/s", "rev/s"))
    names = [columns[number] for number in sorted(columns, key=int)]
    return {"motors": {"columns": names} | _motor_scale(table, names, unit)}


def _motor_scale(table: pl.DataFrame, names: list[str], unit: str) -> dict[str, Any]:
    """Unit of motors, by their names and then by their size."""
    if unit in ("rpm", "rad/s", "rev/s", "percent"):
        return {"unit": unit}
    values = np.concatenate([table[name].drop_nulls().cast(pl.Float64).to_numpy() for name in names])
    values = values[np.isfinite(values)]
    turning = values[values > 0.0]
    top = float(np.quantile(turning, 0.999)) if len(turning) else 0.0
    if top <= 1.5:
        return {"unit": "share"}
    is_crazyflie = all(map(_is_of_crazyflie, names))
    if PULSES_US[0] < float(np.quantile(turning, 0.05)) and top < PULSES_US[1] and not is_crazyflie:
        return {"unit": "us"}
    if unit == "pwm" or is_crazyflie or top > FASTEST_RPM:
        full = FULL_COUNTS[-1] if is_crazyflie else next((full for full in FULL_COUNTS if top <= full), FULL_COUNTS[-1])
        return {"unit": "pwm", "full": full}
    return {"unit": "rad/s" if top < FASTEST_RAD_S else "rpm"}


def _tells_unit(motor: str) -> bool:
    of = meaning(motor)
    return (of is not None and of.unit != "") or _is_of_crazyflie(motor)


def _is_of_crazyflie(motor: str) -> bool:
    return _CRAZYFLIE_MOTOR.search(plain(motor)) is not None


def _largest(table: pl.DataFrame, names: list[str]) -> float:
    return max(float(np.nanmax(np.abs(table[name].drop_nulls().to_numpy()), initial=0.0)) for name in names)


def _clock(path: Path, table: pl.DataFrame) -> dict[str, str]:
    """Clock of the table: the first column that is one by its name and goes on by its values, else by its name."""
    named = {name: of.unit for name in table.columns if (of := meaning(name)) is not None and of.kind == "time"}
    found: list[tuple[bool, dict[str, str]]] = []
    for name, unit in named.items():
        if (dates := dates_s(table[name])) is not None:
            found.append((_stands_still(dates), {"column": name, "unit": "date"}))
        elif table[name].dtype.is_numeric():
            values = table[name].drop_nulls().to_numpy().astype(np.float64)
            counted = unit if unit in SECONDS else _unit_of_time(values)
            found.append((_stands_still(values), {"column": name, "unit": counted}))
    if found:
        return min(found, key=lambda clock: clock[0])[1]
    if named:
        name = next(iter(named))
        shown = str(next(iter(table[name].drop_nulls()), "nothing"))[:40]
        raise LogError(f"{path}: column '{name}' holds {shown!r}, expected numbers or dates as the time")
    raise LogError(f"{path}: the names of its columns do not tell the time, expected one such as time or timestamp")


def _stands_still(clock: Floats) -> bool:
    """Tell whether a clock goes on in few of the rows: a date without the time of the day, for example."""
    return bool(np.mean(np.diff(clock) > 0.0) < MIN_GOING_ON) if len(clock) > 1 else True


def _unit_of_time(values: Floats) -> str:
    """Unit of a clock: of one that counts from 1970 by its size, else by its steps."""
    steps = np.diff(values)
    steps = steps[steps > 0.0]
    step = float(np.median(steps)) if len(steps) else 0.0
    middle = float(np.median(values)) if len(values) else 0.0
    for unit, factor in SECONDS.items():
        if SINCE_1970_S[0] < factor * middle < SINCE_1970_S[1] and factor * step < 100.0 and unit != "date":
            return unit
    return next(unit for unit, least in (("ns", 3e5), ("us", 3e2), ("ms", 0.8), ("s", 0.0)) if step >= least)


def _variants(groups: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The map in all frames that are tried; the usual ones first."""
    is_quaternion = "order" in groups["attitude"]
    worlds = (("NED", "NED"), ("ENU", "ENU"), ("NEU", "NED"))  # of the vectors, and of the attitude
    for (world, of_attitude), body, moving, turned, of_imu in itertools.product(
        worlds, ("FRD", "FLU"), (True, False), (False, True), ("FRD", "FLU") if "imu" in groups else ("",)
    ):
        variant = {
            **groups,
            "position": {"frame": world} | groups["position"],
            "velocity": {"frame": world if moving else body} | groups["velocity"],
            "attitude": groups["attitude"] | {"body": body, "world": of_attitude},
        }
        if is_quaternion:
            variant["attitude"]["inverse"] = turned
        elif turned:  # nose up is positive to the pilot, whatever the frame
            roll, pitch, yaw = groups["attitude"]["columns"]
            variant["attitude"]["columns"] = [roll, f"-{pitch}", yaw]
        if "rates" in groups:
            variant["rates"] = groups["rates"] | {"frame": body}
        if "imu" in groups:
            variant["imu"] = groups["imu"] | {"frame": of_imu}
        yield variant


def _alternatives(by: TableMap) -> Iterator[tuple[str, str, TableMap]]:
    """(field, value, map) of all maps that differ from `by` in one frame, unit, order or direction."""
    data = by.model_dump(exclude_none=True)
    for name, group in (("time", by.time), *by.groups()):
        if name in ("motors", "battery", "throttle"):
            continue
        for field, info in type(group).model_fields.items():
            present = getattr(group, field)
            if field == "column" or not isinstance(present, str | bool):
                continue
            choices = [v for choice in get_args(info.annotation) for v in get_args(choice) or (choice,)]
            for other in (not present,) if isinstance(present, bool) else choices:
                if other == present or other is type(None):
                    continue
                try:
                    changed = TableMap.model_validate(data | {name: data[name] | {field: other}})
                except ValidationError:  # the order of a quaternion for a matrix, for example
                    continue
                yield f"{name}.{field}", str(other).lower() if isinstance(other, bool) else str(other), changed
