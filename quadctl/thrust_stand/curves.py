"""Thrust over rotor speed and over throttle: least squares with standard errors, and whether the simple law will do.

One point for each throttle step, all with the same error of thrust; throttle and rotor speed count as exact.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import curve_fit
from scipy.stats import f, t

from quadctl.errors import LogError
from quadctl.thrust_stand.measurement import Point
from quadctl.vehicle import Vehicle

Floats = npt.NDArray[np.float64]

SIGNIFICANCE = 0.01
"""Probability that any of the alternatives is chosen by chance."""
RELEVANCE = 0.02
"""Share of the greatest thrust: a smaller error of the simple law does no harm, however significant it is."""
FLYING = (0.3, 2.0)
"""Total thrust over weight: where the throttle line is flown, and so where it is fitted."""
MIN_FLYING = 4
"""With fewer points there, the line is fitted to all of them."""
EXPONENTS = (0.1, 10.0)
TOLERANCE = 1e-14
"""Relative change of squared error, parameters and gradient at which the fit of the exponent ends."""


@dataclass(frozen=True)
class Estimate:
    """A fitted number with its standard error and the degrees of freedom that are left."""

    value: float
    standard_error: float
    freedom: int

    @property
    def ci95(self) -> tuple[float, float]:
        half = float(t.ppf(0.975, self.freedom)) * self.standard_error
        return self.value - half, self.value + half


@dataclass(frozen=True)
class Alternative:
    """A law with one more parameter than T = k rpm^2, against which that is tested."""

    law: str
    """`power`: T = a rpm^p; `offset`: T = k rpm^2 + c."""
    parameter: Estimate
    """p, or c in newtons."""
    f_ratio: float
    """Fall of the squared error by the parameter, over the variance that is left."""
    p_value: float
    worst_n: float
    """Greatest difference between the two laws at the points."""
    at_rpm: float
    k_hover: float
    """N/rpm^2: the k with which k rpm^2 gives this law's rotor speed at a rotor's share of the weight."""


@dataclass(frozen=True)
class ThrustCurve:
    """T = k rpm^2 of one rotor."""

    k: Estimate
    """N/rpm^2."""
    rms_n: float
    alternatives: tuple[Alternative, ...]
    """The better one first; none with less than four points."""
    greatest_n: float

    @property
    def better(self) -> Alternative | None:
        """The law that is needed, or None where one k is enough."""
        for alternative in self.alternatives[:1]:
            sure = alternative.p_value * len(self.alternatives) < SIGNIFICANCE
            if sure and alternative.worst_n > RELEVANCE * self.greatest_n:
                return alternative
        return None

    @property
    def k_to_fly(self) -> float:
        """For the vehicle file: where thrust follows another power, the k that is right in hover."""
        return self.better.k_hover if self.better is not None and self.better.law == "power" else self.k.value


@dataclass(frozen=True)
class ThrottleLine:
    """throttle = offset + per_newton * total thrust of all rotors."""

    per_newton: Estimate
    offset: Estimate
    max_thrust_per_rotor_n: float
    reached_full: bool
    """True where the greatest thrust was measured; else it is the line's, at full throttle."""
    from_throttle: float
    to_throttle: float
    n_points: int
    worst: float
    """Greatest distance of a point from the line, in throttle."""


def fit_thrust_curve(points: Sequence[Point], vehicle: Vehicle) -> ThrustCurve | None:
    """k from the points with a known rotor speed above zero; None with less than three of those."""
    known = [point for point in points if point.rpm > 0.0]  # a nan is not
    if len(known) < 3:
        return None
    rpm = np.array([point.rpm for point in known])
    thrust = np.array([point.thrust_n for point in known])
    (k,), covariance, rss = _least_squares(rpm[:, None] ** 2, thrust)
    freedom = len(known) - 1
    alternatives: tuple[Alternative, ...] = ()
    if len(known) > 3:
        hover_n = vehicle.weight_n / vehicle.n_rotors
        found = (_power_law(rpm, thrust, k, rss, hover_n), _with_offset(rpm, thrust, k, rss, hover_n))
        alternatives = tuple(sorted(found, key=lambda alternative: -alternative.f_ratio))
    k_estimate = Estimate(float(k), math.sqrt(covariance[0, 0]), freedom)
    return ThrustCurve(k_estimate, math.sqrt(rss / freedom), alternatives, float(thrust.max()))


def fit_throttle_line(points: Sequence[Point], vehicle: Vehicle) -> ThrottleLine:
    """The line through the points at thrusts that are flown; all rotors are taken to be like the measured one.

    Thrust is regressed on throttle, because thrust carries the error, and the line is turned round.

    Raises
    ------
    LogError
        Thrust does not rise along the line.
    """
    n = vehicle.n_rotors
    low_n, high_n = (share * vehicle.weight_n / n for share in FLYING)
    flown = [point for point in points if low_n <= point.thrust_n <= high_n]
    if len({point.throttle for point in flown}) < MIN_FLYING:
        flown = list(points)
    throttle = np.array([point.throttle for point in flown])
    thrust = np.array([point.thrust_n for point in flown])
    (a, b), covariance, _ = _least_squares(np.column_stack([np.ones_like(throttle), throttle]), thrust)
    if b <= 0.0:
        raise LogError(f"thrust does not rise with throttle ({b:.3g} N from 0 to 1), so there is no line to turn round")
    to_offset = np.array([-1.0 / b, a / b**2])  # derivatives of -a/b
    freedom = len(flown) - 2
    offset = Estimate(float(-a / b), math.sqrt(to_offset @ covariance @ to_offset), freedom)
    per_newton = Estimate(float(1.0 / (n * b)), math.sqrt(covariance[1, 1]) / (n * b**2), freedom)
    reached_full = max(point.throttle for point in points) > 0.99
    greatest_n = max(point.thrust_n for point in points) if reached_full else float(a + b)
    worst = float(np.abs((thrust - a) / b - throttle).max())
    return ThrottleLine(per_newton, offset, greatest_n, reached_full, throttle.min(), throttle.max(), len(flown), worst)


def _power_law(rpm: Floats, thrust: Floats, k: float, rss_k: float, hover_n: float) -> Alternative:
    """T = a (rpm / greatest rpm)^p."""
    x = rpm / rpm.max()
    found, covariance = curve_fit(
        lambda x, a, p: a * x**p,
        x,
        thrust,
        [float(k * rpm.max() ** 2), 2.0],
        bounds=([-np.inf, EXPONENTS[0]], [np.inf, EXPONENTS[1]]),
        jac=lambda x, a, p: np.column_stack([x**p, a * x**p * np.log(x)]),
        ftol=TOLERANCE,
        xtol=TOLERANCE,
        gtol=TOLERANCE,
    )
    a, p = (float(value) for value in found)
    left = thrust - a * x**p
    hover_rpm = float(rpm.max()) * (hover_n / a) ** (1.0 / p) if a > 0.0 else math.nan
    exponent = Estimate(p, math.sqrt(covariance[1, 1]), len(rpm) - 2)
    return _tested("power", exponent, rss_k, float(left @ left), rpm, a * x**p - k * rpm**2, hover_n / hover_rpm**2)


def _with_offset(rpm: Floats, thrust: Floats, k: float, rss_k: float, hover_n: float) -> Alternative:
    (slope, c), covariance, rss = _least_squares(np.column_stack([rpm**2, np.ones_like(rpm)]), thrust)
    offset = Estimate(float(c), math.sqrt(covariance[1, 1]), len(rpm) - 2)
    k_hover = slope * hover_n / (hover_n - c) if hover_n > c else math.nan
    return _tested("offset", offset, rss_k, rss, rpm, slope * rpm**2 + c - k * rpm**2, float(k_hover))


def _tested(
    law: str, parameter: Estimate, rss_k: float, rss: float, rpm: Floats, difference: Floats, k_hover: float
) -> Alternative:
    """The F-test of one more parameter."""
    freedom = parameter.freedom
    # Measurements that a law meets to rounding error leave nothing to divide by.
    variance = max(rss / freedom, 1e-20 * rss_k, 1e-30)
    f_ratio = max(rss_k - rss, 0.0) / variance
    worst = int(np.abs(difference).argmax())
    p_value = float(f.sf(f_ratio, 1, freedom))
    return Alternative(law, parameter, f_ratio, p_value, float(abs(difference[worst])), float(rpm[worst]), k_hover)


def _least_squares(design: Floats, measured: Floats) -> tuple[Floats, Any, float]:
    """Parameters, their covariance, and the sum of the squared residuals; `design` is (points, parameters)."""
    scale = np.abs(design).max(axis=0)
    parameters, *_ = np.linalg.lstsq(design / scale, measured, rcond=None)
    left = measured - design / scale @ parameters
    rss = float(left @ left)
    freedom = len(measured) - design.shape[1]
    covariance = np.linalg.pinv((design / scale).T @ (design / scale)) * rss / freedom
    return parameters / scale, covariance / np.outer(scale, scale), rss
