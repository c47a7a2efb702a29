"""Rotor interaction: in forward flight the rear rotors work in the wake of the front ones."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from quadctl.effects.base import Conditions, Effect, parameter
from quadctl.numeric import Number, clip, maximum, minimum, sqrt
from quadctl.vehicle import Vehicle


@dataclass(frozen=True)
class FrontWake(Effect):
    """A rotor that lies x behind the centre, seen along the airspeed V, loses the share loss (V / v_h) (x / arm).

    V is the airspeed in the rotor plane, up to v_h, the induced velocity in hover; the arm is half the distance between
    opposite rotors. Beyond about v_h the wake passes below the rear rotors, and the law is cut there.
    """

    name: ClassVar[str] = "rotor_interaction.wake"
    source: ClassVar[str] = "Luo et al. 2015, Bannwarth et al. 2019: rear rotors in the front rotors' wake, first order"
    depends_on: ClassVar[tuple[str, ...]] = ("speed_forward", "speed_right")
    physics: ClassVar[str] = (
        "In forward flight the rear rotors work in the front rotors' downwash: less thrust, and a moment nose-up."
    )
    distinguished_by: ClassVar[str] = "the pitching moment in runs at several speeds; drag has none"
    mission: ClassVar[str] = "missions/forward_runs.yaml"
    affects_moment: ClassVar[bool] = True
    essential: ClassVar[tuple[str, ...]] = ("loss",)
    needs: ClassVar[dict[str, float]] = {"speed": 0.7}

    loss: float = parameter(0.1, 0.0, 3.0, "", "share of thrust that the rearmost rotors lose at an airspeed of v_h")

    def negligible(self) -> bool:
        return self.loss < 0.03

    def shows_in(self, vehicle: Vehicle) -> tuple[str, ...]:
        """The vertical axis: the moment alone is that of any drag that acts off the centre of mass."""
        return ("up",)

    def rotor_thrust(self, thrust_n: Sequence[Number], c: Conditions, vehicle: Vehicle) -> Sequence[Number]:
        u, v, _ = c.velocity_body_m_s
        speed = sqrt(u * u + v * v)
        share = self.loss * minimum(speed / vehicle.hover_induced_velocity_m_s, 1.0)
        per_arm = share / (maximum(speed, 1e-6) * 0.5 * vehicle.opposite_distance_m)
        forward, right = -u * per_arm, -v * per_arm
        found = []
        for rotor, thrust in zip(vehicle.rotors, thrust_n, strict=True):
            x, y, _ = rotor.position_m
            behind = clip(x * forward + y * right, 0.0, 0.9)
            found.append(thrust * (1.0 - behind))
        return found
