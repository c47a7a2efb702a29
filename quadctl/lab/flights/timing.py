"""Timing of a log's channels: the lag of the velocity behind the position, and the delay of the rotor signal.

Every channel of a log is late by a time of its own: estimators filter the velocity, telemetry sends rotor speeds when
it has time. An error of 30 ms looks like a force that depends on the acceleration. These times belong to the hardware,
so they are estimated from all flights together: each flight gives an estimate with a standard error, and a
random-effects model (DerSimonian & Laird 1986, Controlled Clinical Trials 7) says how far flights may differ. What a
flight does not show is taken from the others and, where none shows it, from a prior.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from quadctl.effects.motor_lag import lagged
from quadctl.lab.arrays import Floats
from quadctl.lab.finding import Finding, Kind
from quadctl.lab.flights.flight import Estimate, Flight, Timing
from quadctl.lab.flights.prediction import predict
from quadctl.lab.random_effects import variance_between
from quadctl.model import Model

VELOCITY_PRIOR = Estimate(0.0, 0.02)
"""Prior of the lag of the velocity behind the position, s. Estimators of autopilots have 20 to 40 ms."""
ROTOR_PRIOR = Estimate(0.0, 0.03)
"""Prior of the delay of the rotor signal relative to the force that it makes, s. Rotor speeds come up to 30 ms late,
and positions up to 40 ms; a larger delay needs evidence."""
MOST_EARLY_S = 0.04
"""Largest time by which a rotor signal comes before its force because the position is late, unless the flights show
that the position is later."""
VELOCITY_RANGE_S = (-0.04, 0.3)
ROTOR_RANGE_S = (-0.2, 0.3)
"""Ranges that are searched; an estimate at an end says nothing. Filters make velocities late by up to 0.15 s."""
VELOCITY_GAIN = 1.0
"""Acceleration that a controller commands per error of the velocity, 1/s: half of that of autopilots (PX4's
MPC_XY_VEL_P_ACC is 1.8, ArduPilot's PSC_VELXY_P 2), as the intercepts of `_regression` take away half of the answer or
more."""
CLIMB_GAIN = 4.0
"""The same for the vertical velocity (PX4's MPC_Z_VEL_P_ACC is 4, ArduPilot's PSC_VELZ_P 5), of which the regression on
several columns takes away little."""
STEADY_S = 2.0
"""Length of the windows between which motion grows and fades while the noise of the velocity stays as it is."""
LEAST_STD_S = 0.002
"""Least standard deviation between flights, and of an estimate."""
WINDOW_S = 3.0
"""Only motion that is quicker than this tells of delays: slower motion is a matter of forces."""
UNSEEN_STD_S = 10.0
"""Standard error of a time that a flight does not show."""
ITERATIONS = 10
MAX_STEP_S = 0.04
"""Largest change of an estimate in one iteration: the estimates are linear in a delay for small delays only."""
STARTS_S = (-0.05, 0.0, 0.05, 0.1, 0.15, 0.2, 0.25)
CLEARLY = 0.8
"""A delay far from 0 is where the search begins if the squared error there is less than this share of that at 0."""
LAGS_S = (0.02, 0.03, 0.05, 0.08, 0.12, 0.16, 0.25)
"""Motor lags by which a signal that comes before its force is explained."""
LEAST_SHARE = 0.1
"""Least coefficient of the thrust in the vertical acceleration; with less, the thrust does not move the vehicle, and
nothing is known of its time."""
LEAST_MOTION_M_S2 = 1e-3
"""Least root mean square of a quick motion that tells of delays; less is rounding."""
PROBE_S = 0.005
"""Step of the finite difference of the prediction over the delay."""


def timed(flights: Sequence[Flight], lag: Model) -> tuple[Flight, ...]:
    """Copies of flights of one vehicle whose channels are moved to the time of the position.

    `lag` is a model that holds the effects that delay the thrust, given which the delay of the rotor signal is
    estimated: a delay that is estimated without the lag would contain a part of the lag.
    """
    lags, filtered = _velocity_lags(flights)
    velocity = _shrunk(lags, VELOCITY_PRIOR)
    prompt = [
        flight.with_velocity_lag(of_flight.value, filtered)
        for flight, of_flight in zip(flights, velocity.of_flights, strict=True)
    ]
    rotor = _shrunk([_rotor_delay(flight, lag) for flight in prompt], ROTOR_PRIOR)
    delays_s = [of_flight.value for of_flight in rotor.of_flights]
    earliest_s = -math.inf if _is_position_late(prompt, delays_s, lag) else -MOST_EARLY_S
    timing = Timing(rotor=rotor.common, velocity=velocity.common, earliest_s=earliest_s)
    return tuple(
        replace(flight.with_rotor_delay(max(own.value, earliest_s)), timing=timing, delay_std_s=own.std)
        for flight, own in zip(prompt, rotor.of_flights, strict=True)
    )


def comes_too_early(timing: Timing) -> bool:
    """Tell whether the rotor signal comes before its force by more than the position is old: then the rotors follow it
    late."""
    return timing.rotor.value + 1.64 * timing.rotor.std < timing.earliest_s


def of_timing(timing: Timing) -> list[Finding]:
    """Finding on a force that comes later than positions usually are: by a late position, or by that or motors that
    lag; none otherwise."""
    if timing.rotor.value > -MOST_EARLY_S:
        return []
    kind = Kind.LATE_POSITION if timing.earliest_s < timing.rotor.value else Kind.LATE_OR_LAGGING
    low, high = sorted(-1000.0 * end for end in timing.rotor.ci95)
    late = {"delay_ms": -1000.0 * timing.rotor.value, "low_ms": low, "high_ms": high, "usual_ms": 1000.0 * MOST_EARLY_S}
    return [Finding(kind, late)]


def _is_position_late(flights: Sequence[Flight], delays_s: Sequence[float], lag: Model) -> bool:
    """Tell whether rotor signals come before their force because the position is later than `MOST_EARLY_S`.

    A late position shifts the answer to a quick change of thrust, rotors that lag also round it. So the position is
    late where the best lag, beside a delay that a position usually has, clearly leaves more of the quick vertical
    acceleration than the delay alone. Where both explain as much, a lag is likelier: positions are seldom that late.
    """
    early = [(f, delay_s) for f, delay_s in zip(flights, delays_s, strict=True) if delay_s < -MOST_EARLY_S]
    if not early:
        return False
    shifted = sum(_left_with(flight, lag, delay_s) for flight, delay_s in early)
    rounded = [
        sum(
            # To first order a lag delays the thrust by its time constant, to which the delay makes room.
            _left_with(_with_lag(flight, lag_s), lag, max(delay_s + lag_s, -MOST_EARLY_S))
            for flight, delay_s in early
        )
        for lag_s in LAGS_S
    ]
    return shifted < CLEARLY * min(rounded)


def _with_lag(flight: Flight, lag_s: float) -> Flight:
    """Copy of a flight whose rotors follow the logged signal with a first-order lag."""
    step_s = float(flight.grid_s[1] - flight.grid_s[0])
    logged = [lagged(thrust, step_s, lag_s) for thrust in flight.logged_n]
    return replace(flight, logged_n=logged, nominal_n=[flight.later(thrust, flight.delay_s) for thrust in logged])


@dataclass(frozen=True)
class _Shrunk:
    """Estimates of one time: common to the vehicle, and of each flight."""

    common: Estimate
    of_flights: list[Estimate]


def _shrunk(own: Sequence[Estimate], prior: Estimate) -> _Shrunk:
    """Combine the estimates of single flights by the random-effects model, with a prior of the common value."""
    value = np.array([estimate.value for estimate in own])
    variance = np.clip([estimate.std for estimate in own], LEAST_STD_S, UNSEEN_STD_S) ** 2
    between = max(variance_between(value, variance), LEAST_STD_S**2)
    weights = 1.0 / (variance + between)
    precision = weights.sum() + 1.0 / prior.std**2
    common = Estimate(float((weights @ value + prior.value / prior.std**2) / precision), float(precision**-0.5))
    each = [
        Estimate(
            float((v / s2 + common.value / between) / (1.0 / s2 + 1.0 / between)),
            float((s2 * between / (s2 + between) + (common.std * s2 / (s2 + between)) ** 2) ** 0.5),
        )
        for v, s2 in zip(value, variance, strict=True)
    ]
    return _Shrunk(common, each)


def _velocity_lags(flights: Sequence[Flight]) -> tuple[list[Estimate], bool]:
    """Lag of the velocity of each flight, and whether it is that of a first-order filter.

    It is where undoing a filter clearly leaves less of the difference from the derivative of the position than reading
    the velocity later, which leaves it rounded: by the geometric mean of the ratios, as each flight has a noise of its
    own.
    """
    by_delay, by_filter = ([_velocity_lag(flight, filtered) for flight in flights] for filtered in (False, True))
    ratios = [filtered / late for (_, late), (_, filtered) in zip(by_delay, by_filter, strict=True) if late > 0.0]
    filtered = math.prod(ratios) < CLEARLY ** len(ratios)
    return [lag for lag, _ in (by_filter if filtered else by_delay)], filtered


def _velocity_lag(flight: Flight, filtered: bool) -> tuple[Estimate, float]:
    """Lag of the logged velocity behind the derivative of the position, s, from motion along all three axes, and the
    sum of squares of the difference that it leaves, (m/s)^2.

    A velocity that lags is off by the lag times the acceleration: the estimate is the regression of the difference on
    the acceleration, repeated with what was found taken out of the velocity.
    """
    c = flight.conditions
    true = np.column_stack([flight.derivative @ x for x in (*c.position_ne_m, c.height_m)])
    found, left = Estimate(0.0, UNSEEN_STD_S), math.inf
    for _ in range(ITERATIONS):
        seen = flight.prompt_velocity(found.value, filtered)
        error = _quick(flight, true - flight.filtered_vector(seen))
        left = float(np.sum(error**2))
        acceleration = _quick(flight, np.column_stack([flight.derivative @ v for v in seen]))
        (step,), (std,) = _regression(flight, error, [acceleration])
        lag_s = float(np.clip(found.value + np.clip(step, -MAX_STEP_S, MAX_STEP_S), *VELOCITY_RANGE_S))
        std = np.hypot(std, _feedback_error(VELOCITY_GAIN, error - step * acceleration, acceleration))
        found = Estimate(lag_s, float(std) if lag_s not in VELOCITY_RANGE_S else UNSEEN_STD_S)
        if abs(step) < 0.1 * LEAST_STD_S:
            break
    return found, left


def _rotor_delay(flight: Flight, lag: Model) -> Estimate:
    """Delay of the rotor signal relative to the force that it makes, s, from quick vertical motion.

    The vertical acceleration is regressed on the predicted one, its derivative with respect to the delay, the climb
    rate and the height: forces that depend on these (inflow, ground effect) would else pass for a delay, and the
    rotors' answer to the noise of the velocity for a signal that comes before its force.
    """
    up, beside = _quick_vertical(flight)

    def predicted(delay_s: float) -> Floats:
        return _quick_prediction(flight, lag, delay_s)

    left = {start: _left(up, [predicted(start), *beside]) for start in STARTS_S}
    best = min(left, key=left.__getitem__)
    delay_s, std = (best if left[best] < CLEARLY * left[0.0] else 0.0), UNSEEN_STD_S
    # What the velocity has and the position has not is noise of one of them.
    height_m = flight.conditions.height_m
    noise = _quick(flight, (flight.filtered(flight.velocity_up) - flight.derivative @ height_m)[:, None])
    noise_slope = np.gradient(noise, flight.time_s, axis=0)
    for _ in range(ITERATIONS):
        here = predicted(delay_s)
        slope = (predicted(delay_s + PROBE_S) - predicted(delay_s - PROBE_S)) / (2.0 * PROBE_S)
        (step, share, *_), (std, *_) = _regression(flight, up, [slope, here, *beside])
        if not share > LEAST_SHARE:
            return Estimate(0.0, UNSEEN_STD_S)
        step, std = step / share, float(np.hypot(std / share, _feedback_error(CLIMB_GAIN, noise_slope, slope)))
        delay_s = float(np.clip(delay_s + np.clip(step, -MAX_STEP_S, MAX_STEP_S), *ROTOR_RANGE_S))
        if abs(step) < 0.1 * LEAST_STD_S:
            break
    return Estimate(delay_s, std if delay_s not in ROTOR_RANGE_S else UNSEEN_STD_S)


def _quick_vertical(flight: Flight) -> tuple[Floats, list[Floats]]:
    """Quick vertical acceleration, and the quick climb rate and height, at the samples, shape (n, 1) each."""
    beside = (flight.velocity_up, flight.conditions.height_m)
    return _quick(flight, flight.measured[:, 2:3]), [_quick(flight, flight.filtered(s)[:, None]) for s in beside]


def _quick_prediction(flight: Flight, lag: Model, delay_s: float) -> Floats:
    """Quick vertical acceleration by `lag`, m/s^2, shape (n, 1), of rotor signals that are read `delay_s` later."""
    return _quick(flight, predict(lag, flight.with_rotor_delay(delay_s))[:, 2:3])


def _left_with(flight: Flight, lag: Model, delay_s: float) -> float:
    """Sum of squares of the quick vertical acceleration that `lag` and a delay leave."""
    up, beside = _quick_vertical(flight)
    return _left(up, [_quick_prediction(flight, lag, delay_s), *beside])


def _left(target: Floats, columns: Sequence[Floats]) -> float:
    """Sum of squares that a linear regression of `target` on `columns` leaves."""
    x = np.column_stack(columns)
    left = target[:, 0] - x @ np.linalg.lstsq(x, target[:, 0], rcond=None)[0]
    return float(left @ left)


def _regression(flight: Flight, target: Floats, columns: Sequence[Floats]) -> tuple[Floats, Floats]:
    """Coefficients of a linear regression of `target` on `columns`, shape (n, axes) each, and their standard errors.

    The controller answers the noise of the velocity, so that noise and motion are correlated (closed-loop
    identification: Söderström & Stoica 1989, System Identification, ch. 10). Their covariance is the same all the time,
    while what the motion explains grows and fades with it. Therefore the normal equations are taken for each window of
    `STEADY_S`, with an intercept for each column and axis, and solved by weighted least squares. Windows are the
    independent units of the standard errors (sandwich estimator).
    """
    windows = np.unique(((flight.time_s - flight.time_s[0]) / STEADY_S).astype(int), return_inverse=True)[1]
    size = np.bincount(windows)

    def per_window(values: Floats) -> Floats:
        """Means of `values`, shape (n, axes), in the windows, shape (axes, windows)."""
        return np.stack([np.bincount(windows, column) for column in values.T]) / size

    gram, right, equations = np.zeros((len(columns), len(columns))), np.zeros(len(columns)), []
    for one in columns:
        covariance, moments = per_window(one * target), np.stack([per_window(one * other) for other in columns])
        power = per_window(one**2)
        # The covariances of a window scatter the more, the more motion it has.
        weight = size / (power + np.maximum(np.median(power, axis=1, keepdims=True), LEAST_MOTION_M_S2**2))
        mean = weight / weight.sum(axis=1, keepdims=True)
        x = moments - (mean * moments).sum(axis=-1, keepdims=True)
        y = covariance - (mean * covariance).sum(axis=-1, keepdims=True)
        gram += np.einsum("iaw,jaw,aw->ij", x, x, weight)
        right += np.einsum("iaw,aw,aw->i", x, y, weight)
        equations.append((x, y, weight))
    free = len(size) - len(columns) * (1 + target.shape[1])
    seen = gram[0, 0] > len(target) * LEAST_MOTION_M_S2**2
    if free < 1 or not seen or np.linalg.cond(gram) > 1e12:
        return np.zeros(len(columns)), np.full(len(columns), UNSEEN_STD_S)
    coefficients, inverse = np.linalg.solve(gram, right), np.linalg.inv(gram)
    scores = np.zeros((len(columns), len(size)))
    for x, y, weight in equations:
        scores += np.einsum("iaw,aw->iw", x, weight * (y - np.tensordot(coefficients, x, 1)))
    variance = inverse @ (scores @ scores.T) @ inverse * len(size) / free
    return np.asarray(coefficients), np.sqrt(np.diag(variance))


def _feedback_error(gain: float, noise: Floats, motion: Floats) -> float:
    """Standard error of a delay, s, by a controller's answer to noise of the velocity.

    Noise n of the velocity makes an acceleration of about -`gain` n. A regression of the noise on a motion that holds
    this answer is off by up to gain var(n) / var(motion); the same is true of their derivatives. `noise` and `motion`
    have shape (n, axes).
    """
    return gain * float(np.mean(noise**2)) / max(float(np.mean(motion**2)), LEAST_MOTION_M_S2**2)


def _quick(flight: Flight, values: Floats) -> Floats:
    """Values at the samples, shape (n, axes), without their running mean over `WINDOW_S`."""
    n = max(3, round(WINDOW_S / float(np.median(np.diff(flight.time_s)))) | 1)
    padded = np.pad(values, ((n // 2, n // 2), (0, 0)), mode="edge")
    sums = np.cumsum(np.concatenate([np.zeros((1, values.shape[1])), padded]), axis=0)
    return np.asarray(values - (sums[n:] - sums[:-n]) / n)
