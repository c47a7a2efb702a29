"""Attitude and rate control of the simulated autopilot, after PX4's: quaternion P, rate PI, control allocation."""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from quadctl.frames import multiply
from quadctl.sitl.vehicle.body import STEP_S
from quadctl.state import Quat, Vec3
from quadctl.vehicle import AxisResponse, Vehicle

MAX_RATE_RAD_S = (3.8, 3.8, 3.5)
LOOP_S = 2.0 * STEP_S
"""Period of the attitude loop; the rate loop runs at every step of the physics."""


@dataclass(frozen=True)
class Gains:
    """Gains of the two loops, for roll, pitch and yaw."""

    attitude_p: Vec3
    """1/s."""
    rate_p: Vec3
    """Angular acceleration per rate error, 1/s."""
    rate_i: Vec3
    """1/s^2."""
    max_integral_rad_s2: float


PX4 = Gains((6.5, 6.5, 2.8), (20.0, 20.0, 6.0), (25.0, 25.0, 6.0), 12.0)
"""Attitude: PX4's MC_ROLL_P, MC_PITCH_P, MC_YAW_P."""


class AttitudeModel:
    """Reference model of an attitude loop: target, delayed, through a second order, with rates and their change."""

    def __init__(self, response: AxisResponse, dt: float) -> None:
        self._square, self._damping = response.frequency_rad_s**2, 2.0 * response.damping * response.frequency_rad_s
        self._dt = dt
        self._targets: deque[Quat] = deque(maxlen=1 + round(response.delay_s / dt))
        self.attitude: Quat = (1.0, 0.0, 0.0, 0.0)
        self.rates: Vec3 = (0.0, 0.0, 0.0)
        self.acceleration: Vec3 = (0.0, 0.0, 0.0)

    def start(self, attitude: Quat) -> None:
        """Rest at `attitude`."""
        self._targets.clear()
        self.attitude, self.rates, self.acceleration = attitude, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)

    def step(self, target: Quat) -> None:
        """Advance toward `target`, which arrives now."""
        self._targets.append(target)
        x, y, z = turn_between(self.attitude, self._targets[0])
        (p, q, r), (mx, my, mz) = self.rates, MAX_RATE_RAD_S
        square, damping, dt = self._square, self._damping, self._dt
        self.acceleration = ax, ay, az = square * x - damping * p, square * y - damping * q, square * z - damping * r
        self.rates = p, q, r = within(p + ax * dt, mx), within(q + ay * dt, my), within(r + az * dt, mz)
        w, x, y, z = multiply(self.attitude, (1.0, 0.5 * dt * p, 0.5 * dt * q, 0.5 * dt * r))
        norm = 1.0 / math.sqrt(w * w + x * x + y * y + z * z)
        self.attitude = (w * norm, x * norm, y * norm, z * norm)


class InnerLoops:
    """Controller from attitude target and throttle to motor outputs, with the state of its rate integrator.

    With a `response` the attitude follows a reference model with that answer, as in PX4 from May 2026 on.
    """

    def __init__(self, vehicle: Vehicle, response: AxisResponse | None = None, gains: Gains = PX4) -> None:
        self._gains = gains
        self._model = AttitudeModel(response, LOOP_S) if response is not None else None
        self._acceleration: Vec3 = (0.0, 0.0, 0.0)
        self._inertia = vehicle.principal_inertia_kg_m2
        self._output_per_newton = vehicle.throttle.per_newton * vehicle.n_rotors
        rows = zip(allocation(vehicle), vehicle.allocation.lateral_mix, strict=True)
        self._rows = [(*of_torque, *of_lateral) for of_torque, of_lateral in rows]
        self.max_integral_rad_s2 = gains.max_integral_rad_s2
        self.integral: Vec3 = (0.0, 0.0, 0.0)

    def reset(self) -> None:
        self.integral = (0.0, 0.0, 0.0)

    def rate_setpoint(self, target: Quat, attitude: Quat, airborne: bool = True) -> Vec3:
        """Rates that turn the vehicle toward `target` along the shortest way, limited; once every LOOP_S."""
        model = self._model
        if model is None:
            return self._limited_rates((0.0, 0.0, 0.0), turn_between(attitude, target))
        if airborne:
            model.step(target)
        else:
            model.start(attitude)
        self._acceleration = model.acceleration
        return self._limited_rates(model.rates, turn_between(attitude, model.attitude))

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
        (p_roll, p_pitch, p_yaw), (i_roll, i_pitch, i_yaw) = self._gains.rate_p, self._gains.rate_i
        roll, pitch, yaw = rate_sp[0] - rates[0], rate_sp[1] - rates[1], rate_sp[2] - rates[2]
        kept_roll = kept_pitch = kept_yaw = 0.0
        if airborne:
            most, (x, y, z) = self.max_integral_rad_s2, self.integral
            kept_roll = within(x + i_roll * roll * dt, most)
            kept_pitch = within(y + i_pitch * pitch * dt, most)
            kept_yaw = within(z + i_yaw * yaw * dt, most)
        self.integral = (kept_roll, kept_pitch, kept_yaw)
        (ix, iy, iz), (ax, ay, az), per_newton = self._inertia, self._acceleration, self._output_per_newton
        tx = ix * (p_roll * roll + kept_roll + ax)
        ty = iy * (p_pitch * pitch + kept_pitch + ay)
        tz = iz * (p_yaw * yaw + kept_yaw + az)
        forward, right = lateral or (0.0, 0.0)
        outputs = [
            throttle + per_newton * (a * tx + b * ty + c * tz) + forward * x + right * y for a, b, c, x, y in self._rows
        ]
        return [0.0 if output < 0.0 else 1.0 if output > 1.0 else output for output in outputs]

    def _limited_rates(self, ahead: Vec3, off: Vec3) -> Vec3:
        """Rates `ahead` and those that take away the turn `off`, limited."""
        px, py, pz = self._gains.attitude_p
        mx, my, mz = MAX_RATE_RAD_S
        return (
            within(ahead[0] + px * off[0], mx),
            within(ahead[1] + py * off[1], my),
            within(ahead[2] + pz * off[2], mz),
        )


def within(value: float, most: float) -> float:
    """`value` limited to -`most` .. `most`; two calls of `min` and `max` take longer."""
    return -most if value < -most else most if value > most else value


def turn_between(attitude: Quat, target: Quat) -> Vec3:
    """Turn from `attitude` to `target` along the shortest way, body axes, rad; small angles."""
    w, x, y, z = attitude
    ew, ex, ey, ez = multiply((w, -x, -y, -z), target)
    sign = 2.0 if ew >= 0.0 else -2.0
    return sign * ex, sign * ey, sign * ez


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
