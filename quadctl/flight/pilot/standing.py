"""Check that a vehicle stands still and level on the ground before a flight; if not, its estimate is wrong."""

import math
from typing import NamedTuple

from quadctl.flight.pilot.reasons import Kind, Reason, reason
from quadctl.flight.pilot.settings import HeightDatum
from quadctl.frames import tilt
from quadctl.state import VehicleState

MAX_TILT_DEG = 10.0
MAX_SPEED_M_S = 0.3
MAX_HEIGHT_M = 0.3
"""Largest tilt, speed and height in the estimate of a vehicle that stands on the ground."""
POSTURE = "{:.1f} deg tilt, {:.2f} m/s, z = {:.2f} m in the autopilot's frame"


class Posture(NamedTuple):
    """How a vehicle stands, in the autopilot's frame."""

    tilt_deg: float
    speed_m_s: float
    height_m: float

    def __str__(self) -> str:
        return POSTURE.format(*self)


def posture(state: VehicleState) -> Posture:
    """How the vehicle stands."""
    speed_m_s = math.hypot(*state.velocity_ned_m_s)
    return Posture(math.degrees(tilt(state.attitude)), speed_m_s, -state.position_ned_m[2])


def not_standing(state: VehicleState, height_datum: HeightDatum) -> Reason | None:
    """Expectation that a vehicle standing on the ground does not meet, or None."""
    lean_deg, speed_m_s, height_m = posture(state)
    if not lean_deg <= MAX_TILT_DEG:
        return reason(Kind.LEANS, most_deg=MAX_TILT_DEG)
    if not speed_m_s <= MAX_SPEED_M_S:
        return reason(Kind.MOVES, most_m_s=MAX_SPEED_M_S)
    if height_datum == "frame" and not abs(height_m) <= MAX_HEIGHT_M:
        return Reason(Kind.OTHER_DATUM)
    return None
