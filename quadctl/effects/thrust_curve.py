"""Thrust curve: the thrust grows with the rotor speed by another exponent than 2."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from quadctl.effects.base import Conditions, Effect, parameter
from quadctl.numeric import Number
from quadctl.vehicle import Vehicle


@dataclass(frozen=True)
class PowerCurve(Effect):
    """T = T_hover (T_nominal / T_hover)^(exponent / 2): k rpm^2 is right in hover and off away from it.

    Blade twist, Reynolds number and compressibility bend the curve; thrust stands find 1.8 to 2.4, and a command that
    sets a motor's power instead of its speed is nearer to linear. Rotor speeds or commands that are noisy or late
    flatten the thrust they promise as an exponent below 2 does, so that the least that counts is more on that side.
    """

    name: ClassVar[str] = "thrust_curve.power"
    source: ClassVar[str] = "thrust-stand data of Appius' thesis, section 3.3: T / rpm^2 rises by 20 % over the range"
    depends_on: ClassVar[tuple[str, ...]] = ("thrust",)
    physics: ClassVar[str] = "Thrust does not grow with the square of the rotor speed, but by another exponent."
    distinguished_by: ClassVar[str] = "strong and quick changes of thrust, away from the ground"
    mission: ClassVar[str] = "missions/vertical_runs.yaml"
    needs: ClassVar[dict[str, float]] = {"thrust_share": 0.1}
    corrects: ClassVar[tuple[str, ...]] = ("exponent",)

    exponent: float = parameter(2.0, 1.0, 3.0, "", "2: the vehicle file's law")

    def negligible(self) -> bool:
        return -0.15 < self.exponent - 2.0 < 0.09

    def rotor_thrust(self, thrust_n: Sequence[Number], c: Conditions, vehicle: Vehicle) -> Sequence[Number]:
        hover_n = vehicle.weight_n / vehicle.n_rotors
        power = 0.5 * self.exponent
        # 0 below 0, for floats and arrays alike; the compensator calls this twice in a tick, and `maximum` takes longer
        return [hover_n * (thrust * (thrust > 0.0) / hover_n) ** power for thrust in thrust_n]
