"""Attitude and rate control of the simulated autopilot, after PX4's: quaternion P, rate PI, control allocation."""

import math

import numpy as np

from quadctl.frames import multiply
from quadctl.state import Quat, Vec3
from quadctl.vehicle import Vehicle

ATTITUDE_P = (6.5, 6.5, 2.8)
"""Gains of the attitude loop, 1/s: PX4's MC_ROLL_P, MC_PITCH_P, MC_YAW_P."""
RATE_P = (20.0, 20.0, 6.0)
"""Gains of the rate loop, 1/s: angular acceleration per rate error."""
RATE_I = (25.0, 25.0, 6.0)
"""Integral gains of the rate loop, 1/s^2."""
MAX_RATE_RAD_S = (3.8, 3.8, 3.5)
MAX_INTEGRAL_RAD_S2 = 12.0


class InnerLoops:
    """Controller from attitude target and throttle to motor outputs, with the state of its rate integrator."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._inertia = vehicle.principal_inertia_kg_m2
        self._curve = vehicle.throttle
        self._n = vehicle.n_rotors
        self._allocation = allocation(vehicle)
        self._lateral_mix = vehicle.allocation.lateral_mix
        self.max_integral_rad_s2 = MAX_INTEGRAL_RAD_S2
        self.integral: Vec3 = (0.0, 0.0, 0.0)

    def reset(self) -> None:
        self.integral = (0.0, 0.0, 0.0)

    def rate_setpoint(self, target: Quat, attitude: Quat) -> Vec3:
        """Rates that turn the vehicle toward `target` along the shortest way, limited."""
        w, x, y, z = attitude
        ew, ex, ey, ez = multiply((w, -x, -y, -z), target)
        sign = 2.0 if ew >= 0.0 else -2.0
        px, py, pz = ATTITUDE_P
        mx, my, mz = MAX_RATE_RAD_S
        return (
            min(max(sign * px * ex, -mx), mx),
            min(max(sign * py * ey, -my), my),
            min(max(sign * pz * ez, -mz), mz),
        )

    def motor_outputs(
        self,
        rate_sp: Vec3,
        rates: Vec3,
        throttle: float,
        dt: float,
        airborne: bool,
        lateral: tuple[float, float] | None = None,
    ) -> list[float]:
        """Motor outputs 0..1 that give the thrust of throttle and lateral throttle, and the torque of the rate loop."""
        torque = []
        integral = []
        for i in range(3):
            error = rate_sp[i] - rates[i]
            total = self.integral[i] + RATE_I[i] * error * dt if airborne else 0.0
            total = min(max(total, -self.max_integral_rad_s2), self.max_integral_rad_s2)
            integral.append(total)
            torque.append(self._inertia[i] * (RATE_P[i] * error + total))
        self.integral = (integral[0], integral[1], integral[2])
        per_thrust = self._curve.per_newton * self._n
        tx, ty, tz = torque
        forward, right = lateral or (0.0, 0.0)
        return [
            min(max(throttle + per_thrust * (a * tx + b * ty + c * tz) + forward * x + right * y, 0.0), 1.0)
            for (a, b, c), (x, y) in zip(self._allocation, self._lateral_mix, strict=True)
        ]


def allocation(vehicle: Vehicle) -> list[tuple[float, float, float]]:
    """Thrust of each rotor, N, per torque about body x, y, z, N m: pseudo-inverse of the rotors' geometry.

    The fourth row asks for no change in total thrust along the body axis; with full actuation, two more ask for no
    lateral force.
    """
    if vehicle.allocation.fully_actuated:
        return [(float(a), float(b), float(c)) for a, b, c in vehicle.allocation.inverse[:, 3:]]
    arms = zip(vehicle.rotors, vehicle.moment_arms_m, strict=True)
    columns = [[*arm, -rotor.axis[2]] for rotor, arm in arms]
    inverse = np.linalg.pinv(np.array(columns).T)
    return [(float(a), float(b), float(c)) for a, b, c, _ in inverse]


def level_with_yaw(attitude: Quat) -> Quat:
    """Level attitude with the heading of `attitude`."""
    w, x, y, z = attitude
    yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw)
