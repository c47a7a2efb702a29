"""Thrust map: the line from command to thrust in the vehicle file is not the true one."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from quadctl.effects.base import Conditions, Effect, parameter
from quadctl.numeric import Number
from quadctl.vehicle import Vehicle


@dataclass(frozen=True)
class LineMap(Effect):
    """T = factor T_file + offset W, T_file being the thrust of all rotors by the vehicle file's line and W the weight.

    With the file's line throttle = o + p T_file the true one has per_newton = p / factor and
    offset = o - p W offset / factor.
    """

    name: ClassVar[str] = "thrust_map.line"
    source: ClassVar[str] = "definition; lines of real vehicles are off by 30 % where nobody measured them"
    depends_on: ClassVar[tuple[str, ...]] = ("thrust",)
    physics: ClassVar[str] = (
        "The line from command to thrust in the vehicle file has another slope and offset than the vehicle."
    )
    distinguished_by: ClassVar[str] = "strong and quick changes of thrust, away from the ground"
    mission: ClassVar[str] = "missions/vertical_runs.yaml"
    needs: ClassVar[dict[str, float]] = {"thrust_share": 0.1}
    only_without_rotor_speeds: ClassVar[bool] = True
    corrects: ClassVar[tuple[str, ...]] = ("thrust", "throttle")

    factor: float = parameter(1.0, 0.2, 5.0, "", "slope of the true thrust over the file's thrust")
    offset: float = parameter(0.0, -2.0, 2.0, "", "true thrust where the file's line gives none, over the weight")

    def negligible(self) -> bool:
        """True where the line is right in hover and its slope within 10 %."""
        return abs(self.factor + self.offset - 1.0) < 0.015 and abs(self.factor - 1.0) < 0.1

    def rotor_thrust(self, thrust_n: Sequence[Number], c: Conditions, vehicle: Vehicle) -> Sequence[Number]:
        each_n = self.offset * vehicle.weight_n / vehicle.n_rotors
        return [self.factor * thrust + each_n for thrust in thrust_n]
