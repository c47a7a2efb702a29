"""Cosine: up and down about a height, from the top to the top, as Garofano-Soldado et al. fly it near the ground."""

import math
from typing import ClassVar, Self

from pydantic import Field

from quadctl.state import Vec3
from quadctl.trajectories.base import Reference, Trajectory


class Cosine(Trajectory):
    """Keys: centre_z_m, amplitude_m, period_s, cycles. z = centre_z_m + amplitude_m cos(2 pi t / period_s).

    It begins and ends at rest at the top, where the phase before should end; where that one ended sideways it stays.
    """

    kind: ClassVar[str] = "cosine"

    centre_z_m: float = Field(gt=0.0, le=1000.0)
    amplitude_m: float = Field(gt=0.0, le=100.0)
    period_s: float = Field(ge=0.5, le=600.0)
    cycles: int = Field(default=1, ge=1, le=1000)

    def lifted(self, up_m: float) -> Self:
        return self.model_copy(update={"centre_z_m": self.centre_z_m + up_m})

    def duration_s(self, start_m: Vec3) -> float:
        return self.cycles * self.period_s

    def reference(self, t_s: float, start_m: Vec3) -> Reference:
        x, y, _ = start_m
        if t_s >= self.duration_s(start_m):
            return Reference((x, y, self.centre_z_m + self.amplitude_m))
        rate = 2.0 * math.pi / self.period_s
        above = self.amplitude_m * math.cos(rate * t_s)
        climb = -self.amplitude_m * rate * math.sin(rate * t_s)
        return Reference((x, y, self.centre_z_m + above), (0.0, 0.0, climb), (0.0, 0.0, -rate * rate * above))
