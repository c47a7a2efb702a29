"""Step run: on a run at constant speed the height jumps; what happens then is the step response in forward flight."""

import math
from typing import ClassVar

from pydantic import Field

from quadctl.state import Vec3
from quadctl.trajectories.base import Reference
from quadctl.trajectories.run import Run


class StepRun(Run):
    """Keys: to_m [north, east, up], step_after_m, speed_m_s, acceleration_m_s2, hold_s.

    A run at the height where the phase before ended; when `step_after_m` of the way are behind, or all of it, the
    height jumps to that of `to_m`.
    """

    kind: ClassVar[str] = "step_run"

    step_after_m: float = Field(ge=0.0, le=1000.0)

    def reference(self, t_s: float, start_m: Vec3) -> Reference:
        run = super().reference(t_s, start_m)
        x, y, _ = run.position_m
        behind_m = math.dist(start_m, run.position_m)
        if behind_m < min(self.step_after_m, math.dist(start_m, self._target_m(start_m))):
            return run
        return run._replace(position_m=(x, y, self.to_m[2]))

    def _target_m(self, start_m: Vec3) -> Vec3:
        """Level: the height is the step's."""
        return self.to_m[0], self.to_m[1], start_m[2]
