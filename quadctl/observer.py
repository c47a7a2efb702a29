"""An observer of slow forces and moments: its noise, which a model file may hold, and its equations.

What a model leaves of velocity and rates is, along each axis, the integral of a quick and a slow disturbance, both
Ornstein-Uhlenbeck processes, and the sensor's noise. The steady Kalman filter of that noise finds them in the past; a
rollout goes on with them while they fade. The functions need NumPy and nothing else: exported code holds their text.
"""

from collections.abc import Callable
from functools import cached_property
from typing import Annotated

import numpy as np
from pydantic import Field

from quadctl.settings import Settings

SIZES = 1e-6, 1e6
MOST_SHARE, MOST_DAMPING_1_S = 2.0, 60.0
Size = Annotated[float, Field(ge=SIZES[0], le=SIZES[1])]
Time = Annotated[float, Field(ge=1e-3, le=1e3)]
AXES = ("north", "east", "down", "roll", "pitch", "yaw")
"""Axes of the disturbances: accelerations NED, m/s^2, and angular accelerations FRD, rad/s^2."""
DISTURBANCES = tuple(
    f"{kind}_{axis}_{'m' if axis in AXES[:3] else 'rad'}_s2" for kind in ("quick", "slow") for axis in AXES
)


class AxisNoise(Settings):
    """Disturbances along one axis, as standard deviations, m/s^2 or rad/s^2, and times in which they fade."""

    quick: Size
    quick_s: Time
    slow: Size
    slow_s: Time
    sensor: Size
    """Standard deviation of the noise of velocity or rate, m/s or rad/s, each sample."""


class MomentNoise(AxisNoise):
    """Disturbances about a body axis, and what a forecast of a closed loop trusts.

    The commands to come answer disturbances that nobody knows yet, so a share of what turns the body is trusted, with
    more damping.
    """

    share: Annotated[float, Field(ge=0.0, le=MOST_SHARE)] = 1.0
    damping_1_s: Annotated[float, Field(ge=0.0, le=MOST_DAMPING_1_S)] = 0.0


class Observer(Settings):
    """Noise that an observer reckons with in flights sampled every `step_s`."""

    step_s: Annotated[float, Field(gt=0.0, le=0.1)]
    north: AxisNoise
    east: AxisNoise
    down: AxisNoise
    roll: MomentNoise
    pitch: MomentNoise
    yaw: MomentNoise

    @cached_property
    def noise(self) -> np.ndarray:
        """The fields of `AxisNoise` in their order, by `AXES`, shape (6, 5)."""
        return np.array([[getattr(getattr(self, axis), name) for name in AxisNoise.model_fields] for axis in AXES])

    @cached_property
    def trusted(self) -> np.ndarray:
        """Share and damping, 1/s, of a forecast about roll, pitch and yaw, shape (3, 2)."""
        return np.array([[axis.share, axis.damping_1_s] for axis in (self.roll, self.pitch, self.yaw)])

    @cached_property
    def lasting_s(self) -> np.ndarray:
        """Time in which each of `DISTURBANCES` fades, shape (12,)."""
        return np.concatenate([self.noise[:, 1], self.noise[:, 3]])


def delayed(u: np.ndarray, delay_s: float, step_s: float) -> np.ndarray:
    """Commands of so long before each sample, linear in between, shape (rotors, samples) as of u."""
    rows = np.arange(u.shape[1])
    return np.array([np.interp(rows - delay_s / step_s, rows, each) for each in u])


def lagged(wanted: np.ndarray, lag_s: float, step_s: float) -> np.ndarray:
    """Response of a first-order lag to signals that are linear between samples, from rest, shape (signals, samples)."""
    decay = np.exp(-step_s / lag_s)
    mean = (1.0 - decay) * lag_s / step_s
    found = wanted.copy()
    for k in range(1, wanted.shape[1]):
        found[:, k] = decay * found[:, k - 1] + (mean - decay) * wanted[:, k - 1] + (1.0 - mean) * wanted[:, k]
    return found


def disturbances(moved: np.ndarray, by_model: np.ndarray, noise: np.ndarray, step_s: float) -> np.ndarray:
    """Quick and slow disturbance along six axes at each sample, from it and those before, shape (12, samples).

    moved: velocity and body rates, by_model: their derivatives by the model, both of shape (6, samples); noise: of
    each axis quick, quick_s, slow, slow_s, sensor.
    """
    steps = 0.5 * step_s * (by_model[:, 1:] + by_model[:, :-1])
    unexplained = moved - moved[:, :1]
    unexplained[:, 1:] -= np.cumsum(steps, axis=1)
    filters = [steady_filter(axis, step_s) for axis in noise]
    transition, gain = (np.array(part) for part in zip(*filters, strict=True))
    state, found = np.zeros((6, 3)), []
    for seen in unexplained.T:
        state = state + gain * (seen - state[:, 0])[:, None]
        found.append(state[:, 1:].T.ravel())
        state = np.einsum("aij,aj->ai", transition, state)
    return np.array(found).T


def steady_filter(noise: np.ndarray, step_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Transition, shape (3, 3), and gain, shape (3,), of the steady Kalman filter of an integral of disturbances.

    Its states are the integral, which is seen, and the quick and the slow disturbance. The Riccati equation is solved
    by doubling (Chu, Fan, Lin & Wang 2004, Int. J. Control 77(8)), in the unit of the sensor's noise.
    """
    quick, quick_s, slow, slow_s, sensor = noise
    lasting_s = np.array([quick_s, slow_s])

    def after(time_s: float) -> np.ndarray:
        fade = np.exp(-time_s / lasting_s)
        return np.array([[1.0, *(lasting_s * (1.0 - fade))], [0.0, fade[0], 0.0], [0.0, 0.0, fade[1]]])

    density = np.diag([0.0, *(2.0 * (np.array([quick, slow]) / sensor) ** 2 / lasting_s)])
    nodes, weights = np.polynomial.legendre.leggauss(12)
    ages = 0.5 * step_s * (1.0 + nodes)
    parts = [0.5 * step_s * w * after(s) @ density @ after(s).T for s, w in zip(ages, weights, strict=True)]
    covariance = np.sum(parts, axis=0)
    transition = after(step_s)
    power, seen = transition.T, np.diag([1.0, 0.0, 0.0])
    for _ in range(40):
        shared = np.linalg.inv(np.eye(3) + seen @ covariance)
        seen, covariance, power = (
            seen + power @ shared @ seen @ power.T,
            covariance + power.T @ covariance @ shared @ power,
            power @ shared @ power,
        )
    return transition, covariance[:, 0] / (covariance[0, 0] + 1.0)


def foreseen(rate: np.ndarray, x: np.ndarray, trusted: np.ndarray) -> np.ndarray:
    """Derivative of states as a forecast of a closed loop reckons with it, shape as of rate, of the states x.

    trusted: share and damping, 1/s, about roll, pitch and yaw, shape (3, 2).
    """
    share, damping_1_s = trusted.T.reshape((2, 3) + (1,) * (x.ndim - 1))
    return np.concatenate([rate[:10], share * rate[10:13] - damping_1_s * x[10:13], rate[13:]])


def rolled_out(
    x_dot: Callable[[np.ndarray, np.ndarray], np.ndarray],
    x: np.ndarray,
    u: np.ndarray,
    lags_s: np.ndarray,
    step_s: float,
) -> np.ndarray:
    """States from x on, shape (states, steps + 1) or (states, steps + 1, windows), by the trapezoidal rule (Heun).

    x: the first 13 as in STATE, behind them such as follow or fade with the times lags_s, shape (states,) or (states,
    windows); u: what x_dot(x, u) takes at each sample, shape (inputs, steps + 1) or (inputs, steps + 1, windows).
    """
    lags_s = np.reshape(lags_s, (-1,) + (1,) * (x.ndim - 1))
    decay = np.exp(-step_s / lags_s)
    mean = (1.0 - decay) * lags_s / step_s

    def seen(x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Slope of the first states, and what the others follow."""
        rate = x_dot(x, u)
        return np.concatenate([rate[:13], x[13:] + lags_s * rate[13:]])

    def moved(before: np.ndarray, after: np.ndarray) -> np.ndarray:
        new = x[:13] + 0.5 * step_s * (before[:13] + after[:13])
        new[6:10] /= np.sqrt(np.sum(new[6:10] ** 2, axis=0))
        return np.concatenate([new, decay * x[13:] + (mean - decay) * before[13:] + (1.0 - mean) * after[13:]])

    found, before = [x], seen(x, u[:, 0])
    for k in range(1, u.shape[1]):
        after = seen(moved(before, before), u[:, k])
        x, before = moved(before, after), after
        found.append(x)
    return np.stack(found, axis=1)
