"""Payload: the vehicle's mass changes at some time of the flight."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from quadctl.effects.base import Conditions, Effect, ThrustRatio, parameter
from quadctl.effects.onset import Sudden, onsets
from quadctl.numeric import Number, maximum
from quadctl.vehicle import Vehicle


@dataclass(frozen=True)
class MassStep(Sudden, ThrustRatio):
    """The mass grows by `mass_kg` at `time_s` of one flight: the same thrust accelerates m + mass_kg.

    K = m / (m + mass_kg) from then on.
    """

    name: ClassVar[str] = "payload.step"
    source: ClassVar[str] = "Newton's second law"
    depends_on: ClassVar[tuple[str, ...]] = ("time",)
    physics: ClassVar[str] = "The mass changes at one moment: something is picked up or dropped."
    distinguished_by: ClassVar[str] = "a step in time, at whatever height, speed and voltage"
    mission: ClassVar[str] = "missions/hover_staircase_high.yaml"
    reversible: ClassVar[bool] = True
    corrects: ClassVar[tuple[str, ...]] = ("mass",)
    not_for_flight: ClassVar[str] = "the time of the change belongs to one flight"

    mass_kg: float = parameter(0.1, -20.0, 20.0, "kg", "mass picked up (+) or dropped (-)")
    time_s: float = parameter(0.0, 0.0, 1e6, "s", "time of the log at which it happens", fitted=False)
    flight: float = parameter(0.0, 0.0, 1e6, "", "number of the flight, in the order given; 0: every one", fitted=False)

    @classmethod
    def starts(cls, flights: Sequence[Conditions], vehicle: Vehicle) -> Sequence[Effect]:
        """A small change every few seconds, in one flight or at the same time in every one; not near the ends, where it
        would look like a thrust scale."""
        small = 0.02 * vehicle.mass_kg
        found = [MassStep(small, *onset) for onset in onsets(flights)]
        every = sorted({start.time_s for start in found}) if len(flights) > 1 else []
        return [*found, *(MassStep(small, t) for t in every)] or [MassStep()]

    def believable(self, flights: Sequence[Conditions], vehicle: Vehicle) -> bool:
        """True for changes above 1 % of the mass, by which a thrust scale may drift, except for losses above 70 %."""
        return self.mass_kg / vehicle.mass_kg > -0.7 and abs(self.mass_kg) > 0.01 * vehicle.mass_kg

    def ratio(self, c: Conditions, vehicle: Vehicle) -> Number:
        share = maximum(self.mass_kg / vehicle.mass_kg, -0.9)
        return 1.0 / (1.0 + share * self.begun(c))
