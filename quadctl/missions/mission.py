"""A mission: phases of trajectories in time, the limits that they stay within, and the heading."""

import bisect
import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from pydantic import Field

from quadctl.frames import wrap_pi
from quadctl.numeric import scaled
from quadctl.settings import Settings
from quadctl.state import Vec3
from quadctl.surfaces import Place
from quadctl.trajectories import Reference, Trajectory

QUANTITIES = ("thrust", "drag", "inflow")
"""Quantities of a vehicle that a mission may be flown for."""


class MissionLimits(Settings):
    """The mission's reference must stay inside these; a flight that leaves them by more than `margin_m` lands."""

    min_z_m: float = Field(default=0.05, ge=0.0)
    max_z_m: float = Field(gt=0.0)
    max_distance_m: float = Field(default=5.0, gt=0.0)
    """Largest horizontal distance from the take-off point."""
    max_duration_s: float = Field(default=900.0, gt=0.0, le=36000.0)
    margin_m: float = Field(default=0.5, gt=0.0)
    tolerance_m: float = Field(default=0.75, gt=0.0)
    """Largest position error, RMS over the flight, with which the mission counts as flown."""


class Phase(NamedTuple):
    """One leg of a mission, laid out in time."""

    name: str
    trajectory: Trajectory
    start_s: float
    end_s: float
    start_m: Vec3
    time_scale: float = 1.0
    """Factor on the time that its trajectory takes."""

    def reference(self, t_s: float) -> Reference:
        """Reference at `t_s` since lift-off."""
        return self.reference_after(t_s - self.start_s)

    def reference_after(self, since_s: float) -> Reference:
        """Reference at `since_s` since the phase began."""
        slow = self.time_scale
        reference = self.trajectory.reference(since_s / slow, self.start_m)
        if slow == 1.0:
            return reference
        velocity, acceleration = reference.velocity_m_s, reference.acceleration_m_s2
        return reference._replace(
            velocity_m_s=scaled(1.0 / slow, velocity), acceleration_m_s2=scaled(1.0 / slow**2, acceleration)
        )


class Turn(NamedTuple):
    """A turn that begins at `start_s` and ends at the heading `yaw_rad`, or when the next turn begins."""

    start_s: float
    yaw_rad: float
    end_s: float = math.inf


class Mission(NamedTuple):
    """Phases in time, from lift-off to the beginning of the landing."""

    name: str
    description: str
    phases: tuple[Phase, ...]
    limits: MissionLimits
    turns: tuple[Turn, ...] = ()
    """Turns in the order of time; before the first, the heading at take-off is kept."""
    yaw_rate_rad_s: float = math.radians(45.0)
    offset_up_m: float = 0.0
    parameters: Mapping[str, Any] = {}
    """Values of the mission's parameters as flown: those of the file, or those that override them."""
    place: Place | None = None
    """Surfaces of the ground that it flies over; None: not said."""
    until: Mapping[str, float] = {}
    """Quantities for which it is flown, each with the half of its 95 % interval, over its value, at which it is known
    well enough; the mission ends early when all are."""
    time_scale: float = 1.0
    """Factor on all times of the file."""

    @property
    def duration_s(self) -> float:
        return self.phases[-1].end_s

    def phase_at(self, t_s: float) -> Phase:
        """The phase at `t_s` since lift-off; the last one after the end."""
        index = bisect.bisect_right(self.phases, t_s, key=lambda phase: phase.end_s)
        return self.phases[min(index, len(self.phases) - 1)]

    def reference(self, t_s: float) -> Reference:
        return self.phase_at(t_s).reference(t_s)

    def slowed(self, factor: float) -> "Mission":
        """The same places and headings in `factor` times the time: velocities over it, accelerations over its square.

        A reference that jumps still jumps; what its answer asks of the vehicle does not depend on the factor.
        """
        phases = tuple(
            phase._replace(
                start_s=factor * phase.start_s, end_s=factor * phase.end_s, time_scale=factor * phase.time_scale
            )
            for phase in self.phases
        )
        turns = tuple(turn._replace(start_s=factor * turn.start_s, end_s=factor * turn.end_s) for turn in self.turns)
        return self._replace(
            phases=phases,
            turns=turns,
            yaw_rate_rad_s=self.yaw_rate_rad_s / factor,
            time_scale=factor * self.time_scale,
        )

    def yaw_rad(self, t_s: float, heading_rad: float) -> float:
        """Heading at `t_s` when it was `heading_rad` at take-off: each turn goes the short way at the yaw rate."""
        yaw = heading_rad
        for turn in self.turns:
            if t_s <= turn.start_s:
                break
            most = self.yaw_rate_rad_s * (min(t_s, turn.end_s) - turn.start_s)
            yaw += min(max(wrap_pi(turn.yaw_rad - yaw), -most), most)
        return wrap_pi(yaw)
