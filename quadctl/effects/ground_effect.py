"""Ground effect: near the ground the rotors' wake is dammed up and the same rotor speed gives more thrust.

Each variant gives K = T_IGE / T_OGE over the height z of the rotor plane above the ground, R being the rotor radius,
d the distance between neighbouring rotor axes and b that between opposite ones. The textbook forms have a pole near
the ground; they are evaluated no lower than `LOWEST_HEIGHT_OVER_RADIUS` rotor radii, which is also where the
experiments behind them end. A pole above that height is left where it is, for the check before flight to find.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from quadctl.effects.base import Conditions, ThrustRatio, parameter
from quadctl.frames import rotate
from quadctl.numeric import Number, exp, inverse, maximum
from quadctl.vehicle import Vehicle

LOWEST_HEIGHT_OVER_RADIUS = 0.5
REACH_RADII, LEFT_THERE = 8.0, 0.2
"""Height at which a ground effect has faded to less than this share of what it is at one radius: measurements find none
above four to six radii (Sanchez-Cuevas et al. 2017), and the textbook forms leave 1 to 6 % of it there."""
LEAST_VARIATION = 0.5
"""Least variation of a ground effect over the flights, as a share of its largest value: less is a constant factor."""


@dataclass(frozen=True)
class NearGround(ThrustRatio):
    """Base of all variants."""

    depends_on: ClassVar[tuple[str, ...]] = ("height_over_radius",)
    physics: ClassVar[str] = (
        "Near the ground the rotors' downwash is dammed up: the lower, the more thrust the same rotor speed gives."
    )
    distinguished_by: ClassVar[str] = "hovering at many heights, the lowest within one rotor radius of the ground"
    mission: ClassVar[str] = "missions/hover_staircase.yaml"
    sections_over_radius: ClassVar[tuple[float, ...]] = (LOWEST_HEIGHT_OVER_RADIUS,)
    """Heights, in rotor radii, at which the formula changes to another, or is held."""

    def believable(self, flights: Sequence[Conditions], vehicle: Vehicle) -> bool:
        """True where the ratio varies over these flights by much of what it differs from 1: far from the ground some
        textbook forms leave a factor, which is that of a thrust scale."""
        ratios = np.concatenate([np.atleast_1d(self.ratio(c, vehicle)) for c in flights])
        low, high = np.percentile(ratios, [5.0, 95.0])
        return bool(high - low >= LEAST_VARIATION * max(abs(low - 1.0), abs(high - 1.0)))


@dataclass(frozen=True)
class GroundEffect(NearGround):
    """Base of the variants that depend on height alone and never rise with it."""

    def ratio(self, c: Conditions, vehicle: Vehicle) -> Number:
        return self.at_height(clamped_height(c, vehicle), vehicle)

    def at_height(self, z: Number, vehicle: Vehicle) -> Number:
        """K at the height `z` of the rotor plane, metres, not below the validity limit."""
        raise TypeError(f"{type(self).__name__} does not say its thrust ratio over height")


def clamped_height(c: Conditions, vehicle: Vehicle) -> Number:
    """Height of the rotor plane, metres, no lower than the textbook forms are evaluated."""
    return maximum(c.height_m, LOWEST_HEIGHT_OVER_RADIUS * vehicle.rotor.radius_m)


def horizontal_speed_squared(c: Conditions) -> Number:
    """Square of the speed over ground, m^2/s^2, whatever the attitude."""
    north, east, _ = rotate(c.attitude, c.velocity_body_m_s)
    return north * north + east * east


@dataclass(frozen=True)
class Exponential(GroundEffect):
    """K = c + a exp(-b z), z the height of the rotors in m; with c = 1 there is no effect far away.

    The thesis fits c = 1.028 (a = 0.114, b = 5.388) and c = 0.988 (a = 0.147, b = 4.368); c other than 1 adds or
    removes thrust at every height and belongs to `thrust_scale`.
    """

    name: ClassVar[str] = "ground_effect.exponential"
    source: ClassVar[str] = "Appius, thesis, eq. 14 and 16 (found by sparse regression), with c = 1"
    formula: ClassVar[str] = r"K = c + a \, e^{-b z}"

    a: float = parameter(0.114, 0.0, 5.0, "", "gain in thrust at height 0")
    b: float = parameter(5.388, 0.3, 100.0, "1/m", "rate at which it fades with height")
    c: float = parameter(1.0, 0.8, 1.2, "", "ratio far away", fitted=False)

    def negligible(self) -> bool:
        return self.a < 0.03

    def believable(self, flights: Sequence[Conditions], vehicle: Vehicle) -> bool:
        """True where it fades as a ground effect does; what reaches higher is another force that changes with
        height."""
        fades = bool(exp(-self.b * (REACH_RADII - 1.0) * vehicle.rotor.radius_m) < LEFT_THERE)
        return fades and super().believable(flights, vehicle)

    def at_height(self, z: Number, vehicle: Vehicle) -> Number:
        return self.c + self.a * exp(-self.b * z)


@dataclass(frozen=True)
class Sanchez(GroundEffect):
    """Image sources below all rotors of a quadrotor, and the fountain between them, weighted with k_b, on its body."""

    name: ClassVar[str] = "ground_effect.sanchez"
    source: ClassVar[str] = "Sanchez-Cuevas et al. 2017, Int. J. Aerospace Eng.; Dena et al. eq. 15"

    k_b: float = parameter(2.0, 0.0, 6.0, "", "weight of the fountain on the body (2 in the thesis, 0.4509 in Dena)")

    def at_height(self, z: Number, vehicle: Vehicle) -> Number:
        return quadrotor_ratio(z, vehicle, self.k_b)


def quadrotor_ratio(z: Number, vehicle: Vehicle, fountain_weight: Number) -> Number:
    """K of image sources below four rotors in a square and of the fountain between them."""
    r, d, b = vehicle.rotor.radius_m, vehicle.adjacent_distance_m, vehicle.opposite_distance_m
    z4 = 4.0 * z * z
    own = (r / (4.0 * z)) ** 2
    neighbours = r * r * z / (d * d + z4) ** 1.5
    opposite = 0.5 * r * r * z / (2.0 * d * d + z4) ** 1.5
    fountain = 2.0 * r * r * z * fountain_weight / (b * b + z4) ** 1.5
    return 1.0 / (1.0 - own - neighbours - opposite - fountain)


@dataclass(frozen=True)
class Cheeseman(GroundEffect):
    """K = 1 / (1 - (R/4z)^2): an image source below one rotor."""

    name: ClassVar[str] = "ground_effect.cheeseman"
    source: ClassVar[str] = "Cheeseman & Bennett 1955, ARC R&M 3021, eq. for V = 0"
    formula: ClassVar[str] = r"K = \bigl(1 - (R / 4z)^2\bigr)^{-1}"

    def at_height(self, z: Number, vehicle: Vehicle) -> Number:
        return 1.0 / (1.0 - (vehicle.rotor.radius_m / (4.0 * z)) ** 2)


@dataclass(frozen=True)
class Hayden(GroundEffect):
    """K = (0.9926 + 0.03794 / (z/2R)^2)^(2/3), from helicopter flight tests; tends to 0.995, not to 1, far away."""

    name: ClassVar[str] = "ground_effect.hayden"
    source: ClassVar[str] = "Hayden 1976, The effect of the ground on helicopter hovering power required"
    formula: ClassVar[str] = r"K = \bigl(0.9926 + 0.03794 \, (2R / z)^2\bigr)^{2/3}"

    def at_height(self, z: Number, vehicle: Vehicle) -> Number:
        diameters = z / (2.0 * vehicle.rotor.radius_m)
        return (0.9926 + 0.03794 / diameters**2) ** (2.0 / 3.0)


@dataclass(frozen=True)
class Danjun(GroundEffect):
    """K = 1 / (1 - rho (R/4z)^2): Cheeseman with a weight that is fitted; rho = 1 gives `cheeseman`.

    Dena et al. (eq. 13) print the inverse, which would lose thrust near the ground. The pole is at z = sqrt(rho) R/4;
    rho stays below 4, so that it is below the lowest height at which this form is evaluated.
    """

    name: ClassVar[str] = "ground_effect.danjun"
    source: ClassVar[str] = "Danjun et al. 2015; Dena et al. eq. 13 (printed inverted), rho = 3.6490"

    rho: float = parameter(3.649, 0.0, 3.9, "", "weight of the image source")

    def at_height(self, z: Number, vehicle: Vehicle) -> Number:
        return 1.0 / (1.0 - self.rho * (vehicle.rotor.radius_m / (4.0 * z)) ** 2)


@dataclass(frozen=True)
class CheesemanForward(NearGround):
    """K = 1 / (1 - (R/4z)^2 / (1 + (V/v_h)^2)): forward flight carries the wake away before it is dammed up.

    V is the horizontal speed, v_h the induced velocity in hover; at V = 0 this is `cheeseman`. The thesis (eq. 4)
    prints the factor 1 / (1 + (V/v_h)^2) with one more square, which neither the source nor the thesis' code has.
    """

    name: ClassVar[str] = "ground_effect.cheeseman_forward"
    source: ClassVar[str] = "Cheeseman & Bennett 1955, ARC R&M 3021"
    depends_on: ClassVar[tuple[str, ...]] = ("height_over_radius", "speed_forward", "speed_right")
    physics: ClassVar[str] = (
        "Near the ground the downwash is dammed up and thrust grows; in forward flight the vehicle leaves it behind."
    )
    distinguished_by: ClassVar[str] = "low runs at several speeds: the gain near the ground fades with the speed"
    mission: ClassVar[str] = "missions/forward_runs.yaml"
    needs: ClassVar[dict[str, float]] = {"speed": 1.0}

    def ratio(self, c: Conditions, vehicle: Vehicle) -> Number:
        own = (vehicle.rotor.radius_m / (4.0 * clamped_height(c, vehicle))) ** 2
        return 1.0 / (1.0 - own / (1.0 + horizontal_speed_squared(c) / vehicle.hover_induced_velocity_m_s**2))


@dataclass(frozen=True)
class Surface(GroundEffect):
    """`sanchez` with k_b + k_s in the place of k_b: how much of the fountain the surface sends back.

    In flights over one surface k_s cannot be told from k_b, so the lab proposes `sanchez` instead; `add` fits k_s for a
    surface. The paper prints no k_s (turf, dirt, dry soil, irregular dry soil), so the default is none. Its equations
    14 and 20 are typeset with terms outside the fraction; all belong in the denominator. k_b + k_s is taken as no less
    than 0: a surface may swallow the fountain, but it does not pull.
    """

    name: ClassVar[str] = "ground_effect.surface"
    source: ClassVar[str] = "Dena et al. eq. 20"
    candidate: ClassVar[bool] = False

    k_b: float = parameter(0.4509, 0.0, 6.0, "", "weight of the fountain on the body", fitted=False)
    k_s: float = parameter(0.0, -6.0, 6.0, "", "what the surface adds to it")

    def at_height(self, z: Number, vehicle: Vehicle) -> Number:
        return quadrotor_ratio(z, vehicle, maximum(self.k_b + self.k_s, 0.0))


@dataclass(frozen=True)
class Nobahari(NearGround):
    """K = 1 / (1 - (R_eq/4z)^2), R_eq = 2.5 R: Cheeseman for one equivalent rotor in the place of a quadrotor's four.

    Very strong: 1.64 at one rotor radius, and a pole at z = R_eq/4 = 0.625 R, below which it is negative. The check
    before flight refuses it wherever the flight may come that low. It has no parameter that data could soften, so the
    lab does not propose it.
    """

    name: ClassVar[str] = "ground_effect.nobahari"
    source: ClassVar[str] = "Nobahari: Cheeseman & Bennett 1955 with an equivalent radius"
    candidate: ClassVar[bool] = False

    EQUIVALENT_RADII: ClassVar[float] = 2.5

    def ratio(self, c: Conditions, vehicle: Vehicle) -> Number:
        r = self.EQUIVALENT_RADII * vehicle.rotor.radius_m
        return inverse(1.0 - (r / (4.0 * clamped_height(c, vehicle))) ** 2)


@dataclass(frozen=True)
class Kan(NearGround):
    """K = (1 - 3R/25z) / (1 + (3V/50v_h)^3), as printed: less thrust near the ground, where there is more.

    Kept to reproduce what was published. At one rotor radius it gives 0.88, so that a compensator would add thrust
    where the ground does so already; hence it must not fly, and the lab does not propose it.
    """

    name: ClassVar[str] = "ground_effect.kan"
    source: ClassVar[str] = "Kan et al. 2019 as printed in Appius, thesis"
    depends_on: ClassVar[tuple[str, ...]] = ("height_over_radius", "speed_forward", "speed_right")
    physics: ClassVar[str] = "As printed, thrust falls near the ground and in forward flight, against all measurements."
    candidate: ClassVar[bool] = False
    not_for_flight: ClassVar[str] = "as printed it takes thrust away near the ground, where there is more"

    def ratio(self, c: Conditions, vehicle: Vehicle) -> Number:
        hover = 1.0 - 3.0 * vehicle.rotor.radius_m / (25.0 * clamped_height(c, vehicle))
        squared = (3.0 / (50.0 * vehicle.hover_induced_velocity_m_s)) ** 2 * horizontal_speed_squared(c)
        return hover / (1.0 + squared**1.5)
