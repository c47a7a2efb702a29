"""Payload: the vehicle's mass changes at some time of the flight."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from quadctl.effects.base import Conditions, Effect, ThrustRatio, parameter
from quadctl.numeric import Number, step
from quadctl.vehicle import Vehicle

MARGIN_S = 5.0
COARSE_S, FINE_S = 4.0, 0.5
"""Distance of the times that a fit may start from: first all over the flights, then about the best of them. A step
explains little less of another one that is a few seconds off."""


@dataclass(frozen=True)
class MassStep(ThrustRatio):
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
    not_for_flight: ClassVar[str] = "the time of the change belongs to one flight"

    mass_kg: float = parameter(0.1, -20.0, 20.0, "kg", "mass picked up (+) or dropped (-)")
    time_s: float = parameter(0.0, 0.0, 1e6, "s", "time of the log at which it happens", fitted=False)
    flight: float = parameter(0.0, 0.0, 1e6, "", "number of the flight, in the order given; 0: every one", fitted=False)

    @classmethod
    def starts(cls, flights: Sequence[Conditions], vehicle: Vehicle) -> Sequence[Effect]:
        """A small change every few seconds, in one flight or at the same time in every one; not near the ends, where it
        would look like a thrust scale."""
        small = 0.02 * vehicle.mass_kg
        every = {float(t) for c in flights for t in np.arange(*_searched(c), COARSE_S)} if len(flights) > 1 else {}
        found = [cls(small, float(t), float(c.flight)) for c in flights for t in np.arange(*_searched(c), COARSE_S)]
        return [*found, *(cls(small, t) for t in sorted(every))] or [cls()]

    def closer(self, flights: Sequence[Conditions]) -> Sequence[Effect]:
        times = self.time_s + np.arange(-COARSE_S + FINE_S, COARSE_S, FINE_S)
        ranges = [_searched(c) for c in flights if c.flight == self.flight]
        return [
            replace(self, time_s=float(t))
            for begin, end in ranges
            for t in times
            if begin <= t < end and t != self.time_s
        ]

    def believable(self, flights: Sequence[Conditions], vehicle: Vehicle) -> bool:
        """True for changes above 1 % of the mass, by which a thrust scale may drift, except for losses above 70 %."""
        return self.mass_kg / vehicle.mass_kg > -0.7 and abs(self.mass_kg) > 0.01 * vehicle.mass_kg

    def ratio(self, c: Conditions, vehicle: Vehicle) -> Number:
        if self.flight not in (0.0, c.flight):
            return 1.0
        share = max(self.mass_kg / vehicle.mass_kg, -0.9)
        return 1.0 / (1.0 + share * step(c.time_s - self.time_s))


def _searched(c: Conditions) -> tuple[float, float]:
    """Earliest and latest time of one flight, s, at which a change of mass is looked for."""
    return float(c.time_s[0]) + MARGIN_S, float(c.time_s[-1]) - MARGIN_S
