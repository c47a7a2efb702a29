"""Errors of a barometer that is carried by rotors: air speed, ground, throttle, drift.

The height error of a pressure error dp is -dp / (rho g), and a static port errs by a share of the dynamic pressure
rho v^2 / 2: the density drops out.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from quadctl.effects.base import parameter
from quadctl.effects.sensor_error import SensorConditions, SensorError
from quadctl.frames import GRAVITY_M_S2
from quadctl.numeric import Number

RUNS = "missions/barometer_runs.yaml"
RATIO = "static pressure error over dynamic pressure in flight"
SPEED_M_S, STEEP_M, DRIVE = 1.5, 0.5, 0.05
"""Spans that show an error: speed through the air, height near the ground, share of thrust."""
LOW_M = 1.0
"""Height below which the error of the ground shows."""
FADED_M = 0.05
"""Error that is left at the height up to which an autopilot expects the ground's effect."""


@dataclass(frozen=True)
class AirspeedError(SensorError):
    """The pressure at the barometer changes with the air speed, by the side from which the air comes."""

    name: ClassVar[str] = "barometer.airspeed"
    sensor: ClassVar[str] = "barometer"
    source: ClassVar[str] = "PX4 EKF2_PCOEF_*, ArduPilot AP_Baro_Wind.cpp (BAROn_WCF_*)"
    formula: ClassVar[str] = r"\Delta h = -\sum_i c_i v_i^2 / (2 g)"
    physics: ClassVar[str] = "Air that flows past the barometer changes its pressure: the height errs with speed."
    distinguished_by: ClassVar[str] = "runs in all directions at two speeds, at a height that another sensor measures"
    mission: ClassVar[str] = RUNS
    feels_wind: ClassVar[bool] = True

    forward: float = parameter(0.0, -2.0, 2.0, "", f"{RATIO} forward")
    backward: float = parameter(0.0, -2.0, 2.0, "", f"{RATIO} backward")
    right: float = parameter(0.0, -2.0, 2.0, "", f"{RATIO} to the right")
    left: float = parameter(0.0, -2.0, 2.0, "", f"{RATIO} to the left")
    down: float = parameter(0.0, -2.0, 2.0, "", f"{RATIO} down")
    up: float = parameter(0.0, -2.0, 2.0, "", f"{RATIO} up")

    @classmethod
    def unshown(cls, flights: Sequence[SensorConditions]) -> str:
        fastest = max(float(np.percentile(np.sqrt(sum(v**2 for v in c.velocity_body_m_s)), 99.0)) for c in flights)
        return "" if fastest > SPEED_M_S else "speed"

    def error_m(self, c: SensorConditions) -> Number:
        sides = ((self.forward, self.backward), (self.right, self.left), (self.down, self.up))
        pressure: Number = 0.0
        for (ahead, behind), speed in zip(sides, c.velocity_body_m_s, strict=True):
            pressure = pressure + ahead * np.maximum(speed, 0.0) ** 2 + behind * np.minimum(speed, 0.0) ** 2
        return -pressure / (2.0 * GRAVITY_M_S2)


@dataclass(frozen=True)
class GroundError(SensorError):
    """The air under a vehicle near the ground presses on the barometer, or is thinned where it flows past it fast."""

    name: ClassVar[str] = "barometer.ground"
    sensor: ClassVar[str] = "barometer"
    source: ClassVar[str] = "PX4 EKF2_GND_EFF_DZ, issue 26655; exponential over height, in proportion to the thrust"
    formula: ClassVar[str] = r"\Delta h = a \, (T / T_{hover}) \, e^{-h / b}"
    physics: ClassVar[str] = "The rotors' air is dammed up by the ground: the barometer errs near it, to either side."
    distinguished_by: ClassVar[str] = "hovers at several heights near the ground, which a range finder measures"
    mission: ClassVar[str] = RUNS
    scales: ClassVar[dict[str, tuple[float, ...]]] = {"fade_m": (0.1, 0.15, 0.22, 0.33, 0.5, 0.75, 1.1, 1.6)}

    at_ground_m: float = parameter(0.0, -10.0, 10.0, "m", "error at the ground in hover")
    fade_m: float = parameter(0.4, 0.02, 5.0, "m", "height over which it falls to 1/e")

    @property
    def faded_at_m(self) -> float:
        """Height above which less than FADED_M of the error in hover is left."""
        return self.fade_m * math.log(max(abs(self.at_ground_m) / FADED_M, 1.0))

    @classmethod
    def unshown(cls, flights: Sequence[SensorConditions]) -> str:
        above = np.concatenate([np.atleast_1d(c.height_m) for c in flights])
        low = float(np.percentile(above, 3)) < LOW_M
        return "" if low and float(np.ptp(np.percentile(above, (3, 97)))) > STEEP_M else "height"

    def error_m(self, c: SensorConditions) -> Number:
        return self.at_ground_m * c.thrust_share * np.exp(-np.maximum(c.height_m, 0.0) / self.fade_m)


@dataclass(frozen=True)
class ThrottleError(SensorError):
    """The pressure around the vehicle changes with the thrust."""

    name: ClassVar[str] = "barometer.throttle"
    sensor: ClassVar[str] = "barometer"
    source: ClassVar[str] = "ArduPilot BAROn_THST_SCALE"
    formula: ClassVar[str] = r"\Delta h = a \, T / T_{hover}"
    physics: ClassVar[str] = "The rotors change the pressure around the vehicle, in proportion to their thrust."
    distinguished_by: ClassVar[str] = "climbs and stops that change the thrust far from the ground"
    mission: ClassVar[str] = "missions/vertical_runs.yaml"

    in_hover_m: float = parameter(0.0, -20.0, 20.0, "m", "error in hover")

    @classmethod
    def unshown(cls, flights: Sequence[SensorConditions]) -> str:
        return "" if max(float(np.std(c.thrust_share)) for c in flights) > DRIVE else "thrust"

    def error_m(self, c: SensorConditions) -> Number:
        return self.in_hover_m * c.thrust_share


@dataclass(frozen=True)
class DriftError(SensorError):
    """The reading changes with the sensor's temperature, or steadily with time as the weather does."""

    name: ClassVar[str] = "barometer.drift"
    sensor: ClassVar[str] = "barometer"
    source: ClassVar[str] = "linear in time and temperature, as sensors' data sheets give it"
    formula: ClassVar[str] = r"\Delta h = a \, t + b \, (\vartheta - \vartheta_0)"
    physics: ClassVar[str] = "The sensor warms, or the weather changes: the height drifts."
    distinguished_by: ClassVar[str] = "hovers at one height at the begin and at the end of a flight"
    mission: ClassVar[str] = RUNS

    rate_m_s: float = parameter(0.0, -1.0, 1.0, "m/s", "drift")
    per_kelvin_m: float = parameter(0.0, -10.0, 10.0, "m/K", "change with temperature")

    def error_m(self, c: SensorConditions) -> Number:
        return self.rate_m_s * c.time_s + self.per_kelvin_m * c.temperature_k
