"""The errors of a vehicle's height sensors, as fitted: what a file of them holds, and how it is read and written."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import yaml
from pydantic import Field

from quadctl.effects.sensor_error import SensorError
from quadctl.effects.sensors import SENSOR_ERRORS
from quadctl.errors import SettingsError
from quadctl.files import write_text
from quadctl.settings import Settings, read_yaml, validate
from quadctl.words import nearest


@dataclass(frozen=True)
class FittedError:
    """An error with its parameters and their 95 % intervals."""

    error: SensorError
    ci95: dict[str, tuple[float, float]]
    missing: bool
    """True: these flights show it, and it matters; False: it was tried, and is not told from zero or is small."""


@dataclass(frozen=True)
class SensorModel:
    """Errors of the height sensors of one vehicle."""

    errors: tuple[FittedError, ...]
    logs: tuple[str, ...]
    scatter_m: float | None = None
    """Standard deviation of the barometer's samples about what its errors explain."""
    hover_throttle: float | None = None
    """Middle throttle of these flights, 0 to 1."""
    near_ground_s: tuple[float, ...] = ()
    """Time of each flight from its lift-off to the height at which the ground's error has faded, s."""

    def of(self, name: str) -> FittedError | None:
        """The error called `name`; None where it was not tried."""
        return next((one for one in self.errors if one.error.name == name), None)

    def beside(self, other: "SensorModel") -> "SensorModel":
        """The errors of both, of the same flights."""
        return replace(self, errors=(*self.errors, *other.errors))


class _Entry(Settings):
    error: str
    parameters: dict[str, Any] = Field(default_factory=dict)
    ci95: dict[str, tuple[float, float]] = Field(default_factory=dict)
    missing: bool = True


class _SensorFile(Settings):
    sensors: list[_Entry]
    logs: list[str] = Field(default_factory=list)
    scatter_m: float | None = Field(None, gt=0.0)
    hover_throttle: float | None = Field(None, gt=0.0, le=1.0)
    near_ground_s: list[float] = Field(default_factory=list)


def is_sensor_file(path: Path) -> bool:
    """Tell whether a YAML file holds errors of sensors, not a model of the motion.

    Raises
    ------
    SettingsError
        It cannot be read.
    """
    return "sensors" in read_yaml(path)


def load_sensors(path: Path) -> SensorModel:
    """Read a file that `save_sensors` wrote.

    Raises
    ------
    SettingsError
        One sentence that names file, field, value and what was expected.
    """
    file = validate(read_yaml(path), _SensorFile, str(path))
    errors = []
    for i, entry in enumerate(file.sensors, start=1):
        source = f"{path}: sensors[{i}]"
        if entry.error not in SENSOR_ERRORS:
            hint = nearest(entry.error, SENSOR_ERRORS) or f", expected one of: {', '.join(SENSOR_ERRORS)}"
            raise SettingsError(f"{source}: there is no sensor error '{entry.error}'{hint}")
        error = SENSOR_ERRORS[entry.error].from_values(entry.parameters, source)
        errors.append(FittedError(error, dict(entry.ci95), entry.missing))
    near_ground_s = tuple(file.near_ground_s)
    return SensorModel(tuple(errors), tuple(file.logs), file.scatter_m, file.hover_throttle, near_ground_s)


def sensors_to_dict(model: SensorModel) -> dict[str, Any]:
    """Content of the file of `model`."""
    entries = [
        {
            "error": one.error.name,
            "missing": one.missing,
            "parameters": one.error.values(),
            "ci95": {name: list(interval) for name, interval in one.ci95.items()},
        }
        for one in model.errors
    ]
    known = {"scatter_m": model.scatter_m, "hover_throttle": model.hover_throttle}
    known_s = {"near_ground_s": list(model.near_ground_s)} if model.near_ground_s else {}
    content = {"sensors": entries, "logs": list(model.logs)} | known_s
    return content | {name: value for name, value in known.items() if value is not None}


def save_sensors(model: SensorModel, path: Path) -> None:
    """Write `model` so that `load_sensors` gives it back.

    Raises
    ------
    SettingsError
        The file cannot be written.
    """
    write_text(path, yaml.safe_dump(sensors_to_dict(model), sort_keys=False), SettingsError)
