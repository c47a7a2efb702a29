"""Ground effect of hexarotors: image sources below all rotors and the fountain between them.

R is the rotor radius, z the height of the rotor plane above the ground, d the distance between neighbouring rotor
axes. The authors evaluate these forms no lower than 0.25 R and take K = 1 beyond 8 R; so does this file. Without
the term of a rotor's own image they have no pole, but they are not monotonic: on the authors' hexarotor K of the first
form rises from 1.211 at 0.25 R to 1.305 at 0.58 R and falls from there on.
"""

import math
from dataclasses import dataclass
from typing import ClassVar

from quadctl.effects.base import Conditions, parameter
from quadctl.effects.ground_effect import NearGround
from quadctl.numeric import Number, maximum, where
from quadctl.vehicle import Vehicle

LOWEST_HEIGHT_OVER_RADIUS = 0.25
HIGHEST_HEIGHT_OVER_RADIUS = 8.0


@dataclass(frozen=True)
class Hexarotor(NearGround):
    """K = 1 / (1 - S - F), S being the images of the rotors and F the fountain, weighted with J_k.

    S = R^2 z ((d^2/4 + 4z^2)^-1.5 + 1/2 (21d^2/4 + 4z^2)^-1.5 + (13d^2/4 + 4z^2)^-1.5 + 1/2 (7d^2/4 + 4z^2)^-1.5)
    F = 2 R^2 z J_k (r_d^2 + 4z^2)^-1.5, r_d = 2d - c

    The paper prints a difference of two fractions; the authors' firmware has this one. Their vehicle: R = 0.1194 m,
    d = 0.28 m, c = 0.22 m; there K falls from 1.0138 to 1 at 8 R.
    """

    name: ClassVar[str] = "ground_effect.hexarotor"
    source: ClassVar[str] = "Garofano-Soldado et al. eq. 9"
    sections_over_radius: ClassVar[tuple[float, ...]] = (LOWEST_HEIGHT_OVER_RADIUS, HIGHEST_HEIGHT_OVER_RADIUS)

    j_k: float = parameter(2.2, 0.0, 6.0, "", "weight of the fountain on the body")
    c: float = parameter(0.22, 0.0, 5.0, "m", "length that shortens the fountain's distance r_d = 2d - c", fitted=False)

    @classmethod
    def applies_to(cls, vehicle: Vehicle) -> bool:
        return vehicle.n_rotors == 6

    def ratio(self, c: Conditions, vehicle: Vehicle) -> Number:
        radius_m = vehicle.rotor.radius_m
        z = maximum(c.height_m, LOWEST_HEIGHT_OVER_RADIUS * radius_m)
        return where(
            z > HIGHEST_HEIGHT_OVER_RADIUS * radius_m,
            1.0,
            1.0 / (1.0 - rotor_images(z, vehicle) - fountain(z, vehicle, self.j_k, self.c)),
        )


@dataclass(frozen=True)
class HexarotorTilted(NearGround):
    """The same for tilted rotors, in three sections of height.

    z < 2.5 R: K = 1 / (1 - f_m S - F); up to 3 R: K = f_d z/R + f_r; above: K = 1 / (1 - f_n S - F), each f being
    f_0 + f_1 sin(beta) cos(alpha) + f_2 cos(beta) sin(alpha) with its own coefficients (`SECTION_...`). alpha is
    taken as the size of the first rotor's cant, beta as that of its dihedral, the other rotors as tilted alike; valid
    up to 30 deg.

    The sections meet where alpha = beta, as on the authors' vehicle (R = 0.1194 m, d = 0.28 m), and nowhere else:

    | alpha, beta | K to the left and right of 2.5 R | of 3 R         | of 8 R     |
    |-------------|----------------------------------|----------------|------------|
    | 0, 0 deg    | 1.0703, 1.0710                   | 1.0642, 1.0647 | 1.0113, 1  |
    | 20, 20 deg  | 1.0933, 1.0947                   | 1.0261, 1.0257 | 1.0044, 1  |
    | 30, 30 deg  | 1.1015, 1.1029                   | 1.0129, 1.0128 | 1.0020, 1  |
    | 30, 0 deg   | 1.0879, 1.0041                   | 0.9510, 1.1496 | 1.0251, 1  |
    | 0, 30 deg   | 1.0882, 1.1747                   | 1.1181, 0.9397 | 0.9874, 1  |

    The middle section holds for that vehicle alone: with other d/R, J_k or c it does not meet its neighbours either.
    """

    name: ClassVar[str] = "ground_effect.hexarotor_tilted"
    source: ClassVar[str] = "Garofano-Soldado et al. eq. 10-13, tables II and III"

    j_k: float = parameter(2.2, 0.0, 6.0, "", "weight of the fountain on the body", fitted=False)
    c: float = parameter(0.22, 0.0, 5.0, "m", "length that shortens the fountain's distance r_d = 2d - c", fitted=False)

    SECTION_LOW: ClassVar[tuple[float, float, float]] = (0.216, 0.841, 0.826)
    SECTION_MIDDLE_SLOPE: ClassVar[tuple[float, float, float]] = (-0.0136, -0.1994, -0.1851)
    SECTION_MIDDLE_OFFSET: ClassVar[tuple[float, float, float]] = (1.105, 0.706, 0.329)
    SECTION_HIGH: ClassVar[tuple[float, float, float]] = (0.553, -8.784, 4.874)
    LOW_ENDS: ClassVar[float] = 2.5
    HIGH_BEGINS: ClassVar[float] = 3.0
    sections_over_radius: ClassVar[tuple[float, ...]] = (
        *(LOWEST_HEIGHT_OVER_RADIUS, LOW_ENDS, HIGH_BEGINS, HIGHEST_HEIGHT_OVER_RADIUS),
    )

    @classmethod
    def applies_to(cls, vehicle: Vehicle) -> bool:
        return vehicle.n_rotors == 6 and any(r.cant_deg or r.dihedral_deg for r in vehicle.rotors)

    def ratio(self, c: Conditions, vehicle: Vehicle) -> Number:
        radius_m = vehicle.rotor.radius_m
        z = maximum(c.height_m, LOWEST_HEIGHT_OVER_RADIUS * radius_m)
        radii = z / radius_m
        alpha, beta = math.radians(vehicle.rotors[0].cant_deg), math.radians(vehicle.rotors[0].dihedral_deg)
        across = abs(math.sin(beta)) * math.cos(alpha), math.cos(beta) * abs(math.sin(alpha))
        images, spring = rotor_images(z, vehicle), fountain(z, vehicle, self.j_k, self.c)
        low = 1.0 / (1.0 - _tilted(self.SECTION_LOW, across) * images - spring)
        middle = _tilted(self.SECTION_MIDDLE_SLOPE, across) * radii + _tilted(self.SECTION_MIDDLE_OFFSET, across)
        high = 1.0 / (1.0 - _tilted(self.SECTION_HIGH, across) * images - spring)
        near = where(radii < self.LOW_ENDS, low, where(radii <= self.HIGH_BEGINS, middle, high))
        return where(radii > HIGHEST_HEIGHT_OVER_RADIUS, 1.0, near)


def rotor_images(z: Number, vehicle: Vehicle) -> Number:
    """S: reduction of the inflow by the images of the rotors, as a fraction of it."""
    r2, d2 = vehicle.rotor.radius_m**2, vehicle.adjacent_distance_m**2
    z4 = 4.0 * z * z
    whole = (0.25 * d2 + z4) ** -1.5 + (3.25 * d2 + z4) ** -1.5
    half = (5.25 * d2 + z4) ** -1.5 + (1.75 * d2 + z4) ** -1.5
    return r2 * z * (whole + 0.5 * half)


def fountain(z: Number, vehicle: Vehicle, j_k: float, c_m: float) -> Number:
    """F: effect of the air that rises between the rotors on the body, as a fraction of the inflow."""
    r_d = 2.0 * vehicle.adjacent_distance_m - c_m
    return 2.0 * vehicle.rotor.radius_m**2 * z * j_k * (r_d * r_d + 4.0 * z * z) ** -1.5


def _tilted(coefficients: tuple[float, float, float], across: tuple[float, float]) -> float:
    return coefficients[0] + coefficients[1] * across[0] + coefficients[2] * across[1]
