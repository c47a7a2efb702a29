"""Move: a straight line at constant speed, with short ramps so that the velocity reference does not jump."""

import math
from typing import ClassVar, Self

from pydantic import Field

from quadctl.numeric import scaled
from quadctl.state import Vec3
from quadctl.trajectories.base import Reference, Trajectory, direction, moved, raised
from quadctl.trajectories.trapezoid import Trapezoid


class Move(Trajectory):
    """Keys: to_m [north, east, up], speed_m_s, acceleration_m_s2, hold_s (wait at the end)."""

    kind: ClassVar[str] = "move"

    to_m: Vec3
    speed_m_s: float = Field(default=0.5, gt=0.0, le=20.0)
    acceleration_m_s2: float = Field(default=2.0, gt=0.0, le=10.0)
    hold_s: float = Field(default=0.0, ge=0.0, le=3600.0)

    def lifted(self, up_m: float) -> Self:
        return self.model_copy(update={"to_m": raised(self.to_m, up_m)})

    def duration_s(self, start_m: Vec3) -> float:
        return self._way(start_m).duration_s + self.hold_s

    def reference(self, t_s: float, start_m: Vec3) -> Reference:
        way, target = self._way(start_m), self._target_m(start_m)
        if t_s >= way.duration_s:
            return Reference(target)
        travelled, speed, push = way.at(t_s)
        ahead = direction(start_m, target)
        return Reference(moved(start_m, travelled, ahead), scaled(speed, ahead), scaled(push, ahead))

    def _target_m(self, start_m: Vec3) -> Vec3:
        """End of the line."""
        return self.to_m

    def _way(self, start_m: Vec3) -> Trapezoid:
        length = math.dist(start_m, self._target_m(start_m))
        return Trapezoid.over(length, self.speed_m_s, self.acceleration_m_s2)
