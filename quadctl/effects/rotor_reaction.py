"""Rotor reaction: a rotor that spins up turns the body the other way, beyond the drag of its blades."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from quadctl.effects.base import NO_TORQUE, Conditions, Effect, parameter
from quadctl.numeric import Number, Vector
from quadctl.vehicle import Vehicle

RAD_S_PER_RPM = math.pi / 30.0
LEAST_S = 0.005
"""Lead that no controller of the yaw notices: it is far quicker than the rotors."""


@dataclass(frozen=True)
class InertialReaction(Effect):
    """A moment J d(omega)/dt of each rotor against its spin: its drag torque c T, ahead by lead = J / (2 c k omega).

    J is the rotor's moment of inertia, k omega^2 its thrust T, and omega that of hover. Behind a rotor lag tau the yaw
    moment answers a command at once with lead / tau of what it gives in the end: a Crazyflie 2.1 has 0.03 s of lag and
    0.05 to 0.1 s of lead. Fast moments are not those of the lab: `quadctl rotation` finds it in gyro and commands.
    """

    name: ClassVar[str] = "rotor_reaction.inertia"
    source: ClassVar[str] = "conservation of angular momentum: Mahony, Kumar & Corke 2012, with rotors that spin up"
    formula: ClassVar[str] = r"M = \sum_i \, c_i \, \mathrm{lead} \; \dot T_i"
    depends_on: ClassVar[tuple[str, ...]] = ()
    physics: ClassVar[str] = "A rotor that spins up turns the body against its spin, at once and not after its lag."
    distinguished_by: ClassVar[str] = "quick turns in yaw with gyro and commands at 40 Hz or more: `quadctl rotation`"
    mission: ClassVar[str] = "missions/excitation.yaml"
    candidate: ClassVar[bool] = False
    needs_thrust_rate: ClassVar[bool] = True

    lead_s: float = parameter(0.0, 0.0, 2.0, "s", "rotor inertia in hover, over the slope of its drag torque")

    def negligible(self) -> bool:
        return self.lead_s < LEAST_S

    def torque(self, thrust_n: Sequence[Number], c: Conditions, vehicle: Vehicle) -> Vector:
        if not c.thrust_rate_n_s:
            return NO_TORQUE
        pairs = list(zip(vehicle.drag_arms_m, c.thrust_rate_n_s, strict=True))
        x, y, z = (
            self.lead_s * sum((arms[axis] * rate for arms, rate in pairs if arms[axis]), start=0.0) for axis in range(3)
        )
        return x, y, z

    def rotor_inertia_kg_m2(self, vehicle: Vehicle) -> float:
        """Moment of inertia of one rotor, kg m^2."""
        rotor = vehicle.rotor
        k = rotor.thrust_n_per_rpm2 / RAD_S_PER_RPM**2
        hover_rad_s = math.sqrt(vehicle.weight_n / vehicle.n_rotors / k)
        return 2.0 * rotor.torque_to_thrust_m * k * hover_rad_s * self.lead_s
