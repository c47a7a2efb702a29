"""A mission file: read, merged with the file that it extends, expanded, laid out in time, checked for its limits."""

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import Field

from quadctl.errors import SettingsError
from quadctl.missions.expansion import RawPhase, Value, check_size, expanded, known, names_in, put_in
from quadctl.missions.mission import QUANTITIES, Mission, MissionLimits, Phase, Turn
from quadctl.missions.profile import references
from quadctl.settings import Settings, read_value, read_yaml, validate
from quadctl.state import Vec3
from quadctl.surfaces import read_place
from quadctl.trajectories import Trajectory, find_trajectory

START_M: Vec3 = (0.0, 0.0, 0.0)
_NAME = re.compile(r"[\w.+-]+( [\w.+-]+)*")
"""Name of a phase or a mission: it goes into a CSV without quotes, and into the name of a file."""
MAX_NAME_LENGTH = 100


class _MissionFile(Settings):
    name: str | None = None
    description: str = ""
    parameters: dict[str, Value] = Field(default={})
    offset_up_m: float = 0.0
    repeat: int = Field(default=1, ge=1, le=1000)
    yaw_deg: float | None = None
    yaw_rate_deg_s: float = Field(default=45.0, gt=0.0, le=360.0)
    limits: MissionLimits
    surface: Any = None
    surfaces: Any = None
    edge_m: Any = None
    """Surfaces of the ground, as `read_place` takes them."""
    until: dict[str, Any] = Field(default={})
    phases: list[dict[str, Any]] = Field(min_length=1)


class _Leg(NamedTuple):
    """One phase before it is laid out in time."""

    name: str
    trajectory: Trajectory
    yaw_rad: float | None


class _Heading(Settings):
    yaw_deg: float | None = None


def load_mission(path: Path | str, offset_up_m: float | None = None, overrides: Sequence[str] = ()) -> Mission:
    """Read a mission file and lay it out.

    `extends: OTHER.yaml` takes everything from another file except the keys given here; `offset_up_m` lifts the whole
    mission (all heights, and the limit above them), so that the same flight is flown out of ground effect. Each of the
    `overrides`, NAME=VALUE, takes the place of one of the file's `parameters`.

    Raises
    ------
    SettingsError
        One sentence that names file, field, value and what was expected; also when the mission leaves its own limits.
    """
    path = Path(path)
    own = read_yaml(path)
    data = _with_base(path, own, depth=0)
    check_size(data, str(path))
    if offset_up_m is not None:
        data["offset_up_m"] = offset_up_m
    data["parameters"] = values = _parameters(data, own, overrides, path)
    phases = data.pop("phases", None)
    whole = put_in(data, values, str(path))
    entry = validate({**whole, **({} if phases is None else {"phases": phases})}, _MissionFile, str(path))
    if entry.name is not None:
        _check_name(entry.name, f"{path}: name")
    raw = expanded(entry.phases, entry.repeat, values, f"{path}: phases")
    laid, turns = _laid_out([_leg(phase, entry.offset_up_m) for phase in raw], entry)
    mission = Mission(
        name=entry.name or path.stem,
        description=entry.description,
        phases=laid,
        limits=entry.limits.model_copy(update={"max_z_m": entry.limits.max_z_m + entry.offset_up_m}),
        turns=turns,
        yaw_rate_rad_s=math.radians(entry.yaw_rate_deg_s),
        offset_up_m=entry.offset_up_m,
        parameters=values,
        place=read_place(whole, str(path)),
        until=_wanted(entry.until, path),
    )
    _check_limits(mission, path)
    return mission


_PERCENT = re.compile(r"(\d+(?:\.\d+)?) ?%")


def _wanted(until: dict[str, Any], path: Path) -> dict[str, float]:
    """Shares to which quantities are to be known, from `until: {drag: 10 %}`."""
    shares = {}
    for name, value in until.items():
        if name not in QUANTITIES:
            raise SettingsError(f"{path}: until.{name} is not known, expected one of {', '.join(QUANTITIES)}")
        found = _PERCENT.fullmatch(str(value))
        if found is None or not 0.0 < float(found[1]) <= 100.0:
            raise SettingsError(f"{path}: until.{name} is {value!r}, expected a share such as 10 %, up to 100 %")
        shares[name] = 0.01 * float(found[1])
    return shares


def mission_files(folder: Path) -> list[Path]:
    """The mission files of a folder by name; raises SettingsError when it has none."""
    paths = sorted(folder.glob("*.yaml"))
    if not paths:
        raise SettingsError(f"{folder}: holds no mission, expected a folder with mission files (.yaml)")
    return paths


def _with_base(path: Path, data: dict[str, Any], depth: int) -> dict[str, Any]:
    base = data.pop("extends", None)
    if base is None:
        return data
    if not isinstance(base, str) or depth > 8:
        raise SettingsError(f"{path}: extends is {base!r}, expected the name of a mission file that does not lead back")
    base_path = path.parent / base
    below = _with_base(base_path, read_yaml(base_path), depth + 1)
    both = {**below, "name": path.stem, **data}
    if isinstance(below.get("parameters"), dict) and isinstance(data.get("parameters"), dict):
        both["parameters"] = {**below["parameters"], **data["parameters"]}
    return both


def _parameters(
    data: dict[str, Any], own: dict[str, Any], overrides: Sequence[str], path: Path
) -> dict[str, float | str | list[Any]]:
    """The values of the mission's parameters, `own` being the file without what it extends.

    One that nothing refers to is a slip where the file declares it itself; where it extends the file that does, other
    phases may have come in its place.
    """
    declared = data.get("parameters", {})
    if not isinstance(declared, dict):
        raise SettingsError(f"{path}: parameters is {declared!r:.60}, expected names with their values")
    used = names_in({key: value for key, value in data.items() if key != "parameters"})
    idle = own.get("parameters", {}).keys() - used
    if idle:
        raise SettingsError(f"{path}: nothing refers to the parameter '{min(idle)}', expected ${min(idle)} somewhere")
    values = {name: value for name, value in declared.items() if name in used}
    for override in overrides:
        name, equals, text = override.partition("=")
        if not equals:
            raise SettingsError(f"--set is '{override}', expected NAME=VALUE")
        if name not in values:
            raise SettingsError(f"--set {override}: {path} has no parameter '{name}'{known(name, values)}")
        value = read_value(text, f"--set {name}")
        if _kind(value) != _kind(declared[name]):
            raise SettingsError(f"--set {name} is {text}, expected {_kind(declared[name])}, as {declared[name]} is")
        values[name] = value
    return values


def _kind(value: Any) -> str:
    if isinstance(value, int | float) and not isinstance(value, bool):
        return "a number"
    if isinstance(value, str):
        return "a text"
    return "a list" if isinstance(value, list) else "a number, a text or a list"


def _leg(raw: RawPhase, lift_m: float) -> _Leg:
    settings, source = dict(raw.keys), raw.source
    kind = settings.pop("kind", None)
    if not isinstance(kind, str):
        raise SettingsError(f"{source}.kind is {kind!r}, expected the name of a trajectory")
    trajectory_kind = find_trajectory(kind, source)
    name = _check_name(settings.pop("name", kind), f"{source}.name")
    yaw_deg = validate({"yaw_deg": settings.pop("yaw_deg", None)}, _Heading, source).yaw_deg
    trajectory = validate(settings, trajectory_kind, source).lifted(lift_m)
    return _Leg(name, trajectory, None if yaw_deg is None else math.radians(yaw_deg))


def _laid_out(legs: Sequence[_Leg], entry: _MissionFile) -> tuple[tuple[Phase, ...], tuple[Turn, ...]]:
    phases: list[Phase] = []
    turns = [] if entry.yaw_deg is None else [Turn(0.0, math.radians(entry.yaw_deg))]
    at, now = START_M, 0.0
    for name, trajectory, yaw_rad in legs:
        if yaw_rad is not None and (not turns or turns[-1].yaw_rad != yaw_rad):
            turns = [*(turn._replace(end_s=min(turn.end_s, now)) for turn in turns), Turn(now, yaw_rad)]
        phases.append(Phase(name, trajectory, now, now + trajectory.duration_s(at), at))
        at, now = trajectory.end_m(at), phases[-1].end_s
    return tuple(phases), tuple(turns)


def _check_name(name: Any, source: str) -> str:
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise SettingsError(f"{source} is {name!r}, expected words of letters, digits and . + - _")
    if len(name) > MAX_NAME_LENGTH:
        raise SettingsError(f"{source} has {len(name)} characters, expected at most {MAX_NAME_LENGTH}")
    return name


def _check_limits(mission: Mission, path: Path) -> None:
    limits = mission.limits
    lifted = f" (the mission is lifted by offset_up_m = {mission.offset_up_m:g})" if mission.offset_up_m else ""
    if mission.duration_s > limits.max_duration_s:
        raise SettingsError(
            f"{path}: the mission lasts {mission.duration_s:.0f} s, "
            f"expected at most limits.max_duration_s = {limits.max_duration_s:g}{lifted}"
        )
    for phase in mission.phases:
        where, along = f"{path}: phase '{phase.name}' goes to", references(phase)
        for reference in along:
            x, y, z = reference.position_m
            if z > limits.max_z_m + 1e-9:
                raise SettingsError(
                    f"{where} z = {z:.2f} m, expected at most limits.max_z_m = {limits.max_z_m:g}{lifted}"
                )
            rising = phase is mission.phases[0] and reference is not along[-1]  # from the ground
            if z < limits.min_z_m - 1e-9 and not rising:
                raise SettingsError(
                    f"{where} z = {z:.2f} m, expected at least limits.min_z_m = {limits.min_z_m:g}{lifted}"
                )
            if math.hypot(x, y) > limits.max_distance_m + 1e-9:
                raise SettingsError(
                    f"{where} {math.hypot(x, y):.2f} m from the take-off point, "
                    f"expected at most limits.max_distance_m = {limits.max_distance_m:g}"
                )
