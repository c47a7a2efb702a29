"""Thrust map: the line from command to thrust in the vehicle file is not the true one, or it moves with the voltage."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from quadctl.effects.base import Conditions, Effect, parameter
from quadctl.numeric import Number, known_or
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


@dataclass(frozen=True)
class VoltageMap(Effect):
    """T = W (linear w + square w^2), w being command times voltage, over those of hover by the file's line and V_ref.

    A motor is driven by the mean voltage u V: its speed is nearly proportional to it where it turns slowly, and grows
    less where its drag is large. W is the weight; of the rotors each has its own command. Where the voltage is not
    known it is V_ref.
    """

    name: ClassVar[str] = "thrust_map.motor_voltage"
    source: ClassVar[str] = "thrust over PWM of a Crazyflie (Foerster 2015, ETH Zurich), times the voltage"
    formula: ClassVar[str] = r"T = W \, (\mathrm{linear} \, w + \mathrm{square} \, w^2), \; w = u V / (u_h V_{ref})"
    depends_on: ClassVar[tuple[str, ...]] = ("thrust", "battery")
    physics: ClassVar[str] = (
        "The thrust follows command times battery voltage, and its square, not the vehicle file's line."
    )
    distinguished_by: ClassVar[str] = "strong and quick changes of thrust at several voltages, away from the ground"
    mission: ClassVar[str] = "missions/vertical_runs.yaml"
    needs: ClassVar[dict[str, float]] = {"thrust_share": 0.1, "battery": 0.1}
    only_without_rotor_speeds: ClassVar[bool] = True
    corrects: ClassVar[tuple[str, ...]] = ("thrust", "throttle", "exponent")

    linear: float = parameter(0.5, -3.0, 5.0, "", "thrust in proportion to the voltage of the motor, over the weight")
    square: float = parameter(0.5, -3.0, 5.0, "", "thrust by its square, over the weight")
    reference_v: float = parameter(16.0, 2.0, 100.0, "V", "voltage at which w is 1 in hover", fitted=False)

    @classmethod
    def starts(cls, flights: Sequence[Conditions], vehicle: Vehicle) -> Sequence[Effect]:
        """The reference is the mean voltage."""
        mean = float(np.mean(np.concatenate([np.ravel(c.battery_v) for c in flights])))
        return [cls(reference_v=mean)] if 2.0 < mean < 100.0 else [cls()]

    def rotor_thrust(self, thrust_n: Sequence[Number], c: Conditions, vehicle: Vehicle) -> Sequence[Number]:
        line, n = vehicle.throttle, vehicle.n_rotors
        each_n = vehicle.weight_n / n
        share = known_or(c.battery_v, self.reference_v) / (self.reference_v * vehicle.hover_throttle)
        driven = [share * (line.offset + line.per_newton * n * thrust) for thrust in thrust_n]
        return [each_n * w * (self.linear + self.square * w) for w in driven]
