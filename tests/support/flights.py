"""Flights for the tests of the lab: simulated ones, and synthetic logs that obey a model exactly."""

import fcntl
import math
import zlib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import yaml

import quadctl.sitl.run
from quadctl.flight.preflight.preparation import prepare_flight
from quadctl.frames import GRAVITY_M_S2
from quadctl.lab.arrays import Floats
from quadctl.logs.columns import STATE_COLUMNS, rpm_columns
from quadctl.logs.flight_log import ATTITUDE, RATES, FlightLog
from quadctl.logs.read import read_log
from quadctl.model import Model, conditions
from tests.support.places import ROOT

MISSIONS = ROOT / "missions"
CUSHION = ("hidden.ground_cushion", {"gain": 0.25, "width": 1.8})
"""A ground effect that is not in the catalogue."""
SHORTER = {"hover_staircase": ("hover_s=5", "step_s=3"), "step_response": ("settle_s=4", "step_s=12")}
"""Parameters of missions that show the same in less time, which the simulation and every fit take."""


def simulated(
    mission: str, effects: Sequence[tuple[str, dict[str, float]]], seed: int, where: Path, shorter: Sequence[str] = ()
) -> FlightLog:
    """The log of one simulated flight in a world with `effects`, of a mission with the parameters `shorter`."""
    where.mkdir(parents=True, exist_ok=True)
    hidden = where / "hidden.yaml"
    hidden.write_text(yaml.safe_dump({"effects": [{"effect": e, "parameters": p} for e, p in effects]}))
    plan = prepare_flight(MISSIONS / f"{mission}.yaml", ROOT / "config" / "flight_thesis.yaml", "none", None, shorter)
    outcome = quadctl.sitl.run.simulate(plan, where, hidden, seed)
    assert outcome.completed, outcome.ended
    return read_log(outcome.log)


def flown_once(mission: str, effects: Sequence[tuple[str, dict[str, float]]], seed: int, shared: Path) -> FlightLog:
    """The log of `simulated`, as short as it may be, in a folder that all processes share: the first to ask flies."""
    where = shared / f"{mission}-{zlib.crc32(repr(effects).encode())}-{seed}"
    where.mkdir(parents=True, exist_ok=True)
    with (where / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        for path in where.glob("*.csv"):
            return read_log(path)
        return simulated(mission, effects, seed, where, SHORTER.get(mission, ()))


def obedient(
    model: Model,
    seconds: float = 60.0,
    rate_hz: float = 50.0,
    noise_m_s: float = 0.0,
    seed: int = 0,
    name: str = "made.csv",
) -> FlightLog:
    """A level flight of waves over height, whose rotor speeds give exactly the accelerations by `model`.

    `noise_m_s`: white noise on the logged velocity.
    """
    t = np.arange(0.0, seconds, 1.0 / rate_hz)
    z, vz, az = _wave(t, 0.6, 0.45, 0.25)
    vehicle = model.vehicle
    level = (np.ones_like(t), 0.0 * t, 0.0 * t, 0.0 * t)
    c = conditions(vehicle, z, (0.0 * t, 0.0 * t, -vz), level, t)
    # Thrust ratios do not depend on the thrust here, so one evaluation at hover inverts the model.
    hover = [np.full_like(t, vehicle.weight_n / vehicle.n_rotors)] * vehicle.n_rotors
    ratio = sum(model.rotor_thrust(hover, c)) / vehicle.weight_n
    each = vehicle.mass_kg * (az + GRAVITY_M_S2) / ratio / vehicle.n_rotors
    random = np.random.default_rng(seed)
    columns = {column: np.zeros_like(t) for column in STATE_COLUMNS}
    columns |= {"time_s": t, "z_m": z, "vz_m_s": vz + noise_m_s * random.standard_normal(len(t))}
    for column in ("vx_m_s", "vy_m_s"):
        columns[column] = max(noise_m_s, 1e-6) * random.standard_normal(len(t))
    for column in ("x_m", "y_m", *ATTITUDE, *RATES):
        columns[column] = 1e-6 * random.standard_normal(len(t))
    rpm = np.sqrt(each / vehicle.rotor.thrust_n_per_rpm2)
    columns |= dict.fromkeys(rpm_columns(vehicle.n_rotors), rpm)
    return FlightLog(name=name, path=None, columns=columns)


def swaying(model: Model, late_s: float = 0.0, seed: int = 1) -> FlightLog:
    """A minute of flight by a rigid `model` that rises and falls steadily, 8 m above the ground, by satellites: the
    velocity is off by some centimetres a second for seconds, and rotor speeds are logged `late_s` late."""
    t, step_s, forgets_s = np.arange(0.0, 60.0, 0.04), 0.04, 3.0
    w, size_m, off_m_s, vehicle = 2.0 * np.pi / 3.0, 0.3, 0.03, model.vehicle
    random = np.random.default_rng(seed)
    drift = np.zeros((3, len(t)))
    for i in range(1, len(t)):
        kick = off_m_s * np.sqrt(2.0 * step_s / forgets_s) * random.standard_normal(3)
        drift[:, i] = drift[:, i - 1] * (1.0 - step_s / forgets_s) + kick
    level = {name: 1e-6 * random.standard_normal(len(t)) for name in ("x_m", "y_m", *ATTITUDE, *RATES)}
    each = vehicle.mass_kg * (GRAVITY_M_S2 - size_m * w**2 * np.sin(w * t)) / vehicle.n_rotors
    rpm = np.interp(t - late_s, t, np.sqrt(each / vehicle.rotor.thrust_n_per_rpm2))
    columns = {column: np.zeros_like(t) for column in STATE_COLUMNS} | level
    columns |= {"time_s": t, "z_m": 8.0 + size_m * np.sin(w * t), "vx_m_s": drift[0], "vy_m_s": drift[1]}
    columns |= {"vz_m_s": size_m * w * np.cos(w * t) + drift[2], **dict.fromkeys(rpm_columns(vehicle.n_rotors), rpm)}
    return FlightLog(name="swaying.csv", path=None, columns=columns)


def to_and_fro(log: FlightLog, speed_m_s: float) -> FlightLog:
    """The same flight, carried to and fro along both axes at up to `speed_m_s` on each."""
    w, columns = 2.0 * np.pi * 0.05, dict(log.columns)
    for along, speed in (("x_m", "vx_m_s"), ("y_m", "vy_m_s")):
        columns[along] = columns[along] - speed_m_s / w * np.cos(w * log.time_s)
        columns[speed] = columns[speed] + speed_m_s * np.sin(w * log.time_s)
    return replace(log, columns=columns)


def with_late_rotors(log: FlightLog, late_s: float, lag_s: float = 0.0) -> FlightLog:
    """The same flight with rotor speeds that are logged late, or of motors that follow them with a lag."""
    t = log.time_s
    columns = dict(log.columns)
    for name in (name for name in columns if name.endswith("_rpm")):
        thrust = columns[name] ** 2
        columns[name] = np.interp(t - late_s, t, np.sqrt(thrust + lag_s * np.gradient(thrust, t)))
    return replace(log, columns=columns)


def _wave(t: Floats, centre: float, size: float, hz: float) -> tuple[Floats, Floats, Floats]:
    """Value, first and second derivative of a wave whose size swells slowly, so that heights mix."""
    w, s = 2.0 * math.pi * hz, 2.0 * math.pi * 0.02
    a, da, dda = size * np.sin(s * t) ** 2, size * s * np.sin(2 * s * t), 2 * size * s * s * np.cos(2 * s * t)
    return (
        centre + a * np.sin(w * t),
        da * np.sin(w * t) + a * w * np.cos(w * t),
        dda * np.sin(w * t) + 2 * da * w * np.cos(w * t) - a * w * w * np.sin(w * t),
    )
