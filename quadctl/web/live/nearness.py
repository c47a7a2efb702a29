"""Nearness of a flight to the limit of each guard, and the guards that have acted."""

import math
from collections.abc import Iterator
from typing import NamedTuple

from quadctl.flight.autopilot.telemetry import WORD_TIMEOUT_S
from quadctl.flight.pilot.guards import Guard, floor
from quadctl.flight.record.view_link import Record
from quadctl.web.live.history import Brief


class Nearness(NamedTuple):
    """Value and limit of one guard."""

    guard: Guard
    value: float
    limit: float
    unit: str
    decimals: int
    share: float
    """Value as a share of the limit; the guard acts above 1. nan where the value is unknown."""

    def acted(self, record: Record) -> str | None:
        """Answer of the guard, or None where it has not acted."""
        return next((event.answer for event in record.events if event.guard == self.guard), None)


def guards(record: Record, brief: Brief) -> Iterator[Nearness]:
    """Every guard that has a limit, in the order in which they decide."""
    limits, place = brief.guards, brief.mission.limits
    yield _most(Guard.LINK, record.link_age_s, WORD_TIMEOUT_S, "s", 1)
    yield _most(Guard.TICK_LATE, 1e3 * record.late_s, 1e3 * limits.max_tick_late_s, "ms", 1)
    yield _most(Guard.STATE_AGE, 1e3 * record.state_age_s, 1e3 * limits.max_state_age_s, "ms", 0)
    if limits.max_estimator_ratio > 0.0:
        yield _most(Guard.ESTIMATOR, record.estimator_ratio, limits.max_estimator_ratio, "", 2)
    if limits.max_horizontal_std_m > 0.0:
        yield _most(Guard.HORIZONTAL_STD, record.horizontal_std_m, limits.max_horizontal_std_m, "m", 2)
    if limits.max_vertical_std_m > 0.0:
        yield _most(Guard.VERTICAL_STD, record.vertical_std_m, limits.max_vertical_std_m, "m", 2)
    if limits.model_error.max_m_s2 > 0.0:
        yield _most(Guard.MODEL, math.hypot(*record.residual_m_s2), limits.model_error.max_m_s2, "m/s²", 2)
    yield _most(Guard.TILT, record.tilt_deg, limits.max_tilt_deg, "°", 0)
    yield _most(Guard.SPEED, record.speed_m_s, limits.max_speed_m_s, "m/s", 1)
    yield _most(Guard.HEIGHT, record.height_m, place.max_z_m + place.margin_m, "m", 2)
    if floor(place) > 0.0:
        yield _least(Guard.FLOOR, record.height_m, floor(place), "m", 2)
    yield _most(Guard.DISTANCE, record.distance_m, place.max_distance_m + place.margin_m, "m", 2)
    yield _most(Guard.TIME, record.flight_s, brief.mission.duration_s + limits.max_over_time_s, "s", 0)
    if limits.min_battery_v > 0.0:
        yield _least(Guard.BATTERY, record.battery_v, limits.min_battery_v, "V", 2)


def _most(guard: Guard, value: float, limit: float, unit: str, decimals: int) -> Nearness:
    return Nearness(guard, value, limit, unit, decimals, max(value, 0.0) / limit)


def _least(guard: Guard, value: float, limit: float, unit: str, decimals: int) -> Nearness:
    return Nearness(guard, value, limit, unit, decimals, limit / value if value > 0.0 else math.inf)
