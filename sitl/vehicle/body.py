"""The simulated vehicle: rigid body, rotors with lag, battery, ground. Motor outputs 0..1 in, motion out.

Plain floats, because at 500 Hz a step must take some microseconds. Effects are those of a `Model`, the same code that
predicts and compensates.
"""

import math
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

from quadctl.frames import rotate, rotate_inverse
from quadctl.model import Model, conditions
from quadctl.state import Quat, Vec3
from quadctl.surfaces import Place

STEP_S = 0.002
"""Physics step: 500 Hz."""

REST_HEIGHT_M = 0.05
"""Height of the logged body point when the vehicle stands on its legs."""

IDLE_RPM = 1000.0
"""Rotor speed of an armed motor at zero output."""


class Motion(NamedTuple):
    """True state at one instant, NED/FRD."""

    time_s: float
    position_ned_m: Vec3
    velocity_ned_m_s: Vec3
    attitude: Quat
    rates_rad_s: Vec3
    rotor_rpm: tuple[float, ...]
    battery_v: float


class Battery:
    """Four-cell pack: open-circuit voltage falls with the charge drawn, terminal voltage with the current too."""

    FULL_V, EMPTY_V, CHARGE_C, RESISTANCE_OHM = 16.8, 14.0, 5000 * 3.6, 0.02
    AMPERE_PER_WATT = 1.0 / 15.5
    REFERENCE_V = 16.0
    """Voltage at which a motor output gives the thrust of the vehicle file's throttle curve."""

    def __init__(self) -> None:
        self.drawn_c = 0.0
        self.resting_v = self.FULL_V
        """Voltage without a load."""
        self.voltage_v = self.FULL_V

    def draw(self, power_w: float, dt: float) -> None:
        current_a = power_w * self.AMPERE_PER_WATT
        self.drawn_c += current_a * dt
        self.resting_v = self.FULL_V - (self.FULL_V - self.EMPTY_V) * min(self.drawn_c / self.CHARGE_C, 1.0)
        self.voltage_v = self.resting_v - self.RESISTANCE_OHM * current_a


class SimulatedBody:
    """A vehicle in the world of `truth`, standing on the ground at the origin."""

    def __init__(self, truth: Model, yaw_rad: float = 0.0, ground: Place | None = None) -> None:
        self.truth = truth
        self._ground = ground
        vehicle = truth.vehicle
        self.vehicle = vehicle
        self.time_s = 0.0
        self.position: Vec3 = (0.0, 0.0, -REST_HEIGHT_M)
        self.velocity: Vec3 = (0.0, 0.0, 0.0)
        self.attitude: Quat = (math.cos(0.5 * yaw_rad), 0.0, 0.0, math.sin(0.5 * yaw_rad))
        self.rates: Vec3 = (0.0, 0.0, 0.0)
        self.rpm = [0.0] * vehicle.n_rotors
        self.battery = Battery()
        self.in_contact = True
        self._inertia = vehicle.principal_inertia_kg_m2
        torque = vehicle.rotor.thrust_n_per_rpm2 * vehicle.rotor.torque_to_thrust_m
        self._watts_per_rpm3 = torque * (math.pi / 30.0) * 1.6  # electrical over mechanical
        self._stopped: tuple[float | None, ...] = (None,) * vehicle.n_rotors
        self._commands: deque[Sequence[float | None]] = deque(
            [self._stopped] * round(vehicle.rotor.delay_s / STEP_S), maxlen=1 + round(vehicle.rotor.delay_s / STEP_S)
        )
        self._before_n: list[float] | None = None
        """Nominal thrust of each rotor one step ago, where the truth depends on its change."""
        self._output_per_newton = vehicle.throttle.per_newton * vehicle.n_rotors
        lag = vehicle.rotor.time_constant_s
        self._rotor_share = 1.0 if lag < 1e-6 else 1.0 - math.exp(-STEP_S / lag)

    def motion(self) -> Motion:
        rpm, volts = tuple(self.rpm), self.battery.voltage_v
        return Motion(self.time_s, self.position, self.velocity, self.attitude, self.rates, rpm, volts)

    def step(self, outputs: list[float], armed: bool) -> None:
        """Advance by STEP_S; `outputs` are the motor outputs, 0..1."""
        self._commands.append(outputs if armed else self._stopped)
        self._before_n = self._nominal_n() if self.truth.needs_thrust_rate else None
        self._turn_rotors(self._commands[0])
        force_body, torque = self._force_and_torque()
        fx, fy, fz = rotate(self.attitude, force_body)
        fz += self.vehicle.weight_n
        contact = self._contact_force()
        self.in_contact = contact is not None
        if contact is not None:
            fx, fy, fz = fx + contact[0], fy + contact[1], fz + contact[2]
            torque = self._levelled(torque)
        m, dt = self.vehicle.mass_kg, STEP_S
        vx, vy, vz = self.velocity
        # Semi-implicit Euler: velocity first, then position with the new velocity; stable with the ground's spring.
        vx, vy, vz = vx + fx / m * dt, vy + fy / m * dt, vz + fz / m * dt
        x, y, z = self.position
        self.velocity = (vx, vy, vz)
        self.position = (x + vx * dt, y + vy * dt, z + vz * dt)
        self._turn_body(torque)
        self.time_s += dt

    def step_on_stand(self, rotor: int, output: float) -> None:
        """Advance by STEP_S with the vehicle fixed and only one rotor driven."""
        outputs = list(self._stopped)
        outputs[rotor] = output
        self._turn_rotors(outputs)
        self.time_s += STEP_S

    def motor_current_a(self, rpm: Sequence[float]) -> tuple[float, ...]:
        """Current of each motor, A, at these rotor speeds."""
        return tuple(self._watts_per_rpm3 * r**3 * Battery.AMPERE_PER_WATT for r in rpm)

    def _turn_rotors(self, outputs: Sequence[float | None]) -> None:
        """Advance the rotor speeds by STEP_S. An output of None stops a motor; at an output of 0 it idles."""
        vehicle, rpm, share, per_newton = self.vehicle, self.rpm, self._rotor_share, self._output_per_newton
        k, offset = vehicle.rotor.thrust_n_per_rpm2, vehicle.throttle.offset
        # Rotor speed follows the voltage: half of a change shows, the rest is the load line of the motor.
        scale = 1.0 + 0.5 * (self.battery.voltage_v / Battery.REFERENCE_V - 1.0)
        power = 0.0
        for i, output in enumerate(outputs):
            wanted = 0.0
            if output is not None:
                thrust = (output - offset) / per_newton
                wanted = math.sqrt(thrust / k) * scale if thrust > 0.0 else 0.0
                wanted = IDLE_RPM if wanted < IDLE_RPM else wanted
            rpm[i] = turned = rpm[i] + share * (wanted - rpm[i])
            power += turned**3
        self.battery.draw(power * self._watts_per_rpm3, STEP_S)

    def _nominal_n(self) -> list[float]:
        k = self.vehicle.rotor.thrust_n_per_rpm2
        return [k * rpm * rpm for rpm in self.rpm]

    def _force_and_torque(self) -> tuple[Vec3, Vec3]:
        vehicle, truth = self.vehicle, self.truth
        thrusts = self._nominal_n()
        if not truth.stack:
            return vehicle.rotor_force(thrusts), vehicle.rotor_torque(thrusts)
        north, east, down = self.position
        velocity_body = rotate_inverse(self.attitude, self.velocity)
        volts, place, rates = self.battery.voltage_v, self._ground, self.rates
        before = self._before_n
        change = () if before is None else [(n - b) / STEP_S for n, b in zip(thrusts, before, strict=True)]
        c = conditions(
            vehicle, -down, velocity_body, self.attitude, self.time_s, volts, (north, east), place, rates, change
        )
        return truth.loads(thrusts, c)

    def _contact_force(self) -> Vec3 | None:
        """Spring, damper and friction of the legs; None in the air."""
        depth = self.position[2] + REST_HEIGHT_M
        if depth <= 0.0:
            return None
        m = self.vehicle.mass_kg
        vx, vy, vz = self.velocity
        push = max(0.0, m * (3000.0 * depth + 60.0 * vz))
        grip = 20.0 * m * min(1.0, push / self.vehicle.weight_n)
        return -grip * vx, -grip * vy, -push

    def _levelled(self, torque: Vec3) -> Vec3:
        """Moment with that of the legs, which hold the vehicle level."""
        roll_axis, pitch_axis, _ = rotate_inverse(self.attitude, (0.0, 0.0, 1.0))
        ix, iy, iz = self._inertia
        p, q, r = self.rates
        return (
            torque[0] - ix * (300.0 * pitch_axis + 30.0 * p),
            torque[1] + iy * (300.0 * roll_axis - 30.0 * q),
            torque[2] - iz * 10.0 * r,
        )

    def _turn_body(self, torque: Vec3) -> None:
        ix, iy, iz = self._inertia
        p, q, r = self.rates
        dt = STEP_S
        p, q, r = (
            p + dt * (torque[0] - (iz - iy) * q * r) / ix,
            q + dt * (torque[1] - (ix - iz) * r * p) / iy,
            r + dt * (torque[2] - (iy - ix) * p * q) / iz,
        )
        self.rates = (p, q, r)
        w, x, y, z = self.attitude
        h = 0.5 * dt
        w, x, y, z = (
            w - h * (x * p + y * q + z * r),
            x + h * (w * p + y * r - z * q),
            y + h * (w * q + z * p - x * r),
            z + h * (w * r + x * q - y * p),
        )
        norm = 1.0 / math.sqrt(w * w + x * x + y * y + z * z)
        self.attitude = (w * norm, x * norm, y * norm, z * norm)
