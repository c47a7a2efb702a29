"""Centre of mass: it lies off the middle that the vehicle file's rotors stand around."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from quadctl.effects.base import Conditions, Effect, parameter
from quadctl.numeric import Number, Vector
from quadctl.vehicle import Vehicle

LEAST_MM = 2.0
"""Offset that hands leave that strap in a battery."""


@dataclass(frozen=True)
class FixedOffset(Effect):
    """A moment T_total (y, -x, 0): the thrust acts at the middle of the rotors, (x, y) off the centre of mass.

    Rotors that are not alike (`rotor_fault.unequal`) make the same moments, and one about yaw: one that is `loss` weak
    those of an offset of loss / n times its arm. The lab takes either for a trim of the flight; `quadctl rotation`
    finds it in the rotors' mean commands.
    """

    name: ClassVar[str] = "centre_of_mass.shifted"
    source: ClassVar[str] = "r x F about the centre of mass"
    formula: ClassVar[str] = r"M = T \, (y, -x, 0)"
    depends_on: ClassVar[tuple[str, ...]] = ()
    physics: ClassVar[str] = "The centre of mass is off the middle of the rotors: some of them carry more than others."
    distinguished_by: ClassVar[str] = (
        "the rotors' mean commands: `quadctl rotation`; rotors that are not alike look the same"
    )
    mission: ClassVar[str] = "missions/hover_staircase_high.yaml"
    candidate: ClassVar[bool] = False

    forward_mm: float = parameter(0.0, -500.0, 500.0, "mm", "centre of mass before the middle of the rotors")
    right_mm: float = parameter(0.0, -500.0, 500.0, "mm", "centre of mass right of the middle of the rotors")

    def negligible(self) -> bool:
        return math.hypot(self.forward_mm, self.right_mm) < LEAST_MM

    def torque(self, thrust_n: Sequence[Number], c: Conditions, vehicle: Vehicle) -> Vector:
        total = sum(thrust_n)
        return 1e-3 * self.right_mm * total, -1e-3 * self.forward_mm * total, 0.0 * total
