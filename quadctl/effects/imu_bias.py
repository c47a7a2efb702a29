"""Accelerometer bias: the inertial unit measures a specific force that is not there."""

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

from quadctl.effects.base import Conditions, Effect, parameter
from quadctl.numeric import Vector

LEAST_M_S2 = 0.16
"""Smallest bias that counts: less is within the calibration of any small accelerometer."""


@dataclass(frozen=True)
class ConstantBias(Effect):
    """The accelerometer reads `x`, `y`, `z` more than the specific force, in body axes.

    Nothing pushes the vehicle: the bias shows only where the accelerometer and the change of velocity disagree.
    """

    name: ClassVar[str] = "imu_bias.offset"
    source: ClassVar[str] = "error model of inertial sensors, as in PX4's EKF2"
    depends_on: ClassVar[tuple[str, ...]] = ()
    physics: ClassVar[str] = "The accelerometer reads a force that is not there: the velocity does not follow it."
    distinguished_by: ClassVar[str] = "accelerometer against the change of velocity: a real force moves both"
    mission: ClassVar[str] = "missions/hover_staircase_high.yaml"

    x: float = parameter(0.0, -5.0, 5.0, "m/s^2", "bias forward")
    y: float = parameter(0.0, -5.0, 5.0, "m/s^2", "bias to the right")
    z: float = parameter(0.0, -5.0, 5.0, "m/s^2", "bias down")

    def negligible(self) -> bool:
        return math.sqrt(self.x**2 + self.y**2 + self.z**2) < LEAST_M_S2

    def inseparable_from(
        self, missing: Collection[str], ci95: Mapping[str, tuple[float, float]], span: Callable[[str], float]
    ) -> Sequence[str]:
        """A tilted thrust beside it: the two may be one error of the attitude estimate."""
        return ["thrust_tilt"] if "thrust_tilt" in missing else []

    def sensed_m_s2(self, c: Conditions) -> Vector:
        return self.x, self.y, self.z
