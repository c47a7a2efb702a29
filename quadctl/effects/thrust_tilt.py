"""Thrust tilt: the thrust axis is not the vertical axis of the body to which the attitude refers."""

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

from quadctl.effects.base import Conditions, Effect, parameter
from quadctl.numeric import Number, Vector, cos, sin
from quadctl.vehicle import Vehicle

LEAST_DEG = 0.8
"""Smaller trims have all vehicles, and they change between flights."""


@dataclass(frozen=True)
class FixedTilt(Effect):
    """The thrust points as if the vehicle were rolled by `roll_deg` and pitched by `pitch_deg` more.

    Trims of real vehicles are up to 3.5 deg; motors that are canted on purpose, or a frame that is bent, give more.
    """

    name: ClassVar[str] = "thrust_tilt.fixed"
    source: ClassVar[str] = "geometry: R_y(pitch) R_x(roll) (0, 0, -1)"
    depends_on: ClassVar[tuple[str, ...]] = ()
    physics: ClassVar[str] = (
        "The rotors' common axis leans against the attitude estimate's: a steady push to one side of the body."
    )
    distinguished_by: ClassVar[str] = "hovering at several headings: the push turns with the body, wind does not"
    mission: ClassVar[str] = "missions/headings.yaml"
    corrects: ClassVar[tuple[str, ...]] = ("tilt",)

    roll_deg: float = parameter(0.0, -15.0, 15.0, "deg", "thrust leans to the right")
    pitch_deg: float = parameter(0.0, -15.0, 15.0, "deg", "thrust leans backward")

    def negligible(self) -> bool:
        return math.hypot(self.roll_deg, self.pitch_deg) < LEAST_DEG

    def inseparable_from(
        self, missing: Collection[str], ci95: Mapping[str, tuple[float, float]], span: Callable[[str], float]
    ) -> Sequence[str]:
        """A bias of the accelerometer, or a board that is mounted askew, by which an estimator levels."""
        return ["imu_bias"] if span("levelled") and "imu_bias" not in missing else []

    def force(self, total_thrust_n: Number, c: Conditions, vehicle: Vehicle) -> Vector:
        roll, pitch = math.pi / 180.0 * self.roll_deg, math.pi / 180.0 * self.pitch_deg
        return (
            -cos(roll) * sin(pitch) * total_thrust_n,
            sin(roll) * total_thrust_n,
            (1.0 - cos(roll) * cos(pitch)) * total_thrust_n,
        )
