"""Replay of flights by a model, as exported code does it, and the noise of the observer that suits the model.

The model's equations are evaluated along the measured states; what they leave is observed. From any sample on, they are
integrated with the commands that were sent and with what was observed, which fades.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.signal import lfilter

from quadctl.frames import GRAVITY_M_S2, multiply, rotate, rotate_inverse
from quadctl.lab.arrays import Floats
from quadctl.lab.rotation.forecast import SETTLED_S, WINDOWS, compared, typical_size
from quadctl.lab.rotation.innovations import SteadyFilter, first_order, noise_of, rate_filter
from quadctl.lab.rotation.model import UNBALANCED
from quadctl.lab.rotation.rollout import State, Track, errors_in_axes, joined, state_at
from quadctl.model import Model, conditions
from quadctl.observer import (
    AXES,
    MOST_DAMPING_1_S,
    MOST_SHARE,
    SIZES,
    AxisNoise,
    Observer,
    delayed,
    disturbances,
    foreseen,
    lagged,
    rolled_out,
)

RPM2_PER_KRPM2 = 1e6
START = np.array([-3.3, 0.9, 0.5, -4.0])
LOWEST, HIGHEST = np.array([-5.0, -1.5, -7.0, -11.0]), np.array([-1.0, 3.5, 4.0, 5.0])
"""Logarithms of the noise, as `noise_of` takes them."""
AHEAD_S = (0.1, 0.25, 0.5)
"""Horizons whose forecasts the observer's noise is fitted to: one that is fitted to the next sample follows quick
disturbances, which are gone half a second later."""
WHOLE = np.array([[1.0, 0.0]] * 3)
"""All that is observed and computed, as `Observer.trusted`."""
LEAST_WINDOWS = 50
"""Rollouts that are needed to tell what of them can be trusted."""


@dataclass(frozen=True, eq=False)
class Replay:
    """One flight beside the equations of a model. n samples, k rotors; two lags in a row are one of their sum."""

    model: Model
    track: Track
    measured: bool
    """True where the commands of the track are squared rotor speeds, krpm^2, which have no lag."""

    @cached_property
    def _prompt(self) -> Model:
        return self.model.prompt()

    @cached_property
    def lag_s(self) -> float:
        """Lag of the rotors behind their commands."""
        if self.measured:
            return 0.0
        own = (effect.values()["time_constant_s"] for effect in self.model.late().effects)
        return self.model.vehicle.rotor.time_constant_s + sum(own)

    def commanded_n(self) -> Floats:
        """Nominal thrust that the rotors follow, N, shape (k, n)."""
        vehicle, u = self.model.vehicle, self.track.command.T
        if self.measured:
            return np.asarray(RPM2_PER_KRPM2 * vehicle.rotor.thrust_n_per_rpm2 * u)
        line, delay = vehicle.throttle, self.model.command_delay_s
        late = u if delay is None else delayed(u, delay[0], self.track.step_s)
        return np.asarray(np.maximum(late - line.offset, 0.0) / (line.per_newton * vehicle.n_rotors))

    def states(self) -> Floats:
        """Measured states, and the thrusts behind the lag, shape (13, n) or (13 + k, n)."""
        t = self.track
        rotors = [lagged(self.commanded_n(), self.lag_s, t.step_s)] if self.lag_s > 0.0 else []
        return np.concatenate([t.position.T, t.velocity.T, t.attitude.T, t.rates.T, *rotors])

    def x_dot(self, x: Floats, commanded_n: Floats) -> Floats:
        """Derivative of states, as of `states`, shape as of x."""
        vehicle, rates = self.model.vehicle, x[10:13]
        q, world = (x[6], x[7], x[8], x[9]), (x[3], x[4], x[5])
        thrust, follows = commanded_n, np.empty((0, *x.shape[1:]))
        if self.lag_s > 0.0:
            thrust = x[13 : 13 + vehicle.n_rotors]
            follows = (commanded_n - thrust) / self.lag_s
        c = conditions(
            vehicle, -x[2], rotate_inverse(q, world), q, position_ne_m=(x[0], x[1]), rates_rad_s=tuple(rates)
        )
        loads = self._prompt.loads(list(thrust), replace(c, thrust_rate_n_s=tuple(follows)))
        linear = np.array(rotate(q, loads.force_n)) / vehicle.mass_kg
        linear[2] += GRAVITY_M_S2
        inertia = np.reshape(vehicle.principal_inertia_kg_m2, (3,) + (1,) * (x.ndim - 1))
        turning = np.cross(rates, inertia * rates, axis=0)
        angular = (np.array(np.broadcast_arrays(*loads.torque_n_m)) - turning) / inertia
        turned = 0.5 * np.array(multiply(q, (0.0 * rates[0], *rates)))
        return np.concatenate([x[3:6], linear, turned, angular, follows])

    def unexplained(self) -> Floats:
        """Velocity and rates beyond what the model gives along the measured states, by `AXES`, shape (6, n)."""
        moved, by_model = self._sixfold()
        return np.asarray(moved - moved[:, :1] - first_order(by_model, 0.0, self.track.step_s))

    def _sixfold(self) -> tuple[Floats, Floats]:
        """Velocity and rates, and their derivatives by the model, both of shape (6, n)."""
        x = self.states()
        found = self.x_dot(x, self.commanded_n())
        return np.concatenate([x[3:6], x[10:13]]), np.concatenate([found[3:6], found[10:13]])

    @cached_property
    def _observer(self) -> Observer:
        if self.model.observer is None:
            raise ValueError(f"{self.model.name}: has no observer")
        return self.model.observer

    def observed(self) -> Floats:
        """States and, behind them, the disturbances at each sample, from it and those before."""
        return np.concatenate([self.states(), disturbances(*self._sixfold(), self._observer.noise, self.track.step_s)])

    def windows(self, rows: NDArray[np.intp], steps: int) -> tuple[Floats, Floats]:
        """States with disturbances at `rows`, and nominal thrusts at each step from there, shapes (states, w) and (k,
        steps + 1, w)."""
        return self.observed()[:, rows], self.commanded_n()[:, rows[None, :] + np.arange(steps + 1)[:, None]]

    def rolled_out(self, begin: Floats, ahead: Floats, trusted: Floats) -> Floats:
        """States from those of `windows` on, shape (states, steps + 1, w); `trusted` as in `Observer`."""
        at, lasting_s = len(begin) - 2 * len(AXES), self._observer.lasting_s

        def x_dot(x: Floats, commanded_n: Floats) -> Floats:
            rate = self.x_dot(x[:at], commanded_n)
            beyond = x[at : at + 6] + x[at + 6 :]
            rate[3:6] += beyond[:3]
            rate[10:13] += beyond[3:]
            return foreseen(np.concatenate([rate, -x[at:] / lasting_s[:, None]]), x, trusted)

        lags_s = np.concatenate([np.full(at - 13, self.lag_s), lasting_s])
        return rolled_out(x_dot, begin, ahead, lags_s, self.track.step_s)

    def roll_out(self, rows: NDArray[np.intp], steps: Sequence[int]) -> list[State]:
        """States after each of these numbers of steps, from windows that start at `rows`."""
        return _states(self.rolled_out(*self.windows(rows, max(steps)), self._observer.trusted), steps)


def _states(ends: Floats, steps: Sequence[int]) -> list[State]:
    return [State(*(ends[part, k].T for part in (slice(3), slice(3, 6), slice(6, 10), slice(10, 13)))) for k in steps]


def fit_observer(replays: Sequence[Replay]) -> Observer:
    """Noise by which the past forecasts best what a model leaves of these flights, in the size of that.

    A centre of mass, or a balance of the rotors, counts as a disturbance: that of these flights is not that of the
    next, with another battery or a rotor that gives less, and an observer that trusts it forgets the new one.
    """
    step_s = replays[0].track.step_s
    left = [replace(replay, model=_without_offset(replay.model)).unexplained() for replay in replays]
    found = [_axis([signals[i] for signals in left], step_s).model_dump() for i in range(len(AXES))]

    def observer(trusted: Floats) -> Observer:
        turning = [
            of | dict(zip(("share", "damping_1_s"), row, strict=True))
            for of, row in zip(found[3:], trusted.tolist(), strict=True)
        ]
        return Observer.model_validate({"step_s": step_s} | dict(zip(AXES, found[:3] + turning, strict=True)))

    whole = observer(WHOLE)
    observing = [replace(replay, model=replace(replay.model, observer=whole)) for replay in replays]
    return observer(_trusted(observing))


def _trusted(replays: Sequence[Replay]) -> Floats:
    """Shares and dampings that forecasts trust, as in `Observer`, where rollouts come closest to these flights: alike
    about roll and pitch, and about yaw. Errors count as in `fit_forecast`; all is trusted where the flights are too
    short to tell."""
    step_s = replays[0].track.step_s
    steps = [round(s / step_s) for s in AHEAD_S[1:]]
    rows = [np.arange(round(SETTLED_S / step_s), len(r.track.rates) - max(steps)) for r in replays]
    every = max(sum(map(len, rows)) // WINDOWS, 1)
    flights = [(r, of[::every]) for r, of in zip(replays, rows, strict=True) if len(of)]
    if sum(len(of) for _, of in flights) < LEAST_WINDOWS:
        return WHOLE
    parts = zip(*(r.windows(of, max(steps)) for r, of in flights), strict=True)
    begin, ahead = (np.concatenate(of, axis=-1) for of in parts)
    true = [joined([state_at(r.track, of + k) for r, of in flights]) for k in steps]

    def errors(trusted: Floats) -> Floats:
        ends = _states(replays[0].rolled_out(begin, ahead, trusted), steps)
        return np.stack([errors_in_axes(e, t) for e, t in zip(ends, true, strict=True)], axis=1)

    typical, alike = typical_size(errors(WHOLE)), [0, 0, 1]

    def missed(x: Floats) -> Floats:
        return compared(errors(x.reshape(2, 2)[alike]) / typical)

    bounds, scale = (np.zeros(4), np.array([MOST_SHARE, MOST_DAMPING_1_S] * 2)), np.array([0.2, 2.0] * 2)
    found = least_squares(missed, np.array([0.8, 1.0] * 2), bounds=bounds, x_scale=scale, ftol=1e-3, max_nfev=15)
    return np.asarray(found.x.reshape(2, 2)[alike])


def _without_offset(model: Model) -> Model:
    return replace(model, stack=tuple(item for item in model.stack if item.effect.family() not in UNBALANCED))


def _axis(signals: Sequence[Floats], step_s: float) -> AxisNoise:
    """Noise that forecasts signals of shape (n,) best."""

    def errors(x: Floats) -> Floats:
        steady = rate_filter(noise_of(x), 0.0, step_s)
        return np.concatenate([_forecast_errors(signal, steady, step_s) for signal in signals])

    steps = np.full(len(START), 1e-3)
    noise = noise_of(least_squares(errors, START, bounds=(LOWEST, HIGHEST), diff_step=steps, ftol=1e-5).x)
    steady = rate_filter(noise, 0.0, step_s)
    innovations = np.concatenate([steady.whitened(signal) for signal in signals])
    size = float(np.sqrt(np.mean(innovations**2) / steady.variance))
    quick, slow, sensor = (float(x) for x in np.clip([size, noise.slow * size, noise.sensor * size], *SIZES))
    return AxisNoise(quick=quick, quick_s=noise.quick_s, slow=slow, slow_s=noise.slow_s, sensor=sensor)


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
