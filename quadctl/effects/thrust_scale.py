"""Thrust coefficient or mass wrong by a factor."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from quadctl.effects.base import Conditions, Effect, ThrustRatio, parameter
from quadctl.numeric import Number
from quadctl.vehicle import Vehicle

REFERENCE_ERROR = 0.05
"""Relative error of the thrust by the unknown voltage at which a coefficient was measured: 4.2 V per cell when full,
4.0 V in flight."""


@dataclass(frozen=True)
class ConstantScale(ThrustRatio):
    """All rotors give `factor` times the thrust that the vehicle file says."""

    name: ClassVar[str] = "thrust_scale.constant"
    source: ClassVar[str] = "definition; PX4's hover-thrust estimator tracks the same quantity"
    formula: ClassVar[str] = r"K = \mathrm{factor}"
    depends_on: ClassVar[tuple[str, ...]] = ()
    physics: ClassVar[str] = (
        "The thrust coefficient (or the mass) in the vehicle file is off by a factor: the error is the same everywhere."
    )
    distinguished_by: ClassVar[str] = "being the same at all heights, speeds and voltages"
    mission: ClassVar[str] = "missions/hover_staircase_high.yaml"
    corrects: ClassVar[tuple[str, ...]] = ("thrust",)

    factor: float = parameter(1.0, 0.4, 2.5, "", "true thrust over the vehicle file's thrust, per mass")

    def negligible(self) -> bool:
        return abs(self.factor - 1.0) < 0.015

    def implied_by(self, others: Sequence[Effect], flights: Sequence[Conditions], vehicle: Vehicle) -> bool:
        """True beside a battery sag, whose reference voltage is known to a few percent only."""
        sagging = any(effect.family() == "battery_sag" for effect in others)
        return sagging and abs(self.factor - 1.0) < REFERENCE_ERROR

    def ratio(self, c: Conditions, vehicle: Vehicle) -> Number:
        return self.factor
