"""Parameters of an autopilot, from a parameter file or from a log, which holds those that it was flown with."""

from contextlib import suppress
from pathlib import Path
from pkgutil import resolve_name

from quadctl.errors import SettingsError
from quadctl.files import reading
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.formats import FORMATS, HEAD_BYTES, format_of_folder
from quadctl.parameter_file import read_parameters


def read_present_parameters(path: Path) -> dict[str, float]:
    """Values by name; of a log, in any format that holds them, the last ones.

    Raises
    ------
    SettingsError
        The file cannot be read, is neither a log nor a parameter file, or holds no parameters.
    LogError
        The log cannot be parsed.
    """
    form = format_of_folder(path)
    if form is None:
        with reading(path, SettingsError), path.open("rb") as file:
            head = file.read(HEAD_BYTES)
        form = next((each for each in FORMATS if each.parameters is not None and each.recognises(head)), None)
    if form is None or form.parameters is None:
        return read_parameters(path)
    values: dict[str, float] = resolve_name(form.parameters)(path)
    if not values:
        raise SettingsError(f"{path}: is a log without parameters, expected an autopilot's parameters")
    return values


def parameters_of(log: FlightLog) -> dict[str, float]:
    """Values by name that a log holds, itself or in its sidecar; empty where it holds none."""
    said = log.meta.get("autopilot_parameters")
    if isinstance(said, dict):
        return {str(name): float(value) for name, value in said.items() if isinstance(value, int | float)}
    if log.path is None or log.path.suffix.lower() == ".csv":
        return {}
    with suppress(SettingsError):  # of another program, which logs none
        return read_present_parameters(log.path)
    return {}
