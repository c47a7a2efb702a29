"""Rollouts of the whole state from motor commands, with an observer of the slow force and the slow moment.

From any instant on, position, velocity, attitude and rates are integrated with the commands that were sent. What the
named physics leaves is observed in the past by the steady Kalman filter of its noise, and held while it fades. The
observer knows no later sample than the start.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from quadctl.frames import GRAVITY_M_S2, multiply, rotate
from quadctl.lab.arrays import Floats
from quadctl.lab.rotation.innovations import Noise, SteadyFilter, first_order, noise_of

HORIZONS_S = (0.01, 0.1, 0.5, 2.0)
QUANTITIES = ("position_m", "velocity_m_s", "rotation_rad", "rates_rad_s")


@dataclass(frozen=True, eq=False)
class Track:
    """State and thrust of one flight on an even clock. n samples; NED and FRD."""

    name: str
    step_s: float
    position: Floats
    """NED, m, shape (n, 3)."""
    velocity: Floats
    """NED, m/s, shape (n, 3)."""
    attitude: Floats
    """Quaternion, body to world, shape (n, 4)."""
    rates: Floats
    """FRD, rad/s, shape (n, 3)."""
    command: Floats
    """Command of each rotor over its mean in hover, shape (n, k)."""


@dataclass(frozen=True, eq=False)
class Driven:
    """What the commands alone do along a flight: the angular acceleration, rad/s^2, FRD, shape (n, 3), and the thrust,
    m/s^2, shape (n,)."""

    moment: Floats
    thrust: Floats


@dataclass(frozen=True)
class Physics:
    """Parameters of the named physics, beside what drives it."""

    damping_1_s: tuple[float, float, float]
    airspeed: tuple[float, float]
    """Angular acceleration about roll per airspeed right, and about pitch per airspeed forward, rad/s^2 per m/s."""
    drag_1_s: tuple[float, float, float]

    def angular(self, moment: Floats, rates: Floats, body: Floats) -> Floats:
        """Angular acceleration, rad/s^2, shape (n, 3), at these rates and body velocities."""
        by_air = np.stack([self.airspeed[0] * body[:, 1], self.airspeed[1] * body[:, 0], 0.0 * body[:, 0]], axis=1)
        return np.asarray(moment + by_air - np.array(self.damping_1_s) * rates)

    def specific(self, thrust: Floats, body: Floats) -> Floats:
        """Specific force in body axes, m/s^2, shape (n, 3)."""
        force = -np.array(self.drag_1_s) * body
        force[:, 2] -= thrust
        return force


@dataclass(frozen=True, eq=False)
class Disturbance:
    """Quick and slow disturbance, as the past shows them, each of shape (n, 3), and how they fade."""

    quick: Floats
    slow: Floats
    noise: tuple[Noise, ...]

    def later(self, rows: NDArray[np.intp], after_s: float) -> Floats:
        """Disturbance expected some time after these rows, shape (len(rows), 3)."""
        quick = np.array([np.exp(-after_s / n.quick_s) for n in self.noise])
        slow = np.array([np.exp(-after_s / n.slow_s) for n in self.noise])
        return np.asarray(quick * self.quick[rows] + slow * self.slow[rows])


def turned(q: Floats, vector: Floats) -> Floats:
    """Body vectors in world axes; `q` of shape (n, 4), `vector` and result of shape (n, 3)."""
    return np.stack(rotate(tuple(q.T), tuple(vector.T)), axis=1)


def turned_back(q: Floats, vector: Floats) -> Floats:
    """World vectors in body axes; shapes as of `turned`."""
    return turned(q * np.array([1.0, -1.0, -1.0, -1.0]), vector)


def rotation_vector(q: Floats, other: Floats) -> Floats:
    """Rotation from attitude `q` to `other` in the axes of `q`, rad, both of shape (n, 4), the result (n, 3)."""
    difference = np.stack(multiply(tuple((q * np.array([1.0, -1.0, -1.0, -1.0])).T), tuple(other.T)), axis=1)
    difference *= np.where(difference[:, :1] < 0.0, -1.0, 1.0)
    size = np.linalg.norm(difference[:, 1:], axis=1, keepdims=True)
    angle = 2.0 * np.arctan2(size, difference[:, :1])
    return np.asarray(difference[:, 1:] * np.where(size > 1e-12, angle / np.maximum(size, 1e-12), 2.0))


def turned_by(q: Floats, vector: Floats) -> Floats:
    """Attitude after a rotation by `vector`, rad, in body axes; the inverse of `rotation_vector`."""
    half = 0.5 * np.linalg.norm(vector, axis=1, keepdims=True)
    part = np.concatenate([np.cos(half), 0.5 * np.sinc(half / np.pi) * vector], axis=1)
    return np.stack(multiply(tuple(q.T), tuple(part.T)), axis=1)


def _unexplained(track: Track, driven: Driven, physics: Physics) -> tuple[Floats, Floats]:
    """Rates and velocity beyond what the physics gives along the measured states, each of shape (3, n): what is left
    of the rates damps itself, what is left of the velocity does not."""
    body = turned_back(track.attitude, track.velocity)
    damping = np.array(physics.damping_1_s)
    forcing = physics.angular(driven.moment, 0.0 * track.rates, body)
    rates = [
        track.rates[:, i] - track.rates[0, i] - first_order(forcing[:, i], damping[i], track.step_s) for i in range(3)
    ]
    force = turned(track.attitude, physics.specific(driven.thrust, body))
    force[:, 2] += GRAVITY_M_S2
    velocity = track.velocity - track.velocity[0] - first_order(force.T, 0.0, track.step_s).T
    return np.array(rates), velocity.T


def observe(track: Track, driven: Driven, physics: Physics, noise: "Disturbances") -> tuple[Disturbance, Disturbance]:
    """Slow and quick moment (FRD, rad/s^2) and force (NED, m/s^2) at each sample, from it and those before."""
    rates, velocity = _unexplained(track, driven, physics)
    filters = [n.of_rate(c, track.step_s) for n, c in zip(noise.moment, physics.damping_1_s, strict=True)]
    moment = _states(rates, filters)
    force = _states(velocity, [n.of_rate(0.0, track.step_s) for n in noise.force])
    return (
        Disturbance(moment[:, 1].T, moment[:, 2].T, noise.moment),
        Disturbance(force[:, 1].T, force[:, 2].T, noise.force),
    )


def _states(signals: Floats, filters: Sequence[SteadyFilter]) -> Floats:
    """Filtered states, shape (3, states, n), of three signals, shape (3, n)."""
    transition = np.array([f.transition for f in filters])
    gain = np.array([f.gain for f in filters])
    update = np.linalg.solve(transition, gain[:, :, None])[:, :, 0]
    found, predicted = np.empty((*transition.shape[:2], signals.shape[1])), np.zeros(gain.shape)
    for k, sample in enumerate(signals.T):
        found[:, :, k] = predicted + update * (sample - predicted[:, 0])[:, None]
        predicted = np.einsum("aij,aj->ai", transition, found[:, :, k])
    return found


@dataclass(frozen=True)
class Disturbances:
    """Noise of the moment about each body axis and of the force along each world axis."""

    moment: tuple[Noise, ...]
    force: tuple[Noise, ...]


START = np.array([-3.3, 0.9, 0.5, -4.0])
LOWEST, HIGHEST = np.array([-5.0, -0.5, -5.0, -11.0]), np.array([-1.0, 2.5, 4.0, 3.0])


def fit_disturbances(tracks: Sequence[Track], driven: Sequence[Driven], physics: Physics) -> Disturbances:
    """Noise that predicts the next sample of these flights best, without a bias: an observer has none at its start."""
    left = [_unexplained(t, d, physics) for t, d in zip(tracks, driven, strict=True)]
    steps = [t.step_s for t in tracks]

    def fitted(part: int, axis: int, damping: float) -> Noise:
        def errors(x: Floats) -> Floats:
            noise = noise_of(x)
            return np.concatenate(
                [noise.of_rate(damping, s).whitened(pair[part][axis]) for pair, s in zip(left, steps, strict=True)]
            )

        return noise_of(least_squares(errors, START, bounds=(LOWEST, HIGHEST), diff_step=1e-4, ftol=1e-6).x)

    moment = tuple(fitted(0, axis, physics.damping_1_s[axis]) for axis in range(3))
    return Disturbances(moment, tuple(fitted(1, axis, 0.0) for axis in range(3)))


@dataclass(frozen=True, eq=False)
class State:
    """Whole state of many windows: NED and FRD, shapes (w, 3) and (w, 4)."""

    position: Floats
    velocity: Floats
    attitude: Floats
    rates: Floats


def state_at(track: Track, rows: NDArray[np.intp]) -> State:
    return State(track.position[rows], track.velocity[rows], track.attitude[rows], track.rates[rows])


def errors(predicted: State, track: Track, rows: NDArray[np.intp]) -> Floats:
    """Errors in `QUANTITIES` of windows that end at these rows, shape (w, 4)."""
    true = state_at(track, rows)
    pairs = (
        predicted.position - true.position,
        predicted.velocity - true.velocity,
        rotation_vector(true.attitude, predicted.attitude),
        predicted.rates - true.rates,
    )
    return np.stack([np.linalg.norm(pair, axis=1) for pair in pairs], axis=1)


def held(track: Track, rows: NDArray[np.intp], steps: int) -> State:
    """State after some steps where velocity and body rates stay as they are."""
    start, time_s = state_at(track, rows), steps * track.step_s
    attitude = turned_by(start.attitude, time_s * start.rates)
    return State(start.position + time_s * start.velocity, start.velocity, attitude, start.rates)


def roll_out(
    track: Track,
    driven: Driven,
    physics: Physics,
    disturbed: tuple[Disturbance, Disturbance],
    rows: NDArray[np.intp],
    steps: Sequence[int],
) -> list[State]:
    """States after each of these numbers of steps, ascending, from windows that start at `rows`."""
    moment, force = disturbed
    s, h = state_at(track, rows), track.step_s
    found = []
    before = _slopes(s, track, driven, physics, moment, force, rows, 0)
    for k in range(1, max(steps) + 1):
        guess = _moved(s, before, before, h)
        after = _slopes(guess, track, driven, physics, moment, force, rows, k)
        s = _moved(s, before, after, h)
        before = after
        if k in steps:
            found.append(s)
    return found


def _slopes(
    s: State,
    track: Track,
    driven: Driven,
    physics: Physics,
    moment: Disturbance,
    force: Disturbance,
    rows: NDArray[np.intp],
    k: int,
) -> tuple[Floats, Floats]:
    """Acceleration, NED, and angular acceleration, FRD, `k` steps after the start."""
    body, after_s = turned_back(s.attitude, s.velocity), k * track.step_s
    linear = turned(s.attitude, physics.specific(driven.thrust[rows + k], body)) + force.later(rows, after_s)
    linear[:, 2] += GRAVITY_M_S2
    return linear, physics.angular(driven.moment[rows + k], s.rates, body) + moment.later(rows, after_s)


def _moved(s: State, before: tuple[Floats, Floats], after: tuple[Floats, Floats], h: float) -> State:
    """Step of the trapezoidal rule (Heun): `before` and `after` are the slopes at its ends."""
    velocity = s.velocity + 0.5 * h * (before[0] + after[0])
    rates = s.rates + 0.5 * h * (before[1] + after[1])
    position = s.position + 0.5 * h * (s.velocity + velocity)
    attitude = turned_by(s.attitude, 0.5 * h * (s.rates + rates))
    return State(position, velocity, attitude, rates)
