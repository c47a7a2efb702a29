"""Ceiling effect: below a ceiling the air that the rotors draw in has to squeeze through, and thrust grows."""

from dataclasses import dataclass
from typing import ClassVar

from quadctl.effects.base import Conditions, ThrustRatio, parameter
from quadctl.numeric import Number, maximum, sqrt
from quadctl.vehicle import Vehicle

LOWEST_DISTANCE_OVER_RADIUS = 0.2
"""Smallest distance of the rotor plane from the ceiling that is used, rotor radii."""


@dataclass(frozen=True)
class MomentumCeiling(ThrustRatio):
    """K = 1/2 + 1/2 sqrt(1 + gain / (8 (D/R)^2)), D being the distance from the rotor plane to the ceiling.

    Momentum theory of a disk that draws its air through the gap below the ceiling gives gain = 1; neighbouring rotors
    make it larger: 15 to 20 % more thrust at one radius (Jimenez-Cano et al. 2019) is a gain of 6 to 8, and a thrust
    that falls more slowly with the distance needs more. The vehicle file says how high the ceiling is (`ceiling_m`);
    without it there is none.
    """

    name: ClassVar[str] = "ceiling_effect.momentum"
    source: ClassVar[str] = "Hsiao & Chirarattananon 2019, IEEE/ASME T-Mech, thrust ratio at constant rotor speed"
    depends_on: ClassVar[tuple[str, ...]] = ("height_over_radius",)
    physics: ClassVar[str] = (
        "Close to a ceiling the rotors draw their air through a narrow gap: the same rotor speed gives more thrust."
    )
    distinguished_by: ClassVar[str] = "hovering within two rotor radii of the ceiling"
    mission: ClassVar[str] = "missions/hover_staircase_high.yaml"

    gain: float = parameter(1.0, 0.0, 30.0, "", "1 for a single rotor")

    @classmethod
    def applies_to(cls, vehicle: Vehicle) -> bool:
        return vehicle.ceiling_m is not None

    def ratio(self, c: Conditions, vehicle: Vehicle) -> Number:
        if vehicle.ceiling_m is None:
            return 1.0
        distance = maximum(vehicle.ceiling_m - c.height_m, LOWEST_DISTANCE_OVER_RADIUS * vehicle.rotor.radius_m)
        return 0.5 + 0.5 * sqrt(1.0 + self.gain / 8.0 * (vehicle.rotor.radius_m / distance) ** 2)
