"""Move: a straight line at constant speed, with short ramps so that the velocity reference does not jump."""

import math
from typing import ClassVar, Self

from pydantic import Field

from quadctl.state import Vec3
from quadctl.trajectories.base import Reference, Trajectory


class Move(Trajectory):
    """Keys: to_m [north, east, up], speed_m_s, acceleration_m_s2, hold_s (wait at the end)."""

    kind: ClassVar[str] = "move"

    to_m: Vec3
    speed_m_s: float = Field(default=0.5, gt=0.0, le=20.0)
    acceleration_m_s2: float = Field(default=2.0, gt=0.0, le=10.0)
    hold_s: float = Field(default=0.0, ge=0.0, le=3600.0)

    def lifted(self, up_m: float) -> Self:
        return self.model_copy(update={"to_m": (self.to_m[0], self.to_m[1], self.to_m[2] + up_m)})

    def duration_s(self, start_m: Vec3) -> float:
        ramp_s, cruise_s, _ = self._profile(start_m)
        return 2.0 * ramp_s + cruise_s + self.hold_s

    def reference(self, t_s: float, start_m: Vec3) -> Reference:
        ramp_s, cruise_s, top_m_s = self._profile(start_m)
        length = math.dist(start_m, self.to_m)
        if length < 1e-9 or t_s >= 2.0 * ramp_s + cruise_s:
            return Reference(self.to_m)
        a = self.acceleration_m_s2
        if t_s < ramp_s:
            travelled, speed, push = 0.5 * a * t_s * t_s, a * t_s, a
        elif t_s < ramp_s + cruise_s:
            travelled, speed, push = 0.5 * a * ramp_s**2 + top_m_s * (t_s - ramp_s), top_m_s, 0.0
        else:
            left_s = 2.0 * ramp_s + cruise_s - t_s
            travelled, speed, push = length - 0.5 * a * left_s**2, a * left_s, -a
        ux, uy, uz = ((e - s) / length for s, e in zip(start_m, self.to_m, strict=True))
        return Reference(
            (start_m[0] + ux * travelled, start_m[1] + uy * travelled, start_m[2] + uz * travelled),
            (ux * speed, uy * speed, uz * speed),
            (ux * push, uy * push, uz * push),
        )

    def _profile(self, start_m: Vec3) -> tuple[float, float, float]:
        """Ramp time, cruise time, top speed: a trapezoid, or a triangle where the way is too short for full speed."""
        length = math.dist(start_m, self.to_m)
        top = min(self.speed_m_s, math.sqrt(length * self.acceleration_m_s2))
        if top < 1e-9:
            return 0.0, 0.0, 0.0
        ramp_s = top / self.acceleration_m_s2
        return ramp_s, max(0.0, length / top - ramp_s), top
