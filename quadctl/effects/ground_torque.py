"""Ground torque: near the ground a tilted vehicle is turned back to level."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from quadctl.effects.base import Conditions, Effect, parameter
from quadctl.frames import euler_from_quaternion
from quadctl.numeric import Number, Vector, exp, maximum
from quadctl.vehicle import Vehicle


@dataclass(frozen=True)
class Levelling(Effect):
    """A moment -T_total stiffness R exp(-z / (reach R)) (roll, pitch): a tilted vehicle's lower side lifts more."""

    name: ClassVar[str] = "ground_torque.levelling"
    source: ClassVar[str] = "Kan et al. 2019, IEEE RA-L: restoring moment near the ground, in outline"
    depends_on: ClassVar[tuple[str, ...]] = ("height_over_radius",)
    physics: ClassVar[str] = "Near the ground the lower rotors of a tilted vehicle lift more and turn it back to level."
    distinguished_by: ClassVar[str] = "the balance of moments in runs close to the ground"
    mission: ClassVar[str] = "missions/forward_runs.yaml"
    affects_moment: ClassVar[bool] = True

    stiffness: float = parameter(0.5, 0.0, 50.0, "1/rad", "moment at the ground, over thrust and rotor radius")
    reach: float = parameter(1.0, 0.2, 10.0, "", "height, in rotor radii, over which it falls to 1/e")

    def negligible(self) -> bool:
        """True where the moment is tiny with the rotor plane one radius above the ground."""
        return self.stiffness * math.exp(-1.0 / self.reach) < 0.2

    def torque(self, thrust_n: Sequence[Number], c: Conditions, vehicle: Vehicle) -> Vector:
        radius = vehicle.rotor.radius_m
        roll, pitch, _ = euler_from_quaternion(c.attitude)
        near = exp(-maximum(c.height_m, 0.0) / (self.reach * radius))
        spring = -sum(thrust_n) * self.stiffness * radius * near
        return spring * roll, spring * pitch, 0.0 * spring
