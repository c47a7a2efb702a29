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
from quadctl.control.settings import ControllerSettings
from quadctl.control.throttle import lateral_throttle, throttle_for_thrust
from quadctl.control.velocity import VelocityMemory, acceleration_setpoint, velocity_setpoint
from quadctl.frames import GRAVITY_M_S2
from quadctl.state import AttitudeTarget, Setpoint, Vec3, VehicleState
from quadctl.vehicle import Vehicle


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
) -> ControlOutput:
    """Compute one tick: position P -> velocity PID -> force -> compensation -> attitude and thrust -> throttle.

    `dt` is the time since the last tick, s; `ground_down_m` the height of the ground, NED. State and setpoint are NED.
    `memory` and the memory of the output carry the controller's state. With `actuation: full` the attitude is level as
    far as the tilted rotors reach, and the force goes out in three dimensions of the present body.
    """
    velocity_sp = velocity_setpoint(setpoint, state.position_ned_m, settings)
    acceleration, velocity_memory = acceleration_setpoint(
        velocity_sp, state.velocity_ned_m_s, setpoint.acceleration_ned_m_s2, memory.velocity, dt, settings
    )
    # Gravity is fed forward: the integrator must not have to find the weight.
    m = vehicle.mass_kg
    wanted: Vec3 = (m * acceleration[0], m * acceleration[1], m * (acceleration[2] - GRAVITY_M_S2))
    here = compensator.surroundings(state, ground_down_m)
    previous_thrust_n = vehicle.weight_n if memory.thrust_n is None else memory.thrust_n
    side_force = fx, fy, fz = compensator.force_ned_n(here, previous_thrust_n)
    # The acceleration was limited, but what compensation adds may lean further, or even point down.
    rotor_force = limit_tilt((wanted[0] - fx, wanted[1] - fy, wanted[2] - fz), math.radians(settings.max_tilt_deg))
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
        lateral_n = lateral_in_body(wanted, state.attitude, vehicle.allocation)
    return ControlOutput(
        AttitudeTarget(attitude, throttle, lateral),
        thrust_along_body(wanted, state.attitude),
        Compensation(ratio, side_force, here.trust),
        velocity_sp,
        acceleration,
        Memory(velocity_memory, rotor_thrust_n),
        lateral_n,
    )
