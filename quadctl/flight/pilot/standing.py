"""Check that a vehicle stands still and level on the ground before a flight; if not, its estimate is wrong."""

import math

from quadctl.flight.pilot.reasons import Kind, Reason, reason
from quadctl.flight.pilot.settings import HeightDatum
from quadctl.frames import tilt
from quadctl.state import VehicleState

MAX_TILT_DEG = 10.0
MAX_SPEED_M_S = 0.3
MAX_HEIGHT_M = 0.3
"""Largest tilt, speed and height in the estimate of a vehicle that stands on the ground."""


def posture(state: VehicleState) -> Reason:
    """Tilt, speed and height of the vehicle."""
    lean_deg, speed_m_s, height_m = _shown(state)
    return reason(Kind.POSTURE, tilt_deg=lean_deg, speed_m_s=speed_m_s, height_m=height_m)


def not_standing(state: VehicleState, height_datum: HeightDatum) -> Reason | None:
    """Expectation that a vehicle standing on the ground does not meet, or None."""
    lean_deg, speed_m_s, height_m = _shown(state)
    if not lean_deg <= MAX_TILT_DEG:
        return reason(Kind.LEANS, most_deg=MAX_TILT_DEG)
    if not speed_m_s <= MAX_SPEED_M_S:
        return reason(Kind.MOVES, most_m_s=MAX_SPEED_M_S)
    if height_datum == "frame" and not abs(height_m) <= MAX_HEIGHT_M:
        return Reason(Kind.OTHER_DATUM)
    return None


def _shown(state: VehicleState) -> tuple[float, float, float]:
    return math.degrees(tilt(state.attitude)), math.hypot(*state.velocity_ned_m_s), -state.position_ned_m[2]
