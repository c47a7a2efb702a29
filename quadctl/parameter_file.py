"""Parameter files of autopilots: QGroundControl's .params, Mission Planner's and MAVProxy's .param and .parm."""

import math
import re
from pathlib import Path

from quadctl.errors import SettingsError

MAX_BYTES = 1_000_000
_QGROUNDCONTROL = re.compile(r"\d+\s+\d+\s+(?P<name>[A-Z]\w*)\s+(?P<value>\S+)\s+\d+")
"""Vehicle id, component id, name, value, type."""
_PLAIN = re.compile(r"(?P<name>[A-Z]\w*)[\s,=]+(?P<value>[^\s,#]+)")


def read_parameters(path: Path) -> dict[str, float]:
    """Values by name.

    Raises
    ------
    SettingsError
        The file cannot be read, a line is no parameter, or a value is not a finite number.
    """
    try:
        if path.stat().st_size > MAX_BYTES:
            raise SettingsError(f"{path}: is larger than {MAX_BYTES / 1e6:g} MB, expected a parameter file")
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise SettingsError(f"{path}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError:
        raise SettingsError(f"{path}: is no text, expected an autopilot's parameter file") from None
    values: dict[str, float] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        entry = line.partition("#")[0].strip()
        if entry:
            name, value = _parameter(entry, f"{path}: line {number}")
            values[name] = value
    if not values:
        raise SettingsError(f"{path}: holds no parameters, expected lines such as MOT_THST_HOVER,0.35")
    return values


def _parameter(line: str, where: str) -> tuple[str, float]:
    found = _QGROUNDCONTROL.fullmatch(line) or _PLAIN.match(line)
    if found is None:
        raise SettingsError(f"{where} is '{line[:60]}', expected a parameter's name and value")
    name = found["name"]
    try:
        value = float(found["value"])
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise SettingsError(f"{where}: {name} is {found['value'][:40]}, expected a number")
    return name, value
