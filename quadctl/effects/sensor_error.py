"""The base of errors of sensors of the height: what such a sensor reads beyond the true height.

An effect on the motion says what the vehicle does; an error of a sensor says what is read of it. The same object
predicts the reading of a whole log (arrays) and corrupts that of a simulated sensor (floats).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from quadctl.effects.base import Parametric
from quadctl.frames import Quaternion
from quadctl.numeric import Number, Vector


@dataclass(frozen=True, slots=True)
class SensorConditions:
    """Conditions that the error of a sensor may depend on; each field is one value, or one per sample, shape (n,)."""

    height_m: Number
    """Height above the ground."""
    velocity_body_m_s: Vector
    """Velocity relative to the air, FRD."""
    attitude: Quaternion
    """Attitude, body to world."""
    thrust_share: Number = 1.0
    """Thrust over that of hover."""
    time_s: Number = 0.0
    """Time since the take-off."""
    temperature_k: Number = 0.0
    """Temperature of the sensor above that at the take-off."""


@dataclass(frozen=True)
class SensorError(Parametric):
    """Base of all errors of height sensors."""

    sensor: ClassVar[str]
    """Sensor that it acts on: `barometer` or `rangefinder`."""
    scales: ClassVar[dict[str, tuple[float, ...]]] = {}
    """Values to try of the parameters in which the error is not linear, in which all others are."""

    feels_wind: ClassVar[bool] = False
    """True: it goes with the velocity relative to the air, so that it is fitted together with the wind."""

    @classmethod
    def unshown(cls, flights: Sequence[SensorConditions]) -> str:
        """Quantity that these flights do not span, which the error needs; empty where they do."""
        return ""

    def error_m(self, c: SensorConditions) -> Number:
        """Reading beyond the true height, m."""
        raise TypeError(f"{type(self).__name__} does not say its error")
