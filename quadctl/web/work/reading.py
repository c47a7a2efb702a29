"""Reading of logs, apart from all that analyses them: it begins before the libraries of the lab are loaded."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from quadctl.errors import QuadctlError
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.quality import QualityReport
from quadctl.logs.read import read_log
from quadctl.vehicle import Vehicle
from quadctl.web.work.worker import Progress

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
    doubt: str = ""
    """Reason to ask a person before it is used; empty where there is none, or it was answered."""


def read_logs(paths: Sequence[Path], known: Sequence[OpenedLog], progress: Progress) -> list[OpenedLog]:
    """The `known` logs, and those of `paths` that are not among them, as they are logged; what cannot be read is left
    out."""
    read = list(known)
    for path in paths:
        stamp = stamp_of(path)
        if any((log.path, log.stamp) == (path, stamp) for log in known if stamp is not None):
            continue
        progress(f"reading {path.name}")
        with suppress(QuadctlError):  # `open_logs` says why
            read.append(OpenedLog(path, read_log(path), stamp=stamp))
    return read


def stamp_of(path: Path) -> tuple[int, int] | None:
    """Time of the last change and size of a file; None where it cannot be asked for them."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size
