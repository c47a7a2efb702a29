"""A proposal of a map for a table: quantities by the names of columns, frames by what the values say of each other."""

import itertools
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import polars as pl
import yaml

from quadctl.errors import LogError, QuadctlError
from quadctl.logs.contradictions import contradictions
from quadctl.logs.table_map import TableMap, mapped, read_table

STEMS: dict[str, tuple[str, ...]] = {
    "position": ("position", "pos", "translation", "loc", "p", ""),
    "velocity": ("linear_velocity", "velocity", "vel", "v"),
    "rates": ("angular_velocity", "ang_vel", "angvel", "omega", "gyro", "rates", "rate", "w"),
    "accelerometer": ("accelerometer", "linear_acceleration", "acceleration", "accel", "acc", "imu", "a"),
    "attitude": ("orientation", "quaternion", "quat", "attitude", "att", "rot", "q"),
}
"""Words by which columns of a vector are known, the surest first; "" stands for a component alone."""
COMPONENTS: dict[str, tuple[tuple[str, ...], ...]] = {
    "attitude": (("w", "x", "y", "z"), ("0", "1", "2", "3")),
    "vector": (("x", "y", "z"), ("0", "1", "2")),
}
ANGLES = (("roll", "pitch", "yaw"), ("phi", "theta", "psi"))
RATES_ALONE = (("p", "q", "r"), ("rollspeed", "pitchspeed", "yawspeed"), ("roll_rate", "pitch_rate", "yaw_rate"))
CLOCKS = ("time", "timestamp", "t", "stamp", "time_s", "t_s", "time_us", "timestamp_us", "time_boot_us")
UNITS = {
    "mm": "mm", "cm": "cm", "ft": "ft", "mm_s": "mm/s", "cm_s": "cm/s", "km_h": "km/h", "deg": "deg", "deg_s": "deg/s",
    "dps": "deg/s", "g": "g",
}  # fmt: skip
"""Ends of column names that name a unit other than the usual one."""
MOTOR = re.compile(r"(.*?)(?:motor|mot|rpm|esc|rotor)[._ \[]*(\d+)\]?(?:[._ ]*(rpm|speed|output))?$", re.IGNORECASE)


class Guess(NamedTuple):
    """A proposed map."""

    map: TableMap
    text: str
    """The same as YAML."""
    doubts: list[str]
    """Contradictions that remain, and what the data cannot tell."""


def guess_map(path: Path, separator: str = ",") -> Guess:
    """Propose a map for the table in `path`.

    Frames and orders are tried in all combinations; one is proposed with which the values contradict each other least.

    Raises
    ------
    LogError
        It is no table, or no columns are found for time, position or attitude.
    """
    table = read_table(path, separator)
    found = _by_names(path, table)
    best: tuple[int, dict[str, Any], list[str]] | None = None
    fitting = []
    for variant in _variants(table, found):
        data = variant if separator == "," else {"separator": separator, **variant}
        try:
            doubts = contradictions(mapped(path, table, TableMap.model_validate(data), "the proposed map"))
        except QuadctlError as error:
            doubts = [str(error)]
        if best is None or len(doubts) < best[0]:
            best = len(doubts), data, doubts
        if not doubts:
            fitting.append(data)
    assert best is not None
    _, data, doubts = best
    also = sorted({_frames(other) for other in fitting} - {_frames(data)})
    if also:
        doubts = [*doubts, f"the values agree with {_frames(data)}, and as well with {', or '.join(also[:3])}"]
    return Guess(TableMap.model_validate(data), yaml.safe_dump(data, sort_keys=False, default_flow_style=None), doubts)


def _by_names(path: Path, table: pl.DataFrame) -> dict[str, Any]:
    names = table.columns
    clock = next((name for want in CLOCKS for name in names if name.lower().rsplit("/", 1)[-1] == want), None)
    if clock is None:
        raise LogError(f"{path}: no column is called like a time ({', '.join(names[:8])}, ...), expected one")
    found: dict[str, Any] = {"time": {"column": clock, "unit": _clock_unit(table[clock], clock)}}
    for key in ("position", "velocity"):
        if group := _vector(names, key):
            found[key] = {"columns": group, **_unit(group, "m" if key == "position" else "m/s")}
    found |= _attitude(names)
    group = _vector(names, "rates") or _alone(names, RATES_ALONE)
    if group:
        found["rates"] = {"columns": group, **_unit(group, "rad/s")}
    if group := _vector(names, "accelerometer"):
        found["accelerometer"] = {"columns": group, **_unit(group, "m/s2")}
    if motors := _motors(table):
        found["motors"] = motors
    for key in ("position", "attitude"):
        if key not in found:
            raise LogError(f"{path}: no columns are called like a{'n' * (key[0] == 'a')} {key}, expected a map by hand")
    return found


def _vector(names: Sequence[str], key: str, kind: str = "vector") -> list[str] | None:
    """Columns of one vector: the same words around each of its components."""
    for stem, components in itertools.product(STEMS[key], COMPONENTS[kind]):
        pattern = re.compile(rf"(.*[./_ ]|){stem}[._ \[]*({'|'.join(components)})\]?([_ \[(].*|)", re.IGNORECASE)
        groups: dict[tuple[str, str], dict[str, str]] = {}
        for name in names:
            if match := pattern.fullmatch(name):
                lead, component, tail = match[1].lower(), match[2].lower(), match[3].lower()
                if not stem and (lead or _is_other(tail)):
                    continue
                groups.setdefault((lead, tail), {}).setdefault(component, name)
        for group in groups.values():
            if len(group) == len(components):
                return [group[component] for component in components]
    return None


def _is_other(tail: str) -> bool:
    """True for a word after a bare component that makes it another quantity: x_ref, z_sp."""
    return tail.strip("_ []()") not in ("", "m", *UNITS)


def _alone(names: Sequence[str], groups: Sequence[tuple[str, ...]]) -> list[str] | None:
    lower = {re.sub(r"[_ \[(]*(rad_s|rad|deg_s|deg|dps)[\])]*$", "", name.lower()): name for name in names}
    for group in groups:
        if all(part in lower for part in group):
            return [lower[part] for part in group]
    return None


def _attitude(names: Sequence[str]) -> dict[str, Any]:
    if group := _vector(names, "attitude", "attitude"):
        named = group[0].lower().rstrip("]").endswith("w")
        return {"attitude": {"columns": group, "order": "wxyz" if named else ""}}
    if group := _alone(names, ANGLES):
        return {"attitude": {"columns": group, "order": "roll pitch yaw", **_unit(group, "rad")}}
    return {}


def _unit(group: Sequence[str], usual: str) -> dict[str, str]:
    ends = [name.lower().rstrip("])").replace("[", "_").replace("(", "_").replace("/", "_") for name in group]
    for end in sorted(UNITS, key=len, reverse=True):
        if all(name.endswith(f"_{end}") or name.endswith(f" {end}") for name in ends):
            return {"unit": UNITS[end]}
    return {"unit": usual}


def _clock_unit(values: pl.Series, name: str) -> str:
    for unit in ("us", "ns", "ms"):
        if name.lower().endswith(f"_{unit}"):
            return unit
    steps = np.diff(values.cast(pl.Float64, strict=False).drop_nulls().to_numpy())
    step = float(np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else 1.0
    # Logs have 5 to 2000 rows a second.
    return next((unit for unit, most in (("s", 0.5), ("ms", 400.0), ("us", 4e5)) if step < most), "ns")


def _motors(table: pl.DataFrame) -> dict[str, Any] | None:
    groups: dict[tuple[str, str], dict[int, str]] = {}
    for name in table.columns:
        if match := MOTOR.fullmatch(name):
            groups.setdefault((match[1].lower(), (match[3] or "").lower()), {})[int(match[2])] = name
    for group in groups.values():
        if len(group) in (4, 6, 8):
            names = [group[number] for number in sorted(group)]
            largest = float(table.select(pl.col(names).cast(pl.Float64, strict=False).max()).to_numpy().max())
            limits = (("share", 1.5), ("percent", 100.0), ("us", 2200.0))
            by_size = next((unit for unit, most in limits if largest <= most), "rpm")
            # Rotors turn at 300 to 3000 rad/s: below 2200 only a name or a least value near 1000 tells a pulse.
            if by_size == "us" and not any("out" in n.lower() or "pwm" in n.lower() for n in names):
                by_size = "rad/s"
            return {"columns": names, "unit": by_size}
    return None


def _variants(table: pl.DataFrame, found: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Maps with all combinations of frames and orders, the likeliest first.

    A frame that is turned about the vertical, such as NWU beside ENU, gives a flight that is turned as a whole: values
    cannot contradict it, so it is not tried.
    """
    heights = table[found["position"]["columns"][2]].cast(pl.Float64, strict=False).drop_nulls().to_numpy()
    rises = len(heights) == 0 or float(np.median(heights)) >= float(heights[0])
    worlds = ("ENU", "NED") if rises else ("NED", "ENU")
    bodies: tuple[str, ...] = ("FRD", "FLU") if worlds[0] == "NED" else ("FLU", "FRD")
    if "accelerometer" in found:
        reading = table[found["accelerometer"]["columns"][2]].cast(pl.Float64, strict=False).drop_nulls().to_numpy()
        bodies = ("FLU",) if float(np.median(reading)) > 0.0 else ("FRD",)  # what carries the vehicle points up
    order = found["attitude"]["order"]
    orders = (order,) if order else ("wxyz", "xyzw")
    for world, body, chosen in itertools.product(worlds, bodies, orders):
        data = {key: dict(value) for key, value in found.items()}
        data["position"]["frame"] = world
        if "velocity" in data:
            data["velocity"]["frame"] = world
        data["attitude"] |= {"order": chosen, "world": world, "body": body}
        for key in ("rates", "accelerometer"):
            if key in data:
                data[key]["frame"] = body
        yield data


def _frames(data: Mapping[str, Any]) -> str:
    attitude = data["attitude"]
    return f"{attitude['world']}, {attitude['body']}, {attitude['order']}"
