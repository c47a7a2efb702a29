"""Airspeed moment: the air turns a vehicle that moves through it, as its drag does not act at the centre of mass."""

import math
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
class ProportionalMoment(Effect):
    """A moment T_total (roll v, pitch u, 0): the thrust acts as far from its place as the airspeed says.

    A drag d at the height h above the centre of mass gives pitch = -roll = d h / g, and rotors whose discs flap give
    the same form: both moments are linear in the airspeed and grow with the thrust. A Crazyflie 2.1 has -0.8 and 1.0 mm
    per m/s, or -13 and 16 rad/s^2 per m/s.
    """

    name: ClassVar[str] = "airspeed_moment.proportional"
    source: ClassVar[str] = "hub force and flapping moment, first order: Mahony, Kumar & Corke 2012, eq. 12-15, r x F"
    formula: ClassVar[str] = r"M = T \, (\mathrm{roll} \, v, \mathrm{pitch} \, u, 0)"
    depends_on: ClassVar[tuple[str, ...]] = ("speed_forward", "speed_right")
    physics: ClassVar[str] = (
        "The drag acts above or below the centre of mass, and the rotors' discs flap: the air turns what flies fast."
    )
    distinguished_by: ClassVar[str] = (
        "moments in runs in both directions that go on growing with the speed; a wake also takes thrust"
    )
    mission: ClassVar[str] = "missions/forward_runs.yaml"
    essential: ClassVar[tuple[str, ...]] = ("roll", "pitch")
    needs: ClassVar[dict[str, float]] = {"speed": 0.7}

    roll: float = parameter(0.0, -20.0, 20.0, "mm per m/s", "roll moment over thrust, per airspeed to the right")
    pitch: float = parameter(0.0, -20.0, 20.0, "mm per m/s", "pitch moment over thrust, per airspeed forward")

    def negligible(self) -> bool:
        return math.hypot(self.roll, self.pitch) < LEAST_MM_PER_M_S

    def torque(self, thrust_n: Sequence[Number], c: Conditions, vehicle: Vehicle) -> Vector:
        u, v, _ = c.velocity_body_m_s
        per_mm = 1e-3 * sum(thrust_n)
        return self.roll * per_mm * v, self.pitch * per_mm * u, 0.0 * per_mm
