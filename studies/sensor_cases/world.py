"""The sensors of a flight: a barometer with its errors, and the reference that a log holds beside it.

Written from physics, without a look at the method that it tests. A static pressure error dp reads as a height error of
-dp / (rho g). Air that flows past gives dp = c rho v^2 / 2, with c of the side that the air comes from; the rotors'
outwash gives a pressure near the ground that is a share of the disc loading.
"""

import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from quadctl.frames import quaternion_from_euler, rotate_inverse
from quadctl.logs.columns import motor_columns, rpm_columns
from quadctl.logs.flight_log import ATTITUDE, POSITION, RATES, VELOCITY, FlightLog, Floats
from quadctl.vehicle import Vehicle

Reference = Literal["motion capture", "range finder", "GPS", "none"]
Form = Literal["exponential", "lorentz", "gauss"]
GRAVITY_M_S2 = 9.81
SIDES = ("forward", "backward", "right", "left", "down", "up")
ESTIMATOR_LAG_S = 2.0
"""Time in which an estimator follows its barometer."""


@dataclass(frozen=True)
class Ground:
    """The error near the ground, at the thrust of the empty vehicle in hover."""

    size_m: float
    fade_m: float
    form: Form

    def share(self, z: Floats) -> Floats:
        """The part of the error that is left at these heights."""
        ratio = np.maximum(z, 0.0) / self.fade_m
        forms = {"exponential": np.exp(-ratio), "lorentz": 1.0 / (1.0 + ratio**2), "gauss": np.exp(-(ratio**2))}
        return forms[self.form]


@dataclass(frozen=True)
class Forces:
    """Forces on the vehicle; the simulator flies it."""

    rotor_drag_per_s: float = 0.0
    drag_area_m2: float = 0.0
    ground_gain: float = 0.0
    ground_width_radii: float = 1.8
    payload_kg: float = 0.0
    wind_m_s: tuple[float, float] = (0.0, 0.0)
    """Toward north and east."""

    def hidden(self) -> dict[str, object]:
        """The file for the simulator."""
        found: dict[str, dict[str, float]] = {}
        if self.rotor_drag_per_s:
            found["rotor_drag.linear"] = {"d_x": self.rotor_drag_per_s, "d_y": 0.9 * self.rotor_drag_per_s, "d_z": 0.0}
        if self.drag_area_m2:
            found["body_drag.quadratic"] = {"area_x_m2": self.drag_area_m2, "area_y_m2": 1.2 * self.drag_area_m2}
        if self.ground_gain:
            found["hidden.ground_cushion"] = {"gain": self.ground_gain, "width": self.ground_width_radii}
        if self.payload_kg:
            found["payload.step"] = {"mass_kg": self.payload_kg}
        if any(self.wind_m_s):
            found["wind.steady"] = {"north_m_s": self.wind_m_s[0], "east_m_s": self.wind_m_s[1], "drag": 0.0}
        return {"effects": [{"effect": name, "parameters": values} for name, values in found.items()]}

    def thrust_ratio(self, z: Floats, vehicle: Vehicle) -> Floats:
        """True thrust over that of the rotor speeds; the simulator's ground cushion."""
        ratio = np.maximum(z, 0.0) / (self.ground_width_radii * vehicle.rotor.radius_m)
        return np.asarray(1.0 + self.ground_gain / (1.0 + ratio**2) ** 1.5)


@dataclass(frozen=True)
class Nuisance:
    """Noise, delay and drift of every sensor."""

    white_m: float
    interval_s: float
    """Time between samples of the barometer, held in the log."""
    wander_m: float
    wander_s: float
    offset_m: float
    delay_s: float
    drift_m_s: float
    range_m: float
    """White noise of the range finder."""
    range_offset_m: float
    gps_m_s: float
    gps_time_s: float
    """Correlation time of the noise of GPS's climb rate."""
    gps_delay_s: float


@dataclass(frozen=True)
class Truth:
    """Errors that the world hides."""

    sides: dict[str, float] = field(default_factory=dict)
    """Coefficients of the static pressure, by the side that the vehicle moves to."""
    ground: Ground | None = None

    @property
    def errors(self) -> set[str]:
        """The names of the hidden errors, as the page of the command has them."""
        named = {"barometer.airspeed"} if any(self.sides.values()) else set()
        return named | ({"barometer.ground"} if self.ground else set())


def observed(
    flown: FlightLog,
    vehicle: Vehicle,
    truth: Truth,
    forces: Forces,
    nuisance: Nuisance,
    reference: Reference,
    seed: int,
) -> FlightLog:
    """The log as a user has it: sensors added, references of the mission and all of the truth left out."""
    chance = np.random.default_rng(seed)
    time_s, z = flown.time_s, flown["z_m"]
    names = [*POSITION, *VELOCITY, *ATTITUDE, *RATES, *rpm_columns(vehicle.n_rotors)]
    names += [name for name in [*motor_columns(vehicle.n_rotors, "output"), "battery_v"] if flown.has(name)]
    columns = {"time_s": time_s} | {name: flown[name].copy() for name in names}
    wrong = height_error(flown, vehicle, truth, forces)
    wrong += _coloured(time_s, nuisance.wander_m, nuisance.wander_s, chance) + nuisance.drift_m_s * time_s
    late = np.interp(time_s - nuisance.delay_s, time_s, z + wrong)
    baro = _held(time_s, late + nuisance.white_m * chance.normal(size=len(time_s)), nuisance.interval_s)
    columns["baro_m"] = np.round(baro + nuisance.offset_m, 3)
    if reference != "motion capture":
        off = _lagged(time_s, baro - z, ESTIMATOR_LAG_S)
        columns["z_m"] += off - off[0]
        columns["vz_m_s"] += np.gradient(off, time_s)
    if reference == "range finder":
        roll, pitch = np.radians(flown["roll_deg"]), np.radians(flown["pitch_deg"])
        slant = (z + nuisance.range_offset_m) / (np.cos(roll) * np.cos(pitch))
        seen = slant + nuisance.range_m * chance.normal(size=len(z))
        columns["range_m"] = np.asarray(np.round(np.maximum(_held(time_s, seen, 0.04), 0.02), 2), dtype=np.float64)
    if reference == "GPS":
        climb = np.interp(time_s - nuisance.gps_delay_s, time_s, flown["vz_m_s"])
        noise = _coloured(time_s, nuisance.gps_m_s, nuisance.gps_time_s, chance)
        columns["gps_vz_m_s"] = np.round(_held(time_s, climb + noise, 0.1), 3)
    # A sidecar that names an autopilot says that the height leans on the barometer; a table of motion capture has none.
    meta = {} if reference == "motion capture" else {"autopilot": "PX4", "parameters": {"EKF2_BARO_CTRL": 1}}
    return FlightLog("flight.csv", None, columns, None, meta)


def height_error(flown: FlightLog, vehicle: Vehicle, truth: Truth, forces: Forces) -> Floats:
    """Error of the barometer's height by pressure, m, shape (n,)."""
    north, east = forces.wind_m_s
    roll, pitch, yaw = (np.radians(flown[name]) for name in ATTITUDE)
    through_air = (flown["vx_m_s"] - north, flown["vy_m_s"] - east, -flown["vz_m_s"])
    along = rotate_inverse(quaternion_from_euler(roll, pitch, yaw), through_air)
    wrong = np.zeros(len(flown))
    pairs = (("forward", "backward"), ("right", "left"), ("down", "up"))
    for speed, (ahead, astern) in zip(along, pairs, strict=True):
        coefficient = np.where(speed > 0.0, truth.sides.get(ahead, 0.0), truth.sides.get(astern, 0.0))
        wrong -= coefficient * speed**2 / (2.0 * GRAVITY_M_S2)
    if truth.ground:
        z = flown["z_m"]
        rpm = np.nan_to_num(np.stack([flown[name] for name in rpm_columns(vehicle.n_rotors)]))
        thrust_n = vehicle.rotor.thrust_n_per_rpm2 * (rpm**2).sum(axis=0) * forces.thrust_ratio(z, vehicle)
        loading = thrust_n / (vehicle.mass_kg * GRAVITY_M_S2)
        wrong += truth.ground.size_m * loading * truth.ground.share(z + vehicle.rotor_height_m)
    return wrong


def _coloured(time_s: Floats, size: float, correlation_s: float, chance: np.random.Generator) -> Floats:
    """A Gauss-Markov process."""
    kept = np.exp(-np.diff(time_s, prepend=time_s[0] - 0.02) / correlation_s)
    push = size * np.sqrt(1.0 - kept**2) * chance.normal(size=len(time_s))
    values = np.empty(len(time_s))
    value = size * float(chance.normal())
    for i, (share, step) in enumerate(zip(kept, push, strict=True)):
        value = share * value + step
        values[i] = value
    return values


def _held(time_s: Floats, values: Floats, interval_s: float) -> Floats:
    """The values as a slower sensor sends them: the last one is held."""
    number = np.floor((time_s - time_s[0]) / interval_s + 1e-6)
    first = np.flatnonzero(np.diff(number, prepend=-1.0) > 0)
    return values[first[np.searchsorted(first, np.arange(len(values)), side="right") - 1]]


def _lagged(time_s: Floats, values: Floats, lag_s: float) -> Floats:
    """The values behind a first-order lag, which begins at rest."""
    out = np.empty(len(values))
    value = float(values[:50].mean())
    for i, (new, step_s) in enumerate(zip(values, np.diff(time_s, prepend=time_s[0]), strict=True)):
        value += (1.0 - math.exp(-step_s / lag_s)) * (new - value)
        out[i] = value
    return out
