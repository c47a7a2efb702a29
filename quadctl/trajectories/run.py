"""Run: a line flown by velocity alone, so that no position control disturbs the effects of speed."""

from typing import ClassVar

from quadctl.state import Vec3
from quadctl.trajectories.base import Reference
from quadctl.trajectories.move import Move


class Run(Move):
    """Keys: those of `move`: to_m [north, east, up], speed_m_s, acceleration_m_s2, hold_s.

    On the way the position loop is off along the horizontal axes on which it leads; it holds the others, and all again
    from the end of the way on.
    """

    kind: ClassVar[str] = "run"

    def reference(self, t_s: float, start_m: Vec3) -> Reference:
        line = super().reference(t_s, start_m)
        vx, vy, _ = line.velocity_m_s
        return line._replace(by_velocity=(vx != 0.0, vy != 0.0, False))
