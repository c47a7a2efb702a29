"""Swoop: down to the ground and up again on the way ahead, as when a vehicle picks something up in flight."""

import math
from typing import ClassVar, Self

from pydantic import Field

from quadctl.state import Vec3
from quadctl.trajectories.base import Reference, Trajectory, direction, raised
from quadctl.trajectories.trapezoid import Trapezoid


class Swoop(Trajectory):
    """Keys: to_m [north, east, up], speed_m_s, acceleration_m_s2, hold_s (wait at the end).

    A line over the ground from where the phase before ended, from rest to rest. The height falls as half a wave of a
    cosine to that of `to_m`, which is reached half way, and rises again to that of the start.
    """

    kind: ClassVar[str] = "swoop"

    to_m: Vec3
    speed_m_s: float = Field(default=1.0, gt=0.0, le=20.0)
    acceleration_m_s2: float = Field(default=2.0, gt=0.0, le=10.0)
    hold_s: float = Field(default=0.0, ge=0.0, le=3600.0)

    def lifted(self, up_m: float) -> Self:
        return self.model_copy(update={"to_m": raised(self.to_m, up_m)})

    def duration_s(self, start_m: Vec3) -> float:
        return self._way(start_m).duration_s + self.hold_s

    def reference(self, t_s: float, start_m: Vec3) -> Reference:
        way, level = self._way(start_m), self._level_m(start_m)
        if t_s >= way.duration_s:
            return Reference(level)
        travelled, speed, push = way.at(t_s)
        ux, uy, _ = direction(start_m, level)
        # z = start - depth (1 - cos(k s)) / 2 over the distance s, whose derivatives are known
        k, depth = 2.0 * math.pi / way.length, start_m[2] - self.to_m[2]
        sine, cosine = math.sin(k * travelled), math.cos(k * travelled)
        return Reference(
            (start_m[0] + ux * travelled, start_m[1] + uy * travelled, start_m[2] - 0.5 * depth * (1.0 - cosine)),
            (ux * speed, uy * speed, -0.5 * depth * k * sine * speed),
            (ux * push, uy * push, -0.5 * depth * k * (k * cosine * speed * speed + sine * push)),
        )

    def _level_m(self, start_m: Vec3) -> Vec3:
        return self.to_m[0], self.to_m[1], start_m[2]

    def _way(self, start_m: Vec3) -> Trapezoid:
        length = math.dist(start_m, self._level_m(start_m))
        return Trapezoid.over(length, self.speed_m_s, self.acceleration_m_s2)
