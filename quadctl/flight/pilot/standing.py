"""Check that a vehicle stands still and level on the ground before a flight; if not, its estimate is wrong."""

import math

from quadctl.flight.pilot.settings import HeightDatum
from quadctl.frames import tilt
from quadctl.state import VehicleState

MAX_TILT_DEG = 10.0
MAX_SPEED_M_S = 0.3
MAX_HEIGHT_M = 0.3
"""Largest tilt, speed and height in the estimate of a vehicle that stands on the ground."""


def posture(state: VehicleState) -> str:
    """Tilt, speed and height, in words."""
    lean_deg, speed, height_m = _shown(state)
    return f"{lean_deg:.1f} deg tilt, {speed:.2f} m/s, z = {height_m:.2f} m in the autopilot's frame"


def not_standing(state: VehicleState, height_datum: HeightDatum) -> str | None:
    """Expectation that a vehicle standing on the ground does not meet, or None."""
    lean_deg, speed, height_m = _shown(state)
    if not lean_deg <= MAX_TILT_DEG:
        return f"expected at most {MAX_TILT_DEG:g} deg"
    if not speed <= MAX_SPEED_M_S:
        return f"expected at most {MAX_SPEED_M_S:g} m/s"
    if height_datum == "frame" and not abs(height_m) <= MAX_HEIGHT_M:
        return "height_datum: frame takes z = 0 for the ground, expected the vehicle there; or say takeoff"
    return None


def _shown(state: VehicleState) -> tuple[float, float, float]:
    return math.degrees(tilt(state.attitude)), math.hypot(*state.velocity_ned_m_s), -state.position_ned_m[2]
