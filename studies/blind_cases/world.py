"""A world that hides something: the simulated body with forces, moments and faults that the catalogue did not write.

Nothing of `quadctl.effects` is used here. A truth acts on one instant of one physics step, in plain floats, and each
rotor has its own place, height and coefficient.
"""

import math
import random
from collections.abc import Sequence
from typing import ClassVar

from quadctl.frames import rotate, rotate_inverse
from quadctl.model import Model
from quadctl.sitl.vehicle.body import IDLE_RPM, STEP_S, SimulatedBody
from quadctl.state import Quat, Vec3
from quadctl.vehicle import Vehicle

from .nuisances import Nuisances


class Instant:
    """State of the world at one physics step; a truth may change `thrusts`, and call `push` and `turn`."""

    __slots__ = ("air_velocity", "attitude", "force", "heights", "position", "rpm", "thrusts", "time_s", "torque")

    def __init__(self, body: "HiddenBody", thrusts: list[float], air_velocity: Vec3) -> None:
        self.time_s = body.time_s
        self.position = body.position
        """NED."""
        self.attitude: Quat = body.attitude
        self.air_velocity = air_velocity
        """Velocity of the body relative to the air, FRD."""
        self.rpm: Sequence[float] = body.rpm
        self.thrusts = thrusts
        """Thrust of each rotor, N."""
        self.heights: list[float] = body.rotor_heights()
        """Height of each rotor above the ground below it, m."""
        self.force = [0.0, 0.0, 0.0]
        self.torque = [0.0, 0.0, 0.0]

    def push(self, x: float, y: float, z: float) -> None:
        """A force on the centre of mass, FRD, N."""
        force = self.force
        force[0] += x
        force[1] += y
        force[2] += z

    def push_ned(self, north: float, east: float, down: float) -> None:
        self.push(*rotate_inverse(self.attitude, (north, east, down)))

    def turn(self, x: float, y: float, z: float) -> None:
        """A moment, FRD, N m."""
        torque = self.torque
        torque[0] += x
        torque[1] += y
        torque[2] += z


class Truth:
    """Hidden physics of a world. Strength 1 is that of real vehicles; 0 is none."""

    family: ClassVar[str] = ""
    """Family in the catalogue; "" for physics that no effect of it describes."""
    nameless: ClassVar[bool] = False
    """True of a wrong number of the vehicle file that no effect corrects: right is an answer without a name."""
    also: ClassVar[tuple[str, ...]] = ()
    """Families that are really there besides, so that naming them after `family` is no mistake."""

    def __init__(self, vehicle: Vehicle, strength: float, chance: random.Random) -> None:
        """`chance` draws what is free: directions, times, which rotor."""
        self.vehicle = vehicle
        self.strength = strength
        self.hover_n = vehicle.weight_n / vehicle.n_rotors
        self.hover_rpm = math.sqrt(self.hover_n / vehicle.rotor.thrust_n_per_rpm2)

    def enter(self, body: "HiddenBody") -> None:
        """Change the body before the flight."""

    def wind(self, time_s: float) -> Vec3:
        """Velocity of the air, NED."""
        return 0.0, 0.0, 0.0

    def act(self, now: Instant) -> None:
        """Change thrusts and forces of one step."""

    def mass_kg(self, time_s: float) -> float:
        """Mass that the vehicle carries beyond that of its file."""
        return 0.0

    def parameters(self) -> dict[str, dict[str, float]]:
        """True parameters in the catalogue's words, by effect; empty where the truth has another form."""
        return {}


class HiddenBody(SimulatedBody):
    """A vehicle in a world of `truths`, with the coefficients and gusts of `nuisances`."""

    def __init__(self, vehicle: Vehicle, truths: Sequence[Truth], nuisances: Nuisances) -> None:
        super().__init__(Model(vehicle))
        self.truths = tuple(truths)
        self.nuisances = nuisances
        self.gust = nuisances.gusts()
        n = vehicle.n_rotors
        self.axes: list[Vec3] = [rotor.axis for rotor in vehicle.rotors]
        self.lag_s = (vehicle.rotor.time_constant_s, vehicle.rotor.time_constant_s)
        """Time constants of a rotor that speeds up, and of one that slows down."""
        self.voltage_exponent = 0.0
        """Exponent of the voltage in the rotor speed at a given output; 0: speed controllers compensate the voltage."""
        self.file_vehicle = vehicle
        self.file_rpm = [0.0] * n
        """Rotor speeds that follow from the same outputs with the lag and the throttle line of the vehicle file."""
        self.from_outputs = False
        """The log will hold motor outputs instead of rotor speeds."""
        self._air_exists = any(type(truth).wind is not Truth.wind for truth in truths)
        self._loaded = any(type(truth).mass_kg is not Truth.mass_kg for truth in truths)
        self._sums = [0.0] * 6
        self._count = 0
        for truth in self.truths:
            truth.enter(self)

    def rotor_heights(self) -> list[float]:
        """Height of each rotor above a ground that may slope in the frame of the log, m."""
        w, x, y, z = self.attitude
        dx, dy = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x)  # how far body x and y point down
        north, east, down = self.position
        slope = self.nuisances.slope
        base = self.file_vehicle.rotor_height_m - down - slope[0] * north - slope[1] * east
        return [base - px * dx - py * dy for px, py, _ in (rotor.position_m for rotor in self.vehicle.rotors)]

    def weigh_moments(self, factors: Sequence[float]) -> None:
        """Multiply the moments of inertia about the body axes."""
        x, y, z = (inertia * factor for inertia, factor in zip(self._inertia, factors, strict=True))
        self._inertia = (x, y, z)

    def means(self) -> tuple[Vec3, Vec3]:
        """Since the last call: acceleration by the truths, NED, and specific force, FRD, m/s^2."""
        n = max(self._count, 1)
        a, b, c, d, e, f = (value / n for value in self._sums)
        self._sums, self._count = [0.0] * 6, 0
        return (a, b, c), (d, e, f)

    def step(self, outputs: list[float], armed: bool) -> None:
        if self._loaded:
            extra = sum(truth.mass_kg(self.time_s) for truth in self.truths)
            if abs(self.file_vehicle.mass_kg + extra - self.vehicle.mass_kg) > 1e-9:
                self.vehicle = with_mass(self.file_vehicle, self.file_vehicle.mass_kg + extra)
        super().step(outputs, armed)

    def _turn_rotors(self, outputs: Sequence[float | None]) -> None:
        curve, n = self.file_vehicle.throttle, self.vehicle.n_rotors
        k = self.vehicle.rotor.thrust_n_per_rpm2
        up, down = (1.0 - math.exp(-STEP_S / lag) if lag > 1e-6 else 1.0 for lag in self.lag_s)
        scale = (self.battery.voltage_v / self.battery.FULL_V) ** self.voltage_exponent
        power = 0.0
        for i, output in enumerate(outputs):
            wanted = by_file = 0.0
            if output is not None:  # the motor is not stopped
                thrust = (output - curve.offset) / (curve.per_newton * n)
                by_file = math.sqrt(thrust / k) if thrust > 0.0 else 0.0
                wanted, by_file = max(IDLE_RPM, by_file * scale), max(IDLE_RPM, by_file)
            self.rpm[i] += (up if wanted > self.rpm[i] else down) * (wanted - self.rpm[i])
            if self.from_outputs:
                self.file_rpm[i] += self._rotor_share * (by_file - self.file_rpm[i])
            power += self.rpm[i] ** 3
        self.battery.draw(power * self._watts_per_rpm3, STEP_S)

    def _force_and_torque(self) -> tuple[Vec3, Vec3]:
        k = self.file_vehicle.rotor.thrust_n_per_rpm2
        coefficients = self.nuisances.rotor_coefficients
        thrusts = [k * c * rpm * rpm for c, rpm in zip(coefficients, self.rpm, strict=True)]
        plain = thrusts
        if self.from_outputs:
            plain = [k * c * rpm * rpm for c, rpm in zip(coefficients, self.file_rpm, strict=True)]
        gust = self.gust.step(STEP_S)
        velocity = self.velocity
        for truth in self.truths if self._air_exists else ():
            wind = truth.wind(self.time_s)
            velocity = (velocity[0] - wind[0], velocity[1] - wind[1], velocity[2] - wind[2])
        now = Instant(self, list(thrusts), rotate_inverse(self.attitude, velocity))
        for truth in self.truths:
            truth.act(now)
        force, torque = self._sum(now)
        self._remember(force, plain)
        m = self.file_vehicle.mass_kg
        gx, gy, gz = rotate_inverse(self.attitude, (m * gust[0], m * gust[1], m * gust[2]))
        mass = self.vehicle.mass_kg
        total = (force[0] + gx, force[1] + gy, force[2] + gz)
        for i in range(3):
            self._sums[3 + i] += total[i] / mass
        return total, torque

    def _sum(self, now: Instant) -> tuple[Vec3, Vec3]:
        fx, fy, fz = now.force
        tx, ty, tz = now.torque
        for rotor, axis, file_arm, thrust in zip(
            self.vehicle.rotors, self.axes, self.file_vehicle.moment_arms_m, now.thrusts, strict=True
        ):
            px, py, pz = rotor.position_m
            rx, ry, rz = axis[0] * thrust, axis[1] * thrust, axis[2] * thrust
            fx, fy, fz = fx + rx, fy + ry, fz + rz
            tx += py * rz - pz * ry
            ty += pz * rx - px * rz
            tz += px * ry - py * rx + file_arm[2] * thrust
        return (fx, fy, fz), (tx, ty, tz)

    def _remember(self, force: Vec3, plain: list[float]) -> None:
        """The truths' part of the acceleration, for the judge alone: with them, minus the file's body without them."""
        total = sum(plain)
        fx, fy, fz = rotate(self.attitude, force)
        bx, by, bz = rotate(self.attitude, (0.0, 0.0, -total))
        m, file_m = self.vehicle.mass_kg, self.file_vehicle.mass_kg
        sums = self._sums
        sums[0] += fx / m - bx / file_m
        sums[1] += fy / m - by / file_m
        sums[2] += fz / m - bz / file_m
        self._count += 1


def with_mass(vehicle: Vehicle, mass_kg: float) -> Vehicle:
    """The same vehicle, heavier or lighter."""
    return Vehicle.model_validate({**vehicle.model_dump(exclude_none=True), "mass_kg": mass_kg})
