"""Flight of a multirotor in a world with a catch: rigid body, rotors with first-order lag, cascaded controller,
estimator, sensors. Inside, vectors are NED and FRD in SI units.

The simulation is its own: the lab's code is used for vehicle files and for the form of a log only.
"""

import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from quadctl.logs.flight_log import FlightLog
from quadctl.vehicle import Vehicle, load_vehicle

Floats: TypeAlias = NDArray[np.float64]

VEHICLES = Path(__file__).resolve().parents[3] / "config" / "vehicles"
STEP_S = 0.005
STEPS_PER_ROW = 4
"""Rows of a log at 50 Hz."""
WEIGHT_M_S2 = np.array([0.0, 0.0, 9.81])
TURBULENCE_M_S2, TURBULENCE_S = 0.03, 0.5
"""Standard deviation and correlation time of the small disturbances that every flight meets."""


@dataclass
class Body:
    """Motion of the vehicle at one moment."""

    position_m: Floats
    velocity_m_s: Floats
    attitude: Floats
    """Rotation from body to world, shape (3, 3)."""
    rates_rad_s: Floats
    speeds_rpm: Floats


def no_force(time_s: float, body: Body) -> Floats:
    """Force of the world on the vehicle, NED, N, besides weight and rotors: none."""
    return np.zeros(3)


def no_moment(time_s: float, body: Body) -> Floats:
    """Moment of the world on the vehicle, FRD, N m, besides rotors: none."""
    return np.zeros(3)


def full_thrust(time_s: float, body: Body) -> Floats:
    """Thrust of each rotor over k rpm²: 1."""
    return np.ones(len(body.speeds_rpm))


def true_attitude(time_s: float, body: Body, specific_force_m_s2: Floats) -> Floats:
    """Attitude that the estimator tells, rotation from body to world: the true one."""
    return body.attitude


@dataclass(frozen=True)
class World:
    """Physics and estimator of one flight. The vehicle file does not know of them."""

    force_n: Callable[[float, Body], Floats] = no_force
    moment_n_m: Callable[[float, Body], Floats] = no_moment
    thrust_ratio: Callable[[float, Body], Floats] = full_thrust
    mass_kg: Callable[[float], float] | None = None
    """Mass over time; that of the vehicle file without it."""
    inertia_kg_m2: Floats | None = None
    """Inertia about the centre of mass, FRD, shape (3, 3); that of the vehicle file without it."""
    estimated_attitude: Callable[[float, Body, Floats], Floats] = true_attitude


@dataclass(frozen=True)
class Sensors:
    """Errors of what is logged; standard deviations of white noise where nothing else is said."""

    position_m: float = 0.001
    velocity_m_s: float = 0.01
    attitude_deg: float = 0.1
    rates_rad_s: float = 0.01
    rpm: float = 15.0
    rpm_resolution: float = 1.0
    rpm_limit: float = np.inf
    """Speed at which the sensor saturates."""
    pose_delay_s: float = 0.0
    """Age of position, velocity, attitude and body rates in a row of the log."""
    accelerometer_m_s2: float | None = None
    """Noise of the accelerometer; not logged without it."""


MOCAP = Sensors()
OUTDOORS = Sensors(position_m=0.01, velocity_m_s=0.03, attitude_deg=0.2, accelerometer_m_s2=0.3)


@dataclass(frozen=True)
class Leg:
    """Move to a place (north, east, up) along a quintic, which starts and ends at rest, then hover there."""

    north_m: float
    east_m: float
    up_m: float
    move_s: float
    hover_s: float
    yaw_deg: float = 0.0


def planned(legs: Sequence[Leg]) -> tuple[Floats, Floats, Floats, Floats]:
    """Reference at each step: position, velocity, acceleration (NED), each of shape (n, 3), and yaw in rad, (n,).

    The first leg is where the flight begins, and its time to move is ignored.
    """
    parts = []
    for before, leg in pairwise((legs[0], *legs)):
        start, end = (np.array([leg.north_m, leg.east_m, -leg.up_m, np.radians(leg.yaw_deg)]) for leg in (before, leg))
        move_s = 0.0 if before is leg else leg.move_s
        time_s = np.arange(round((move_s + leg.hover_s) / STEP_S)) * STEP_S
        t = np.clip(time_s / move_s, 0.0, 1.0)[:, None] if move_s else np.ones((len(time_s), 1))
        per_s = 1.0 / move_s if move_s else 0.0
        position = start + (10 * t**3 - 15 * t**4 + 6 * t**5) * (end - start)
        velocity = (30 * t**2 - 60 * t**3 + 30 * t**4) * per_s * (end - start)
        accel = (60 * t - 180 * t**2 + 120 * t**3) * per_s**2 * (end - start)
        parts.append((position[:, :3], velocity[:, :3], accel[:, :3], position[:, 3]))
    position, velocity, accel, yaw = (np.concatenate(column) for column in zip(*parts, strict=True))
    return position, velocity, accel, yaw


def rotation(vector_rad: Floats) -> Floats:
    """Rotation matrix of a rotation vector (Rodrigues), shape (3, 3)."""
    angle = float(np.linalg.norm(vector_rad))
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = vector_rad / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    result: Floats = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * (cross @ cross)
    return result


def heading(yaw_rad: float) -> Floats:
    """Rotation from body to world of a level vehicle, shape (3, 3)."""
    return rotation(np.array([0.0, 0.0, yaw_rad]))


@dataclass
class Controller:
    """Cascade: position, velocity with an integral, attitude, body rates. Knows the vehicle file and the estimate."""

    vehicle: Vehicle
    integral_m_s2: Floats = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        arms = np.array(self.vehicle.moment_arms_m).T
        self._to_rotors = np.linalg.pinv(np.vstack([np.ones(self.vehicle.n_rotors), arms]))
        self._inertia = np.array(self.vehicle.principal_inertia_kg_m2)

    def speeds_rpm(
        self, body: Body, attitude: Floats, reference: tuple[Floats, Floats, Floats], yaw_rad: float
    ) -> Floats:
        """Commanded rotor speeds; `attitude` is the estimated one, `reference` position, velocity and acceleration."""
        position, velocity, accel = reference
        velocity_error = velocity + 1.2 * (position - body.position_m) - body.velocity_m_s
        self.integral_m_s2 += 0.8 * velocity_error * STEP_S
        force = self.vehicle.mass_kg * (accel + 3.0 * velocity_error + self.integral_m_s2 - WEIGHT_M_S2)
        down = -force / np.linalg.norm(force)
        right = np.cross(down, [np.cos(yaw_rad), np.sin(yaw_rad), 0.0])
        right /= np.linalg.norm(right)
        wanted = np.column_stack([np.cross(right, down), right, down])
        error = wanted.T @ attitude - attitude.T @ wanted
        angles = 0.5 * np.array([error[2, 1], error[0, 2], error[1, 0]])
        moment = self._inertia * 20.0 * (-7.0 * angles - body.rates_rad_s)
        moment += np.cross(body.rates_rad_s, self._inertia * body.rates_rad_s)
        thrust = self._to_rotors @ np.array([-force @ attitude[:, 2], *moment])
        limit = self.vehicle.throttle.max_thrust_per_rotor_n
        result: Floats = np.sqrt(np.clip(thrust, 0.05 * limit, limit) / self.vehicle.rotor.thrust_n_per_rpm2)
        return result


def fly(
    name: str, vehicle_name: str, legs: Sequence[Leg], world: World | None = None, sensors: Sensors = MOCAP
) -> FlightLog:
    """Fly along `legs` and log at 50 Hz, from hover. The name is the seed: the same call gives the same log."""
    world = world or World()
    vehicle = load_vehicle(VEHICLES / f"{vehicle_name}.yaml")
    random = np.random.default_rng(zlib.crc32(name.encode()))
    position, velocity, accel, yaw = planned(legs)
    turbulence = _turbulence(len(yaw), random)
    arms = np.array(vehicle.moment_arms_m).T
    inertia = np.diag(vehicle.principal_inertia_kg_m2) if world.inertia_kg_m2 is None else world.inertia_kg_m2
    coefficient = vehicle.rotor.thrust_n_per_rpm2
    response = 1.0 - np.exp(-STEP_S / vehicle.rotor.time_constant_s)
    hover_rpm = np.sqrt(vehicle.weight_n / vehicle.n_rotors / coefficient)
    body = Body(position[0].copy(), np.zeros(3), heading(yaw[0]), np.zeros(3), np.full(vehicle.n_rotors, hover_rpm))
    controller = Controller(vehicle)
    specific_force = -WEIGHT_M_S2
    rows = []
    for step in range(len(yaw)):
        time_s = step * STEP_S
        estimate = world.estimated_attitude(time_s, body, specific_force)
        thrust = coefficient * body.speeds_rpm**2 * world.thrust_ratio(time_s, body)
        mass_kg = world.mass_kg(time_s) if world.mass_kg else vehicle.mass_kg
        force = world.force_n(time_s, body) + mass_kg * turbulence[step] - body.attitude[:, 2] * thrust.sum()
        specific_force = body.attitude.T @ force / mass_kg
        if step % STEPS_PER_ROW == 0:
            rows.append(_row(time_s, body, estimate, specific_force, thrust.sum()))
        moment = arms @ thrust + world.moment_n_m(time_s, body)
        command = controller.speeds_rpm(body, estimate, (position[step], velocity[step], accel[step]), yaw[step])
        body.velocity_m_s = body.velocity_m_s + (force / mass_kg + WEIGHT_M_S2) * STEP_S
        body.position_m = body.position_m + body.velocity_m_s * STEP_S
        body.rates_rad_s = body.rates_rad_s + turning(moment, body.rates_rad_s, inertia) * STEP_S
        body.attitude = body.attitude @ rotation(body.rates_rad_s * STEP_S)
        body.speeds_rpm = body.speeds_rpm + response * (command - body.speeds_rpm)
    return FlightLog(f"{name}.csv", None, _logged(np.array(rows), sensors, random))


def turning(moment_n_m: Floats, rates_rad_s: Floats, inertia_kg_m2: Floats) -> Floats:
    """Angular acceleration by Euler's equation, FRD, rad/s²."""
    principal = np.diagonal(inertia_kg_m2)
    if np.any(inertia_kg_m2 != np.diag(principal)):
        spin = inertia_kg_m2 @ rates_rad_s
        coupled = np.linalg.solve(inertia_kg_m2, moment_n_m - np.cross(rates_rad_s, spin))
        return np.asarray(coupled, dtype=np.float64)
    moment = moment_n_m - np.cross(rates_rad_s, principal * rates_rad_s)
    return np.asarray(moment / principal, dtype=np.float64)


def _turbulence(n_steps: int, random: np.random.Generator) -> Floats:
    """Accelerations of an Ornstein-Uhlenbeck process, NED, m/s², shape (n_steps, 3)."""
    keep = np.exp(-STEP_S / TURBULENCE_S)
    kicks = TURBULENCE_M_S2 * np.sqrt(1.0 - keep**2) * random.standard_normal((n_steps, 3))
    values = np.zeros((n_steps, 3))
    for step in range(1, n_steps):
        values[step] = keep * values[step - 1] + kicks[step]
    return values


def _row(time_s: float, body: Body, attitude: Floats, specific_force_m_s2: Floats, thrust_n: float) -> Floats:
    """Values of a row without the errors of the sensors; Euler angles in degrees, north, east, up."""
    up = np.array([1.0, 1.0, -1.0])
    angles = np.degrees(
        [
            np.arctan2(attitude[2, 1], attitude[2, 2]),
            -np.arcsin(attitude[2, 0]),
            np.arctan2(attitude[1, 0], attitude[0, 0]),
        ]
    )
    motion = (up * body.position_m, up * body.velocity_m_s, angles, body.rates_rad_s)
    return np.concatenate([[time_s], *motion, specific_force_m_s2, [thrust_n], body.speeds_rpm])


POSE = (
    *("x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s", "roll_deg", "pitch_deg", "yaw_deg"),
    *("roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s"),
)
IMU = ("imu_x_m_s2", "imu_y_m_s2", "imu_z_m_s2")


def _logged(rows: Floats, sensors: Sensors, random: np.random.Generator) -> dict[str, Floats]:
    """Columns of the log: the true rows, shape (n, 17 + rotors), as the sensors see them."""
    late = round(sensors.pose_delay_s / (STEP_S * STEPS_PER_ROW))
    pose, now = rows[: len(rows) - late, 1:13], rows[late:]
    noise = np.repeat([sensors.position_m, sensors.velocity_m_s, sensors.attitude_deg, sensors.rates_rad_s], 3)
    columns = {"time_s": now[:, 0] - now[0, 0]}
    columns |= dict(zip(POSE, (pose + noise * random.standard_normal(pose.shape)).T, strict=True))
    rpm = now[:, 17:] + sensors.rpm * random.standard_normal(now[:, 17:].shape)
    rpm = np.minimum(np.round(rpm / sensors.rpm_resolution) * sensors.rpm_resolution, sensors.rpm_limit)
    columns |= {f"motor{i + 1}_rpm": speeds for i, speeds in enumerate(rpm.T)}
    if sensors.accelerometer_m_s2 is not None:
        imu = now[:, 13:16] + sensors.accelerometer_m_s2 * random.standard_normal((len(now), 3))
        columns |= dict(zip(IMU, imu.T, strict=True))
    # A battery of four cells, emptied at a constant rate, with the drop at its resistance.
    voltage = 16.5 - 0.011 * columns["time_s"] - 0.02 * (now[:, 16] - now[0, 16])
    columns["battery_v"] = voltage + 0.01 * random.standard_normal(len(now))
    return columns
