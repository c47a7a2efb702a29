"""Flights that are meant to fool the lab: `python -m studies.worlds.traps --page docs/traps.md`.

Each trap is a plausible flight of a plausible vehicle whose truth is known and that invites a false answer: a name of
an effect that is not there, a parameter whose interval leaves out the truth, a fault in a clean flight. The honest
answers were written down before the lab had seen a flight. Three controls, which the lab should get right, show that
the simulation is sane.

The simulation is its own: a rigid body on rotors with first-order lag, a cascaded controller, an estimator, sensors.
Inside, vectors are NED and FRD in SI units; the lab's own code is used for vehicle files and for writing logs only.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, field
from enum import StrEnum
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from quadctl.logs.csv_log import write_csv
from quadctl.logs.flight_log import FlightLog
from quadctl.vehicle import Vehicle, load_vehicle
from studies.benchmarks.page import write_page

Floats: TypeAlias = NDArray[np.float64]

VEHICLES = Path(__file__).resolve().parents[2] / "config" / "vehicles"
STEP_S = 0.005
STEPS_PER_ROW = 4
"""Rows of a log at 50 Hz."""
WEIGHT_M_S2 = np.array([0.0, 0.0, 9.81])
TURBULENCE_M_S2, TURBULENCE_S = 0.03, 0.5
"""Standard deviation and correlation time of the small disturbances that every flight meets."""


# --- vehicle, world, sensors ------------------------------------------------------------------------------------------


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
    thrust_ratio: Callable[[float, Body], Floats] = full_thrust
    mass_kg: Callable[[float], float] | None = None
    """Mass over time; that of the vehicle file without it."""
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
    inertia = np.array(vehicle.principal_inertia_kg_m2)
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
        moment = arms @ thrust - np.cross(body.rates_rad_s, inertia * body.rates_rad_s)
        command = controller.speeds_rpm(body, estimate, (position[step], velocity[step], accel[step]), yaw[step])
        body.velocity_m_s = body.velocity_m_s + (force / mass_kg + WEIGHT_M_S2) * STEP_S
        body.position_m = body.position_m + body.velocity_m_s * STEP_S
        body.rates_rad_s = body.rates_rad_s + moment / inertia * STEP_S
        body.attitude = body.attitude @ rotation(body.rates_rad_s * STEP_S)
        body.speeds_rpm = body.speeds_rpm + response * (command - body.speeds_rpm)
    return FlightLog(f"{name}.csv", None, _logged(np.array(rows), sensors, random))


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


# --- expectations and judgement ---------------------------------------------------------------------------------------


class Outcome(StrEnum):
    """Judgement of an answer: fooled by a false statement; missed where it is silent about something large."""

    HONEST = "no"
    MISSED = "missed"
    FOOLED = "yes"


@dataclass(frozen=True)
class Honest:
    """Answers that are true."""

    words: str
    families: Set[str] = frozenset()
    """Families that may be named, each alone or with others of them; another one only as half of a pair with one."""
    verdicts: Set[str] = frozenset()
    """Verdicts that are true beside `missing`: `none` where the vehicle is clean, `unexplained`."""
    intervals: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Lowest and highest true value by `effect parameter`: the 95 % interval must hold at least one between them."""


@dataclass(frozen=True)
class Trap:
    """A flight, the vehicle file that the lab gets, and what it may say."""

    name: str
    vehicle: str
    honest: Honest
    text: str
    generate: Callable[[], FlightLog]


def judge(honest: Honest, result: Mapping[str, Any]) -> Outcome:
    """Compare the JSON result of `quadctl diagnose` with the honest answers."""
    if result["verdict"] != "missing":
        if result["verdict"] in honest.verdicts:
            return Outcome.HONEST
        return Outcome.FOOLED if "none" in honest.verdicts else Outcome.MISSED
    pairs = [frozenset(pair) for pair in result["confounded"]]
    for family in result["missing"]:
        if family not in honest.families and not any(family in pair and pair & honest.families for pair in pairs):
            return Outcome.FOOLED
    for effect, parameter, (low, high) in intervals(result):
        lowest, highest = honest.intervals.get(f"{effect} {parameter}", (low, high))
        if high < lowest or low > highest:
            return Outcome.FOOLED
    return Outcome.HONEST


def intervals(result: Mapping[str, Any]) -> Iterable[tuple[str, str, tuple[float, float]]]:
    """Effect, parameter and 95 % interval of every parameter of the effects that are called missing.

    The interval of a parameter that is not fitted, as the number of a rotor, is its value twice.
    """
    named = {step["effect"] for step in result["ladder"] if step["family"]}
    for entry in result["ranking"]:
        if entry["effect"] in named:
            for parameter, value in entry["parameters"].items():
                low, high = entry["ci95"].get(parameter, (value, value))
                yield entry["effect"], parameter, (low, high)


def said(result: Mapping[str, Any]) -> str:
    """What the lab answered, for the page."""
    parts = [" + ".join(result["missing"]) or str(result["verdict"])]
    for effect, name, (low, high) in intervals(result):
        parts.append(f"{effect} {name} " + (f"{low:.3g}" if low == high else f"[{low:.3g}, {high:.3g}]"))
    parts += [f"cannot tell {' from '.join(sorted(pair))}" for pair in result["confounded"]]
    if result["missing"] and result["unexplained"]:
        parts.append("and something unexplained")
    if result["measured"]:
        parts.append("there but small: " + ", ".join(entry["effect"] for entry in result["measured"]))
    return "; ".join(parts)


CONTROLS: list[Trap] = []
TRAPS: list[Trap] = []


def listed(
    group: list[Trap], vehicle: str, honest: Honest
) -> Callable[[Callable[[str, str], FlightLog]], Callable[[str, str], FlightLog]]:
    """Decorator that adds a flight to a group; its docstring becomes the text of the page."""

    def add(generate: Callable[[str, str], FlightLog]) -> Callable[[str, str], FlightLog]:
        name = generate.__name__
        text = " ".join((generate.__doc__ or "").split())
        group.append(Trap(name, vehicle, honest, text, lambda: generate(name, vehicle)))
        return generate

    return add


# --- flights ----------------------------------------------------------------------------------------------------------


def back_and_forth(
    half_m: float, up_m: float, move_s: float, hover_s: float, times: int, axis: str = "north"
) -> list[Leg]:
    """Runs between two places on the north or east axis, from the southern or western one on."""
    ends = [-half_m, half_m] * times + [-half_m]
    places = [(end, 0.0) if axis == "north" else (0.0, end) for end in ends]
    return [Leg(north, east, up_m, move_s, hover_s) for north, east in places]


def staircase(heights_m: Iterable[float], move_s: float, hover_s: float) -> list[Leg]:
    """Hover at one height after another."""
    return [Leg(0.0, 0.0, height, move_s, hover_s) for height in heights_m]


def all_round() -> list[Leg]:
    """Mission of the controls of 90 s: heights, runs in both directions of both axes, turns."""
    return [
        *staircase((0.8, 1.4, 2.0, 1.4), 2.0, 3.0),
        *(Leg(north, east, 1.4, 2.0, 2.0) for north, east in ((2, 0), (-2, 0), (0, 0), (0, 2), (0, -2), (0, 0))),
        *(Leg(north, east, 1.4, 3.0, 3.0, yaw_deg=90.0) for north, east in ((0, 0), (2, 0), (-2, 0), (0, 2), (0, -2))),
        Leg(0.0, 0.0, 1.4, 3.0, 3.0, yaw_deg=90.0),
    ]


@listed(CONTROLS, "raptor", Honest("none", verdicts={"none"}))
def clean(name: str, vehicle: str) -> FlightLog:
    """Nothing is missing: heights, runs and turns in a hall."""
    return fly(name, vehicle, all_round())


@listed(CONTROLS, "raptor", Honest("ground_effect", {"ground_effect"}))
def ground_effect(name: str, vehicle: str) -> FlightLog:
    """Ground effect, K = 1 + 0.35 exp(-0.9 z/R), hovering from 0.1 m to 1.6 m and back."""

    def ratio(time_s: float, body: Body) -> Floats:
        return np.full(4, 1.0 + 0.35 * np.exp(0.9 * body.position_m[2] / 0.12))

    heights = (1.6, 0.9, 0.5, 0.3, 0.2, 0.14, 0.10, 0.17, 0.25, 0.4, 0.7, 1.2)
    return fly(name, vehicle, staircase(heights, 2.0, 6.0), World(thrust_ratio=ratio))


@listed(
    CONTROLS,
    "raptor",
    Honest(
        "rotor_drag, d_x and d_y 0.3 1/s",
        {"rotor_drag"},
        intervals={"rotor_drag.linear d_x": (0.3, 0.3), "rotor_drag.linear d_y": (0.3, 0.3)},
    ),
)
def rotor_drag(name: str, vehicle: str) -> FlightLog:
    """Rotor drag of 0.3 1/s on the mission of the clean flight."""
    return fly(name, vehicle, all_round(), World(force_n=lambda time_s, body: -1.5 * 0.3 * body.velocity_m_s))


@listed(
    TRAPS,
    "x500",
    Honest(
        "rotor_drag with 0.25 1/s in the interval of d_x, or wind, or both, or unexplained",
        {"rotor_drag", "wind"},
        {"unexplained"},
        {"rotor_drag.linear d_x": (0.25, 0.25)},
    ),
)
def gust_with_every_run(name: str, vehicle: str) -> FlightLog:
    """Four runs over a field with rotor drag of 0.25 1/s; by chance the air of a gusty day comes from ahead in each,
    up to 1.8 m/s, from 1.5 s before a run to 3 s after it. The drag seems half as large again."""
    leg_s, move_s, run_m = 16.0, 8.0, 8.0
    legs = back_and_forth(run_m, 6.0, move_s, leg_s - move_s, 2)

    def force(time_s: float, body: Body) -> Floats:
        number, since_s = divmod(time_s - (leg_s - move_s) + 1.5, leg_s)
        t = since_s / (move_s + 4.5)
        gust_m_s = 1.8 * np.sin(np.pi * t) ** 2 if number >= 0 and t < 1.0 else 0.0
        air = np.array([-gust_m_s if number % 2 == 0 else gust_m_s, 0.0, 0.0])
        result: Floats = -2.064 * 0.25 * (body.velocity_m_s - air) * np.array([1.0, 1.0, 0.0])
        return result

    return fly(name, vehicle, legs, World(force_n=force), OUTDOORS)


@listed(
    TRAPS,
    "x500",
    Honest(
        "payload with a mass dropped of at most 0.25 kg, or unexplained",
        {"payload"},
        {"unexplained"},
        {"payload.step mass_kg": (-0.25, -0.04)},
    ),
)
def leaking_tank(name: str, vehicle: str) -> FlightLog:
    """A sprayer empties its tank, 0.25 kg of 2.064 kg, evenly over 100 s, working its way down a slope from 8 m to 2 m.
    Mass, height and battery voltage fall together: a cable, the battery or a step of mass fit in part."""
    legs = [Leg(1.5 * (-1) ** i, 1.0 * i, 8.0 - 0.75 * i, 5.0, 7.0) for i in range(9)]
    return fly(name, vehicle, legs, World(mass_kg=lambda time_s: 2.064 - 0.0025 * min(time_s, 100.0)), OUTDOORS)


@listed(
    TRAPS,
    "raptor",
    Honest(
        "rotor_fault of rotor 3 with a loss between 0.065 (mean of the flight) and 0.13, or unexplained",
        {"rotor_fault"},
        {"unexplained"},
        {"rotor_fault.weak loss": (0.065, 0.13), "rotor_fault.weak rotor": (3, 3)},
    ),
)
def chipped_half_way(name: str, vehicle: str) -> FlightLog:
    """A propeller is chipped in the middle of the flight: rotor 3 gives 13 % less thrust from then on. As a load that
    is picked up, it costs thrust from one moment on; the lower half of the staircase lies after it."""
    heights = (2.0, 1.8, 1.6, 1.8, 1.5, 0.9, 0.7, 0.9, 0.7, 1.0)

    def ratio(time_s: float, body: Body) -> Floats:
        return np.array([1.0, 1.0, 0.87 if time_s > 50.0 else 1.0, 1.0])

    return fly(name, vehicle, staircase(heights, 3.0, 7.0), World(thrust_ratio=ratio))


@listed(TRAPS, "raptor", Honest("none, or unexplained", verdicts={"none", "unexplained"}))
def yaw_off(name: str, vehicle: str) -> FlightLog:
    """The estimator's yaw is 6° off, as a rigid body that was defined askew: tilting forward pushes to the side.
    Runs north and east with the nose north; the vehicle is clean."""
    world = World(estimated_attitude=lambda time_s, body, specific_force: heading(np.radians(6.0)) @ body.attitude)
    legs = [*back_and_forth(2.0, 1.4, 2.5, 3.0, 5), *back_and_forth(2.0, 1.4, 2.5, 3.0, 4, axis="east")]
    return fly(name, vehicle, legs, world)


class Complementary:
    """Attitude estimate from body rates, drawn towards the accelerometer's vertical with a time constant of 2 s."""

    def __init__(self) -> None:
        self.attitude = np.eye(3)

    def __call__(self, time_s: float, body: Body, specific_force_m_s2: Floats) -> Floats:
        """Estimated attitude, rotation from body to world, shape (3, 3)."""
        up = -self.attitude[2]
        towards = np.cross(specific_force_m_s2 / np.linalg.norm(specific_force_m_s2), up) / 2.0
        self.attitude = self.attitude @ rotation((body.rates_rad_s + towards) * STEP_S)
        return self.attitude


@listed(
    TRAPS,
    "x500",
    Honest(
        "rotor_drag with 0.3 1/s in the interval of d_x, or unexplained",
        {"rotor_drag"},
        {"unexplained"},
        {"rotor_drag.linear d_x": (0.3, 0.3)},
    ),
)
def accelerometer_as_vertical(name: str, vehicle: str) -> FlightLog:
    """A simple attitude estimator takes the accelerometer for the vertical (2 s): after each acceleration its attitude
    is off in proportion to the speed, and rotor drag (0.3 1/s) looks like its tilt. Long runs north and south."""

    def force(time_s: float, body: Body) -> Floats:
        result: Floats = -2.064 * 0.3 * body.velocity_m_s * np.array([1.0, 1.0, 0.0])
        return result

    legs = back_and_forth(9.0, 5.0, 7.0, 4.0, 4)
    return fly(name, vehicle, legs, World(force_n=force, estimated_attitude=Complementary()), OUTDOORS)


@listed(TRAPS, "raptor", Honest("ceiling_effect, or unexplained", {"ceiling_effect"}, {"unexplained"}))
def bridge_overhead(name: str, vehicle: str) -> FlightLog:
    """Inspection of a bridge whose underside is at 1.6 m, while the vehicle file still has the hall's ceiling of 2.6 m:
    K = 1 + 0.12 (R/D)² grows upward. Formulas of height that start at the ground are bent to fit."""

    def ratio(time_s: float, body: Body) -> Floats:
        distance_m = max(1.6 + float(body.position_m[2]), 0.08)
        return np.full(4, 1.0 + 0.12 * (0.12 / distance_m) ** 2)

    heights = (0.7, 1.0, 1.2, 1.3, 1.38, 1.44, 1.48, 1.42, 1.3, 1.1, 1.45, 1.0)
    return fly(name, vehicle, staircase(heights, 2.5, 5.0), World(thrust_ratio=ratio))


class SlungLoad:
    """Load of 0.35 kg on a line of 1.5 m: a point on a stiff, damped spring; it stretches and does not push."""

    mass_kg, length_m, stiffness_n_m, damping_n_s_m = 0.35, 1.5, 400.0, 6.0

    def __init__(self) -> None:
        self.position_m: Floats | None = None
        self.velocity_m_s = np.zeros(3)

    def __call__(self, time_s: float, body: Body) -> Floats:
        """Pull of the line on the vehicle, NED, N; moves the load on by one step."""
        hanging = np.array([0.0, 0.0, self.length_m + self.mass_kg * 9.81 / self.stiffness_n_m])
        position = body.position_m + hanging if self.position_m is None else self.position_m
        line = position - body.position_m
        length = float(np.linalg.norm(line))
        along = line / length
        speed = float((self.velocity_m_s - body.velocity_m_s) @ along)
        pull = max(self.stiffness_n_m * (length - self.length_m) + self.damping_n_s_m * speed, 0.0) * along
        drag = 0.03 * self.velocity_m_s
        self.velocity_m_s = self.velocity_m_s + (WEIGHT_M_S2 - (pull + drag) / self.mass_kg) * STEP_S
        self.position_m = position + self.velocity_m_s * STEP_S
        return pull


@listed(TRAPS, "x500", Honest("unexplained", verdicts={"unexplained"}))
def swinging_load(name: str, vehicle: str) -> FlightLog:
    """Of the vehicle's 2.064 kg, 0.35 kg hang on a line of 1.5 m and swing after each start and stop. Right in hover,
    so that only manoeuvres show it: a force against the velocity, then with it."""
    legs = [*back_and_forth(4.0, 6.0, 4.0, 4.0, 4), *back_and_forth(3.0, 6.0, 3.0, 3.0, 2, axis="east")]
    world = World(force_n=SlungLoad(), mass_kg=lambda time_s: 2.064 - SlungLoad.mass_kg)
    return fly(name, vehicle, legs, world, OUTDOORS)


@listed(TRAPS, "raptor", Honest("none, or unexplained", verdicts={"none", "unexplained"}))
def saturated_rotor_speed(name: str, vehicle: str) -> FlightLog:
    """Rotor speeds from a sensor with steps of 50 rpm that ends at 5900 rpm, 4 % above hover. In quick steps of height
    thrust seems to grow faster than with the square of the speed; the vehicle is clean."""
    legs = [leg for i in range(14) for leg in staircase((0.8, 2.2) if i % 2 else (1.0, 2.0), 1.6, 2.0)]
    return fly(name, vehicle, legs, sensors=Sensors(rpm_resolution=50.0, rpm_limit=5900.0))


@listed(TRAPS, "raptor", Honest("none, or unexplained", verdicts={"none", "unexplained"}))
def late_pose(name: str, vehicle: str) -> FlightLog:
    """Poses of motion capture arrive over a busy wireless link 100 ms late, rotor speeds at once. Thrust seems to
    follow the rotor speeds with a lag; the vehicle is clean."""
    up_and_down = [leg for _ in range(6) for leg in staircase((0.9, 2.1), 1.6, 1.5)]
    legs = [*up_and_down, *back_and_forth(1.5, 1.5, 1.8, 1.5, 6), *up_and_down]
    return fly(name, vehicle, legs, sensors=Sensors(pose_delay_s=0.1))


@listed(
    TRAPS,
    "x500",
    Honest("inflow, or wind, or both, or unexplained", {"inflow", "wind"}, {"unexplained"}),
)
def sinking_air(name: str, vehicle: str) -> FlightLog:
    """Air sinks over a cool pond, the faster the higher (0.12 1/s, up to 1.6 m/s), and none of it at the ground. Inflow
    takes 4 % of thrust per m/s of climb through the air, so that the loss grows with height as a cable's weight."""

    def ratio(time_s: float, body: Body) -> Floats:
        climb_m_s = -float(body.velocity_m_s[2]) + min(-0.12 * float(body.position_m[2]), 1.6)
        return np.full(4, 1.0 - 0.04 * climb_m_s)

    heights = (1.5, 3.0, 4.5, 6.0, 7.5, 9.0, 10.5, 12.0, 9.0, 6.0, 3.0)
    return fly(name, vehicle, staircase(heights, 4.0, 5.0), World(thrust_ratio=ratio), OUTDOORS)


# --- study ------------------------------------------------------------------------------------------------------------


def diagnosed(trap: Trap, folder: Path) -> dict[str, Any]:
    """Answer of `quadctl diagnose --json` to the flight of a trap, which is written to `folder`."""
    log, answer = folder / f"{trap.name}.csv", folder / f"{trap.name}.json"
    write_csv(trap.generate(), log)
    command = [sys.executable, "-m", "quadctl", "diagnose", str(VEHICLES / f"{trap.vehicle}.yaml"), str(log)]
    subprocess.run([*command, "--json", str(answer)], check=True, stdout=subprocess.DEVNULL)
    result: dict[str, Any] = json.loads(answer.read_text(encoding="utf-8"))
    return result


def table(answers: Sequence[tuple[Trap, Mapping[str, Any]]]) -> str:
    """Rows of the page."""
    lines = ["| trap | honest answer | what it said | fooled |", "|---|---|---|---|"]
    for trap, result in answers:
        outcome = judge(trap.honest, result)
        cells = (f"**{trap.name}** ({trap.vehicle}): {trap.text}", trap.honest.words, said(result), outcome)
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


INTRODUCTION = """# Traps

Written by `python -m studies.worlds.traps --page docs/traps.md`. Ten flights that are meant to make `quadctl
diagnose` say something false with confidence: name an effect that is not there, give a 95 % interval that leaves out
the truth, or call a clean vehicle faulty. They were written by somebody who had not read the lab, in a simulation of
their own ([studies/worlds/traps.py](../studies/worlds/traps.py)), and so were the honest answers, before the lab had
seen a flight. A pair that these data do not distinguish is honest where one of the two is true. *Missed* is an answer
that says nothing false and overlooks the effect. An effect that is there but too small to be called missing is shown
and not judged.
"""


def page(controls: Sequence[tuple[Trap, Mapping[str, Any]]], traps: Sequence[tuple[Trap, Mapping[str, Any]]]) -> str:
    """Markdown of the study, without its notes."""
    outcomes = [judge(trap.honest, result) for trap, result in traps]
    counts = f"Fooled by **{outcomes.count(Outcome.FOOLED)} of {len(outcomes)}**"
    counts += f"; {outcomes.count(Outcome.MISSED)} missed.\n"
    shown = f"## The ten\n\n{counts}\n{table(traps)}\n"
    return f"{INTRODUCTION}\n{shown}\n## Controls\n\nPlain flights, to check the simulation.\n\n{table(controls)}\n"


def main() -> None:
    """Fly, diagnose and judge all, and write the page; with `--only`, print the answers alone."""
    parser = argparse.ArgumentParser(prog="python -m studies.worlds.traps", description=__doc__)
    parser.add_argument("--page", type=Path, help="page to write")
    parser.add_argument("--only", choices=[trap.name for trap in (*CONTROLS, *TRAPS)], nargs="+", help="some of them")
    arguments = parser.parse_args()
    groups: list[list[tuple[Trap, Mapping[str, Any]]]] = []
    with tempfile.TemporaryDirectory() as folder:
        for group in (CONTROLS, TRAPS):
            groups.append([])
            for trap in group:
                if arguments.only and trap.name not in arguments.only:
                    continue
                result = diagnosed(trap, Path(folder))
                groups[-1].append((trap, result))
                print(f"{trap.name}: {said(result)}: fooled: {judge(trap.honest, result)}", flush=True)
    if arguments.page and not arguments.only:
        write_page(arguments.page, page(*groups))


if __name__ == "__main__":
    main()
