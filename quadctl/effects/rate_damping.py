"""Rate damping: a body that turns is slowed down by its own rotors, as those that move down give more thrust."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from quadctl.effects.base import Conditions, Effect, parameter
from quadctl.numeric import Number, Vector
from quadctl.vehicle import Vehicle

LEAST_1_S = 0.1
"""Damping below which a turn lasts ten seconds, far longer than any controller lets it."""


@dataclass(frozen=True)
class ProportionalDamping(Effect):
    """A moment -I d omega: the rate about each body axis falls by itself, to 37 % in 1 / d.

    A rotor at the arm a of a body that rolls at p climbs at a p, and loses thrust with it as in a climb of the whole
    vehicle; in yaw the drag torque of the rotors changes. A Crazyflie 2.1 has some 2 1/s in roll and pitch.

    The moments of the lab are slow, where damping is a thousandth of the thrust's moments: it is not looked for there.
    `quadctl rotation` finds it in gyro and commands.
    """

    name: ClassVar[str] = "rate_damping.proportional"
    source: ClassVar[str] = (
        "inflow of each rotor by the body's rates: Pounds, Mahony & Corke 2010, Control Eng. Pract. 18"
    )
    formula: ClassVar[str] = r"M = - (I_x d_x p, I_y d_y q, I_z d_z r)"
    depends_on: ClassVar[tuple[str, ...]] = ()
    physics: ClassVar[str] = "The rotors that move down as the body turns give more thrust, which brakes the turn."
    distinguished_by: ClassVar[str] = "quick turns with gyro and commands at 40 Hz or more: `quadctl rotation`"
    mission: ClassVar[str] = "missions/excitation.yaml"
    candidate: ClassVar[bool] = False

    roll_1_s: float = parameter(0.0, 0.0, 40.0, "1/s", "damping of the roll rate")
    pitch_1_s: float = parameter(0.0, 0.0, 40.0, "1/s", "damping of the pitch rate")
    yaw_1_s: float = parameter(0.0, 0.0, 40.0, "1/s", "damping of the yaw rate")

    def negligible(self) -> bool:
        return max(self.roll_1_s, self.pitch_1_s, self.yaw_1_s) < LEAST_1_S

    def torque(self, thrust_n: Sequence[Number], c: Conditions, vehicle: Vehicle) -> Vector:
        (p, q, r), (ix, iy, iz) = c.rates_rad_s, vehicle.principal_inertia_kg_m2
        return -ix * self.roll_1_s * p, -iy * self.pitch_1_s * q, -iz * self.yaw_1_s * r
