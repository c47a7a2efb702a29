"""Airspeed moment: the air turns a vehicle that moves through it, as its drag does not act at the centre of mass."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from quadctl.effects.base import Conditions, Effect, parameter
from quadctl.numeric import Number, Vector
from quadctl.vehicle import Vehicle

LEAST_MM_PER_M_S = 0.1
"""Smallest moment that counts, over thrust: a drag of 0.2 1/s whose centre is half a centimetre off makes as much. It
takes away moments that at 5 m/s equal a centre of mass 0.5 mm off."""


@dataclass(frozen=True)
class IsotropicMoment(Effect):
    """A moment T_total k (-v, u, 0): the thrust acts as far from its place as the airspeed says.

    A drag d at the height h above the centre of mass gives k = d h / g, and rotors whose discs flap give the same form:
    both moments are linear in the airspeed and grow with the thrust. One coefficient serves roll and pitch, as most
    vehicles are nearly alike from all sides, and runs in one direction show no second one. A Crazyflie 2.1 has 0.8 mm
    per m/s in roll and 1.0 in pitch, or 13 and 16 rad/s^2 per m/s.
    """

    name: ClassVar[str] = "airspeed_moment.isotropic"
    source: ClassVar[str] = "hub force and flapping moment, first order: Mahony, Kumar & Corke 2012, eq. 12-15, r x F"
    formula: ClassVar[str] = r"M = T \, k \, (-v, u, 0)"
    depends_on: ClassVar[tuple[str, ...]] = ("speed_forward", "speed_right")
    physics: ClassVar[str] = (
        "The drag acts above or below the centre of mass, and the rotors' discs flap: the air turns what flies fast."
    )
    distinguished_by: ClassVar[str] = (
        "moments in runs in both directions that go on growing with the speed; a wake also takes thrust"
    )
    mission: ClassVar[str] = "missions/forward_runs.yaml"
    needs: ClassVar[dict[str, float]] = {"speed": 0.7}

    k: float = parameter(0.0, -20.0, 20.0, "mm per m/s", "pitch moment over thrust, per airspeed forward")

    def negligible(self) -> bool:
        return abs(self.k) < LEAST_MM_PER_M_S

    def torque(self, thrust_n: Sequence[Number], c: Conditions, vehicle: Vehicle) -> Vector:
        u, v, _ = c.velocity_body_m_s
        lever_m = 1e-3 * self.k
        return -lever_m * sum(thrust_n) * v, lever_m * sum(thrust_n) * u, 0.0 * sum(thrust_n)
