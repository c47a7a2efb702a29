"""Read flight logs of any supported format: the one entrance that the lab and the commands use."""

import os
import stat
from collections.abc import Iterable
from pathlib import Path

from quadctl.errors import LogError
from quadctl.files import reading
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.formats import HEAD_BYTES, MAP_SUFFIX, MAPPED, TABLES, format_of, format_of_folder

_NO_LOGS = {
    b"\x1f\x8b": "is compressed by gzip, expected it unpacked",
    b"PK\x03\x04": "is a zip archive, expected the log in it, unpacked",
    b"\xff\xfe": "is text in UTF-16, expected UTF-8",
    b"\xfe\xff": "is text in UTF-16, expected UTF-8",
}
"""Beginnings of files that hold no log, or one in a wrapping; and the problem in words."""
_SETTINGS_SUFFIXES = (".yaml", ".yml")


def read_log(path: Path | str) -> FlightLog:
    """The flight log in `path`, in any of `quadctl.logs.formats.FORMATS`.

    The format is recognised by the content, and by the extension where the content is damaged; a table with a map
    beside it, its own or one for all tables of the folder, is read by that map.

    Raises
    ------
    LogError
        One sentence that says which file, where in it, what is wrong and what was expected.
    """
    path = Path(path)
    require_file(path)
    if (folder := format_of_folder(path)) is not None:
        return folder.read(path)
    form = format_of(_head(path), path.suffix)
    may_be_mapped = form.suffix in TABLES and next(path.parent.glob(f"*{MAP_SUFFIX}"), None) is not None
    return (MAPPED if may_be_mapped or path.with_suffix(MAP_SUFFIX).is_file() else form).read(path)


def read_imu_log(path: Path | str) -> FlightLog:
    """The flight log in `path` with all that an autopilot's own log tells of rotation: gyro and torque setpoint at
    their own times. In a ULog of PX4 position, velocity and attitude may be missing.

    Raises
    ------
    LogError
        As `read_log`; or it holds no body rates.
    """
    from quadctl.logs.dataflash import read_dataflash
    from quadctl.logs.dataflash_records import is_dataflash
    from quadctl.logs.ulog import is_ulog, read_ulog

    path = Path(path)
    require_file(path)
    head = _head(path) if path.is_file() else b""
    if is_ulog(head):
        return read_ulog(path, of_rotation=True)
    return read_dataflash(path, of_rotation=True) if is_dataflash(head) else read_log(path)


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


def require_file(path: Path) -> None:
    """Refuse what may never end, or can be read only once; the readers say what else is wrong with a path."""
    try:
        mode = path.stat().st_mode
    except OSError:
        return
    if not stat.S_ISREG(mode) and not stat.S_ISDIR(mode):
        raise LogError(f"{path}: is a device or a pipe, expected a file that holds a flight log")


def _head(path: Path) -> bytes:
    """The first bytes of a file that may hold a flight log."""
    if path.is_dir():
        raise LogError(f"{path}: is a directory, expected a flight log")
    with reading(path, LogError), path.open("rb") as file:
        head = file.read(HEAD_BYTES)
    if not head:
        raise LogError(f"{path}: is empty, expected a flight log")
    for start, problem in _NO_LOGS.items():
        if head.startswith(start):
            raise LogError(f"{path}: {problem}")
    if path.suffix.lower() in _SETTINGS_SUFFIXES:
        raise LogError(f"{path}: is named as settings in YAML, expected a flight log: MODEL comes first, then LOG")
    return head
