"""What the viewer knows of a flight: the last record, curves over time, phases as they began, how it ended."""

import math
import time
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

from quadctl.flight.pilot.guards import GuardLimits
from quadctl.flight.pilot.tick import Stage
from quadctl.flight.record.view_link import Record
from quadctl.missions import Mission

ROWS_KEPT = 36_000
"""An hour."""
SILENT_S = 1.0
"""Without a record for so long, something is wrong with the flight or the way to it."""
ENDING = (Stage.LAND.name, Stage.RELEASED.name, Stage.DONE.name)


class Brief(NamedTuple):
    """What is known before a flight."""

    mission: Mission
    guards: GuardLimits
    vehicle: str
    compensator: str


class Row(NamedTuple):
    """The curves at one time."""

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


class Ending(NamedTuple):
    """What the flight's process said last."""

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
        """When each began, and its name; those of the ground and of the landing among them."""
        self.rows: deque[Row] = deque(maxlen=ROWS_KEPT)
        self.n_rows = 0
        """All that ever were, those that are forgotten included."""
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
        """The rows after the first `n_rows` ones, the last `most` of them."""
        new = min(self.n_rows - n_rows, most, len(self.rows))
        return [self.rows[i] for i in range(len(self.rows) - new, len(self.rows))]

    @property
    def over(self) -> bool:
        return self.ending is not None or (self.latest is not None and self.latest.stage == Stage.DONE.name)

    @property
    def can_land(self) -> bool:
        """There is a flight that a wish to land would end."""
        return not self.over and self.latest is not None and self.latest.stage not in ENDING

    @property
    def silent_s(self) -> float | None:
        """For how long a flight that is not over has said nothing, where that is long; None where all is well."""
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
    )


def _known_ms(age_s: float) -> float:
    return 1e3 * age_s if math.isfinite(age_s) else math.nan
