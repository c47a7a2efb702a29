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
from scipy.signal import lfilter

from quadctl.frames import GRAVITY_M_S2, multiply, rotate
from quadctl.lab.arrays import Floats
from quadctl.lab.rotation.innovations import Noise, SteadyFilter, first_order, noise_of, solved

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
    """Commands of a flight after delay and lag: differences about the body axes, shape (n, 3), and the mean of all
    rotors beyond hover and that of its square, each of shape (n,)."""

    differences: Floats
    mean: Floats
    square: Floats


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
    half = 0.5 * np.linalg.norm(vector, axis=1, keepdims=True)
    part = np.concatenate([np.cos(half), 0.5 * np.sinc(half / np.pi) * vector], axis=1)
    return np.stack(multiply(tuple(q.T), tuple(part.T)), axis=1)


def _unexplained(track: Track, driven: Driven, physics: Physics) -> tuple[Floats, Floats]:
    """Rates and velocity beyond what the physics gives along the measured states, each of shape (3, n): what is left
    of the rates damps itself, what is left of the velocity does not."""
    body = turned_back(track.attitude, track.velocity)
    damping = np.array(physics.damping_1_s)
    forcing = physics.angular(driven.differences, 0.0 * track.rates, body)
    rates = [
        track.rates[:, i] - track.rates[0, i] - first_order(forcing[:, i], damping[i], track.step_s) for i in range(3)
    ]
    force = turned(track.attitude, physics.specific(driven.mean, driven.square, body))
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
LOWEST, HIGHEST = np.array([-5.0, -1.5, -7.0, -11.0]), np.array([-1.0, 3.5, 4.0, 5.0])
AHEAD_S = (0.1, 0.25, 0.5)
"""Horizons whose forecasts the observer's noise is fitted to: one that is fitted to the next sample follows quick
disturbances, which are gone half a second later."""


def fit_disturbances(tracks: Sequence[Track], driven: Sequence[Driven], physics: Physics) -> Disturbances:
    """Noise by which the past forecasts these flights best, without a bias: an observer has none at its start."""
    left = [_unexplained(t, d, physics) for t, d in zip(tracks, driven, strict=True)]
    step_s = tracks[0].step_s
    moment = [_fitted([rates[i] for rates, _ in left], [], c, step_s)[1] for i, c in enumerate(physics.damping_1_s)]
    force = [_fitted([velocity[i] for _, velocity in left], [], 0.0, step_s)[1] for i in range(3)]
    return Disturbances(tuple(moment), tuple(force))


def fit_forecasts(tracks: Sequence[Track], driven: Sequence[Driven], physics: Physics) -> tuple[Physics, Disturbances]:
    """Physics and noise that forecast these flights best from their past and from the commands to come.

    In closed loop they are no properties of the vehicle: part of what the commands do answers disturbances that a
    forecast does not know, so its slopes are smaller and its damping larger than the vehicle's.
    """
    step_s, slopes, dampings, airspeeds, moment = tracks[0].step_s, [], [], [], []
    bodies = [turned_back(t.attitude, t.velocity) for t in tracks]
    for i, damping in enumerate(physics.damping_1_s):
        inputs = [
            np.array([d.differences[:, i], *([body[:, 1 - i]] if i < len(physics.airspeed) else [])])
            for d, body in zip(driven, bodies, strict=True)
        ]
        found, noise, weights = _fitted([t.rates[:, i] for t in tracks], inputs, damping, step_s, free=True)
        slopes.append(float(weights[0]))
        airspeeds += [float(w) for w in weights[1:]]
        dampings.append(found)
        moment.append(noise)
    down, lift = [], []
    for t, d, body in zip(tracks, driven, bodies, strict=True):
        axis = turned(t.attitude, np.repeat([[0.0, 0.0, -1.0]], len(body), axis=0))[:, 2]
        drag = turned(t.attitude, -np.array(physics.drag_1_s) * body * np.array([1.0, 1.0, 0.0]))[:, 2]
        known = GRAVITY_M_S2 * (1.0 + axis * (1.0 - d.square)) + drag
        down.append(t.velocity[:, 2] - first_order(known, 0.0, step_s))
        lift.append(np.array([GRAVITY_M_S2 * axis * (d.mean + d.square), axis * body[:, 2]]))
    _, _, (elasticity, inflow) = _fitted(down, lift, 0.0, step_s)
    drag_1_s = (*physics.drag_1_s[:2], float(inflow))
    fitted = Physics(
        (slopes[0], slopes[1], slopes[2]),
        (dampings[0], dampings[1], dampings[2]),
        (airspeeds[0], airspeeds[1]),
        float(elasticity),
        drag_1_s,
    )
    return fitted, Disturbances(tuple(moment), fit_disturbances(tracks, driven, fitted).force)


def _fitted(
    signals: Sequence[Floats], inputs: Sequence[Floats], damping_1_s: float, step_s: float, *, free: bool = False
) -> tuple[float, Noise, Floats]:
    """Damping (fitted where it is `free`), noise and weights of the inputs, each of shape (p, n), that forecast signals
    of shape (n,) best."""

    def parts(x: Floats) -> tuple[Floats, Floats]:
        damping = float(x[4]) if free else damping_1_s
        steady = noise_of(x[:4]).of_rate(damping, step_s)
        rows = []
        for i, signal in enumerate(signals):
            columns = [signal - signal[0]]
            if inputs:
                columns += list(first_order(inputs[i], damping, step_s))
            rows.append(np.stack([_forecast_errors(column, steady, step_s) for column in columns], axis=1))
        joined = np.concatenate(rows)
        return joined[:, 0], joined[:, 1:]

    def errors(x: Floats) -> Floats:
        wanted, design = parts(x)
        return wanted - design @ solved(design, wanted) if inputs else wanted

    start = np.array([*START, damping_1_s]) if free else START
    bounds = (np.array([*LOWEST, -5.0]), np.array([*HIGHEST, 40.0])) if free else (LOWEST, HIGHEST)
    x = least_squares(errors, start, bounds=bounds, diff_step=np.full(len(start), 1e-3), ftol=1e-5).x
    wanted, design = parts(x)
    weights = solved(design, wanted) if inputs else np.zeros(0)
    return float(x[4]) if free else damping_1_s, noise_of(x[:4]), weights


def _forecast_errors(signal: Floats, steady: SteadyFilter, step_s: float) -> Floats:
    """Errors of the forecasts over `AHEAD_S`, and of their integrals over twice the horizon's mean, each over its
    horizon, joined: a rate that is forecast turns an attitude, and a velocity moves a place."""
    innovations = steady.whitened(signal)
    found = []
    # A forecast's error is the sum of the innovations until then, each with what it does to the signal by then.
    reach = round(max(AHEAD_S) / step_s)
    answers, power = [1.0], steady.gain
    for _ in range(reach - 1):
        answers.append(float(power[0]))
        power = steady.transition @ power
    for ahead_s in AHEAD_S:
        reached = round(ahead_s / step_s)
        both = (np.array(answers[:reached]), 2.0 * step_s / ahead_s * np.cumsum(answers[:reached]))
        found += [lfilter(weights, [1.0], innovations)[reached:] / ahead_s for weights in both]
    return np.concatenate(found)


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
