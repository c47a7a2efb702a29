"""A flight log in memory: one table with the columns of docs/log-format.md, whatever file it came from."""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from quadctl.errors import LogError
from quadctl.logs.columns import rpm_columns
from quadctl.logs.findings import Finding, Kind, worded
from quadctl.words import nearest

Floats: TypeAlias = NDArray[np.float64]

POSITION = ("x_m", "y_m", "z_m")
VELOCITY = ("vx_m_s", "vy_m_s", "vz_m_s")
ATTITUDE = ("roll_deg", "pitch_deg", "yaw_deg")
RATES = ("roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s")
IMU = ("imu_x_m_s2", "imu_y_m_s2", "imu_z_m_s2")
MOTION_CAPTURE, ESTIMATOR = "motion_capture", "estimator"
ATTITUDE_SOURCES = (MOTION_CAPTURE, ESTIMATOR)
"""Sources of a logged attitude: cameras that see markers, or an estimator that the vehicle's own inertial unit
levels."""


@dataclass(frozen=True, eq=False)
class FlightLog:
    """One flight. Units and frames are those of the file: metres and degrees, north, east, up; rates in body FRD.

    A missing value is NaN. Values are as logged: a channel that is slower than the rows is held between its updates.
    """

    name: str
    """Name of the file, with its extension."""
    path: Path | None
    columns: dict[str, Floats]
    """Each of shape (n,), by the names of `quadctl.logs.columns`."""
    phase: NDArray[np.str_] | None = None
    """Name of the mission phase, shape (n,), "" where there is none."""
    meta: dict[str, Any] = field(default_factory=dict)
    """Content of the sidecar file."""
    findings: list[Finding] = field(default_factory=list)
    """Findings about the record: parts that were left out or read in an unusual way."""

    def __post_init__(self) -> None:
        if "time_s" not in self.columns:
            raise LogError(f"{self.name}: a flight log without time_s was made, expected at least that column")
        for name, values in self.columns.items():
            self._require_length(name, len(values))
        if self.phase is not None:
            self._require_length("phase", len(self.phase))

    def _require_length(self, name: str, length: int) -> None:
        if length != len(self):
            raise LogError(f"{self.name}: column '{name}' has {length} values, expected {len(self)} as time_s has")

    def __len__(self) -> int:
        return len(self.columns["time_s"])

    def __getitem__(self, name: str) -> Floats:
        """The values of one column, shape (n,).

        Raises
        ------
        LogError
            The log has no such column.
        """
        try:
            return self.columns[name]
        except KeyError:
            hint = nearest(name, list(self.columns))
            raise LogError(f"{self.name}: has no column '{name}'{hint}") from None

    def has(self, name: str) -> bool:
        """True where the column is there and holds at least one finite value."""
        return name in self.columns and bool(np.isfinite(self.columns[name]).any())

    @property
    def notes(self) -> list[str]:
        """The findings in words, one sentence each."""
        return [worded(found) for found in self.findings]

    @property
    def time_s(self) -> Floats:
        return self.columns["time_s"]

    @property
    def n_rotors(self) -> int:
        """Number of rotors with a speed column; 0 when the log has no rotor speeds."""
        n = 0
        while rpm_columns(n + 1)[-1] in self.columns:
            n += 1
        return n

    def updates(self, *names: str) -> NDArray[np.intp]:
        """Indices of the rows in which a channel got a new value.

        Several names are one channel whose parts arrive together (`log.updates(*POSITION)`): a row counts when any part
        changed. A row in which a part is not finite holds no update; the first finite row does.
        """
        values = [self[name] for name in names]
        rows = np.flatnonzero(np.logical_and.reduce([np.isfinite(part) for part in values]))
        known = [part[rows] for part in values]
        new = np.ones(len(rows), dtype=bool)
        new[1:] = np.logical_or.reduce([part[1:] != part[:-1] for part in known])
        return rows[new]

    def rows(self, selection: slice | NDArray[Any]) -> "FlightLog":
        """The same log with the selected rows only (a slice, a mask or indices)."""
        columns = {name: values[selection] for name, values in self.columns.items()}
        return replace(self, columns=columns, phase=None if self.phase is None else self.phase[selection])


def attitude_source(log: FlightLog) -> str:
    """Source of the attitude, of `ATTITUDE_SOURCES`, as the sidecar or the map of a log says it; empty where neither
    does.

    Raises
    ------
    LogError
        The sidecar names another source.
    """
    source = log.meta.get("attitude_by", "")
    if source not in ("", *ATTITUDE_SOURCES):
        raise LogError(
            f"{log.name}: attitude_by in its meta file is {source!r}, expected {' or '.join(ATTITUDE_SOURCES)}"
        )
    return str(source)


DOUBTS_OF_COPY = {
    Kind.CUT_SHORT: " (its last message is cut short: was the whole log copied?)",
    Kind.DAMAGED: " (the file is damaged: was the whole log copied?)",
}


def doubt_of_copy(findings: Iterable[Finding]) -> str:
    """The question to add to what a log lacks, where these findings say that a part is missing; else empty."""
    kinds = {found.kind for found in findings}
    return next((doubt for kind, doubt in DOUBTS_OF_COPY.items() if kind in kinds), "")
