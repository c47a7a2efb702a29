"""Reading of logs, apart from all that analyses them: it begins before the libraries of the lab are loaded."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from quadctl.errors import QuadctlError
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.quality import QualityReport
from quadctl.logs.read import read_log
from quadctl.vehicle import Vehicle
from quadctl.web.work.worker import Progress
from quadctl.words import Fact

if TYPE_CHECKING:
    from quadctl.lab.flights.flight import Flight


@dataclass(frozen=True, eq=False)
class OpenedLog:
    """One file that was opened, with what is in it; `problem` says why it cannot be analysed."""

    path: Path
    log: FlightLog | None = None
    quality: QualityReport | None = None
    problem: str = ""
    flight: Flight | None = None
    """The flight in it, prepared by itself; None where it cannot be analysed."""
    vehicle: Vehicle | None = None
    """Vehicle that it was prepared for."""
    stamp: tuple[int, int] | None = None
    """Time of its last change, ns, and size, bytes, as it was read."""
    doubt: Fact | None = None
    """Reason to ask a person before it is used; None where there is none, or it was answered."""


def read_logs(paths: Sequence[Path], known: Sequence[OpenedLog], progress: Progress) -> list[OpenedLog]:
    """The logs as they are logged, in the order of `paths`, or the problem why one cannot be read; those of `known`
    that have not changed since are not read again."""
    before = {log.path: log for log in known}
    read = []
    for path, name in zip(paths, log_names(paths), strict=True):
        there, stamp = before.get(path), stamp_of(path)
        if there is not None and there.log is not None and there.stamp == stamp is not None:
            renamed = OpenedLog(path, replace(there.log, name=name), stamp=stamp)
            read.append(there if there.log.name == name else renamed)
            continue
        progress(f"reading {name}")
        try:
            read.append(OpenedLog(path, replace(read_log(path), name=name), stamp=stamp))
        except QuadctlError as error:
            read.append(OpenedLog(path, problem=without_folder(str(error), path), stamp=stamp))
    return read


def log_names(paths: Sequence[Path]) -> list[str]:
    """The names of the files; where several are called the same, with the folder that each is in."""
    same = Counter(path.name for path in paths)
    folders = Counter((path.name, path.parent.name) for path in paths)

    def folder(path: Path) -> str:
        return path.parent.name if folders[path.name, path.parent.name] == 1 else str(path.parent)

    return [path.name if same[path.name] == 1 else f"{path.name} ({folder(path)})" for path in paths]


def without_folder(sentence: str, path: Path) -> str:
    """The sentence with the name of a file that was given to the page, which knows no folder of it."""
    return sentence.replace(str(path), path.name)


def stamp_of(path: Path) -> tuple[int, int] | None:
    """Time of the last change and size of a file; None where it cannot be asked for them."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size
