"""Kinematic identities: what a log says twice, as one table for those who refuse, score and draw.

The change of a channel, its level, is the integral of another, its slope: a position and a velocity, a velocity and the
direction in which the vehicle leans, an attitude and the body rates.
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from quadctl.frames import GRAVITY_M_S2, euler_rates, quaternion_from_euler, rotate
from quadctl.logs.flight_log import ATTITUDE, IMU, POSITION, RATES, VELOCITY, Floats

ACCELERATION = ("ax_m_s2", "ay_m_s2", "az_m_s2")
LEAST_CARRIED = 0.3
"""Least vertical part of the thrust's direction: a vehicle that leans further carries no weight."""


class Identity(NamedTuple):
    """Levels whose changes other columns explain."""

    levels: tuple[str, ...]
    needed: tuple[str, ...]
    """Columns that the slopes are made of."""
    stretch_s: float
    """Length of the stretches over which changes are compared."""
    slopes_of: Callable[..., tuple[Floats, ...]]
    """Function from the needed columns to the slopes of the levels; angles in radians."""

    @property
    def columns(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys((*self.levels, *self.needed)))

    def of(self, values: Mapping[str, Floats]) -> tuple[list[Floats], tuple[Floats, ...]]:
        """Levels and slopes of columns without missing values; angles in radians, and continuous."""
        plain = {name: np.unwrap(np.radians(v)) if name in ATTITUDE else v for name, v in values.items()}
        return [plain[name] for name in self.levels], self.slopes_of(*(plain[name] for name in self.needed))


def push_m_s2(roll: Floats, pitch: Floats, yaw: Floats) -> tuple[Floats, Floats]:
    """Acceleration north and east of a thrust that carries the weight, by the direction in which it leans."""
    north, east, down = rotate(quaternion_from_euler(roll, pitch, yaw), (0.0, 0.0, -1.0))
    carried = np.maximum(-down, LEAST_CARRIED)
    return GRAVITY_M_S2 * north / carried, GRAVITY_M_S2 * east / carried


def _turn(roll: Floats, pitch: Floats, p: Floats, q: Floats, r: Floats) -> tuple[Floats, ...]:
    return euler_rates(roll, pitch, p, q, r)


def _same(*slopes: Floats) -> tuple[Floats, ...]:
    return slopes


MOTION = Identity(POSITION, VELOCITY, 1.0, _same)
PUSH = Identity(VELOCITY[:2], ATTITUDE, 1.0, push_m_s2)
TURN = Identity(ATTITUDE, (*ATTITUDE[:2], *RATES), 0.2, _turn)
SPEED_UP = Identity(VELOCITY, ACCELERATION, 1.0, _same)


def integral(time_s: Floats, values: Floats) -> Floats:
    """Integral from the first time on, by trapezia; the shape of `values`."""
    return np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(time_s))])


def force_in_world(columns: Mapping[str, Floats]) -> Floats:
    """Specific force of the accelerometer north, east and up, m/s^2, shape (3, n)."""
    attitude = quaternion_from_euler(*(np.radians(columns[name]) for name in ATTITUDE))
    x, y, z = (columns[name] for name in IMU)
    north, east, down = rotate(attitude, (x, y, z))
    return np.array([north, east, -down])
