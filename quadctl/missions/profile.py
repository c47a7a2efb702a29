"""Demands of a mission on the vehicle: its reference in samples, and the extremes of each phase."""

import math
from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

from quadctl.frames import GRAVITY_M_S2
from quadctl.missions.mission import Mission, Phase
from quadctl.state import Vec3
from quadctl.trajectories import Reference

STEP_S = 0.05
JUMP_M = 0.005
"""Motion of the reference in one step, beyond that of its velocity, that counts as a jump."""


class Sample(NamedTuple):
    """The reference at one instant, and where it jumped to get there."""

    time_s: float
    reference: Reference
    jump_m: Vec3 = (0.0, 0.0, 0.0)

    @property
    def speed_m_s(self) -> float:
        return math.hypot(*self.reference.velocity_m_s)

    @property
    def tilt_rad(self) -> float:
        """Tilt of the thrust that gives the reference's acceleration, rad."""
        north, east, up = self.reference.acceleration_m_s2
        return math.atan2(math.hypot(north, east), GRAVITY_M_S2 + up)


class PhaseProfile(NamedTuple):
    """Extremes of one phase."""

    phase: Phase
    end_m: Vec3
    lowest_m: float
    highest_m: float
    top_speed_m_s: float
    top_acceleration_m_s2: float
    top_tilt_rad: float
    longest_jump_m: float


def sampled(mission: Mission) -> list[list[Sample]]:
    """The reference of each phase from its first instant to its last, every `STEP_S` or a little less."""
    found: list[list[Sample]] = []
    before = Reference(mission.phases[0].start_m)
    for phase in mission.phases:
        times, along = _times(phase), references(phase)
        jumps = [_jump(a, b, dt) for (a, b), dt in zip(pairwise([before, *along]), _steps(times), strict=True)]
        found.append([Sample(phase.start_s + t, r, j) for t, r, j in zip(times, along, jumps, strict=True)])
        before = along[-1]
    return found


@lru_cache(maxsize=512)
def references(phase: Phase) -> tuple[Reference, ...]:
    """The reference of a phase at the instants of `sampled`: that of a mission is asked for when it is read, when it is
    checked, and when it is drawn."""
    return tuple(phase.reference_after(t) for t in _times(phase))


def profiles(mission: Mission, samples: Sequence[Sequence[Sample]]) -> list[PhaseProfile]:
    """The extremes of each phase of `mission`, whose samples are given."""
    return [_profile(phase, of_phase) for phase, of_phase in zip(mission.phases, samples, strict=True)]


def flown_heights_m(samples: Sequence[Sequence[Sample]]) -> tuple[float, float]:
    """Lowest and highest height of a mission's samples, without the climb from the ground."""
    climbed = [samples[0][-1:], *samples[1:]]
    heights = [sample.reference.position_m[2] for of_phase in climbed for sample in of_phase]
    return min(heights), max(*heights, *(sample.reference.position_m[2] for sample in samples[0]))


def _profile(phase: Phase, samples: Sequence[Sample]) -> PhaseProfile:
    heights = [sample.reference.position_m[2] for sample in samples]
    return PhaseProfile(
        phase=phase,
        end_m=samples[-1].reference.position_m,
        lowest_m=min(heights),
        highest_m=max(heights),
        top_speed_m_s=max(sample.speed_m_s for sample in samples),
        top_acceleration_m_s2=max(math.hypot(*sample.reference.acceleration_m_s2) for sample in samples),
        top_tilt_rad=max(sample.tilt_rad for sample in samples),
        longest_jump_m=max(math.hypot(*sample.jump_m) for sample in samples),
    )


def _times(phase: Phase) -> list[float]:
    """Instants of the samples, s after the begin of the phase."""
    duration_s = phase.end_s - phase.start_s
    steps = max(1, math.ceil(duration_s / STEP_S - 1e-9))
    return [duration_s * i / steps for i in range(steps + 1)]


def _steps(times: Sequence[float]) -> list[float]:
    return [0.0, *(b - a for a, b in pairwise(times))]


def _jump(before: Reference, after: Reference, dt: float) -> Vec3:
    """Motion between two samples beyond that of their velocities, m; zeros below the threshold."""
    x, y, z = (
        q - p - 0.5 * dt * (u + v)
        for p, q, u, v in zip(before.position_m, after.position_m, before.velocity_m_s, after.velocity_m_s, strict=True)
    )
    return (x, y, z) if math.hypot(x, y, z) > JUMP_M else (0.0, 0.0, 0.0)
