"""Allocation of force and moment to rotors: the matrix, its rank, and the forces that they hold without a moment."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

MOMENT_SHARE = 0.3
"""Share of each rotor's room, up to its full thrust and down to none, that lateral force leaves to attitude control."""
RANK_TOLERANCE = 0.01
"""Smallest singular value over the largest that counts for the rank, with moments divided by the arm. A direction that
needs a hundred times the thrust of the easiest one cannot be used: side force by the drag torques of rotors that lean
inward needs two hundred times."""
LEAST_MIX = 1e-7
"""Smallest thrust per force that counts as a rotor taking part, N/N: PX4's FLT_EPSILON."""

Matrix: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Allocation:
    """Allocation of a vehicle's force and moment, FRD, to the thrusts of its n rotors."""

    matrix: Matrix
    """Force (N/N), then moment about the centre of mass (N m/N), per thrust of each rotor, shape (6, n)."""
    max_thrust_n: float
    """Largest thrust of one rotor."""
    arm_m: float
    """Length of the arms, by which moments compare with forces."""

    @cached_property
    def rank(self) -> int:
        """Number of independent directions of force and moment: 4 for upright rotors, 6 for full actuation."""
        sizes = np.linalg.svd(self.matrix / self._units, compute_uv=False)
        return int(np.sum(sizes > RANK_TOLERANCE * sizes[0]))

    @cached_property
    def fully_actuated(self) -> bool:
        return self.rank == 6

    @cached_property
    def inverse(self) -> Matrix:
        """Thrust of each rotor per force and moment, shape (n, 6): the pseudo-inverse, as autopilots mix.

        It is exact with full actuation, and then the only solution for six rotors.
        """
        inverse: Matrix = np.linalg.pinv(self.matrix / self._units, RANK_TOLERANCE) / self._units.T
        return inverse

    @cached_property
    def lateral_mix(self) -> tuple[tuple[float, float], ...]:
        """Change of each rotor's thrust, of 1 on average, by a lateral command of 1 forward and one of 1 right.

        The normalisation is that of PX4 (`ControlAllocationPseudoInverse`): the average size over the rotors that
        take part. All zero without full actuation.
        """
        if not self.fully_actuated:
            return ((0.0, 0.0),) * len(self.inverse)
        mix: Matrix = self.inverse[:, :2] / np.array(self.lateral_scale)
        return tuple((float(mix[i, 0]), float(mix[i, 1])) for i in range(len(mix)))

    @cached_property
    def lateral_scale(self) -> tuple[float, float]:
        """Average change of thrust, over the rotors that take part, per lateral force forward and right, N/N."""
        if not self.fully_actuated:
            return 0.0, 0.0
        sizes = np.abs(self.inverse[:, :2])
        forward, right = (float(column[column > LEAST_MIX].mean()) for column in sizes.T)
        return forward, right

    def lateral_reach_n(self, thrust_n: float) -> float:
        """Largest force in any lateral direction without a moment, N, beside `thrust_n` along the body's thrust axis.

        `MOMENT_SHARE` is kept back. 0 without full actuation, and where `thrust_n` alone is more than the rotors give.
        """
        if not self.fully_actuated:
            return 0.0
        reach_n = math.inf
        for lift, side in self._needs:
            carried_n = lift * thrust_n
            reach_n = min(reach_n, min(carried_n, self.max_thrust_n - carried_n) / side)
        return max(reach_n, 0.0)

    def widest_angle_rad(self, force_n: float) -> float:
        """Largest angle from the thrust axis, rad, at which the rotors hold a force of this size without a moment.

        Continuous in `force_n`, and never beyond `lateral_reach_n`. With s the thrust of a rotor per lateral force
        and l per force along the axis, the angle a must keep s sin a <= l cos a (no rotor stops) and
        s sin a + l cos a <= T_max / F (none is at its limit). The left side of the second is largest at tan a = s / l;
        only angles below that are taken, as they are the ones that can be reached from level.
        """
        if not self.fully_actuated:
            return 0.0
        widest = 0.5 * math.pi
        for lift, side in self._needs:
            largest = math.hypot(lift, side)
            full = min(self.max_thrust_n / (force_n * largest), 1.0) if force_n > 0.0 else 1.0
            steep = math.atan2(side, lift)
            widest = min(widest, math.atan2(lift, side), steep - math.acos(full))
        return max(widest, 0.0)

    @property
    def _units(self) -> Matrix:
        """Units in which force and moment compare, shape (6, 1)."""
        return np.array([[1.0], [1.0], [1.0], [self.arm_m], [self.arm_m], [self.arm_m]])

    @cached_property
    def _needs(self) -> tuple[tuple[float, float], ...]:
        """Thrust of a rotor per force along the thrust axis, and per lateral force in its worst direction, N/N.

        The second is enlarged by the margin for attitude control. Rotors with the same needs are named once, those that
        lateral force does not concern not at all.
        """
        along = -self.inverse[:, 2]
        across = np.hypot(self.inverse[:, 0], self.inverse[:, 1]) / (1.0 - MOMENT_SHARE)
        needs = ((round(float(a), 6), round(float(b), 6)) for a, b in zip(along, across, strict=True) if b > LEAST_MIX)
        return tuple(dict.fromkeys(needs))
