"""Ground effect: near the ground the rotors' wake is dammed up and the same rotor speed gives more thrust.

Each variant gives K = T_IGE / T_OGE over the height z of the rotor plane above the ground, R being the rotor radius,
d the distance between neighbouring rotor axes and b that between opposite ones. The textbook forms have a pole near
the ground; they are evaluated no lower than `LOWEST_HEIGHT_OVER_RADIUS` rotor radii, which is also where the
experiments behind them end.
"""

from dataclasses import dataclass
from typing import ClassVar

from quadctl.effects.base import Conditions, ThrustRatio, parameter
from quadctl.numeric import Number, exp, maximum
from quadctl.vehicle import Vehicle

LOWEST_HEIGHT_OVER_RADIUS = 0.5


@dataclass(frozen=True)
class GroundEffect(ThrustRatio):
    """What the variants share: they depend on height alone."""

    depends_on: ClassVar[tuple[str, ...]] = ("height_over_radius",)
    physics: ClassVar[str] = (
        "Near the ground the rotors' downwash is dammed up: the lower, the more thrust the same rotor speed gives."
    )
    told_apart_by: ClassVar[str] = "hovering at many heights, the lowest within one rotor radius of the ground"
    mission: ClassVar[str] = "missions/hover_staircase.yaml"

    def ratio(self, c: Conditions, vehicle: Vehicle) -> Number:
        return self.at_height(maximum(c.height_m, LOWEST_HEIGHT_OVER_RADIUS * vehicle.rotor.radius_m), vehicle)

    def at_height(self, z: Number, vehicle: Vehicle) -> Number:
        """K at the height `z` of the rotor plane, metres, not below the validity limit."""
        raise TypeError(f"{type(self).__name__} does not say its thrust ratio over height")


@dataclass(frozen=True)
class Cheeseman(GroundEffect):
    """K = 1 / (1 - (R/4z)^2): an image source below one rotor."""

    name: ClassVar[str] = "ground_effect.cheeseman"
    source: ClassVar[str] = "Cheeseman & Bennett 1955, ARC R&M 3021, eq. for V = 0"

    def at_height(self, z: Number, vehicle: Vehicle) -> Number:
        return 1.0 / (1.0 - (vehicle.rotor.radius_m / (4.0 * z)) ** 2)


@dataclass(frozen=True)
class Hayden(GroundEffect):
    """K = (0.9926 + 0.03794 / (z/2R)^2)^(2/3), from helicopter flight tests; tends to 0.995, not to 1, far away."""

    name: ClassVar[str] = "ground_effect.hayden"
    source: ClassVar[str] = "Hayden 1976, The effect of the ground on helicopter hovering power required"

    def at_height(self, z: Number, vehicle: Vehicle) -> Number:
        diameters = z / (2.0 * vehicle.rotor.radius_m)
        return (0.9926 + 0.03794 / diameters**2) ** (2.0 / 3.0)


@dataclass(frozen=True)
class Sanchez(GroundEffect):
    """Image sources below all rotors of a quadrotor, and the fountain between them, weighted with k_b, on its body."""

    name: ClassVar[str] = "ground_effect.sanchez"
    source: ClassVar[str] = "Sanchez-Cuevas et al. 2017, Int. J. Aerospace Eng.; Dena et al. eq. 15"

    k_b: float = parameter(2.0, 0.0, 6.0, "", "weight of the fountain on the body (2 in the thesis, 0.4509 in Dena)")

    def at_height(self, z: Number, vehicle: Vehicle) -> Number:
        r, d, b = vehicle.rotor.radius_m, vehicle.adjacent_distance_m, vehicle.opposite_distance_m
        z4 = 4.0 * z * z
        own = (r / (4.0 * z)) ** 2
        neighbours = r * r * z / (d * d + z4) ** 1.5
        opposite = 0.5 * r * r * z / (2.0 * d * d + z4) ** 1.5
        fountain = 2.0 * r * r * z * self.k_b / (b * b + z4) ** 1.5
        return 1.0 / (1.0 - own - neighbours - opposite - fountain)


@dataclass(frozen=True)
class Exponential(GroundEffect):
    """K = c + a exp(-b z): the compact form found by sparse regression, made physical by c = 1 (no effect far away).

    The thesis fits c = 1.028 (a = 0.114, b = 5.388) and c = 0.988 (a = 0.147, b = 4.368); c other than 1 adds or
    removes thrust at every height and belongs to `thrust_scale`.
    """

    name: ClassVar[str] = "ground_effect.exponential"
    source: ClassVar[str] = "Appius, thesis, eq. 14 and 16, with c = 1"

    a: float = parameter(0.114, 0.0, 1.5, "", "gain in thrust at height 0")
    b: float = parameter(5.388, 0.3, 60.0, "1/m", "rate at which it fades with height")
    c: float = parameter(1.0, 0.8, 1.2, "", "ratio far away", fitted=False)

    def at_height(self, z: Number, vehicle: Vehicle) -> Number:
        return self.c + self.a * exp(-self.b * z)
