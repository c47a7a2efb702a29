"""The base of all trajectories: settings of one mission phase, and a pure function of time that gives the reference."""

import math
from typing import ClassVar, NamedTuple, Self

from quadctl.settings import Settings
from quadctl.state import Vec3


class Reference(NamedTuple):
    """Reference in the mission's frame: north and east from the take-off point, up from the ground."""

    position_m: Vec3
    velocity_m_s: Vec3 = (0.0, 0.0, 0.0)
    acceleration_m_s2: Vec3 = (0.0, 0.0, 0.0)
    by_velocity: tuple[bool, bool, bool] = (False, False, False)
    """Axes flown by velocity alone: control does not correct their position, to which the velocity should lead."""


class Trajectory(Settings):
    """Base of all trajectories. A subclass is one file: its fields are the keys of a phase in a mission file."""

    kind: ClassVar[str]

    def duration_s(self, start_m: Vec3) -> float:
        """Duration, s, of the phase that begins at `start_m`."""
        raise TypeError(f"{type(self).__name__} does not say its duration")

    def reference(self, t_s: float, start_m: Vec3) -> Reference:
        """Reference at `t_s` since the phase began at `start_m`; beyond the duration the last one holds."""
        raise TypeError(f"{type(self).__name__} does not say its reference")

    def lifted(self, up_m: float) -> Self:
        """The same trajectory with its absolute heights raised by `up_m`; relative ones have nothing to raise."""
        return self

    def end_m(self, start_m: Vec3) -> Vec3:
        return self.reference(self.duration_s(start_m), start_m).position_m


def raised(place_m: Vec3, up_m: float) -> Vec3:
    return place_m[0], place_m[1], place_m[2] + up_m


def direction(start_m: Vec3, end_m: Vec3) -> Vec3:
    """Unit vector from one place to another; zeros between a place and itself."""
    length = math.dist(start_m, end_m)
    x, y, z = ((e - s) / length if length > 1e-9 else 0.0 for s, e in zip(start_m, end_m, strict=True))
    return x, y, z


def moved(start_m: Vec3, factor: float, along: Vec3) -> Vec3:
    return start_m[0] + factor * along[0], start_m[1] + factor * along[1], start_m[2] + factor * along[2]
