"""Hold: stay where the phase before ended."""

from typing import ClassVar

from pydantic import Field

from quadctl.state import Vec3
from quadctl.trajectories.base import Reference, Trajectory


class Hold(Trajectory):
    """Keys: duration_s."""

    kind: ClassVar[str] = "hold"

    seconds: float = Field(alias="duration_s", gt=0.0, le=3600.0)

    def duration_s(self, start_m: Vec3) -> float:
        return self.seconds

    def reference(self, t_s: float, start_m: Vec3) -> Reference:
        return Reference(start_m)
