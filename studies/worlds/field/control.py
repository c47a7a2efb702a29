"""Controllers of a batch: geometric, LQR-like and incremental (INDI) position and attitude control."""

from dataclasses import dataclass

import numpy as np

from studies.worlds.field.arrays import GRAVITY_M_S2, Floats, cross, rotate, rotate_back
from studies.worlds.field.cases import Case


@dataclass
class Estimate:
    """Estimated state that the controllers see, NED and FRD, one row per flight."""

    position_m: Floats
    velocity_m_s: Floats
    accel_m_s2: Floats
    attitude: Floats
    rates_rad_s: Floats
    rate_change_rad_s2: Floats
    """Filtered angular acceleration."""
    thrust_n: Floats
    """Total thrust that the autopilot computes from rotor speeds, with the same filter."""
    moment_n_m: Floats


class Controllers:
    """Controllers of all flights of a batch, with their gains and integrators."""

    def __init__(self, cases: list[Case], rotors: int) -> None:
        """Set gains and allocation matrices; `cases` holds the case of each flight."""
        control = [case.control for case in cases]
        count = len(cases)
        self._geometric = np.array([c.kind == "geometric" for c in control])
        self._incremental = np.array([c.kind == "indi" for c in control])
        self._mass = np.array([case.beliefs.mass_kg for case in cases])
        self._coefficient = np.array([case.beliefs.thrust_n_per_rpm2 for case in cases])
        self._inertia = np.stack([case.beliefs.inertia_kg_m2 for case in cases])
        self._rate_gain = np.array([c.rate_gain for c in control])[:, None] * np.array([1.0, 1.0, 0.45])
        self._attitude_gain = np.array([c.attitude_gain for c in control])[:, None] * np.array([1.0, 1.0, 0.5])
        bandwidth = np.array([[c.flat_bandwidth, c.flat_bandwidth, c.up_bandwidth] for c in control])
        damping = np.array([c.damping for c in control])[:, None]
        self._position_gain = bandwidth**2
        self._velocity_gain = 2.0 * damping * bandwidth
        self._integral_gain = bandwidth**2 / np.array([c.integral_time_s for c in control])[:, None]
        self._integral_gain[self._incremental] = 0.0
        self._feedforward = np.array([[c.feedforward, c.feedforward, 1.0] for c in control])
        self._flat_limit = GRAVITY_M_S2 * np.tan(np.array([c.max_tilt_rad for c in control]))
        self._inner_hz = np.array([c.inner_hz for c in control])
        self._outer_hz = np.array([c.outer_hz for c in control])
        self._max_thrust = np.array([case.vehicle.max_thrust_n for case in cases])
        self._rotors = np.array([case.vehicle.rotors for case in cases])
        self._allocation = np.zeros((count, rotors, 4))
        for row, case in enumerate(cases):
            vehicle = case.vehicle
            mixing = np.stack(
                [
                    np.ones(vehicle.rotors),
                    -vehicle.positions_m[:, 1],
                    vehicle.positions_m[:, 0],
                    vehicle.yaw_signs * vehicle.torque_to_thrust_m,
                ]
            )
            self._allocation[row, : vehicle.rotors] = np.linalg.pinv(mixing)
        self._present = np.arange(rotors)[None] < self._rotors[:, None]
        self._integral = np.zeros((count, 3))
        self._force = np.tile([0.0, 0.0, -GRAVITY_M_S2], (count, 1))
        self.thrust_n = self._mass * GRAVITY_M_S2
        self.rotor_thrust_n = np.where(self._present, (self.thrust_n / self._rotors)[:, None], 0.0)
        self.tilt_setpoint = np.tile([0.0, 0.0, 1.0], (count, 1))

    def preload(self, accel_m_s2: Floats) -> None:
        """Start the integrators at a known steady error, as an autopilot that has flown before does."""
        self._integral[:] = np.where(self._incremental[:, None], 0.0, accel_m_s2)

    def outer(
        self, step: int, step_hz: int, estimate: Estimate, position: Floats, velocity: Floats, accel: Floats
    ) -> None:
        """Update the wanted specific force of the flights whose position loop is due."""
        due = step % (step_hz // self._outer_hz) == 0
        if not due.any():
            return
        seconds = 1.0 / self._outer_hz[:, None]
        error = position - estimate.position_m
        limit = 2.5 * self._velocity_gain / self._position_gain
        wanted = (
            self._position_gain * np.clip(error, -limit, limit)
            + self._velocity_gain * (velocity - estimate.velocity_m_s)
            + self._feedforward * accel
        )
        integral = np.clip(self._integral + self._integral_gain * error * seconds, -4.0, 4.0)
        self._integral = np.where(due[:, None], integral, self._integral)
        # Incremental control adds the wanted change of acceleration to the thrust that acts now.
        acting = -estimate.thrust_n[:, None] / self._mass[:, None] * estimate.attitude[:, :, 2]
        increment = acting + wanted - estimate.accel_m_s2
        steady = wanted + self._integral
        steady[:, 2] -= GRAVITY_M_S2
        force = np.where(self._incremental[:, None], increment, steady)
        force[:, 2] = np.clip(force[:, 2], -1.7 * GRAVITY_M_S2, -0.35 * GRAVITY_M_S2)
        flat = np.hypot(force[:, 0], force[:, 1])
        allowed = np.minimum(self._flat_limit, 0.8 * -force[:, 2])
        shrink = np.minimum(1.0, allowed / np.maximum(flat, 1e-9))
        force[:, :2] *= shrink[:, None]
        self._force = np.where(due[:, None], force, self._force)
        size = np.sqrt(np.sum(self._force**2, axis=1))
        self.tilt_setpoint = -self._force / size[:, None]

    def inner(self, step: int, step_hz: int, estimate: Estimate, yaw: Floats) -> None:
        """Update the wanted thrust of each rotor of the flights whose rate loop is due."""
        due = step % (step_hz // self._inner_hz) == 0
        if not due.any():
            return
        attitude, rates = estimate.attitude, estimate.rates_rad_s
        down = self.tilt_setpoint
        # Geometric: the whole attitude error on SO(3), with heading.
        ahead = np.stack([np.cos(yaw), np.sin(yaw), np.zeros_like(yaw)], axis=1)
        right = cross(down, ahead)
        right /= np.sqrt(np.sum(right**2, axis=1))[:, None]
        wanted = np.stack([cross(right, down), right, down], axis=2)
        relative = np.matmul(np.swapaxes(wanted, 1, 2), attitude)
        whole = 0.5 * np.stack(
            [
                relative[:, 1, 2] - relative[:, 2, 1],
                relative[:, 2, 0] - relative[:, 0, 2],
                relative[:, 0, 1] - relative[:, 1, 0],
            ],
            axis=1,
        )
        # Reduced attitude: tilt first, heading apart from it.
        tilt = rotate_back(attitude, cross(attitude[:, :, 2], down))
        turn = np.arctan2(attitude[:, 1, 0], attitude[:, 0, 0]) - yaw
        reduced = tilt.copy()
        reduced[:, 2] = -((turn + np.pi) % (2.0 * np.pi) - np.pi)
        error = np.where(self._geometric[:, None], whole, reduced)
        rate_setpoint = np.clip(self._attitude_gain * error, -4.0, 4.0)
        angular = self._rate_gain * (rate_setpoint - rates)
        direct = self._inertia * angular + cross(rates, self._inertia * rates)
        increment = estimate.moment_n_m + self._inertia * (angular - estimate.rate_change_rad_s2)
        moment = np.where(self._incremental[:, None], increment, direct)
        thrust = -self._mass * np.sum(self._force * attitude[:, :, 2], axis=1)
        thrust = np.clip(thrust, 0.25 * self._mass * GRAVITY_M_S2, 0.92 * self._rotors * self._max_thrust)
        turning = rotate(self._allocation[:, :, 1:], moment)
        # Keep the moment and give up collective thrust where a rotor would saturate.
        base = thrust[:, None] * self._allocation[:, :, 0]
        room = np.minimum(base - 0.03 * self._max_thrust[:, None], self._max_thrust[:, None] - base)
        room = np.maximum(room, 0.1 * self._max_thrust[:, None])
        excess = np.max(np.where(self._present, np.abs(turning) / room, 0.0), axis=1)
        turning /= np.maximum(excess, 1.0)[:, None]
        rotors = np.clip(base + turning, 0.02 * self._max_thrust[:, None], self._max_thrust[:, None])
        self.rotor_thrust_n = np.where(due[:, None] & self._present, rotors, self.rotor_thrust_n)
        self.thrust_n = np.where(due, thrust, self.thrust_n)

    def speeds_rpm(self) -> Floats:
        """Rotor speeds that give the wanted thrusts by the thrust coefficient that the autopilot knows, (N, n)."""
        return np.asarray(np.sqrt(self.rotor_thrust_n / self._coefficient[:, None]))
