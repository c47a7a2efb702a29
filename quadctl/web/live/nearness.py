"""Nearness of a flight to the limit of each guard, and the guards that have acted."""

import math
import re
from collections.abc import Iterator
from typing import NamedTuple

from quadctl.flight.autopilot.telemetry import WORD_TIMEOUT_S
from quadctl.flight.pilot.guards import floor
from quadctl.flight.record.view_link import Record
from quadctl.web.live.history import Brief


class Nearness(NamedTuple):
    """Value and limit of one guard."""

    name: str
    value: float
    limit: float
    unit: str
    decimals: int
    share: float
    """Value as a share of the limit; the guard acts above 1. nan where the value is unknown."""
    says: str
    """Regular expression that matches the message of this guard."""

    def acted(self, record: Record) -> str | None:
        """Answer of the guard, or None where it has not acted."""
        return next((event.answer for event in record.events if re.search(self.says, event.what)), None)


def guards(record: Record, brief: Brief) -> Iterator[Nearness]:
    """Every guard that has a limit, in the order in which they decide."""
    limits, place = brief.guards, brief.mission.limits
    yield _most("link age", record.link_age_s, WORD_TIMEOUT_S, "s", 1, r"heartbeat is lost")
    yield _most("tick lateness", 1e3 * record.late_s, 1e3 * limits.max_tick_late_s, "ms", 1, r"control loop stalled")
    yield _most(
        "state age",
        1e3 * record.state_age_s,
        1e3 * limits.max_state_age_s,
        "ms",
        0,
        r"the (position|attitude) (is .* old|never came)",
    )
    if limits.max_estimator_ratio > 0.0:
        yield _most("estimator ratio", record.estimator_ratio, limits.max_estimator_ratio, "", 2, r"is in doubt")
    if limits.max_horizontal_std_m > 0.0:
        stated, limit = record.horizontal_std_m, limits.max_horizontal_std_m
        yield _most("stated accuracy", stated, limit, "m", 2, r"deviation .* horizontal position")
    if limits.max_vertical_std_m > 0.0:
        stated, limit = record.vertical_std_m, limits.max_vertical_std_m
        yield _most("stated accuracy, height", stated, limit, "m", 2, r"deviation .* height")
    if limits.model_error.max_m_s2 > 0.0:
        size, limit = math.hypot(*record.residual_m_s2), limits.model_error.max_m_s2
        yield _most("model error", size, limit, "m/s²", 2, r"not the one of the model")
    yield _most("tilt", record.tilt_deg, limits.max_tilt_deg, "°", 0, r"^the tilt is")
    yield _most("speed", record.speed_m_s, limits.max_speed_m_s, "m/s", 1, r"^the speed is")
    yield _most("height", record.height_m, place.max_z_m + place.margin_m, "m", 2, r"^the height is .* m$")
    if floor(place) > 0.0:
        yield _least("lowest height", record.height_m, floor(place), "m", 2, r"^the height is .* or more$")
    yield _most("distance", record.distance_m, place.max_distance_m + place.margin_m, "m", 2, r"from take-off")
    yield _most(
        "mission time", record.flight_s, brief.mission.duration_s + limits.max_over_time_s, "s", 0, r"the flight lasts"
    )
    if limits.min_battery_v > 0.0:
        yield _least("battery", record.battery_v, limits.min_battery_v, "V", 2, r"^the battery is")


def _most(name: str, value: float, limit: float, unit: str, decimals: int, says: str) -> Nearness:
    return Nearness(name, value, limit, unit, decimals, max(value, 0.0) / limit, says)


def _least(name: str, value: float, limit: float, unit: str, decimals: int, says: str) -> Nearness:
    return Nearness(name, value, limit, unit, decimals, limit / value if value > 0.0 else math.inf, says)
