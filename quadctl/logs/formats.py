"""Formats of flight logs, to read and to convert to. Reader, commands and page share these tables.

A new format is one module with its functions, and one line here. Functions are named, not imported: a command lists the
formats without loading the libraries that read them.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, TypeAlias, cast

if TYPE_CHECKING:
    from quadctl.logs.flight_log import FlightLog

Reader: TypeAlias = "Callable[[Path], FlightLog]"
Writer: TypeAlias = "Callable[[FlightLog, Path], None]"

HEAD_BYTES = 4096
"""Length of a file's beginning by which its format is recognised."""


@dataclass(frozen=True)
class LogFormat:
    """One format that can be read; functions are named as `module:function`."""

    label: str
    suffix: str
    """With its dot, in lower case; "" where a log is always a folder."""
    reader: str
    """(path) -> FlightLog; it raises a LogError for a file that is not of its format."""
    recogniser: str | None
    """(the first HEAD_BYTES of a file) -> bool; None for the one format that is tried where no other is recognised."""
    folder_holds: tuple[str, ...] = ()
    """Files of which any makes a folder a log of this format, with {name} for its own name; none where a log is always
    one file."""
    other_suffixes: tuple[str, ...] = ()
    """Further suffixes of its files, as `suffix`."""
    parameters: str | None = None
    """(path) -> the last value of each parameter of the autopilot, by name; None where no log holds any."""
    shared_suffixes: tuple[str, ...] = ()
    """Suffixes that other files have, too: by these alone no format is recognised."""

    @property
    def own_suffixes(self) -> tuple[str, ...]:
        return (self.suffix, *self.other_suffixes) if self.suffix else ()

    @property
    def suffixes(self) -> tuple[str, ...]:
        return (*self.own_suffixes, *self.shared_suffixes)

    def files_in(self, folder: str) -> Iterator[str]:
        """Names of the files of which any makes a folder of that name a log of this format."""
        return (name.format(name=folder) for name in self.folder_holds)

    def recognises(self, head: bytes) -> bool:
        return self.recogniser is not None and bool(resolve_name(self.recogniser)(head))

    def read(self, path: Path) -> "FlightLog":
        return cast(Reader, resolve_name(self.reader))(path)


FORMATS: tuple[LogFormat, ...] = (
    LogFormat("CSV", ".csv", "quadctl.logs.csv_log:read_csv", None),
    LogFormat(
        *("PX4 ULog", ".ulg", "quadctl.logs.ulog:read_ulog", "quadctl.logs.ulog:is_ulog"),
        parameters="quadctl.logs.ulog:parameters_in_ulog",
    ),
    LogFormat(
        *("ArduPilot DataFlash", ".bin", "quadctl.logs.dataflash:read_dataflash"),
        "quadctl.logs.dataflash_records:is_dataflash",
        parameters="quadctl.logs.dataflash:parameters_in_dataflash",
        shared_suffixes=(".log",),
    ),
    LogFormat("MAVLink telemetry", ".tlog", "quadctl.logs.tlog:read_tlog", "quadctl.logs.tlog:is_tlog"),
    LogFormat(
        *("ROS bag", ".mcap", "quadctl.logs.rosbag:read_rosbag", "quadctl.logs.rosbag:is_rosbag"),
        folder_holds=("metadata.yaml", "{name}_0.mcap", "{name}_0.db3"),
        other_suffixes=(".db3", ".bag"),
    ),
    LogFormat("Parquet", ".parquet", "quadctl.logs.table:read_parquet", "quadctl.logs.table:is_parquet"),
    LogFormat(
        *("folder of PX4 Flight Review 2", "", "quadctl.logs.flight_review:read_flight_review", None),
        folder_holds=("vehicle_attitude.parquet",),
        parameters="quadctl.logs.flight_review:parameters_in_flight_review",
    ),
)
MAP_SUFFIX = ".map.yaml"
"""A table `NAME.csv` with a map `NAME.map.yaml` beside it is read by that map, by every command."""
MAPPED = LogFormat("a table with a map", "", "quadctl.logs.table:read_mapped", None)
"""Any table, CSV or Parquet, that has a map beside it."""
TABLES = (".csv", ".parquet")
"""Suffixes of the formats that are tables."""
A_MAP = "or a map of its columns beside it (`quadctl logs --guess` proposes one)"
"""Part of the sentences about a table of another program."""

CONVERTERS: dict[str, str] = {
    "csv": "quadctl.logs.csv_log:write_csv",
    "parquet": "quadctl.logs.convert:write_parquet",
    "mcap": "quadctl.logs.convert:write_mcap",
}
"""Functions (log, path) -> None that write a log in another format, by the suffix (without dot) of what they write."""


def suffixes() -> tuple[str, ...]:
    """Suffixes of all formats that can be read."""
    return tuple(suffix for form in FORMATS for suffix in form.suffixes)


def suffixes_with_parameters() -> tuple[str, ...]:
    """Suffixes of the logs that hold the parameters of their autopilot."""
    return tuple(suffix for form in FORMATS if form.parameters is not None for suffix in form.own_suffixes)


def labels() -> str:
    """All formats of files that can be read, in words: `CSV (.csv), PX4 ULog (.ulg), ...`."""
    return ", ".join(f"{form.label} ({', '.join(form.suffixes)})" for form in FORMATS if form.suffix)


def format_of(head: bytes, suffix: str) -> LogFormat:
    """The format of a file by its first bytes, by its suffix where they are damaged, else the one tried on anything."""
    for form in FORMATS:
        if form.recognises(head):
            return form
    by_suffix = [form for form in FORMATS if suffix.lower() in form.own_suffixes]
    return (by_suffix or [form for form in FORMATS if form.recogniser is None])[0]


def format_of_folder(path: Path) -> LogFormat | None:
    """The format of a log that is a folder; None for any other folder, or a file."""
    return next((form for form in FORMATS if any((path / name).is_file() for name in form.files_in(path.name))), None)


def writer(to: str) -> Writer:
    """The function that writes a log as `to`, a key of CONVERTERS."""
    return cast(Writer, resolve_name(CONVERTERS[to]))
