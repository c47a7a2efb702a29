"""A mission file to phases of trajectories with limits; the reference at any time is a pure function of the mission."""

import bisect
import math
import re
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import Field

from quadctl.errors import SettingsError
from quadctl.settings import Settings, read_yaml, validate
from quadctl.state import Vec3
from quadctl.trajectories import Reference, Trajectory, find_trajectory

START_M: Vec3 = (0.0, 0.0, 0.0)
CHECK_STEP_S = 0.05
_NAME = re.compile(r"[\w.+-]+( [\w.+-]+)*")
"""Of a phase or a mission: it goes into a CSV without quotes, and into the name of a file."""
MAX_NAME_LENGTH = 100


class MissionLimits(Settings):
    """The mission's reference must stay inside these; a flight that leaves them by more than `margin_m` lands."""

    min_z_m: float = Field(default=0.05, ge=0.0)
    max_z_m: float = Field(gt=0.0)
    max_distance_m: float = Field(default=5.0, gt=0.0)
    """Horizontal, from the take-off point."""
    max_duration_s: float = Field(default=900.0, gt=0.0, le=36000.0)
    margin_m: float = Field(default=0.5, gt=0.0)


class Phase(NamedTuple):
    """One leg of a mission, laid out in time."""

    name: str
    trajectory: Trajectory
    start_s: float
    end_s: float
    start_m: Vec3


class Mission(NamedTuple):
    """Phases in time, from lift-off to the beginning of the landing."""

    name: str
    description: str
    phases: tuple[Phase, ...]
    limits: MissionLimits
    yaw_rad: float | None
    """None: the heading at take-off is kept."""
    offset_up_m: float

    @property
    def duration_s(self) -> float:
        return self.phases[-1].end_s

    def phase_at(self, t_s: float) -> Phase:
        """The phase at `t_s` since lift-off; the last one after the end."""
        index = bisect.bisect_right(self.phases, t_s, key=lambda phase: phase.end_s)
        return self.phases[min(index, len(self.phases) - 1)]

    def reference(self, t_s: float) -> Reference:
        phase = self.phase_at(t_s)
        return phase.trajectory.reference(t_s - phase.start_s, phase.start_m)


class _MissionFile(Settings):
    name: str | None = None
    description: str = ""
    extends: str | None = None
    offset_up_m: float = 0.0
    repeat: int = Field(default=1, ge=1, le=1000)
    yaw_deg: float | None = None
    limits: MissionLimits
    phases: list[dict[str, Any]] = Field(min_length=1)


def load_mission(path: Path | str, offset_up_m: float | None = None) -> Mission:
    """Read a mission file and lay it out.

    `extends: OTHER.yaml` takes everything from another file except the keys given here; `offset_up_m` lifts the whole
    mission (all heights, and the limit above them), so that the same flight is flown out of ground effect.

    Raises
    ------
    SettingsError
        One sentence that names file, field, value and what was expected; also when the mission leaves its own limits.
    """
    path = Path(path)
    data = _with_base(path, read_yaml(path), depth=0)
    if offset_up_m is not None:
        data["offset_up_m"] = offset_up_m
    entry = validate(data, _MissionFile, str(path))
    if entry.name is not None:
        _check_name(entry.name, f"{path}: name")
    trajectories = [_phase_trajectory(raw, i, path) for i, raw in enumerate(entry.phases)]
    lift = entry.offset_up_m
    phases: list[Phase] = []
    at, now = START_M, 0.0
    for _ in range(entry.repeat):
        for name, trajectory in trajectories:
            lifted = trajectory.lifted(lift)
            duration = lifted.duration_s(at)
            phases.append(Phase(name, lifted, now, now + duration, at))
            at, now = lifted.end_m(at), now + duration
    limits = entry.limits.model_copy(update={"max_z_m": entry.limits.max_z_m + lift})
    yaw = None if entry.yaw_deg is None else math.radians(entry.yaw_deg)
    mission = Mission(entry.name or path.stem, entry.description, tuple(phases), limits, yaw, lift)
    _check_limits(mission, path)
    return mission


def _with_base(path: Path, data: dict[str, Any], depth: int) -> dict[str, Any]:
    base = data.pop("extends", None)
    if base is None:
        return data
    if not isinstance(base, str) or depth > 8:
        raise SettingsError(f"{path}: extends is {base!r}, expected the name of a mission file that does not lead back")
    base_path = path.parent / base
    return {**_with_base(base_path, read_yaml(base_path), depth + 1), **{"name": path.stem, **data}}


def _phase_trajectory(raw: dict[str, Any], index: int, path: Path) -> tuple[str, Trajectory]:
    source = f"{path}: phases[{index + 1}]"
    settings = dict(raw)
    kind = settings.pop("kind", None)
    if not isinstance(kind, str):
        raise SettingsError(f"{source}.kind is {kind!r}, expected the name of a trajectory")
    trajectory = find_trajectory(kind, source)
    name = _check_name(settings.pop("name", kind), f"{source}.name")
    return name, validate(settings, trajectory, source)


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
        steps = max(1, math.ceil((phase.end_s - phase.start_s) / CHECK_STEP_S))
        for i in range(steps + 1):
            t = phase.start_s + (phase.end_s - phase.start_s) * i / steps
            x, y, z = phase.trajectory.reference(t - phase.start_s, phase.start_m).position_m
            where = f"{path}: phase '{phase.name}' goes to"
            if z > limits.max_z_m + 1e-9:
                raise SettingsError(
                    f"{where} z = {z:.2f} m, expected at most limits.max_z_m = {limits.max_z_m:g}{lifted}"
                )
            rising = phase is mission.phases[0] and i < steps  # from the ground
            if z < limits.min_z_m - 1e-9 and not rising:
                raise SettingsError(
                    f"{where} z = {z:.2f} m, expected at least limits.min_z_m = {limits.min_z_m:g}{lifted}"
                )
            if math.hypot(x, y) > limits.max_distance_m + 1e-9:
                raise SettingsError(
                    f"{where} {math.hypot(x, y):.2f} m from the take-off point, "
                    f"expected at most limits.max_distance_m = {limits.max_distance_m:g}"
                )
