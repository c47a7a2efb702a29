"""Tether: a cable hangs below the vehicle, and the higher it flies the more of it must be carried."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from quadctl.effects.base import Conditions, Effect, parameter
from quadctl.frames import rotate_inverse
from quadctl.numeric import Vector, maximum
from quadctl.vehicle import Vehicle

THINNER_AIR_PER_M = 1e-4
"""Share of the thrust that rotors lose per metre of height, at the same speed, as the air is thinner there (ISA)."""
LEAST_SPAN_M = 0.5
"""Least span of the heights (5th to 95th percentile) that shows a cable: a controller leaves less of whatever disturbs
it, and such a height follows the error that it would seem to explain."""


@dataclass(frozen=True)
class HangingTether(Effect):
    """A downward force of `weight_n_per_m` per metre of height of the rotor plane above `slack_m`."""

    name: ClassVar[str] = "tether.hanging"
    source: ClassVar[str] = "weight of the lifted part of a cable"
    depends_on: ClassVar[tuple[str, ...]] = ("height_over_radius",)
    physics: ClassVar[str] = "A cable hangs below the vehicle: the higher it flies, the more of it must be carried."
    distinguished_by: ClassVar[str] = "growing with height without end, where a ground effect fades"
    mission: ClassVar[str] = "missions/hover_staircase_high.yaml"

    weight_n_per_m: float = parameter(0.2, 0.0, 20.0, "N/m", "weight of the cable per length")
    slack_m: float = parameter(0.0, 0.0, 50.0, "m", "height below which it carries itself")

    @classmethod
    def starts(cls, flights: Sequence[Conditions], vehicle: Vehicle) -> Sequence[Effect]:
        """A cable that hangs from the ground on, or that pulls from one of the heights flown on."""
        heights = np.concatenate([np.atleast_1d(c.height_m) for c in flights])
        lowest, *between = np.quantile(heights, (0.05, 0.3, 0.55, 0.8))
        return [cls(), *(cls(slack_m=float(height)) for height in between if height - lowest > 0.0 and height < 50.0)]

    def believable(self, flights: Sequence[Conditions], vehicle: Vehicle) -> bool:
        """True for a cable that weighs clearly more than what thinner air costs in thrust."""
        return self.weight_n_per_m > 2.0 * THINNER_AIR_PER_M * vehicle.weight_n

    def distinct(self, flights: Sequence[Conditions], vehicle: Vehicle) -> bool:
        """True where heights were flown, as on a way up: else they follow the errors of the thrust."""
        low, high = np.percentile(np.concatenate([np.atleast_1d(c.height_m) for c in flights]), [5.0, 95.0])
        return bool(high - low > LEAST_SPAN_M)

    def force(self, total_thrust_n: float, c: Conditions, vehicle: Vehicle) -> Vector:
        lifted = maximum(c.height_m - self.slack_m, 0.0)
        return rotate_inverse(c.attitude, (0.0 * lifted, 0.0 * lifted, self.weight_n_per_m * lifted))
