"""Changes of the vehicle against its model, by recursive least squares on the velocity that it gained.

The velocity gained in a block less the one that the model predicts is linear in small changes of its parameters:

    (v(t + T) - v(t)) / T - mean(a_model) = sum of x_j mean(h_j) + noise

with h_j the acceleration per change of parameter j. Those of drag and inflow take the velocity by `FollowedVelocity`:
the error of the estimated velocity is in the prediction too, and would pass for a change of drag. The estimate is a
Kalman filter whose parameters walk at random; the variance of the noise is estimated beside them, from what each
block leaves over its degrees of freedom. How quickly the parameters walk is not known: of filters for calm, breeze,
gusts and a vehicle that is changing the one counts that foresaw the latest blocks best (multiple models; Bar-Shalom,
Li and Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001, section 11.6).
"""

import math
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
    """Acceleration beyond the model's over one block, NED, and its slopes, shape (3, parameters)."""

    duration_s: float
    excess_m_s2: Array
    slopes: Array
    air_m_s: Vec3
    """Root mean square of the velocity relative to the air, FRD."""


class Blocks:
    """Sums predictions up to blocks, by the trapezoidal rule, as half a tick of delay would pass for a drag."""

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
        return Block(duration_s, gained - means[:3], slopes, (u, v, w))

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
    """Recursive estimate of the parameters; with `constant`, those of the vehicle do not change in flight.

    All filters, one for each walk, are advanced together: arrays have them along the first axis.
    """

    def __init__(self, constant: bool) -> None:
        walks = [wind._replace(vehicle=0.0) for wind in WINDS] if constant else [*WINDS, CHANGING]
        n = len(walks)
        self._walk = np.array([np.diag(np.square(_drifts(walk))) for walk in walks])
        self._x = np.zeros((n, len(PARAMETERS)))
        self._p = np.tile(np.diag([parameter.prior**2 for parameter in PARAMETERS]), (n, 1, 1))
        self._freedom = np.full((n, 2), FIRST_BLOCKS)
        self._squares = FIRST_BLOCKS * np.full((n, 2), FIRST_NOISE_M_S2**2)
        self._log_likelihood = np.zeros(n)
        """Logarithm of the likelihood with which each has foreseen the latest blocks, up to a constant."""

    def take(self, block: Block) -> None:
        """Take in one block."""
        h, y = block.slopes, block.excess_m_s2
        p = self._p + block.duration_s * self._walk
        noise = (self._squares / self._freedom)[:, _KIND]
        seen = h @ p
        foreseen = seen @ h.T
        foreseen[:, _DIAGONAL, _DIAGONAL] += noise
        inverse, surprise = np.linalg.inv(foreseen), y - self._x @ h.T
        gain = seen.transpose(0, 2, 1) @ inverse
        self._x = self._x + (gain @ surprise[:, :, None])[:, :, 0]
        p = p - gain @ seen
        self._p = 0.5 * (p + p.transpose(0, 2, 1))  # rounding must not make it asymmetric
        left, freedom = np.square(y - self._x @ h.T), 1.0 - (h @ gain)[:, _DIAGONAL, _DIAGONAL]
        self._freedom = KEPT * self._freedom + _by_kind(freedom)
        self._squares = KEPT * self._squares + _by_kind(left)
        of_block = np.log(np.linalg.det(inverse)) - np.sum(surprise * (inverse @ surprise[:, :, None])[:, :, 0], axis=1)
        self._log_likelihood = REMEMBERED * self._log_likelihood + 0.5 * of_block

    def estimates(self) -> dict[str, Estimate]:
        """Change of each parameter against the model, by the filter that has foreseen the latest blocks best."""
        best = int(np.argmax(self._log_likelihood))
        stds = np.sqrt(np.diagonal(self._p[best])).tolist()
        return {name: Estimate(x, s) for name, x, s in zip(NAMES, self._x[best].tolist(), stds, strict=True)}


def _drifts(walk: Walk) -> list[float]:
    """Standard deviation of the walk of each parameter in one second."""
    return [*(walk.vehicle * parameter.drift for parameter in PARAMETERS[:-2]), walk.push_m_s2, walk.push_m_s2]


_DIAGONAL = np.arange(3)
_KIND = np.array([0, 0, 1])
"""Kind of noise of each axis, NED: both horizontal ones have the same."""


def _by_kind(of_axes: Array) -> Array:
    """Sums of the horizontal axes and of the vertical one, for each filter."""
    return np.stack((of_axes[:, 0] + of_axes[:, 1], of_axes[:, 2]), axis=1)
