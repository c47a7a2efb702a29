"""Margins of one axis of the position loop, from its gains and lags: a linear model, no simulation.

With A the answer of the acceleration to its setpoint, F the filter of D, and v the velocity (Skogestad and
Postlethwaite, Multivariable Feedback Control, 2005, chapter 2):

    L(s) = A(s) / s [(Kv + Ki / s) (1 + Kp / s) + Kd s F(s)],    A(s) = e^(-s d) / (second order) / (tau s + 1)
"""

import math
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

Complex: TypeAlias = NDArray[np.complex128]
Floats: TypeAlias = NDArray[np.float64]

SLOWEST_RAD_S, FASTEST_RAD_S, POINTS = 1e-4, 1e4, 40_000
"""Frequencies: below, the loop is a chain of integrators, above its gain is nothing."""


class LoopGains(NamedTuple):
    """Gains of one axis, as in the configuration."""

    position_p: float
    p: float
    i: float = 0.0
    d: float = 0.0
    derivative_time_s: float = 0.05


class LoopLags(NamedTuple):
    """Lags from the state of an axis to its acceleration: delay, second order (attitude), first order (rotors)."""

    delay_s: float = 0.0
    """Age of the state, way of the setpoint, half the time for which it is held, delay of the attitude."""
    frequency_rad_s: float | None = None
    """Frequency of the attitude; None: it takes no part."""
    damping: float = 1.0
    time_constant_s: float = 0.0


class Margins(NamedTuple):
    """Robustness of a loop; one that is not stable has none."""

    stable: bool
    sensitivity_peak: float
    """Largest |1 / (1 + L)|: how much a disturbance is amplified at worst."""
    gain: float
    """Factor on all gains that makes it swing; inf: none does."""
    phase_deg: float
    delay_s: float
    """More delay, which makes it swing."""


def loop(gains: LoopGains, lags: LoopLags, omega_rad_s: Floats) -> Complex:
    """Open loop L(j omega), shape as `omega_rad_s`, negative feedback."""
    s = 1j * omega_rad_s
    answer = np.exp(-s * lags.delay_s) / (lags.time_constant_s * s + 1.0)
    if lags.frequency_rad_s is not None:
        x = s / lags.frequency_rad_s
        answer = answer / (x * x + 2.0 * lags.damping * x + 1.0)
    control = (gains.p + gains.i / s) * (1.0 + gains.position_p / s)
    open_loop: Complex = answer / s * (control + gains.d * s / (gains.derivative_time_s * s + 1.0))
    return open_loop


def margins(gains: LoopGains, lags: LoopLags) -> Margins:
    """Margins of the loop of these gains and lags."""
    omega = np.geomspace(SLOWEST_RAD_S, FASTEST_RAD_S, POINTS)
    open_loop = loop(gains, lags, omega)
    if not _stable(gains, open_loop):
        return Margins(False, math.inf, 1.0, 0.0, 0.0)
    return margins_of(omega, open_loop)


def margins_of(omega_rad_s: Floats, open_loop: Complex) -> Margins:
    """Margins of a loop that is stable when closed, from its open loop at these frequencies."""
    phase_deg, delay_s = _phase_margins(omega_rad_s, open_loop)
    peak = float(np.max(1.0 / np.abs(1.0 + open_loop)))
    return Margins(True, peak, _gain_margin(open_loop), phase_deg, delay_s)


def _stable(gains: LoopGains, open_loop: Complex) -> bool:
    """Nyquist: without unstable poles, 1 + L turns by a quarter for each integrator, and no further."""
    integrators = 1 + (gains.i > 0.0) + (gains.position_p > 0.0)
    phase = np.unwrap(np.angle(1.0 + open_loop))
    return bool(abs(phase[-1] - phase[0] - 0.5 * math.pi * integrators) < 0.5 * math.pi)


def _phase_margins(omega: Floats, open_loop: Complex) -> tuple[float, float]:
    """Smallest phase margin, deg, and delay margin, s, over all frequencies at which |L| falls to 1; inf without."""
    size = np.abs(open_loop)
    at = np.flatnonzero((size[:-1] >= 1.0) & (size[1:] < 1.0))
    if not len(at):
        return math.inf, math.inf
    left_rad = np.mod(np.angle(open_loop[at]) + math.pi, 2.0 * math.pi)
    return float(np.degrees(left_rad.min())), float(np.min(left_rad / omega[at]))


def _gain_margin(open_loop: Complex) -> float:
    """Smallest factor beyond 1 on L that brings it to -1; inf without."""
    crossed = (np.sign(open_loop.imag[:-1]) != np.sign(open_loop.imag[1:])) & (open_loop.real[:-1] < 0.0)
    sizes = np.abs(open_loop[:-1][crossed])
    within = sizes[(sizes < 1.0) & (sizes > 0.0)]
    return float(1.0 / within.max()) if len(within) else math.inf
