"""Battery sag: as the battery's voltage falls, so does the thrust that the model expects."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from quadctl.effects.base import Conditions, Effect, ThrustRatio, parameter
from quadctl.numeric import Number, clip, known_or, maximum
from quadctl.vehicle import Vehicle

CELL_V = 3.95
"""Usual mean voltage of a lithium cell in flight: tells how many cells a battery has."""
REFERENCE_CELL_V = (4.2, 4.0)
"""Voltages per cell at which a thrust coefficient may have been measured: full, or in flight."""
RATIO_LIMITS = (0.4, 1.6)


@dataclass(frozen=True)
class LinearSag(ThrustRatio):
    """K = 1 + share (V / V_ref - 1), V_ref being the voltage at which the vehicle file's coefficients hold.

    Where the voltage is not known there is no correction.
    """

    name: ClassVar[str] = "battery_sag.voltage"
    source: ClassVar[str] = "first order in the voltage, as the battery compensation of autopilots has it"
    depends_on: ClassVar[tuple[str, ...]] = ("battery",)
    physics: ClassVar[str] = "The thrust falls with the battery's voltage, more than the rotor speeds or commands tell."
    distinguished_by: ClassVar[str] = "following the voltage, up again with it, and not the time or the height"
    mission: ClassVar[str] = "missions/hover_staircase_high.yaml"
    needs: ClassVar[dict[str, float]] = {"battery": 0.1}
    essential: ClassVar[tuple[str, ...]] = ("share",)
    if_constant: ClassVar[str] = "thrust_scale.constant"

    share: float = parameter(0.5, 0.0, 5.0, "", "relative loss of thrust per relative loss of voltage")
    reference_v: float = parameter(16.0, 2.0, 100.0, "V", "voltage at which the coefficients hold", fitted=False)

    @classmethod
    def starts(cls, flights: Sequence[Conditions], vehicle: Vehicle) -> Sequence[Effect]:
        """The coefficients hold at the highest voltage seen, or at one of a cell's usual voltages."""
        highest = max(float(np.max(c.battery_v)) for c in flights)
        if not 2.0 < highest < 100.0:
            return [cls()]
        cells = max(1, round(highest / CELL_V))
        return [cls(reference_v=volts) for volts in (highest, *(cells * cell for cell in REFERENCE_CELL_V))]

    def ratio(self, c: Conditions, vehicle: Vehicle) -> Number:
        volts = known_or(c.battery_v, self.reference_v)
        return clip(1.0 + self.share * (volts / self.reference_v - 1.0), *RATIO_LIMITS)


@dataclass(frozen=True)
class PowerSag(LinearSag):
    """K = (V / V_ref)^share: the thrust of a motor at a fixed command goes with about the square of the voltage."""

    name: ClassVar[str] = "battery_sag.voltage_power"
    source: ClassVar[str] = "thrust k rpm^2 of a motor whose speed is proportional to its voltage: share 2"

    def ratio(self, c: Conditions, vehicle: Vehicle) -> Number:
        volts = known_or(c.battery_v, self.reference_v)
        return clip(maximum(volts / self.reference_v, 0.1) ** self.share, *RATIO_LIMITS)
