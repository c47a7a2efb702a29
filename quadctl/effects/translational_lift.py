"""Translational lift: a rotor that moves sideways through the air gives more thrust at the same speed."""

from dataclasses import dataclass
from typing import ClassVar

from quadctl.effects.base import Conditions, ThrustRatio, parameter
from quadctl.numeric import Number
from quadctl.vehicle import Vehicle


@dataclass(frozen=True)
class HorizontalLift(ThrustRatio):
    """K = 1 + gain x^2 / (1 + x^2), x = V_h / v_h: quadratic in the horizontal airspeed at first, then saturating.

    V_h is the airspeed in the rotor plane and v_h the induced velocity in hover; far above v_h the rotor works in
    clean air and the induced loss is gone. Valid to some v_h, before the blades' retreating side stalls.
    """

    name: ClassVar[str] = "translational_lift.horizontal"
    source: ClassVar[str] = "Leishman, Principles of Helicopter Aerodynamics, 2nd ed., sec. 2.14 (Glauert), in outline"
    depends_on: ClassVar[tuple[str, ...]] = ("speed_forward", "speed_right")
    physics: ClassVar[str] = (
        "In horizontal flight the rotors meet fresh air and need less of it pushed down: more thrust at the same speed."
    )
    distinguished_by: ClassVar[str] = "level runs at several speeds, both ways: the extra thrust has no sign"
    mission: ClassVar[str] = "missions/forward_runs.yaml"
    needs: ClassVar[dict[str, float]] = {"speed": 0.7}

    gain: float = parameter(0.3, 0.0, 5.0, "", "gain in thrust far above the induced velocity")

    def ratio(self, c: Conditions, vehicle: Vehicle) -> Number:
        u, v, _ = c.velocity_body_m_s
        x2 = (u * u + v * v) / vehicle.hover_induced_velocity_m_s**2
        return 1.0 + self.gain * x2 / (1.0 + x2)
