"""Read flight logs of any supported format: the one entrance that the lab and the commands use."""

from collections.abc import Iterable
from pathlib import Path

from quadctl.errors import LogError
from quadctl.logs.csv_log import read_csv
from quadctl.logs.flight_log import FlightLog

_SUFFIXES = {".ulg": "a PX4 ULog", ".bin": "an ArduPilot DataFlash log", ".tlog": "a MAVLink telemetry log"}
_MAGIC = {b"ULog\x01\x12\x35": "a PX4 ULog", b"\xa3\x95": "an ArduPilot DataFlash log"}


def read_log(path: Path | str) -> FlightLog:
    """The flight log in `path`, its format told by content and extension.

    Raises
    ------
    LogError
        One sentence that says which file, where in it, what is wrong and what was expected.
    """
    path = Path(path)
    if path.is_file() and (kind := _foreign_kind(path)):
        raise LogError(f"{path}: is {kind}, a format that is not supported yet, expected a CSV log")
    return read_csv(path)


def read_logs(paths: Iterable[Path | str]) -> list[FlightLog]:
    """The logs of several flights, in the order given.

    Raises
    ------
    LogError
        One of them cannot be read, or is given twice: the same flight in training and test data proves nothing.
    """
    logs: list[FlightLog] = []
    seen: set[Path] = set()
    for path in map(Path, paths):
        if path.resolve() in seen:
            raise LogError(f"{path}: is given twice, expected each flight once")
        seen.add(path.resolve())
        logs.append(read_log(path))
    return logs


def _foreign_kind(path: Path) -> str | None:
    if path.suffix.lower() in _SUFFIXES:
        return _SUFFIXES[path.suffix.lower()]
    try:
        with path.open("rb") as file:
            head = file.read(8)
    except OSError:
        return None  # read_csv says why it cannot be opened
    return next((kind for magic, kind in _MAGIC.items() if head.startswith(magic)), None)
