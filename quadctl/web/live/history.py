"""History of a flight as the viewer knows it: last record, curves over time, phases, ending."""

import math
import time
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

from quadctl.flight.pilot.guards import GuardLimits
from quadctl.flight.pilot.tick import Stage
from quadctl.flight.record.view_link import Record
from quadctl.missions import Mission
from quadctl.vehicle import Vehicle

ROWS_KEPT = 36_000
"""One hour of rows."""
SILENT_S = 1.0
"""Longest normal time between two records; after it, the flight or the link has a fault."""
ENDING = (Stage.LAND.name, Stage.RELEASED.name, Stage.DONE.name)


class Brief(NamedTuple):
    """Facts known before a flight."""

    mission: Mission
    guards: GuardLimits
    vehicle: Vehicle
    compensator: str


class Row(NamedTuple):
    """Values of all curves at one time."""

    time_s: float
    height_m: float
    height_ref_m: float
    speed_m_s: float
    tilt_deg: float
    throttle: float
    battery_v: float
    late_ms: float
    state_age_ms: float
    link_age_ms: float
    residual_forward: float
    residual_right: float
    residual_down: float
    expected: float
    expected_below: float
    north_m: float
    """NaN while disarmed, as `east_m`: standing is no part of the path."""
    east_m: float


class Ending(NamedTuple):
    """Last message of the flight's process."""

    completed: bool
    lines: Sequence[str]


LOST = Ending(False, ["quadctl was ended without a last word: the autopilot's own failsafe acts."])


class History:
    """Grows by one row with each record."""

    def __init__(self, brief: Brief) -> None:
        self.brief = brief
        self.latest: Record | None = None
        self.ending: Ending | None = None
        self.phases: list[tuple[float, str]] = []
        """Start time and name of each phase, those on the ground and the landing included."""
        self.rows: deque[Row] = deque(maxlen=ROWS_KEPT)
        self.n_rows = 0
        """Number of all rows so far, those no longer kept included."""
        self.worst_late_s = 0.0
        self._heard_s = time.monotonic()

    def take(self, record: Record) -> None:
        self.latest = record
        self._heard_s = time.monotonic()
        self.worst_late_s = max(self.worst_late_s, record.late_s)
        if not self.phases or self.phases[-1][1] != record.phase:
            self.phases.append((record.time_s, record.phase))
        self.rows.append(_row(record))
        self.n_rows += 1

    def since(self, n_rows: int, most: int) -> list[Row]:
        """Rows after the first `n_rows`, at most the last `most` of them."""
        new = min(self.n_rows - n_rows, most, len(self.rows))
        return [self.rows[i] for i in range(len(self.rows) - new, len(self.rows))]

    @property
    def over(self) -> bool:
        return self.ending is not None or (self.latest is not None and self.latest.stage == Stage.DONE.name)

    @property
    def can_land(self) -> bool:
        """A flight is under way that a wish to land would end."""
        return not self.over and self.latest is not None and self.latest.stage not in ENDING

    @property
    def silent_s(self) -> float | None:
        """Time without a record of a flight that is not over; None while it is shorter than `SILENT_S`."""
        silent = time.monotonic() - self._heard_s
        return silent if silent > SILENT_S and self.latest is not None and not self.over else None


def _row(record: Record) -> Row:
    return Row(
        record.time_s,
        record.height_m,
        record.height_ref_m,
        record.speed_m_s,
        record.tilt_deg,
        record.throttle,
        record.battery_v,
        1e3 * record.late_s,
        _known_ms(record.state_age_s),
        _known_ms(record.link_age_s),
        *record.residual_m_s2,
        record.expected_m_s2,
        -record.expected_m_s2,
        record.north_m if record.armed else math.nan,
        record.east_m if record.armed else math.nan,
    )


def _known_ms(age_s: float) -> float:
    return 1e3 * age_s if math.isfinite(age_s) else math.nan
