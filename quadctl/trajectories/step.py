"""Step: the reference jumps at once and stays there; what happens then is the step response."""

from typing import ClassVar, Self

from pydantic import Field

from quadctl.state import Vec3
from quadctl.trajectories.base import Reference, Trajectory, raised


class Step(Trajectory):
    """Keys: to_m [north, east, up], duration_s."""

    kind: ClassVar[str] = "step"

    to_m: Vec3
    seconds: float = Field(alias="duration_s", gt=0.0, le=3600.0)

    def lifted(self, up_m: float) -> Self:
        return self.model_copy(update={"to_m": raised(self.to_m, up_m)})

    def duration_s(self, start_m: Vec3) -> float:
        return self.seconds

    def reference(self, t_s: float, start_m: Vec3) -> Reference:
        return Reference(self.to_m)
