"""The velocity that a vehicle has while it follows its reference, without the errors of its estimate.

The first stage of a regression with instruments (two-stage least squares; Wooldridge, Econometric Analysis of Cross
Section and Panel Data, 2010, section 5.1): the estimated velocity is regressed on the reference's velocity and
acceleration, which know nothing of those errors, and its fitted value takes its place.
"""

import math

from quadctl.state import Setpoint, Vec3

MEMORY_S = 10.0
"""Time for which the past counts."""
PRIOR_M2_S = 0.2
"""Weight of the assumption that the vehicle follows without a lag, as a square of the velocity over time."""
PRIOR_LAG_S = 0.5
"""Size of the lag that the assumption allows for."""


class FollowedVelocity:
    """Velocity of one flight: `expected` at every tick, after `take`."""

    def __init__(self) -> None:
        self._horizontal, self._vertical = _Response(), _Response()

    def take(self, velocity: Vec3, reference: Setpoint, dt: float) -> None:
        """Take in the estimated velocity, NED, and the reference of its time, for `dt`."""
        (x, y, z), (u, v, w), (a, b, c) = velocity, reference.velocity_ned_m_s, reference.acceleration_ned_m_s2
        kept = math.exp(-dt / MEMORY_S)
        self._horizontal.forget(kept)
        self._horizontal.add(x, u, a, dt)
        self._horizontal.add(y, v, b, dt)
        self._vertical.forget(kept)
        self._vertical.add(z, w, c, dt)

    def expected(self, reference: Setpoint) -> Vec3:
        """Velocity, NED, with this reference."""
        (u, v, w), (a, b, c) = reference.velocity_ned_m_s, reference.acceleration_ned_m_s2
        share, lag_s = self._horizontal.share_and_lag()
        share_down, lag_down_s = self._vertical.share_and_lag()
        return share * u - lag_s * a, share * v - lag_s * b, share_down * w - lag_down_s * c


class _Response:
    """Least squares for v = share v_ref - lag a_ref, from sums over time."""

    def __init__(self) -> None:
        self._vv = self._va = self._aa = self._yv = self._ya = 0.0

    def forget(self, kept: float) -> None:
        self._vv, self._va, self._aa = kept * self._vv, kept * self._va, kept * self._aa
        self._yv, self._ya = kept * self._yv, kept * self._ya

    def add(self, actual: float, velocity: float, acceleration: float, dt: float) -> None:
        self._vv += dt * velocity * velocity
        self._va -= dt * velocity * acceleration
        self._aa += dt * acceleration * acceleration
        self._yv += dt * actual * velocity
        self._ya -= dt * actual * acceleration

    def share_and_lag(self) -> tuple[float, float]:
        vv, aa = self._vv + PRIOR_M2_S, self._aa + PRIOR_M2_S / PRIOR_LAG_S**2
        yv, ya, va = self._yv + PRIOR_M2_S, self._ya, self._va
        size = vv * aa - va * va
        return (yv * aa - ya * va) / size, (ya * vv - yv * va) / size
