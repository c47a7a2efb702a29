"""Position P and velocity PID: reference and state to a wanted acceleration. Pure functions, NED.

The chain is PX4's (PositionControl): position error -> velocity setpoint, limited -> velocity error -> acceleration,
limited, with an integrator that does not wind up while the output is at its limit.

With e the error of the velocity against its setpoint, F a filter of first order, and the reference `here` at the time
of the state:

    v_sp = v_here + Kp (p_here - p)
    a    = Kv e + I - Kd F(s) (dv/dt - a_here),    dI/dt = Ki e

With `horizontal_integral: position` dI/dt = Ki Kp (p_here - p), limited, in the horizontal axes instead.

The reference's own acceleration, at the time when the vehicle will have turned, is fed forward on top of it.
"""

import math
from typing import NamedTuple

from quadctl.control.settings import AxisGains, ControllerSettings
from quadctl.frames import GRAVITY_M_S2
from quadctl.numeric import minus
from quadctl.state import Setpoint, Vec3

ORIGIN: Vec3 = (0.0, 0.0, 0.0)
INTEGRAL_M_S = 0.5
"""Largest velocity back to the place that the integral of the position sums up: a step of the reference is no drift."""


class Easing(NamedTuple):
    """Shares of the gains, 0..1, that the lags of the loop allow."""

    horizontal: float = 1.0
    vertical: float = 1.0


FULL = Easing()


class VelocityMemory(NamedTuple):
    """State of the PID between one tick and the next."""

    integral_m_s2: Vec3 = ORIGIN
    previous_velocity_m_s: Vec3 | None = None
    acceleration_m_s2: Vec3 = ORIGIN
    """Filtered derivative of the measured velocity, less the reference's acceleration where D acts on the error."""


def velocity_setpoint(
    setpoint: Setpoint, position_ned_m: Vec3, settings: ControllerSettings, easing: Easing = FULL
) -> Vec3:
    """Velocity that brings the vehicle to the setpoint, limited; an axis whose position is nan keeps its velocity."""
    target, feed_forward = setpoint.position_ned_m, setpoint.velocity_ned_m_s
    level_p, upright_p = easing.horizontal * settings.position_p, easing.vertical * settings.position_p_vertical
    north, east = _limit_length(
        _led_back(target[0], position_ned_m[0], feed_forward[0], level_p),
        _led_back(target[1], position_ned_m[1], feed_forward[1], level_p),
        settings.max_horizontal_m_s,
    )
    down = _led_back(target[2], position_ned_m[2], feed_forward[2], upright_p)
    return north, east, min(max(down, -settings.max_up_m_s), settings.max_down_m_s)


def acceleration_setpoint(
    velocity_sp: Vec3,
    velocity: Vec3,
    feed_forward: Vec3,
    memory: VelocityMemory,
    dt: float,
    settings: ControllerSettings,
    expected: Vec3 = ORIGIN,
    easing: Easing = FULL,
    here_m_s: Vec3 = ORIGIN,
) -> tuple[Vec3, VelocityMemory]:
    """Acceleration that brings the velocity to its setpoint, limited, and the memory for the next tick.

    `feed_forward` is the acceleration of the reference that the vehicle is to have, `expected` the one that it should
    have at the time of its velocity, `here_m_s` the reference's velocity at that time, `easing` the share of the gains
    that the lag of the loop allows.
    """
    not_wanted = expected if settings.derivative == "error" else ORIGIN
    excess = _filtered_acceleration(velocity, not_wanted, memory, dt, settings.derivative_time_s)
    gains = (settings.velocity_horizontal, settings.velocity_horizontal, settings.velocity_vertical)
    shares = (easing.horizontal, easing.horizontal, easing.vertical)
    error = minus(velocity_sp, velocity)
    integral = memory.integral_m_s2
    north, east, down = (
        ahead + share * (k.p * e - k.d * a)
        for ahead, share, k, e, a in zip(feed_forward, shares, gains, error, excess, strict=True)
    )
    in_force = integral[2] if settings.vertical_integral == "force" else 0.0
    raw = (north + integral[0], east + integral[1], down + in_force)
    limited = _limit_acceleration(raw, settings)
    summed = error
    if settings.horizontal_integral == "position":
        back = _limit_length(velocity_sp[0] - here_m_s[0], velocity_sp[1] - here_m_s[1], INTEGRAL_M_S)
        summed = (*back, error[2])
    most, beyond = settings.max_integral_m_s2, minus(raw, limited)
    new_integral = (
        _integrated(integral[0], summed[0], beyond[0], gains[0], dt, most),
        _integrated(integral[1], summed[1], beyond[1], gains[1], dt, most),
        _integrated(integral[2], summed[2], beyond[2], gains[2], dt, most),
    )
    return limited, VelocityMemory(new_integral, velocity, excess)


def thrust_factor(integral_m_s2: Vec3, settings: ControllerSettings) -> float:
    """Factor on the thrust that the vertical integral has found: a wrong mass or throttle curve acts along the thrust.

    1 where the integral is a part of the force.
    """
    return 1.0 if settings.vertical_integral == "force" else 1.0 - integral_m_s2[2] / GRAVITY_M_S2


def _integrated(integral: float, error: float, beyond: float, gains: AxisGains, dt: float, most: float) -> float:
    """Integral of one axis after `dt`; an axis that is `beyond` its limit integrates only what leads away from it."""
    return integral if beyond * error > 0.0 else _clip(integral + gains.i * error * dt, most)


def _led_back(target: float, actual: float, feed_forward: float, p: float) -> float:
    """Velocity of one axis that leads back to its target; nan: there is none."""
    return feed_forward if math.isnan(target) else feed_forward + p * (target - actual)


def _filtered_acceleration(
    velocity: Vec3, not_wanted: Vec3, memory: VelocityMemory, dt: float, time_constant_s: float
) -> Vec3:
    """Filtered derivative of the measured velocity less the acceleration `not_wanted` (first order).

    Not the derivative of the velocity's error, which jumps with the setpoint.
    """
    if memory.previous_velocity_m_s is None or dt <= 0.0:
        return memory.acceleration_m_s2
    share = dt / (dt + time_constant_s)
    old, before = memory.acceleration_m_s2, memory.previous_velocity_m_s
    return (
        old[0] + share * ((velocity[0] - before[0]) / dt - not_wanted[0] - old[0]),
        old[1] + share * ((velocity[1] - before[1]) / dt - not_wanted[1] - old[1]),
        old[2] + share * ((velocity[2] - before[2]) / dt - not_wanted[2] - old[2]),
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
