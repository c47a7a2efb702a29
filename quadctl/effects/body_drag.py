"""Body drag: the pressure drag of frame and payload, quadratic in velocity."""

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

from quadctl.effects.base import Conditions, Effect, parameter
from quadctl.effects.rotor_drag import acts_sideways, is_of_inflow, may_be_inflow
from quadctl.numeric import Vector, sqrt
from quadctl.vehicle import Vehicle


@dataclass(frozen=True)
class QuadraticDrag(Effect):
    """F = -1/2 rho |v| (A_x u, A_y v, A_z w) in body axes, A being drag areas (coefficient times frontal area)."""

    name: ClassVar[str] = "body_drag.quadratic"
    source: ClassVar[str] = "definition of the drag coefficient; Hattenberger et al. 2022 for multirotors"
    formula: ClassVar[str] = (
        r"\mathbf{f} = -\tfrac{1}{2} \rho \, |\mathbf{v}| \, \mathrm{diag}(A_x, A_y, A_z) \, \mathbf{v}"
    )
    depends_on: ClassVar[tuple[str, ...]] = ("speed_forward", "speed_right")
    physics: ClassVar[str] = "The frame's pressure drag pushes against the flight velocity and grows with its square."
    distinguished_by: ClassVar[str] = (
        "runs at several speeds: linear drag doubles with the speed, this one grows fourfold"
    )
    mission: ClassVar[str] = "missions/forward_runs.yaml"
    needs: ClassVar[dict[str, float]] = {"speed": 1.0}

    area_x_m2: float = parameter(0.02, 0.0, 1.0, "m^2", "drag area seen from the front")
    area_y_m2: float = parameter(0.02, 0.0, 1.0, "m^2", "drag area seen from the side")
    area_z_m2: float = parameter(0.0, 0.0, 1.0, "m^2", "drag area seen from above")

    def believable(self, flights: Sequence[Conditions], vehicle: Vehicle) -> bool:
        areas_m2 = (self.area_x_m2, self.area_y_m2, self.area_z_m2)
        return are_possible_areas(areas_m2, vehicle) and acts_sideways(*areas_m2, flights)

    def implied_by(self, others: Sequence[Effect], flights: Sequence[Conditions], vehicle: Vehicle) -> bool:
        """True where it acts along the thrust axis alone, beside an inflow: then the form of that one is off."""
        return is_of_inflow(self.area_x_m2, self.area_y_m2, self.area_z_m2, others)

    def inseparable_from(
        self, missing: Collection[str], ci95: Mapping[str, tuple[float, float]], span: Callable[[str], float]
    ) -> Sequence[str]:
        return may_be_inflow("area_z_m2", self, missing, ci95)

    def force(self, total_thrust_n: float, c: Conditions, vehicle: Vehicle) -> Vector:
        u, v, w = c.velocity_body_m_s
        half = -0.5 * vehicle.air_density_kg_m3 * sqrt(u * u + v * v + w * w)
        return half * self.area_x_m2 * u, half * self.area_y_m2 * v, half * self.area_z_m2 * w


def are_possible_areas(areas_m2: Sequence[float], vehicle: Vehicle) -> bool:
    """Tell whether drag areas are below twice that of all rotor disks; most vehicles have a tenth to a half of it."""
    return max(areas_m2) < 2.0 * vehicle.n_rotors * math.pi * vehicle.rotor.radius_m**2
