"""Ten flights that are meant to fool the lab, in a simulation of their own: records, rotation, unknown physics, gusts.

The vehicle of 0.92 kg is a rigid body with four rotors, NED and FRD axes, integrated at 400 Hz; the log holds 100 Hz.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from quadctl.logs.flight_log import FlightLog
from studies.worlds.traps.judgement import Honest, Trap

Array = NDArray[np.float64]
Columns = dict[str, Array]

RATE_HZ, LOG_EVERY, DURATION_S, GRAVITY = 400, 4, 95.0, 9.81
ARMS_M = np.array([[0.112, 0.131], [-0.112, -0.131], [0.112, -0.131], [-0.112, 0.131]])  # forward, right
SPIN = np.array([1.0, 1.0, -1.0, -1.0])  # counter-clockwise rotors turn the body to the right
THRUST_N_PER_RPM2, TORQUE_TO_THRUST_M, RADIUS_M, ROTOR_HEIGHT_M = 8.3e-8, 0.018, 0.1, 0.04
MASS_KG, INERTIA_KG_M2 = 0.92, np.array([0.0075, 0.0083, 0.0135])
REFERENCE_V, PER_NEWTON, THROTTLE_OFFSET = 15.4, 0.031, 0.12


@dataclass(frozen=True)
class World:
    """Physics of one flight; what is 0 is absent."""

    drag_n_s_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gust_m_s: float = 0.0  # standard deviation along each axis, mean zero, correlated over 1.2 s
    ground: float = 0.0  # thrust grows by this share at a rotor height of one radius
    inflow_s_m: float = 0.0  # share of thrust lost for each m/s of climb through the air
    plume_m_s: float = 0.0  # updraft over one place, 0.9 m wide
    airspeed_moment_n_s: float = 0.0  # moment that lifts the side that meets the air, N m for each m/s
    rotor_lag_s: float = 0.035
    centre_m: tuple[float, float] = (0.0, 0.0)  # centre of mass, forward and right of the rotors' centre
    inertia_factor: tuple[float, float, float] = (1.0, 1.0, 1.0)
    slosh_kg: float = 0.0  # part of the mass that swings along the horizontal
    slosh_rad_s: float = 7.5  # its natural frequency, with a damping of 0.04
    vent_n: float = 0.0  # upward force from 14 to 27 s, while the vehicle hovers low
    sag: bool = False  # thrust follows the battery's voltage to the power 1.6; else the rotor speeds are governed


def reference(time_s: Array) -> tuple[Array, Array, Array, Array]:
    """Return position (n, 3; NED, m), velocity, acceleration and heading (n; rad): a staircase, runs, both together."""

    def share(start: float, end: float) -> Array:
        """Return a smooth window between two moments."""
        return 0.5 * (np.tanh((time_s - start) / 0.8) - np.tanh((time_s - end) / 0.8))

    steps = [(0, 2.0), (4, 1.2), (8, 0.7), (12, 0.4), (16, 0.22), (20, 0.12), (25, 0.3), (29, 1.1)]
    height = np.full_like(time_s, steps[0][1])
    for (_, before), (start, after) in pairwise(steps):
        height += (after - before) * 0.5 * (1 + np.tanh((time_s - start) / 0.45))
    both = share(66, DURATION_S + 5)
    height += share(34, 66) * 0.25 * np.sin(0.9 * time_s)
    height += both * (-0.08 + 0.85 * np.sin(1.35 * time_s) * (0.75 + 0.25 * np.sin(0.31 * time_s)))
    north = 3.0 * share(34, 50) * np.sin(1.28 * (time_s - 34)) + 1.3 * both * np.sin(1.1 * time_s)
    east = 2.8 * share(50, 66) * np.sin(1.31 * (time_s - 50)) + 1.5 * both * np.sin(0.83 * time_s + 1)
    position = gaussian_filter1d(np.stack([north + 0.4, east - 0.7, -np.maximum(height, 0.12)], axis=1), 60, axis=0)
    velocity = np.gradient(position, time_s, axis=0)
    heading = np.radians(57 + 75 * np.sin(2 * np.pi * time_s / 41))
    return position, velocity, np.gradient(velocity, time_s, axis=0), heading


def coloured(n: int, deviation: float, time_constant_s: float, rng: np.random.Generator) -> Array:
    """Return first-order noise (n, 3) at 400 Hz with mean zero."""
    keep = np.exp(-1 / (RATE_HZ * time_constant_s))
    noise = lfilter([np.sqrt(1 - keep**2)], [1, -keep], rng.standard_normal((n, 3)), axis=0)
    return np.asarray(deviation * (noise - noise.mean(axis=0)))


def commanded_thrusts(p: Array, v: Array, rotation: Array, w: Array, goal: tuple[Array, Array, Array, float]) -> Array:
    """Return the thrust (4; N) that a cascaded controller commands; goal: position, velocity, acceleration, heading."""
    p_ref, v_ref, a_ref, heading = goal
    feedback = np.array([3.2, 3.2, 6]) * (p_ref - p) + np.array([3, 3, 4.5]) * (v_ref - v)
    a = np.clip(feedback + a_ref, -6.5, 6.5) - np.array([0, 0, GRAVITY])
    down = -a / np.linalg.norm(a)
    right = np.cross(down, [np.cos(heading), np.sin(heading), 0.0])
    right /= np.linalg.norm(right)
    wanted = np.stack([np.cross(right, down), right, down], axis=1)
    skew = wanted.T @ rotation - rotation.T @ wanted
    error = 0.5 * np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
    rate = np.clip(-np.array([6.5, 6.5, 2.5]) * error, -4, 4)
    torque = INERTIA_KG_M2 * np.array([13.0, 13.0, 6.0]) * (rate - w)
    torque[2] = np.clip(torque[2], -0.06, 0.06)
    total = MASS_KG * float(-a @ rotation[:, 2])
    x, y = ARMS_M[0]
    lever = np.stack([-ARMS_M[:, 1] / y**2, ARMS_M[:, 0] / x**2, SPIN / TORQUE_TO_THRUST_M], axis=1)
    return np.asarray(np.clip((total + lever @ torque) / 4, 0.25, 5.5))


def fly(world: World, rng: np.random.Generator) -> Columns:
    """Return what happened, at 400 Hz, before any sensor."""
    n = int(DURATION_S * RATE_HZ)
    dt, time_s = 1 / RATE_HZ, np.arange(n) / RATE_HZ
    p_ref, v_ref, a_ref, heading = reference(time_s)
    gust = coloured(n, world.gust_m_s, 1.2, rng)
    p, v, w = p_ref[0].copy(), np.zeros(3), np.zeros(3)
    rotation = Rotation.from_euler("ZYX", [heading[0], 0, 0]).as_matrix()
    speed = np.full(4, np.sqrt(MASS_KG * GRAVITY / 4 / THRUST_N_PER_RPM2))
    integral, slosh, slosh_rate, used = np.zeros(3), np.zeros(2), np.zeros(2), 0.0
    arms, inertia = ARMS_M - np.asarray(world.centre_m), INERTIA_KG_M2 * np.asarray(world.inertia_factor)
    drag, stiffness = np.asarray(world.drag_n_s_m), world.slosh_kg * world.slosh_rad_s**2
    friction = 0.08 * world.slosh_kg * world.slosh_rad_s
    rows = np.empty((n, 31))
    for i in range(n):
        integral = np.clip(integral + np.array([1.1, 1.1, 4]) * (p_ref[i] - p) * dt, -3, 3)
        command = commanded_thrusts(p, v, rotation, w, (p_ref[i], v_ref[i], a_ref[i] + integral, float(heading[i])))
        voltage = 16.5 - 0.06 * used - 0.055 * float(np.sum(command**1.5)) if world.sag else 16.4 - 0.012 * time_s[i]
        used += dt * float(np.sum(command**1.5)) / 60
        wanted = np.sqrt(command / THRUST_N_PER_RPM2)
        reached = wanted * ((voltage / REFERENCE_V) ** 0.8 if world.sag else 1.0)
        speed = speed + (reached - speed) * dt / world.rotor_lag_s
        air = gust[i].copy()
        air[2] -= world.plume_m_s * np.exp(-((p[0] - 1.2) ** 2 + (p[1] + 0.2) ** 2) / (2 * 0.9**2))
        relative = rotation.T @ (v - air)
        rotor_height = -p[2] + ROTOR_HEIGHT_M
        ratio = 1 + world.ground * np.exp(-0.9 * (rotor_height / RADIUS_M - 1)) + world.inflow_s_m * relative[2]
        thrust = THRUST_N_PER_RPM2 * speed**2 * ratio
        moment = np.array([-thrust @ arms[:, 1], thrust @ arms[:, 0], TORQUE_TO_THRUST_M * (SPIN @ thrust)])
        moment += world.airspeed_moment_n_s * np.array([-relative[1], relative[0], 0])
        force = rotation @ (-drag * relative - np.array([0, 0, thrust.sum()]))
        force[2] -= world.vent_n if 14 < time_s[i] < 27 else 0.0
        acceleration = force / MASS_KG + np.array([0, 0, GRAVITY])
        if world.slosh_kg:
            pull = stiffness * slosh + friction * slosh_rate
            acceleration[:2] = (force[:2] + pull) / (MASS_KG - world.slosh_kg)
            slosh_rate = slosh_rate - (pull / world.slosh_kg + acceleration[:2]) * dt
            slosh = slosh + slosh_rate * dt
        specific = rotation.T @ (acceleration - np.array([0, 0, GRAVITY]))
        rows[i] = np.concatenate([p, v, rotation.ravel(), w, speed, wanted, specific, [voltage, command.sum()]])
        w = w + (moment - np.cross(w, inertia * w)) / inertia * dt
        v = v + acceleration * dt
        p = p + v * dt
        rotation = rotation @ Rotation.from_rotvec(w * dt).as_matrix()
    return sensed(time_s, rows, rng)


def sensed(time_s: Array, rows: Array, rng: np.random.Generator) -> Columns:
    """Return the columns of the log at 400 Hz with noise, 12 ms of delay of the motion and an attitude 0.4 deg off."""
    late = np.roll(rows, 5, axis=0)
    askew = Rotation.from_euler("ZYX", [0.0, 0.4, -0.3], degrees=True)
    yaw, pitch, roll = (Rotation.from_matrix(late[:, 6:15].reshape(-1, 3, 3)) * askew).as_euler("ZYX", degrees=True).T

    def noisy(values: Array, deviation: float) -> Array:
        """Return the values with white noise."""
        return np.asarray(values + deviation * rng.standard_normal(len(values)))

    out = {"time_s": time_s}
    for k, (name, sign) in enumerate([("x", 1), ("y", 1), ("z", -1)]):
        out[f"{name}_m"] = noisy(sign * late[:, k], 0.0006)
        out[f"v{name}_m_s"] = noisy(sign * late[:, 3 + k], 0.015)
    out |= {"roll_deg": noisy(roll, 0.12), "pitch_deg": noisy(pitch, 0.12), "yaw_deg": noisy(yaw, 0.2)}
    for k, name in enumerate(["roll", "pitch", "yaw"]):
        out[f"{name}_rate_rad_s"] = noisy(rows[:, 15 + k], 0.015)
    for k in range(4):
        out[f"motor{k + 1}_rpm"] = noisy(rows[:, 18 + k], 18)
        out[f"motor{k + 1}_wanted"] = rows[:, 22 + k]
    for k, name in enumerate("xyz"):
        out[f"imu_{name}_m_s2"] = noisy(gaussian_filter1d(rows[:, 26 + k], 3), 0.25) + [0.04, -0.03, 0.05][k]
    out["battery_v"] = noisy(rows[:, 29], 0.02)
    out["throttle_cmd"] = THROTTLE_OFFSET + PER_NEWTON * rows[:, 30]
    return {name: values[40:] for name, values in out.items()}


MOTION = ("x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s", "roll_deg", "pitch_deg", "yaw_deg")
RATES = ("roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s")


def wandering_link(columns: Columns, rng: np.random.Generator) -> Columns:
    """Return a log whose motion comes 0 to 90 ms late, by a link that wanders; rotor speeds are in time."""
    time_s = columns["time_s"]
    delay_s = 0.045 + 0.045 * np.tanh(coloured(len(time_s), 1.0, 6.0, rng)[:, 0])
    return columns | {name: np.interp(time_s - delay_s, time_s, columns[name]) for name in (*MOTION, *RATES)}


def slanted_room(columns: Columns, _: np.random.Generator) -> Columns:
    """Return a log whose vertical leans by 1.6 degrees, in position, velocity and attitude alike: a slanted wand."""
    lean = Rotation.from_rotvec(np.radians(1.6) * np.array([0.8, -0.6, 0.0]))
    out = dict(columns)
    for names in (("x_m", "y_m", "z_m"), ("vx_m_s", "vy_m_s", "vz_m_s")):
        north, east, down = lean.apply(np.stack([columns[name] for name in names], axis=1) * [1, 1, -1]).T
        out |= dict(zip(names, (north, east, -down), strict=True))
    angles = np.stack([columns[name] for name in ("yaw_deg", "pitch_deg", "roll_deg")], axis=1)
    yaw, pitch, roll = (lean * Rotation.from_euler("ZYX", angles, degrees=True)).as_euler("ZYX", degrees=True).T
    return out | {"yaw_deg": yaw, "pitch_deg": pitch, "roll_deg": roll}


def late_voltage(columns: Columns, _: np.random.Generator) -> Columns:
    """Return a log whose voltage passes a filter of 6 s and steps of 0.05 V, as a battery monitor shows it."""
    share = 1 / (6 * RATE_HZ)
    volts, first = columns["battery_v"], columns["battery_v"][:400].mean()
    slow = lfilter([share], [1, share - 1], volts - first) + first
    return columns | {"battery_v": np.round(np.asarray(slow) / 0.05) * 0.05}


def commands_as_speeds(columns: Columns, _: np.random.Generator) -> Columns:
    """Return a log whose rotor speeds are those that were commanded."""
    return columns | {f"motor{k}_rpm": columns[f"motor{k}_wanted"] for k in range(1, 5)}


def filtered_position(columns: Columns, _: np.random.Generator) -> Columns:
    """Return a log whose position passed two first-order filters of 0.08 s, and whose velocity is its derivative."""
    share, out = 1 / (0.08 * RATE_HZ), dict(columns)
    for name in "xyz":
        values, first = columns[f"{name}_m"], columns[f"{name}_m"][0]
        for _repeat in range(2):
            values = np.asarray(lfilter([share], [1, share - 1], values - first) + first)
        out[f"{name}_m"], out[f"v{name}_m_s"] = values, np.gradient(values, columns["time_s"])
    return out


DRAG_N_S_M = (0.28, 0.32, 0.05)
IMU, RPM = ("imu_x_m_s2", "imu_y_m_s2", "imu_z_m_s2"), tuple(f"motor{k}_rpm" for k in range(1, 5))
NEVER_LOGGED = frozenset(f"motor{k}_wanted" for k in range(1, 5))
DRAG_PER_S = {f"d_{axis}": drag / MASS_KG for axis, drag in zip("xyz", DRAG_N_S_M, strict=True)}
LEVEL_DRAG = {f"rotor_drag.linear {name}": (DRAG_PER_S[name],) * 2 for name in ("d_x", "d_y")}


def flown(name: str, world: World, record: Callable[..., Columns] | None, left_out: Sequence[str]) -> list[FlightLog]:
    """Return the log of a flight; its seed is its name."""
    rng = np.random.default_rng(list(name.encode()))
    columns = fly(world, rng)
    columns = record(columns, rng) if record else columns
    hidden = NEVER_LOGGED | {*left_out, *(() if set(RPM) <= set(left_out) else ("throttle_cmd",))}
    return [FlightLog(f"{name}.csv", None, {key: v[::LOG_EVERY] for key, v in columns.items() if key not in hidden})]


def vehicle_file(rotor: Mapping[str, float] = MappingProxyType({}), mass_kg: float = MASS_KG) -> dict[str, Any]:
    """Return the vehicle as its user wrote it."""
    spins = ["ccw" if spin > 0 else "cw" for spin in SPIN]
    right = {"radius_m": RADIUS_M, "thrust_n_per_rpm2": THRUST_N_PER_RPM2, "torque_to_thrust_m": TORQUE_TO_THRUST_M}
    return {
        "name": "traveller",
        "mass_kg": mass_kg,
        "inertia_kg_m2": INERTIA_KG_M2.tolist(),
        "rotor": right | {"time_constant_s": 0.035} | dict(rotor),
        "rotors": [{"position_m": [*arm.tolist(), 0.0], "spin": spin} for arm, spin in zip(ARMS_M, spins, strict=True)],
        "rotor_height_m": ROTOR_HEIGHT_M,
        "throttle": {"per_newton": PER_NEWTON, "offset": THROTTLE_OFFSET, "max_thrust_per_rotor_n": 5.5},
    }


def trap(
    name: str,
    text: str,
    world: World,
    families: Sequence[str] = (),
    intervals: Mapping[str, tuple[float, float]] = LEVEL_DRAG,
    record: Callable[..., Columns] | None = None,
    left_out: Sequence[str] = (),
    model: dict[str, Any] | None = None,
    clean: bool = False,
    beyond: bool = False,
) -> Trap:
    """Return a trap of one flight; `clean`: nothing is missing, `beyond`: much is that no family explains."""
    verdicts = ("none", "unexplained") if clean else ("unexplained",)
    words = (*([" + ".join(families)] if families else []), *verdicts)
    honest = Honest(", or ".join(words), frozenset(families), frozenset(verdicts), intervals, beyond=beyond)
    return Trap(name, model or vehicle_file(), honest, text, partial(flown, name, world, record, left_out))


THIRD: tuple[Trap, ...] = (
    trap(
        "late_link",
        "All motion comes 0 to 90 ms late, by a link that wanders; drag and a moment of 0.012 N m for each m/s of "
        "airspeed, 1.33 mm of thrust in hover.",
        World(DRAG_N_S_M, 0.3, airspeed_moment_n_s=0.012),
        ("rotor_drag", "airspeed_moment"),
        LEVEL_DRAG | {"airspeed_moment.isotropic k": (1.29, 1.33)},
        wandering_link,
        IMU,
    ),
    trap(
        "slanted_room",
        "The vertical of motion capture leans by 1.6 degrees, which the accelerometer can tell; nothing is missing.",
        World(),
        record=slanted_room,
        clean=True,
    ),
    trap(
        "late_voltage",
        "No rotor speeds; the battery sags and its monitor shows it 6 s later; drag.",
        World(DRAG_N_S_M, 0.3, sag=True),
        ("battery_sag", "rotor_drag", "thrust_map", "thrust_curve"),
        record=late_voltage,
        left_out=IMU + RPM,
    ),
    trap(
        "wished_speeds",
        "Rotor speeds are commands; the rotors lag 0.08 s, the file says 0.03 s; drag.",
        World(DRAG_N_S_M, 0.3, rotor_lag_s=0.08),
        ("rotor_drag", "motor_lag"),
        LEVEL_DRAG | {"motor_lag.first_order time_constant_s": (0.08, 0.08)},
        commands_as_speeds,
        model=vehicle_file({"time_constant_s": 0.03}),
    ),
    trap(
        "smooth_track",
        "The position lags by two filters of 0.08 s, the velocity with it; the file's mass is 6 % low; ground effect.",
        World(gust_m_s=0.3, ground=0.25),
        ("thrust_scale", "ground_effect"),
        record=filtered_position,
        left_out=IMU,
        model=vehicle_file(mass_kg=0.865),
    ),
    trap(
        "loaded_corner",
        "The centre of mass is 8 mm forward and 6 mm right of the file's, a moment of 0.09 N m; inertia 20 % off.",
        World(centre_m=(0.008, 0.006), inertia_factor=(1.2, 0.83, 1.2)),
    ),
    trap(
        "hung_load",
        "0.25 kg of the mass swing on a string of 0.9 m; the whole mass is right; drag.",
        World(DRAG_N_S_M, 0.3, slosh_kg=0.25, slosh_rad_s=3.3),
        ("rotor_drag",),
        beyond=True,
    ),
    trap(
        "thermal",
        "An updraft of 1.5 m/s stands over one place; thrust falls by 4 % for each m/s of climb through the air; drag.",
        World(DRAG_N_S_M, 0.3, inflow_s_m=0.04, plume_m_s=1.5),
        ("rotor_drag", "inflow"),
        left_out=IMU,
        beyond=True,
    ),
    trap(
        "vent",
        "A vent in the floor pushes up by 0.6 N from 14 to 27 s, in the lowest hovers, not in low passes later; drag.",
        World(DRAG_N_S_M, 0.3, vent_n=0.6),
        ("rotor_drag",),
        beyond=True,
    ),
    trap(
        "gale",
        "Gusts of 2 m/s with mean zero; the model has the right drag, nothing is missing.",
        World(DRAG_N_S_M, 2.0),
        model={"vehicle": vehicle_file(), "effects": [{"effect": "rotor_drag.linear", "parameters": DRAG_PER_S}]},
        clean=True,
    ),
)
