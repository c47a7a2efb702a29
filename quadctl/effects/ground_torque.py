"""Ground torque: near the ground a tilted vehicle is turned back to level."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from quadctl.effects.base import Conditions, Effect, ThrustRatio, parameter
from quadctl.frames import euler_from_quaternion
from quadctl.numeric import Number, Vector, exp, maximum
from quadctl.vehicle import Vehicle

MOST_OF_IMPLIED = 2.0
"""Largest moment, over that which a ground effect on each rotor at its own height gives, that counts as part of it."""

LEAST_STIFFNESS = 0.1
"""Smallest moment that counts, over thrust and rotor radius, per rad."""


@dataclass(frozen=True)
class Levelling(Effect):
    """A moment -T_total stiffness R exp(-z / (reach R)) (roll, pitch): a tilted vehicle's lower side lifts more."""

    name: ClassVar[str] = "ground_torque.levelling"
    source: ClassVar[str] = "Kan et al. 2019, IEEE RA-L: restoring moment near the ground, in outline"
    depends_on: ClassVar[tuple[str, ...]] = ("height_over_radius",)
    physics: ClassVar[str] = "Near the ground the lower rotors of a tilted vehicle lift more and turn it back to level."
    distinguished_by: ClassVar[str] = "the balance of moments in runs close to the ground"
    mission: ClassVar[str] = "missions/forward_runs.yaml"
    essential: ClassVar[tuple[str, ...]] = ("stiffness",)

    stiffness: float = parameter(0.5, 0.0, 50.0, "1/rad", "moment at the ground, over thrust and rotor radius")
    reach: float = parameter(1.0, 0.2, 10.0, "", "height, in rotor radii, over which it falls to 1/e")

    def negligible(self) -> bool:
        """True where one radius above the ground, at a lean of 0.1 rad, it moves the thrust by less than a hundredth of
        the radius: rotors that are 1 % off do as much."""
        return self.stiffness * math.exp(-1.0 / self.reach) < LEAST_STIFFNESS

    def implied_by(self, others: Sequence[Effect], flights: Sequence[Conditions], vehicle: Vehicle) -> bool:
        """True where a ground effect of the model, on each rotor at its own height, gives at least half of this moment.

        The lower rotors of a tilted vehicle gain -K'(z) y phi of their thrust, y being their arm: a stiffness of
        -K'(z) times the mean square of the arms, per thrust.
        """
        ground = [e for e in others if e.family() == "ground_effect" and isinstance(e, ThrustRatio)]
        if not ground:
            return False
        radius = vehicle.rotor.radius_m
        arms = [max(rotor.position_m[0] ** 2, rotor.position_m[1] ** 2) for rotor in vehicle.rotors]
        mean_square_m2 = sum(arms) / len(arms)
        own, implied = [], []
        for c in flights:
            height = np.maximum(c.height_m, 0.1 * radius)
            step = 0.02 * radius
            above, below = (
                sum(e.ratio(replace(c, height_m=height + dz), vehicle) - 1.0 for e in ground) for dz in (step, -step)
            )
            implied.append(-(above - below) / (2.0 * step) * mean_square_m2)
            own.append(self.stiffness * radius * np.exp(-height / (self.reach * radius)))
        expected = np.concatenate(implied)
        return bool(np.concatenate(own) @ expected < MOST_OF_IMPLIED * (expected @ expected))

    def torque(self, thrust_n: Sequence[Number], c: Conditions, vehicle: Vehicle) -> Vector:
        radius = vehicle.rotor.radius_m
        roll, pitch, _ = euler_from_quaternion(c.attitude)
        near = exp(-maximum(c.height_m, 0.0) / (self.reach * radius))
        spring = -sum(thrust_n) * self.stiffness * radius * near
        return spring * roll, spring * pitch, 0.0 * spring
