"""Parameters of an autopilot, from a parameter file or from a log, which holds those that it was flown with."""

from contextlib import suppress
from pathlib import Path

from quadctl.errors import SettingsError
from quadctl.logs.dataflash import parameters_in_dataflash, texts_in_dataflash
from quadctl.logs.dataflash_records import is_dataflash
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.flight_review import parameters_in_flight_review
from quadctl.logs.formats import HEAD_BYTES
from quadctl.logs.frame import with_frame
from quadctl.logs.ulog import is_ulog, parameters_in_ulog
from quadctl.parameter_file import read_parameters


def read_present_parameters(path: Path) -> dict[str, float]:
    """Values by name; of a PX4 ULog, a folder of Flight Review or an ArduPilot DataFlash log the last ones.

    The frame that an older ArduPilot tells in its messages is among them, as FRAME_CLASS and FRAME_TYPE.

    Raises
    ------
    SettingsError
        The file cannot be read, is neither a log nor a parameter file, or holds no parameters.
    LogError
        The log cannot be parsed.
    """
    if path.is_dir() and (values := parameters_in_flight_review(path)):
        return values
    try:
        with path.open("rb") as file:
            head = file.read(HEAD_BYTES)
    except OSError as error:
        raise SettingsError(f"{path}: cannot be read ({error.strerror})") from None
    if not (is_ulog(head) or is_dataflash(head)):
        return read_parameters(path)
    values = parameters_in_ulog(path) if is_ulog(head) else parameters_in_dataflash(path)
    if not values:
        raise SettingsError(f"{path}: is a log without parameters, expected an autopilot's parameters")
    return values if is_ulog(head) else with_frame(values, texts_in_dataflash(path))


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
