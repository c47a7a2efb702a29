"""One tick of control, in the order of the signal: state and setpoint in, attitude and throttle out. No I/O."""

import math
from typing import NamedTuple

from quadctl.compensator import Compensation, Compensator
from quadctl.control.attitude import (
    attitude_for_force,
    lateral_in_body,
    limit_tilt,
    thrust_along_body,
    upright_axis,
)
from quadctl.control.lags import Preview
from quadctl.control.settings import ControllerSettings
from quadctl.control.throttle import lateral_throttle, throttle_for_thrust
from quadctl.control.velocity import VelocityMemory, acceleration_setpoint, thrust_factor, velocity_setpoint
from quadctl.frames import GRAVITY_M_S2
from quadctl.numeric import scaled
from quadctl.state import AttitudeTarget, Motion, Setpoint, Vec3, VehicleState
from quadctl.vehicle import Vehicle

NEAR_M, NEAR_M_S = 0.5, 1.0
"""Distance and difference in velocity from the reference at which effects are evaluated at the state alone."""


class Memory(NamedTuple):
    """State of control between one tick and the next."""

    velocity: VelocityMemory = VelocityMemory()
    thrust_n: float | None = None
    """Thrust asked of the rotors at the last tick, N, from which the compensator's forces follow; None before the
    first tick, which takes the weight."""


class ControlOutput(NamedTuple):
    """Target of one tick, and the intermediate results for the log."""

    target: AttitudeTarget
    thrust_n: float
    """Wanted thrust along the body axis, N, before compensation."""
    compensation: Compensation
    velocity_sp: Vec3
    acceleration_sp: Vec3
    memory: Memory
    lateral_n: tuple[float, float] | None = None
    """Wanted lateral force, forward and right in the body, N, before compensation; None where it is left to tilt."""


def control(
    setpoint: Setpoint,
    state: VehicleState,
    memory: Memory,
    dt: float,
    ground_down_m: float,
    vehicle: Vehicle,
    settings: ControllerSettings,
    compensator: Compensator,
    preview: Preview | None = None,
) -> ControlOutput:
    """Compute one tick: position P -> velocity PID -> force -> compensation -> attitude and thrust -> throttle.

    `dt` is the time since the last tick, s; `ground_down_m` the height of the ground, NED. State and setpoint are NED.
    `memory` and the memory of the output carry the controller's state. With `actuation: full` the attitude is level as
    far as the tilted rotors reach, and the force goes out in three dimensions of the present body.

    `setpoint` is the reference at the time of `state`, `preview` the one when the vehicle will have followed its
    target; None: the same.
    """
    ahead, horizon_s, rise_share, easing = preview or Preview(setpoint)
    expected, coming = setpoint.acceleration_ned_m_s2, ahead.acceleration_ned_m_s2
    feed_forward = (coming[0], coming[1], between(expected, coming, rise_share)[2])
    velocity_sp = velocity_setpoint(setpoint, state.position_ned_m, settings, easing)
    acceleration, velocity_memory = acceleration_setpoint(
        velocity_sp,
        state.velocity_ned_m_s,
        feed_forward,
        memory.velocity,
        dt,
        settings,
        expected,
        easing,
        setpoint.velocity_ned_m_s,
    )
    # Gravity is fed forward: the integrator must not have to find the weight, only what is wrong with it.
    m, factor = vehicle.mass_kg, thrust_factor(memory.velocity.integral_m_s2, settings)
    wanted: Vec3 = (m * acceleration[0], m * acceleration[1], m * (acceleration[2] - GRAVITY_M_S2))
    motion = Motion(state.position_ned_m, state.velocity_ned_m_s)
    if settings.effects_at == "reference" and compensator.model.stack:
        motion = expected_motion(motion, setpoint, ahead, horizon_s)
    here = compensator.surroundings(state, ground_down_m, motion)
    previous_thrust_n = vehicle.weight_n if memory.thrust_n is None else memory.thrust_n
    side_force = fx, fy, fz = compensator.force_ned_n(here, previous_thrust_n)
    # The acceleration was limited, but what compensation adds may lean further, or even point down.
    net = limit_tilt((wanted[0] - fx, wanted[1] - fy, wanted[2] - fz), math.radians(settings.max_tilt_deg))
    rotor_force = scaled(factor, net)
    full = settings.actuation == "full"
    axis = upright_axis(rotor_force, vehicle.allocation) if full else rotor_force
    attitude = attitude_for_force(axis, setpoint.yaw_rad)
    rotor_thrust_n = thrust_along_body(rotor_force, state.attitude) / vehicle.axial_share
    ratio = compensator.thrust_ratio(here, rotor_thrust_n)
    throttle = throttle_for_thrust(rotor_thrust_n / ratio, vehicle, settings.min_throttle, settings.max_throttle)
    lateral = lateral_n = None
    if full:
        # Effects on thrust act on each rotor: its lateral part changes by the same ratio as its part along the axis.
        x_n, y_n = lateral_in_body(rotor_force, state.attitude, vehicle.allocation)
        lateral = lateral_throttle((x_n / ratio, y_n / ratio), vehicle)
        lateral_n = lateral_in_body(scaled(factor, wanted), state.attitude, vehicle.allocation)
    return ControlOutput(
        AttitudeTarget(attitude, throttle, lateral),
        factor * thrust_along_body(wanted, state.attitude),
        Compensation(ratio, side_force, here.trust),
        velocity_sp,
        acceleration,
        Memory(velocity_memory, rotor_thrust_n),
        lateral_n,
    )


def expected_motion(now: Motion, here: Setpoint, ahead: Setpoint, horizon_s: float) -> Motion:
    """Motion at which effects are evaluated: the present place, and the velocity of `horizon_s` from `now`.

    That velocity is the reference's as far as the vehicle follows it, else its present one; `here` is the reference of
    now, and `ahead` that of then. The force to the side needs the attitude's time, but the thrust, on which effects of
    the place act, follows within that of the rotors.
    """
    position, velocity = now.position_ned_m, now.velocity_ned_m_s
    n, e, d = ahead.position_ned_m
    free = _along(position, velocity, horizon_s)
    target = (free[0] if math.isnan(n) else n, free[1] if math.isnan(e) else e, free[2] if math.isnan(d) else d)
    off_m, off_m_s = math.dist(target, free), math.dist(here.velocity_ned_m_s, velocity)
    share = max(0.0, 1.0 - (off_m / NEAR_M) ** 2 - (off_m_s / NEAR_M_S) ** 2)
    return Motion(position, between(velocity, ahead.velocity_ned_m_s, share))


def _along(position: Vec3, velocity: Vec3, time_s: float) -> Vec3:
    (x, y, z), (u, v, w) = position, velocity
    return x + time_s * u, y + time_s * v, z + time_s * w


def between(a: Vec3, b: Vec3, share: float) -> Vec3:
    """Vector from `a` at a share of 0 to `b` at a share of 1."""
    return a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]), a[2] + share * (b[2] - a[2])
