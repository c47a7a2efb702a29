"""Rollouts of the whole state from motor commands, with an observer of the slow force and the slow moment.

From any instant on, position, velocity, attitude and rates are integrated with the commands that were sent. What the
named physics leaves is observed in the past by the steady Kalman filter of its noise, and held while it fades. The
observer knows no later sample than the start.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from quadctl.frames import GRAVITY_M_S2, multiply, rotate
from quadctl.lab.arrays import Floats
from quadctl.lab.rotation.innovations import Noise, first_order, rate_filter
from quadctl.lab.rotation.parameters import differences
from quadctl.lab.rotation.records import Delayed
from quadctl.vehicle import Vehicle


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
    """Command of each rotor, shape (n, k)."""


@dataclass(frozen=True)
class Late:
    """Delay and lag of the rotors behind their commands, and the lead of their moment by their inertia."""

    delay_s: float
    lag_s: float
    lead_s: float = 0.0


@dataclass(frozen=True, eq=False)
class Driven:
    """Commands of a flight after delay and lag: differences about the body axes, shape (n, 3), and the mean of all
    rotors beyond hover and that of its square, each of shape (n,)."""

    differences: Floats
    mean: Floats
    square: Floats


@dataclass(frozen=True, eq=False)
class Commands:
    """Commands of a flight relative to hover, that can be read late: differences about the three body axes, mean beyond
    hover, mean square of what each rotor is beyond it."""

    differences: tuple[Delayed, ...]
    mean: Delayed
    square: Delayed

    def driven(self, moment: Sequence[Late], thrust: Late) -> Driven:
        """The commands after delay and lag, which may differ about each axis and along the thrust."""
        split = [d.by(late.delay_s, late.lag_s, late.lead_s) for d, late in zip(self.differences, moment, strict=True)]
        mean, square = (d.by(thrust.delay_s, thrust.lag_s) for d in (self.mean, self.square))
        return Driven(np.stack(split, axis=1), mean, square)


def commands_of(track: Track, hover: float, elasticity: float, vehicle: Vehicle) -> Commands:
    """Commands of a flight over the command in hover."""
    relative, step_s = track.command / hover, track.step_s
    split, own = differences(relative, elasticity, vehicle), relative - 1.0
    return Commands(
        tuple(Delayed(split[:, i], step_s) for i in range(3)),
        Delayed(own.mean(axis=1), step_s),
        Delayed((own**2).mean(axis=1), step_s),
    )


@dataclass(frozen=True)
class Physics:
    """Parameters of the named physics."""

    slope: tuple[float, float, float]
    """Angular acceleration about the body axes per difference of the commands, rad/s^2."""
    damping_1_s: tuple[float, float, float]
    airspeed: tuple[float, float]
    """Angular acceleration about roll per airspeed right, and about pitch per airspeed forward, rad/s^2 per m/s."""
    elasticity: float
    drag_1_s: tuple[float, float, float]

    def angular(self, difference: Floats, rates: Floats, body: Floats) -> Floats:
        """Angular acceleration, rad/s^2, shape (n, 3), at these rates and body velocities."""
        by_air = np.stack([self.airspeed[0] * body[:, 1], self.airspeed[1] * body[:, 0], 0.0 * body[:, 0]], axis=1)
        return np.asarray(np.array(self.slope) * difference + by_air - np.array(self.damping_1_s) * rates)

    def specific(self, mean: Floats, square: Floats, body: Floats) -> Floats:
        """Specific force in body axes, m/s^2, shape (n, 3)."""
        force = -np.array(self.drag_1_s) * body
        force[:, 2] -= GRAVITY_M_S2 * (1.0 + self.elasticity * mean + (self.elasticity - 1.0) * square)
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
    x, y, z = vector.T
    half = 0.5 * np.sqrt(x * x + y * y + z * z)
    size = 0.5 * np.sinc(half / np.pi)
    return np.stack(multiply(tuple(q.T), (np.cos(half), size * x, size * y, size * z)), axis=1)


def unexplained_rates(track: Track, driven: Driven, physics: Physics) -> Floats:
    """Rates beyond what the physics gives along the measured states, shape (3, n); they damp themselves."""
    forcing = physics.angular(driven.differences, 0.0 * track.rates, turned_back(track.attitude, track.velocity))
    known = [first_order(f, c, track.step_s) for f, c in zip(forcing.T, physics.damping_1_s, strict=True)]
    return np.asarray((track.rates - track.rates[0]).T - np.array(known))


def unexplained_velocity(track: Track, driven: Driven, physics: Physics) -> Floats:
    """Velocity beyond what the physics gives along the measured states, shape (3, n)."""
    body = turned_back(track.attitude, track.velocity)
    force = turned(track.attitude, physics.specific(driven.mean, driven.square, body))
    force[:, 2] += GRAVITY_M_S2
    return np.asarray((track.velocity - track.velocity[0]).T - first_order(force.T, 0.0, track.step_s))


def observe_force(track: Track, driven: Driven, physics: Physics, noise: "Disturbances") -> Disturbance:
    """Slow and quick force, NED, m/s^2, at each sample, from it and those before."""
    return disturbance(unexplained_velocity(track, driven, physics), noise.force, (0.0, 0.0, 0.0), track.step_s)


def disturbance(
    signals: Floats, noise: tuple[Noise, ...], damping_1_s: tuple[float, ...], step_s: float
) -> Disturbance:
    """Disturbances that move three signals, shape (3, n), each with this damping: steady Kalman filters."""
    quick: list[Floats] = []
    slow: list[Floats] = []
    for signal, one, damping in zip(signals, noise, damping_1_s, strict=True):
        steady = rate_filter(one, damping, step_s)
        innovations = steady.whitened(signal)
        update = np.linalg.solve(steady.transition, steady.gain)
        for state, found in ((1, quick), (2, slow)):
            found.append(lfilter([update[state]], [1.0, -steady.transition[state, state]], innovations))
    return Disturbance(np.array(quick).T, np.array(slow).T, noise)


@dataclass(frozen=True)
class Disturbances:
    """Noise of the moment about each body axis and of the force along each world axis."""

    moment: tuple[Noise, ...]
    force: tuple[Noise, ...]


@dataclass(frozen=True, eq=False)
class State:
    """Whole state of many windows: NED and FRD, shapes (w, 3) and (w, 4)."""

    position: Floats
    velocity: Floats
    attitude: Floats
    rates: Floats


def state_at(track: Track, rows: NDArray[np.intp]) -> State:
    return State(track.position[rows], track.velocity[rows], track.attitude[rows], track.rates[rows])


def joined(states: Sequence[State]) -> State:
    """The windows of all."""
    names = ("position", "velocity", "attitude", "rates")
    return State(*(np.concatenate([getattr(s, name) for s in states]) for name in names))


def errors_in_axes(predicted: State, true: State) -> Floats:
    """Errors in `QUANTITIES` along three axes, shape (w, 4, 3)."""
    pairs = (
        predicted.position - true.position,
        predicted.velocity - true.velocity,
        rotation_vector(true.attitude, predicted.attitude),
        predicted.rates - true.rates,
    )
    return np.stack(pairs, axis=1)


def errors(predicted: State, track: Track, rows: NDArray[np.intp]) -> Floats:
    """Sizes of the errors in `QUANTITIES` of windows that end at these rows, shape (w, 4)."""
    return np.asarray(np.linalg.norm(errors_in_axes(predicted, state_at(track, rows)), axis=2))


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
    linear = turned(s.attitude, physics.specific(driven.mean[rows + k], driven.square[rows + k], body)) + force.later(
        rows, after_s
    )
    linear[:, 2] += GRAVITY_M_S2
    return linear, physics.angular(driven.differences[rows + k], s.rates, body) + moment.later(rows, after_s)


def _moved(s: State, before: tuple[Floats, Floats], after: tuple[Floats, Floats], h: float) -> State:
    """Step of the trapezoidal rule (Heun): `before` and `after` are the slopes at its ends."""
    velocity = s.velocity + 0.5 * h * (before[0] + after[0])
    rates = s.rates + 0.5 * h * (before[1] + after[1])
    position = s.position + 0.5 * h * (s.velocity + velocity)
    attitude = turned_by(s.attitude, 0.5 * h * (s.rates + rates))
    return State(position, velocity, attitude, rates)
