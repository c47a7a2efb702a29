"""A map proposed from the names and the values of a table's columns, and the reading that would suit a map better.

Names say which columns are which; frames, and the direction of the quaternion, are those in which the channels agree.
"""

import itertools
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import numpy as np
import polars as pl
import yaml
from pydantic import ValidationError

from quadctl.errors import LogError, QuadctlError
from quadctl.logs.consistency import complaints, misfit
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.table import mapped, read_table
from quadctl.logs.table_map import TableMap, load_map

MIN_GAIN = 0.6
"""Another reading is named where its disagreement is less than this share of the present one."""
MIN_MISFIT = 0.5
"""Sum of disagreements below which no other reading is looked for."""
WORDS = (
    ("rates", r"gyro|ang(ular)?_?(vel|rate)|omega|body_?rate|twist_angular|rates?\b|^w_|_rate_"),
    ("imu", r"(?<!ang_)(?<!angular_)acc|imu|specific_force"),
    ("velocity", r"vel|speed|twist_linear|^v_"),
    ("position", r"pos|^p_|loc|^_$"),
)
"""Words by which a triple x, y, z is recognised; the first that fits."""
_AXIS = re.compile(r"^(?P<stem>.*?)(?P<axis>[xyzw])(?P<rest>(_(m|s|rad|deg|1|2|n|ms|m_s|rad_s|m_s2|m_s_1|m_s_2))*)$")
_MOTOR = re.compile(r"^(?!d)(?:.*_)?(?:mot|motor|rotor|rpm|esc|thrust_?rotor|u)[a-z_]*?(\d+)(?:_.*)?$")


def proposed(path: Path) -> tuple[TableMap, FlightLog]:
    """A map of the table at `path`, and the log that it makes of it.

    Raises
    ------
    LogError
        The names do not tell time, position, velocity and attitude.
    """
    table = read_table(path)
    groups = _by_name(path, table)
    best: tuple[float, TableMap, FlightLog] | None = None
    problem: QuadctlError | None = None
    for variant in _variants(groups):
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
    return best[1], best[2]


def better_reading(path: Path, map_path: Path, log: FlightLog) -> str | None:
    """A sentence that names the one field of the map whose other value makes the channels agree, if there is one."""
    by, table = load_map(map_path), read_table(path)
    present = misfit(log)
    if present < MIN_MISFIT and not complaints(log):
        return None
    found: list[tuple[float, str]] = []
    for field, value, other in _alternatives(by):
        try:
            score = misfit(mapped(table, other, path, []))
        except QuadctlError:
            continue
        found.append((score, f"{field}: {value}"))
    if not found or min(found)[0] > MIN_GAIN * present:
        return None
    return f"the channels agree with `{min(found)[1]}` in the map"


def as_yaml(by: TableMap, note: str) -> str:
    """The map as a file."""
    data = by.model_dump(exclude_none=True, exclude_defaults=True, mode="json")
    return f"# {note}\n" + yaml.dump(data, sort_keys=False, default_flow_style=None, width=118, allow_unicode=True)


# --- names ------------------------------------------------------------------------------------------------------------


def _by_name(path: Path, table: pl.DataFrame) -> dict[str, Any]:
    """The map without frames."""
    plain = {name: re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_") for name in table.columns}
    numeric = {name: text for name, text in plain.items() if table[name].dtype.is_numeric()}
    groups: dict[str, Any] = {"time": _clock(path, table, numeric)}
    triples: dict[tuple[str, str], dict[str, str]] = {}
    for name, text in numeric.items():
        if axis := _AXIS.match(text):
            triples.setdefault((axis["stem"], axis["rest"]), {})[axis["axis"]] = name
    for (stem, _), axes in triples.items():
        if {"x", "y", "z", "w"} <= axes.keys() and "attitude" not in groups:
            groups["attitude"] = {"columns": [axes[a] for a in "wxyz"], "order": "wxyz"}
            continue
        kind = next((kind for kind, words in WORDS if re.search(words, f"{stem}")), None)
        kind = {"": "position", "v": "velocity", "w": "rates", "a": "imu", "p": "position"}.get(stem.strip("_"), kind)
        if kind and {"x", "y", "z"} <= axes.keys() and kind not in groups:
            groups[kind] = {"columns": [axes[a] for a in "xyz"]}
    _angles(table, numeric, groups)
    if motors := {int(found[1]): name for name, text in numeric.items() if (found := _MOTOR.match(text))}:
        names = [motors[number] for number in sorted(motors)]
        top = float(max(np.nanmax(table[name].to_numpy()) for name in names))
        groups["motors"] = {"columns": names, "unit": "share" if top <= 1.5 else "rad/s" if top < 2500 else "rpm"}
    volts = [name for name, text in numeric.items() if re.search(r"bat|volt", text) and "motor" not in text]
    if volts:
        high = float(np.nanmedian(table[volts[0]].to_numpy())) > 1000.0
        groups["battery"] = {"column": volts[0], "unit": "mV" if high else "V"}
    missing = [name for name in ("position", "velocity", "attitude") if name not in groups]
    if missing:
        raise LogError(
            f"{path}: the names of its columns do not tell {', '.join(missing)}, expected names such as pos_x, vel_x "
            f"and q_w; it has {', '.join(table.columns[:12])}"
        )
    return groups


def _angles(table: pl.DataFrame, plain: dict[str, str], groups: dict[str, Any]) -> None:
    """Roll, pitch and yaw, and their rates, where these are the names."""
    for kind, pattern in (
        ("attitude", r"^(?!.*(rate|vel|cmd|ref|set)).*{}"),
        ("rates", r"^(?!.*(cmd|ref|set)).*{}.*rate"),
    ):
        names = [
            next((name for name, text in plain.items() if re.match(pattern.format(angle), text)), None)
            for angle in ("roll", "pitch", "yaw")
        ]
        if kind in groups or None in names:
            continue
        values = np.concatenate([table[str(name)].drop_nulls().to_numpy() for name in names])
        in_degrees = float(np.nanmax(np.abs(values))) > (3.5 if kind == "attitude" else 25.0)
        unit = "deg" if in_degrees or any("deg" in str(name) for name in names) else "rad"
        groups[kind] = {"columns": names, "unit": unit if kind == "attitude" else f"{unit}/s"}


def _clock(path: Path, table: pl.DataFrame, plain: dict[str, str]) -> dict[str, str]:
    for name, text in plain.items():
        if re.match(r"^(t|time|timestamp|stamp|secs?)(_|$)|.*(_time|_stamp|timestamp)", text):
            steps = np.diff(table[name].drop_nulls().to_numpy().astype(np.float64))
            steps = steps[steps > 0.0]
            step = float(np.median(steps)) if len(steps) else 0.0
            unit = next(unit for unit, least in (("ns", 3e5), ("us", 3e2), ("ms", 0.8), ("s", 0.0)) if step >= least)
            return {"column": name, "unit": unit}
    raise LogError(f"{path}: the names of its columns do not tell the time, expected one such as time or timestamp")


def _variants(groups: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The map in all frames that are tried; the usual ones first."""
    inverse = (False, True) if "order" in groups["attitude"] else (False,)
    worlds = (("NED", "NED"), ("ENU", "ENU"), ("NEU", "NED"))  # of the vectors, and of the attitude
    for (world, of_attitude), body, moving, turned, of_imu in itertools.product(
        worlds, ("FRD", "FLU"), (True, False), inverse, ("FRD", "FLU") if "imu" in groups else ("",)
    ):
        variant = {
            **groups,
            "position": groups["position"] | {"frame": world},
            "velocity": groups["velocity"] | {"frame": world if moving else body},
            "attitude": groups["attitude"] | {"body": body, "world": of_attitude, "inverse": turned},
        }
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
