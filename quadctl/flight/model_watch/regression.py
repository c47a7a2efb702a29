"""Changes of the vehicle against its model, by recursive least squares on the velocity that it gained.

The velocity gained in a block less the one that the model predicts is linear in small changes of its parameters:

    (v(t + T) - v(t)) / T - mean(a_model) = sum of x_j mean(h_j) + noise

with h_j the acceleration per change of parameter j. Those of drag and inflow take the velocity by `Following`: the
error of the estimated velocity is in the prediction too, and would pass for a change of drag. The estimate is a
Kalman filter whose parameters walk at random; the variance of the noise is estimated beside them, from what each
block leaves over its degrees of freedom. How quickly the parameters walk is not known: of filters for calm, breeze,
gusts and a vehicle that is changing the one counts that foresaw the latest blocks best (multiple models; Bar-Shalom,
Li and Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001, section 11.6).
"""

import math
from collections.abc import Callable
from functools import partial
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from quadctl.flight.model_watch.prediction import Prediction
from quadctl.frames import GRAVITY_M_S2, rotate
from quadctl.state import Quat, Vec3

BLOCK_S = 0.5
"""Time over which a gain of velocity is compared: the noise of a velocity then weighs little in an acceleration."""
FIRST_NOISE_M_S2, FIRST_BLOCKS = 0.1, 3.0
"""Noise of a block's acceleration that is assumed at first, and the number of blocks that the assumption counts for."""
KEPT = 0.99
"""Share of what is known about the noise that is kept from one block to the next."""

Array: TypeAlias = NDArray[np.float64]


class Parameter(NamedTuple):
    """One parameter of the regression."""

    name: str
    prior: float
    """Standard deviation before the flight."""
    drift: float = 0.0
    """Standard deviation of its walk in one second, where changes are looked for; that of the push is a `Walk`'s."""
    told: float = 0.1
    """Specific force, m/s^2, that a change must make in this flight to be told."""


PARAMETERS = (
    Parameter("thrust", 0.3, 0.02, told=0.5),  # relative; a battery takes some percent
    Parameter("drag forward", 1.0, 0.05),  # 1/s
    Parameter("drag right", 1.0, 0.05),
    Parameter("inflow", 1.0, 0.05),  # 1/s, as a drag along the thrust
    Parameter("lean forward", 0.05, 0.003),  # rad
    Parameter("lean right", 0.05, 0.003),
    Parameter("push north", 0.5),  # m/s^2, by the wind
    Parameter("push east", 0.5),
)


class Walk(NamedTuple):
    """Assumption about how quickly the parameters walk."""

    push_m_s2: float
    """Standard deviation of the walk of the push in one second."""
    vehicle: float = 1.0
    """Factor on the drifts of the vehicle's parameters."""


WINDS = (Walk(0.01), Walk(0.05), Walk(0.25), Walk(1.0))
CHANGING = Walk(0.02, 3.0)
REMEMBERED = 0.85
"""Share of what is known about the present wind that is kept from one block to the next."""
NAMES = tuple(parameter.name for parameter in PARAMETERS)


class Block(NamedTuple):
    """What one block says: the acceleration beyond the model's, NED, and its slopes, shape (3, parameters)."""

    begin_s: float
    duration_s: float
    excess_m_s2: Array
    slopes: Array
    air_m_s: Vec3
    """Root mean square of the velocity relative to the air, FRD."""


class Blocks:
    """Sums predictions up to blocks, by the trapezoidal rule: as half a tick of delay would pass for a drag."""

    def __init__(self) -> None:
        self._begin: tuple[float, Vec3] | None = None
        self._sums = [0.0] * _N_SUMS
        self._last = [0.0] * _N_SUMS

    def forget(self) -> None:
        """Drop the block that has begun."""
        self._begin = None

    def add(self, at: Prediction, velocity: Vec3, attitude: Quat) -> Block | None:
        """Add one prediction, for a vehicle with this velocity (NED) and attitude; the block that it ends, or None."""
        before, self._last = self._last, _terms(at, attitude)
        if self._begin is None:
            self._start(at, velocity)
            return None
        half = 0.5 * at.dt
        self._sums = [s + half * (a + b) for s, a, b in zip(self._sums, before, self._last, strict=True)]
        begin_s, old_velocity = self._begin
        if at.true_s - begin_s < BLOCK_S:
            return None
        duration_s = at.true_s - begin_s
        means = np.array(self._sums) / duration_s
        gained = np.subtract(velocity, old_velocity) / duration_s
        self._start(at, velocity)
        u, v, w = (math.sqrt(mean) for mean in means[-3:])
        slopes = np.zeros((3, len(PARAMETERS)))
        slopes[:, :6] = means[3:21].reshape(6, 3).T
        slopes[0, 6] = slopes[1, 7] = 1.0
        return Block(begin_s, duration_s, gained - means[:3], slopes, (u, v, w))

    def _start(self, at: Prediction, velocity: Vec3) -> None:
        self._begin, self._sums = (at.true_s, velocity), [0.0] * _N_SUMS


_N_SUMS = 3 + 6 * 3 + 3
_AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def _terms(at: Prediction, attitude: Quat) -> list[float]:
    """Acceleration, slopes of the body's parameters, and squares of the velocity along its axes."""
    (u, v, w), g = at.air_body, GRAVITY_M_S2
    forward, right, down = (rotate(attitude, axis) for axis in _AXES)
    rows = (
        (1.0, at.acceleration_ned),
        (1.0, rotate(attitude, at.rotors_body)),
        (-u, forward),
        (-v, right),
        (-w, down),
        (g, forward),
        (g, right),
        (1.0, (u * u, v * v, w * w)),
    )
    return [factor * part for factor, vector in rows for part in vector]


class Estimate(NamedTuple):
    """Estimate of one parameter."""

    value: float
    std: float


class Recursion:
    """Recursive estimate of the parameters; with `constant`, those of the vehicle do not change in flight."""

    def __init__(self, constant: bool) -> None:
        walks = [wind._replace(vehicle=0.0) for wind in WINDS] if constant else [*WINDS, CHANGING]
        self._filters = [_Filter(walk) for walk in walks]

    def tasks(self, block: Block) -> list[Callable[[], None]]:
        """Tasks that together take in one block: one for each filter, so that they can be spread over ticks."""
        return [partial(each.take, block) for each in self._filters]

    def estimates(self) -> dict[str, Estimate]:
        """Change of each parameter against the model, by the filter that has foreseen the latest blocks best."""
        best = max(self._filters, key=lambda each: each.log_likelihood)
        stds = np.sqrt(np.diag(best.p))
        return {name: Estimate(float(x), float(s)) for name, x, s in zip(NAMES, best.x, stds, strict=True)}


class _Filter:
    """Kalman filter with one walk of the parameters, and with the noise of the blocks estimated."""

    def __init__(self, walk: Walk) -> None:
        self.log_likelihood = 0.0
        """Logarithm of the likelihood with which it has foreseen the latest blocks, up to a constant."""
        self.x = np.zeros(len(PARAMETERS))
        self.p = np.diag([parameter.prior**2 for parameter in PARAMETERS])
        drifts = [walk.vehicle * parameter.drift for parameter in PARAMETERS]
        drifts[-2:] = walk.push_m_s2, walk.push_m_s2
        self._walk = np.diag(np.square(drifts))
        self._freedom = np.full(2, FIRST_BLOCKS)
        self._squares = FIRST_BLOCKS * np.full(2, FIRST_NOISE_M_S2**2)

    def take(self, block: Block) -> None:
        """Take in one block."""
        h, y = block.slopes, block.excess_m_s2
        p = self.p + block.duration_s * self._walk
        noise = (self._squares / self._freedom)[_KIND]
        foreseen, surprise = h @ p @ h.T + np.diag(noise), y - h @ self.x
        gain = np.linalg.solve(foreseen, h @ p).T
        self.x = self.x + gain @ surprise
        kept = np.eye(len(p)) - gain @ h
        self.p = kept @ p @ kept.T + gain @ np.diag(noise) @ gain.T  # Joseph's form, which stays symmetric
        left, freedom = np.square(y - h @ self.x), 1.0 - np.diag(h @ gain)
        self._freedom = KEPT * self._freedom + _by_kind(freedom)
        self._squares = KEPT * self._squares + _by_kind(left)
        of_block = -0.5 * float(np.linalg.slogdet(foreseen)[1] + surprise @ np.linalg.solve(foreseen, surprise))
        self.log_likelihood = REMEMBERED * self.log_likelihood + of_block


_KIND = np.array([0, 0, 1])
"""Kind of noise of each axis, NED: both horizontal ones have the same."""


def _by_kind(of_axes: Array) -> Array:
    """Sums of the horizontal axes and of the vertical one."""
    return np.array([of_axes[0] + of_axes[1], of_axes[2]])
