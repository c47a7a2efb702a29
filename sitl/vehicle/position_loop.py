"""Position control of an autopilot itself: place, velocity and acceleration asked for, to attitude and thrust.

With e the error of the velocity against its setpoint, F a filter of first order, and `root` linear near its target and
a square root away from it, as a vehicle with a limited acceleration brakes:

    v_sp = v_ref + root(p_ref - p)
    a    = a_ref + Kv e + I + Kd F(s) de/dt   (or - Kd F(s) dv/dt),    dI/dt = Ki e

Both firmwares lean by the horizontal part of `a` against gravity, and give the vertical part by the thrust alone.
Sources: PX4's `PositionControl`, ArduPilot's `AC_PosControl`, `AC_PID_2D` and `sqrt_controller`. Simplified: at its
limit of tilt an integral stands still, and a target is not shaped, as with limits of speed and jerk that are raised.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from quadctl.frames import GRAVITY_M_S2, multiply
from quadctl.sitl.vehicle.estimator import Estimator
from quadctl.state import AttitudeTarget, Quat, Setpoint, Vec3
from quadctl.vehicle import Vehicle

ORIGIN: Vec3 = (0.0, 0.0, 0.0)
LEAST_THROTTLE, MOST_THROTTLE = 0.05, 0.95


@dataclass(frozen=True)
class AxisGains:
    """Gains of horizontal or vertical control."""

    position_p: float
    """1/s."""
    velocity_p: float
    """1/s."""
    velocity_i: float
    """1/s^2."""
    velocity_d: float


@dataclass(frozen=True)
class PositionLaw:
    """Gains and forms of a firmware's position control."""

    horizontal: AxisGains
    vertical: AxisGains
    damps_error: bool
    """True: D acts on the error of the velocity; False: on the measured acceleration."""
    derivative_hz: float
    """Cut-off of the filter on the derivative."""
    error_hz: float = math.inf
    """Cut-off of the filter on the error of the velocity."""
    braking_m_s2: float = math.inf
    """Acceleration of the square root; inf: the position's control is linear."""
    lift_p: float = 0.0
    """Gain of a vertical acceleration loop, acceleration per error; 0: there is none."""
    lift_i: float = 0.0
    """Its integral gain, 1/s."""
    lift_hz: float = math.inf
    """Cut-off of the filter on its error."""
    max_tilt_deg: float = 45.0


class Memory(NamedTuple):
    """State of position control between two estimates."""

    integral_m_s2: Vec3 = ORIGIN
    error_m_s: Vec3 | None = None
    """Filtered error of the velocity; None before the first estimate."""
    velocity_m_s: Vec3 = ORIGIN
    slope_m_s2: Vec3 = ORIGIN
    """Filtered derivative of what D acts on."""
    lift_error_m_s2: float = 0.0
    lift_m_s2: float = 0.0
    """Integral of the vertical acceleration loop."""


def root(error: float, p: float, braking_m_s2: float) -> float:
    """Correction of an error of either sign: p times it near 0, from where `braking_m_s2` is reached on a square root.

    The two branches meet at braking / p^2 with the same slope.
    """
    size = abs(error)
    bend = braking_m_s2 / (p * p)
    if size <= bend:
        return p * error
    return math.copysign(math.sqrt(2.0 * braking_m_s2 * (size - 0.5 * bend)), error)


def velocity_setpoint(target: Setpoint, position: Vec3, law: PositionLaw) -> Vec3:
    """Velocity that brings the vehicle to its target; an axis without a position keeps the target's velocity."""
    north, east, down = (
        0.0 if math.isnan(wanted) else wanted - actual
        for wanted, actual in zip(target.position_ned_m, position, strict=True)
    )
    far = math.hypot(north, east)
    share = root(far, law.horizontal.position_p, law.braking_m_s2) / far if far > 0.0 else 0.0
    u, v, w = target.velocity_ned_m_s
    return u + share * north, v + share * east, w + root(down, law.vertical.position_p, law.braking_m_s2)


def acceleration_setpoint(
    target: Setpoint, position: Vec3, velocity: Vec3, memory: Memory, law: PositionLaw, dt: float
) -> tuple[Vec3, Memory]:
    """Acceleration, NED, that brings the vehicle to its target, `dt` after the last estimate, and the new memory."""
    raw = _minus(velocity_setpoint(target, position, law), velocity)
    first = memory.error_m_s is None or dt <= 0.0
    before = raw if memory.error_m_s is None else memory.error_m_s
    error = raw if first else _towards(before, raw, share(law.error_hz, dt))
    damped = _minus(error, before) if law.damps_error else _minus(memory.velocity_m_s, velocity)
    slope = memory.slope_m_s2
    if not first:
        slope = _towards(slope, (damped[0] / dt, damped[1] / dt, damped[2] / dt), share(law.derivative_hz, dt))
    gains = (law.horizontal, law.horizontal, law.vertical)
    north, east, down = (
        ahead + k.velocity_p * e + i + k.velocity_d * d
        for ahead, k, e, i, d in zip(
            target.acceleration_ned_m_s2, gains, error, memory.integral_m_s2, slope, strict=True
        )
    )
    most, size = GRAVITY_M_S2 * math.tan(math.radians(law.max_tilt_deg)), math.hypot(north, east)
    shrink = min(1.0, most / size) if size > 0.0 else 1.0
    moving = (shrink == 1.0, shrink == 1.0, True)
    x, y, z = (
        i + k.velocity_i * e * dt * free
        for i, k, e, free in zip(memory.integral_m_s2, gains, error, moving, strict=True)
    )
    integral = (x, y, min(max(z, -GRAVITY_M_S2), GRAVITY_M_S2))
    lift_error, lift = memory.lift_error_m_s2, memory.lift_m_s2
    if law.lift_p > 0.0:
        rise = 0.0 if first else (velocity[2] - memory.velocity_m_s[2]) / dt
        lift_error += share(law.lift_hz, dt) * (down - rise - lift_error)
        lift = min(max(lift + law.lift_i * lift_error * dt, -GRAVITY_M_S2), GRAVITY_M_S2)
        down = law.lift_p * lift_error + lift
    return (shrink * north, shrink * east, down), Memory(integral, error, velocity, slope, lift_error, lift)


def share(cut_off_hz: float, dt: float) -> float:
    """Share of a step that a filter of first order passes on in `dt`."""
    return 1.0 if math.isinf(cut_off_hz) else dt / (dt + 1.0 / (2.0 * math.pi * cut_off_hz))


def leaning(acceleration: Vec3, yaw_rad: float) -> tuple[Quat, float]:
    """Attitude that leans by the horizontal acceleration against gravity, and the cosine of its tilt."""
    north, east = acceleration[0] / GRAVITY_M_S2, acceleration[1] / GRAVITY_M_S2
    cosine = 1.0 / math.sqrt(1.0 + north * north + east * east)
    # the shortest turn from up to the direction of the thrust, after the turn to the heading
    w = math.sqrt(0.5 * (1.0 + cosine))
    turn = (w, 0.5 * cosine * east / w, -0.5 * cosine * north / w, 0.0)
    return multiply(turn, (math.cos(0.5 * yaw_rad), 0.0, 0.0, math.sin(0.5 * yaw_rad))), cosine


class PositionLoop:
    """Position control of one autopilot, on its own estimate, one step for each new one (100 Hz)."""

    def __init__(self, law: PositionLaw, vehicle: Vehicle) -> None:
        self._law, self._vehicle = law, vehicle
        self._memory = Memory()
        self._updated_s = -math.inf
        self._target: AttitudeTarget | None = None

    def start(self) -> None:
        """Forget what was before."""
        self._memory, self._updated_s, self._target = Memory(), -math.inf, None

    def target(self, setpoint: Setpoint, estimator: Estimator) -> AttitudeTarget:
        """Attitude and throttle for the latest estimate."""
        if self._target is None or estimator.updated_s > self._updated_s:
            dt = 0.0 if self._target is None else estimator.updated_s - self._updated_s
            acceleration, self._memory = acceleration_setpoint(
                setpoint, estimator.position, estimator.velocity, self._memory, self._law, dt
            )
            attitude, cosine = leaning(acceleration, setpoint.yaw_rad)
            self._target = AttitudeTarget(attitude, self._throttle(acceleration[2], cosine))
            self._updated_s = estimator.updated_s
        return self._target

    def _throttle(self, down_m_s2: float, cosine: float) -> float:
        """Throttle for a vertical acceleration at a tilt; it knows its throttle of hover."""
        curve = self._vehicle.throttle
        thrust_n = self._vehicle.mass_kg * (GRAVITY_M_S2 - down_m_s2) / cosine
        return float(min(max(curve.offset + curve.per_newton * thrust_n, LEAST_THROTTLE), MOST_THROTTLE))


def _minus(a: Vec3, b: Vec3) -> Vec3:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _towards(a: Vec3, b: Vec3, part: float) -> Vec3:
    return a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1]), a[2] + part * (b[2] - a[2])
