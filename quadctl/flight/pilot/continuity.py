"""Guards that compare successive states: frozen values, and jumps that no vehicle can make."""

import math
from typing import NamedTuple

from pydantic import Field

from quadctl.flight.pilot.reasons import Kind, Reason, reason
from quadctl.settings import Settings
from quadctl.state import VehicleState

MAX_RATE_RAD_S = 10.0
"""Largest angular rate between two states that neither of them shows."""
MAX_ACCELERATION_M_S2 = 40.0
"""4 g: more than the rotors of a multirotor give; a change of velocity beyond it counts as a jump."""


class ContinuityLimits(Settings):
    """Limits of these guards, in YAML under `guards: continuity`; 0 turns a guard off."""

    max_frozen_s: float = Field(default=0.5, ge=0.0, le=10.0)
    """Longest time for which position and velocity, or attitude and rates, may arrive with the very same values. Noise
    moves the last bits of every real estimate; one that is updated at 5 Hz only stands still for 0.2 s."""
    max_position_jump_m: float = Field(default=0.5, ge=0.0)
    """Largest jump of the position between two updates, beyond what the velocity explains. Smaller resets of an
    estimator are tolerated."""
    max_velocity_jump_m_s: float = Field(default=2.0, ge=0.0)
    """Largest change of velocity between two updates, beyond 4 g."""
    max_attitude_jump_deg: float = Field(default=30.0, ge=0.0, lt=180.0)
    """Largest turn between two updates, beyond 10 rad/s."""


class _Part(NamedTuple):
    """One part of the state as it was last seen."""

    sampled_s: float
    values: tuple[float, ...]
    moved_s: float
    """Time of the last update that changed its values."""


class Continuity:
    """Compares each state with the one before; only parts that have been updated since are compared."""

    def __init__(self, limits: ContinuityLimits) -> None:
        self._limits = limits
        self._position: _Part | None = None
        self._attitude: _Part | None = None

    def defect(self, state: VehicleState) -> Reason | None:
        """Reason why this state cannot follow those before it, or None. The state's numbers must be finite."""
        position = _follow(self._position, state, "position", (*state.position_ned_m, *state.velocity_ned_m_s))
        attitude = _follow(self._attitude, state, "attitude", (*state.attitude, *state.rates_rad_s))
        problem = (
            self._position_jump(self._position, position)
            or self._attitude_jump(self._attitude, attitude)
            or self._frozen("position", position)
            or self._frozen("attitude", attitude)
        )
        self._position, self._attitude = position, attitude
        return problem

    def _frozen(self, name: str, part: _Part) -> Reason | None:
        still_s, longest_s = part.sampled_s - part.moved_s, self._limits.max_frozen_s
        if longest_s > 0.0 and still_s > longest_s:
            return reason(Kind.FROZEN, part=name, still_s=still_s, most_s=longest_s)
        return None

    def _position_jump(self, before: _Part | None, now: _Part) -> Reason | None:
        if before is None or now.moved_s == before.moved_s:
            return None
        dt = max(now.moved_s - before.moved_s, 0.0)  # a stream may repeat what is updated seldom
        (x, y, z, u, v, w), after = before.values, now.values
        half = 0.5 * dt
        expected = x + half * (u + after[3]), y + half * (v + after[4]), z + half * (w + after[5])
        jump_m, largest_m = math.dist(after[:3], expected), self._limits.max_position_jump_m
        if 0.0 < largest_m < jump_m:
            return reason(Kind.POSITION_JUMP, jump_m=jump_m, most_m=largest_m)
        jump_m_s = math.dist(after[3:], (u, v, w)) - MAX_ACCELERATION_M_S2 * dt
        if 0.0 < self._limits.max_velocity_jump_m_s < jump_m_s:
            return reason(Kind.VELOCITY_JUMP, jump_m_s=jump_m_s, most_m_s=self._limits.max_velocity_jump_m_s)
        return None

    def _attitude_jump(self, before: _Part | None, now: _Part) -> Reason | None:
        if before is None or now.moved_s == before.moved_s:
            return None
        dt = max(now.moved_s - before.moved_s, 0.0)  # a stream may repeat what is updated seldom
        a, b = before.values, now.values
        cosine = abs(a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3])
        turn_rad = 2.0 * math.acos(min(cosine, 1.0))
        jump_deg, largest_deg = math.degrees(turn_rad - MAX_RATE_RAD_S * dt), self._limits.max_attitude_jump_deg
        if 0.0 < largest_deg < jump_deg:
            return reason(Kind.ATTITUDE_JUMP, jump_deg=jump_deg, most_deg=largest_deg)
        return None


def _follow(before: _Part | None, state: VehicleState, name: str, values: tuple[float, ...]) -> _Part:
    sampled_s = state.received_s[name]
    if before is not None and sampled_s == before.sampled_s:
        return before
    # Rates may be unknown: tuples take the same nan for equal, and there is one (state.NAN).
    if before is not None and values == before.values:
        return _Part(sampled_s, values, before.moved_s)
    return _Part(sampled_s, values, sampled_s)
