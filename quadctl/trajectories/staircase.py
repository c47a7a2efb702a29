"""Staircase: steps of equal height, up or down, each held for a while."""

import math
from typing import ClassVar, Self

from pydantic import Field

from quadctl.state import Vec3
from quadctl.trajectories.base import Reference, Trajectory


class Staircase(Trajectory):
    """Keys: to_z_m (last height), step_m, hold_s (at each height). The first step is taken at once."""

    kind: ClassVar[str] = "staircase"

    to_z_m: float = Field(gt=0.0, le=1000.0)
    step_m: float = Field(ge=0.001, le=100.0)
    hold_s: float = Field(gt=0.0, le=3600.0)

    def lifted(self, up_m: float) -> Self:
        return self.model_copy(update={"to_z_m": self.to_z_m + up_m})

    def duration_s(self, start_m: Vec3) -> float:
        return self._steps(start_m) * self.hold_s

    def reference(self, t_s: float, start_m: Vec3) -> Reference:
        steps = self._steps(start_m)
        taken = min(int(t_s / self.hold_s) + 1, steps)
        rise = math.copysign(self.step_m, self.to_z_m - start_m[2])
        z = self.to_z_m if taken == steps else start_m[2] + taken * rise
        return Reference((start_m[0], start_m[1], z))

    def _steps(self, start_m: Vec3) -> int:
        return max(1, math.ceil(abs(self.to_z_m - start_m[2]) / self.step_m - 1e-6))
