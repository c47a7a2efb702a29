"""Swoop: down to the ground and up again on the way ahead, as when a vehicle picks something up in flight."""

import math
from typing import ClassVar

from pydantic import Field

from quadctl.state import Vec3
from quadctl.trajectories.base import Reference, direction
from quadctl.trajectories.move import Move


class Swoop(Move):
    """Keys: to_m [north, east, up], speed_m_s, acceleration_m_s2, hold_s (wait at the end).

    A line over the ground from where the phase before ended, from rest to rest. The height falls as half a wave of a
    cosine to that of `to_m`, which is reached half way, and rises again to that of the start.
    """

    kind: ClassVar[str] = "swoop"

    speed_m_s: float = Field(default=1.0, gt=0.0, le=20.0)

    def reference(self, t_s: float, start_m: Vec3) -> Reference:
        way, level = self._way(start_m), self._target_m(start_m)
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

    def _target_m(self, start_m: Vec3) -> Vec3:
        """End of the swoop, at the height of its start."""
        return self.to_m[0], self.to_m[1], start_m[2]
