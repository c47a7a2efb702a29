"""Read flight logs of any supported format: the one entrance that the lab and the commands use."""

import os
import stat
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TypeAlias

from quadctl.errors import LogError
from quadctl.logs.csv_log import read_csv
from quadctl.logs.flight_log import FlightLog

_ULOG, _DATAFLASH = b"ULog\x01\x12\x35", b"\xa3\x95"
_NO_LOGS = {
    b"\x1f\x8b": "is compressed by gzip, expected it unpacked",
    b"PK\x03\x04": "is a zip archive, expected the log in it, unpacked",
    b"\xff\xfe": "is text in UTF-16, expected UTF-8",
    b"\xfe\xff": "is text in UTF-16, expected UTF-8",
}
"""How files begin that hold a log in a wrapping, or may."""
_SETTINGS_SUFFIXES = (".yaml", ".yml")
_Reader: TypeAlias = Callable[[Path], FlightLog]


def read_log(path: Path | str) -> FlightLog:
    """The flight log in `path`: CSV, PX4 ULog, ArduPilot DataFlash or MAVLink telemetry log.

    The format is told by the content, and by the extension where the content is damaged.

    Raises
    ------
    LogError
        One sentence that says which file, where in it, what is wrong and what was expected.
    """
    path = Path(path)
    _require_file(path)
    return _reader(path)(path)


def read_logs(paths: Iterable[Path | str]) -> list[FlightLog]:
    """The logs of several flights, in the order given.

    Raises
    ------
    LogError
        One of them cannot be read, or is given twice: the same flight in training and test data proves nothing.
    """
    logs: list[FlightLog] = []
    seen: set[str] = set()
    for path in map(Path, paths):
        place = os.path.realpath(path)  # not Path.resolve(), which fails where symbolic links lead in a circle
        if place in seen:
            raise LogError(f"{path}: is given twice, expected each flight once")
        seen.add(place)
        logs.append(read_log(path))
    return logs


def _require_file(path: Path) -> None:
    """Refuse what may never end, or can be read only once; the readers say what else is wrong with a path."""
    try:
        mode = path.stat().st_mode
    except OSError:
        return
    if not stat.S_ISREG(mode) and not stat.S_ISDIR(mode):
        raise LogError(f"{path}: is a device or a pipe, expected a file that holds a flight log")


def _reader(path: Path) -> _Reader:
    from quadctl.logs import dataflash, tlog, ulog  # they load their libraries when they read

    try:
        with path.open("rb") as file:
            head = file.read(16)
    except IsADirectoryError:
        raise LogError(f"{path}: is a directory, expected a flight log") from None
    except OSError:
        return read_csv  # which says why it cannot be opened
    suffix = path.suffix.lower()
    if not head:
        raise LogError(f"{path}: is empty, expected a flight log")
    for start, what in _NO_LOGS.items():
        if head.startswith(start):
            raise LogError(f"{path}: {what}")
    if suffix in _SETTINGS_SUFFIXES:
        raise LogError(f"{path}: is named as settings in YAML, expected a flight log: MODEL comes first, then LOG")
    if head.startswith(_ULOG):
        return ulog.read_ulog
    if head.startswith(_DATAFLASH):
        return dataflash.read_dataflash
    if suffix == ".tlog" or tlog.is_tlog(head):
        return tlog.read_tlog
    if suffix == ".ulg":
        raise LogError(f"{path}: does not begin as a PX4 ULog does, expected a .ulg file of PX4")
    return dataflash.read_dataflash if suffix == ".bin" else read_csv
