"""Index of a fleet: one line of JSON for each flight measured, so that work that was stopped goes on where it was."""

import hashlib
import json
import re
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import NamedTuple

from quadctl import __version__
from quadctl.errors import LogError, SettingsError
from quadctl.files import writing
from quadctl.fleet.measurement import FlightRecord
from quadctl.logs.formats import format_of_folder, suffixes
from quadctl.model import Model, load_model

OWN_MODEL = "model.yaml"
"""Model file in a vehicle's folder that is used for its flights instead of the common one."""
_NUMBER = re.compile(r"(\d+)")


class LogFile(NamedTuple):
    """One log of a fleet."""

    vehicle: str
    """Name of the folder in which its logs are; "." for logs in the folder of the fleet itself."""
    flight: str
    """Path in the folder of the fleet."""
    path: Path
    model: Model
    key: str


def find_logs(folder: Path, model_path: Path) -> list[LogFile]:
    """All logs under `folder`, vehicle by vehicle; those of one vehicle in the order of their names, in which numbers
    (and dates of the form 2026-03-09) count as numbers.

    Raises
    ------
    LogError
        `folder` is no folder, or holds no logs.
    SettingsError
        A model file is wrong.
    """
    if not folder.is_dir():
        raise LogError(f"{folder}: is no folder, expected one with a folder of flight logs for each vehicle")
    models = {path.parent.name: path for path in sorted(folder.glob(f"*/{OWN_MODEL}"))}
    common = _Version.of(model_path)
    versions = {vehicle: _Version.of(path) for vehicle, path in models.items()}
    found = []
    for path in sorted(_logs(folder), key=lambda path: _natural(path.relative_to(folder).as_posix())):
        parts = path.relative_to(folder).parts
        vehicle = parts[0] if len(parts) > 1 else "."
        version, status = versions.get(vehicle, common), path.stat()
        key = f"{status.st_size}-{status.st_mtime_ns}-{version.text}"
        found.append(LogFile(vehicle, "/".join(parts), path, version.model, key))
    if not found:
        raise LogError(f"{folder}: holds no flight logs, expected files that end with {', '.join(suffixes())}")
    return found


class _Version(NamedTuple):
    model: Model
    text: str
    """Hash of the model's content and of the software: both change what is measured."""

    @classmethod
    def of(cls, path: Path) -> "_Version":
        model = load_model(path)
        said = f"{__version__} {model.vehicle!r} {[item.effect for item in model.stack]!r}"
        return cls(model, hashlib.sha256(said.encode()).hexdigest()[:12])


def _logs(folder: Path) -> Iterator[Path]:
    for path in folder.iterdir():
        if path.name.startswith("."):
            continue
        if path.is_dir():
            if format_of_folder(path) is not None:
                yield path
            else:
                yield from _logs(path)
        elif path.suffix.lower() in suffixes():
            yield path


def _natural(text: str) -> list[tuple[int, str]]:
    """Key by which names are sorted, in which numbers count as numbers: flight_2 comes before flight_10."""
    parts = _NUMBER.split(text)
    return [(int(part), "") if part.isdigit() else (-1, part) for part in parts]


class Index:
    """File with one record for each flight; records of the same flight replace each other."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.records = {record.flight: record for record in self._read()}

    def missing(self, logs: Sequence[LogFile]) -> list[LogFile]:
        """Logs that are not measured yet, or were another file or measured with another model."""
        return [log for log in logs if (r := self.records.get(log.flight)) is None or r.key != log.key]

    def of(self, logs: Sequence[LogFile]) -> list[FlightRecord]:
        """Records of `logs`, in their order; those that are not measured are left out."""
        return [self.records[log.flight] for log in logs if log.flight in self.records]

    def append(self, records: Sequence[FlightRecord]) -> None:
        """Write records to the file, on the disk when this returns.

        Raises
        ------
        SettingsError
            The file cannot be written.
        """
        lines = "".join(json.dumps(asdict(record)) + "\n" for record in records)
        with writing(self._path, SettingsError, "a file name"):
            # A line that was cut off when the work was stopped stays alone.
            cut = self._path.exists() and self._path.read_bytes()[-1:] not in (b"", b"\n")
            with self._path.open("a", encoding="utf-8") as file:
                file.write("\n" * cut + lines)
        self.records |= {record.flight: record for record in records}

    def _read(self) -> Iterator[FlightRecord]:
        if not self._path.exists():
            return
        try:
            lines = self._path.read_text(encoding="utf-8").splitlines()
        except (OSError, UnicodeDecodeError):
            raise SettingsError(f"{self._path}: cannot be read, expected the index of a fleet") from None
        broken = 0
        for line in lines:
            try:
                yield FlightRecord(**json.loads(line))
            except (TypeError, ValueError):  # a line that was cut off: its flight is measured again
                broken += bool(line.strip())
        if broken > 1 and broken > len(lines) / 2:
            raise SettingsError(f"{self._path}: is no index of a fleet, expected one line of JSON for each flight")
