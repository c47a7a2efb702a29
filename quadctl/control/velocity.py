"""Position P and velocity PID: setpoint and state to a wanted acceleration. Pure functions, NED.

The chain is PX4's (PositionControl): position error -> velocity setpoint, limited -> velocity error -> acceleration,
limited, with an integrator that does not wind up while the output is at its limit.
"""

import math
from typing import NamedTuple

from quadctl.control.settings import AxisGains, ControllerSettings
from quadctl.frames import GRAVITY_M_S2
from quadctl.state import Setpoint, Vec3


class VelocityMemory(NamedTuple):
    """State of the PID between one tick and the next."""

    integral_m_s2: Vec3 = (0.0, 0.0, 0.0)
    previous_velocity_m_s: Vec3 | None = None
    acceleration_m_s2: Vec3 = (0.0, 0.0, 0.0)
    """Filtered derivative of the measured velocity."""


def velocity_setpoint(setpoint: Setpoint, position_ned_m: Vec3, settings: ControllerSettings) -> Vec3:
    """Velocity that brings the vehicle to the setpoint, limited; an axis whose position is nan keeps its velocity."""
    target, feed_forward, p = setpoint.position_ned_m, setpoint.velocity_ned_m_s, settings.position_p
    north, east = _limit_length(
        _led_back(target[0], position_ned_m[0], feed_forward[0], p),
        _led_back(target[1], position_ned_m[1], feed_forward[1], p),
        settings.max_horizontal_m_s,
    )
    down = _led_back(target[2], position_ned_m[2], feed_forward[2], p)
    return north, east, min(max(down, -settings.max_up_m_s), settings.max_down_m_s)


def acceleration_setpoint(
    velocity_sp: Vec3,
    velocity: Vec3,
    feed_forward: Vec3,
    memory: VelocityMemory,
    dt: float,
    settings: ControllerSettings,
) -> tuple[Vec3, VelocityMemory]:
    """Acceleration that brings the velocity to its setpoint, limited, and the memory for the next tick."""
    measured = _filtered_acceleration(velocity, memory, dt, settings.derivative_time_s)
    gains = (settings.velocity_horizontal, settings.velocity_horizontal, settings.velocity_vertical)
    error = _subtract(velocity_sp, velocity)
    integral = memory.integral_m_s2
    raw = (
        _pid(error[0], integral[0], measured[0], feed_forward[0], gains[0]),
        _pid(error[1], integral[1], measured[1], feed_forward[1], gains[1]),
        _pid(error[2], integral[2], measured[2], feed_forward[2], gains[2]),
    )
    limited = _limit_acceleration(raw, settings)
    most, beyond = settings.max_integral_m_s2, _subtract(raw, limited)
    new_integral = (
        _integrated(integral[0], error[0], beyond[0], gains[0], dt, most),
        _integrated(integral[1], error[1], beyond[1], gains[1], dt, most),
        _integrated(integral[2], error[2], beyond[2], gains[2], dt, most),
    )
    return limited, VelocityMemory(new_integral, velocity, measured)


def _integrated(integral: float, error: float, beyond: float, gains: AxisGains, dt: float, most: float) -> float:
    """Integral of one axis after `dt`; an axis that is `beyond` its limit integrates only what leads away from it."""
    return integral if beyond * error > 0.0 else _clip(integral + gains.i * error * dt, most)


def _led_back(target: float, actual: float, feed_forward: float, p: float) -> float:
    """Velocity of one axis that leads back to its target; nan: there is none."""
    return feed_forward if math.isnan(target) else feed_forward + p * (target - actual)


def _pid(error: float, integral: float, measured: float, feed_forward: float, gains: AxisGains) -> float:
    return feed_forward + gains.p * error + integral - gains.d * measured


def _filtered_acceleration(velocity: Vec3, memory: VelocityMemory, dt: float, time_constant_s: float) -> Vec3:
    """Filtered derivative of the measured velocity (first order); not of the error, which jumps with the setpoint."""
    if memory.previous_velocity_m_s is None or dt <= 0.0:
        return memory.acceleration_m_s2
    share = dt / (dt + time_constant_s)
    old, before = memory.acceleration_m_s2, memory.previous_velocity_m_s
    return (
        old[0] + share * ((velocity[0] - before[0]) / dt - old[0]),
        old[1] + share * ((velocity[1] - before[1]) / dt - old[1]),
        old[2] + share * ((velocity[2] - before[2]) / dt - old[2]),
    )


def _limit_acceleration(wanted: Vec3, settings: ControllerSettings) -> Vec3:
    """Limit the acceleration: vertical first, then as much horizontal as the tilt limit leaves (PX4's order)."""
    down = min(max(wanted[2], -settings.max_acceleration_up_m_s2), settings.max_acceleration_down_m_s2)
    horizontal = math.tan(math.radians(settings.max_tilt_deg)) * (GRAVITY_M_S2 - down)
    north, east = _limit_length(wanted[0], wanted[1], horizontal)
    return north, east, down


def _limit_length(x: float, y: float, longest: float) -> tuple[float, float]:
    length = math.hypot(x, y)
    return (x, y) if length <= longest else (x * longest / length, y * longest / length)


def _clip(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)


def _subtract(a: Vec3, b: Vec3) -> Vec3:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]
