"""Figure 8: the lemniscate of Gerono, which turns both ways and never stands still."""

import math
from typing import ClassVar

from pydantic import Field

from quadctl.state import Vec3
from quadctl.trajectories.base import Reference, Trajectory
from quadctl.trajectories.trapezoid import Trapezoid


class Figure8(Trajectory):
    """Keys: north_m, east_m (how far it reaches to either side), lap_s (at full speed), laps, fade_s.

    About the point where the phase before ended, at its height: north = north_m sin(a), east = east_m sin(2 a). The
    angle a sets out from rest and comes to rest over `fade_s` each, after `laps` whole laps.
    """

    kind: ClassVar[str] = "figure8"

    north_m: float = Field(gt=0.0, le=1000.0)
    east_m: float = Field(gt=0.0, le=1000.0)
    lap_s: float = Field(ge=1.0, le=600.0)
    laps: int = Field(default=1, ge=1, le=1000)
    fade_s: float = Field(default=3.0, ge=0.5, le=60.0)

    def duration_s(self, start_m: Vec3) -> float:
        return self._angle().duration_s

    def reference(self, t_s: float, start_m: Vec3) -> Reference:
        angle, rate, push = self._angle().at(t_s)
        x, y, z = start_m
        if rate == 0.0:
            return Reference(start_m)
        north, east = self.north_m, self.east_m
        s, c, s2, c2 = math.sin(angle), math.cos(angle), math.sin(2.0 * angle), math.cos(2.0 * angle)
        return Reference(
            (x + north * s, y + east * s2, z),
            (north * c * rate, 2.0 * east * c2 * rate, 0.0),
            (
                north * (c * push - s * rate * rate),
                2.0 * east * (c2 * push - 2.0 * s2 * rate * rate),
                0.0,
            ),
        )

    def _angle(self) -> Trapezoid:
        """Angle over time, rad, from rest to rest."""
        rate = 2.0 * math.pi / self.lap_s
        return Trapezoid.over(2.0 * math.pi * self.laps, rate, rate / self.fade_s)
