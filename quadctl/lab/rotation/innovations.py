"""Prediction-error estimation: parameters of a flight that a controller closes, with honest intervals.

In closed loop the commands hold the controller's knowledge of the disturbances, and a regression of the motion on the
commands is biased. One that predicts each sample from all earlier ones is not, provided that its model of the noise is
right, so that its errors (innovations) are white, and that the command acts at least one sample later (Ljung 1999,
System Identification, 2nd ed., ch. 13.4). The noise here is white noise and a slow disturbance, an Ornstein-Uhlenbeck
process; its innovations are those of the steady Kalman filter. A loop that is faster than the log answers samples of
the gyro that are not logged, too, so what of a command the log before it does not foresee tells the next innovations,
as a later and weaker command would: these are taken beyond it. Parameters that enter linearly are eliminated (variable
projection, Golub & Pereyra 1973).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, solve_discrete_are
from scipy.optimize import least_squares
from scipy.signal import lfilter
from scipy.stats import t as student

from quadctl.lab.arrays import Floats
from quadctl.lab.rotation.value import Value

BLOCK_S = 5.0
"""Time over which innovations may be dependent, where there are too few flights to take each as one block."""
FEW_FLIGHTS = 8
"""Number of flights from which each is one block: then intervals hold what differs from flight to flight, too."""
PREDICTABLE = 0.1
"""Largest share of the innovations' variance that one of the five before may predict, where they pass for white."""
STEP = 1e-4
SENSOR_NOISE = (-4.0, -2.0, 0.0, 2.0)
"""Logarithms of the sensor's noise that are tried as a start: a search that begins far off rests where it is."""


@dataclass(frozen=True, eq=False)
class Regression:
    """One flight's regression after whitening: `wanted`, shape (n,), by signals that all flights share, shape (p, n),
    and by signals of this flight alone, shape (q, n)."""

    wanted: Floats
    shared: Floats
    own: Floats
    instruments: Floats | None = None
    """Signals of which the errors are independent, in place of each shared one, shape (p, n): where that answers the
    disturbance before the sensor shows it."""


@dataclass(frozen=True, eq=False)
class Estimated:
    """Result of an estimation: parameters, how large the innovations are, and whether they are white."""

    values: dict[str, Value]
    innovation: float
    """Standard deviation of the innovations, in the unit of what is predicted."""
    correlation: float
    """Largest absolute autocorrelation of the innovations, at one to five samples."""
    n: int
    at_bound: frozenset[str]
    """Parameters that came to rest at a bound: nothing is known of them."""

    @property
    def white(self) -> bool:
        return self.correlation**2 < PREDICTABLE


def first_order(forcing: Floats, rate_1_s: float, step_s: float) -> Floats:
    """Solution of x' = -rate x + forcing from x = 0, with the forcing linear between samples, along the last axis."""
    z = rate_1_s * step_s
    decay = np.exp(-z)
    mean = (1.0 - decay) / z if abs(z) > 1e-5 else 1.0 - z / 2.0
    late = (1.0 - mean) / z if abs(z) > 1e-5 else 0.5 - z / 6.0
    return np.asarray(lfilter([step_s * late, step_s * (mean - late)], [1.0, -decay], forcing, axis=-1))


def held_response(
    command: Floats, rate_1_s: float, lag_s: float, step_s: float, ahead_s: float = 0.0, lead_s: float = 0.0
) -> Floats:
    """Solution of x' = -rate x + y + lead y', lag y' = command - y from x = 0 and y at rest, shape (n,), `ahead_s`
    after each sample: exact where each command, shape (n,), is held over the step until its sample, and on."""
    own = command - command[0]

    def followed(decay_1_s: float) -> Floats:
        x = lfilter([_held(decay_1_s, step_s)], [1.0, -np.exp(-decay_1_s * step_s)], own)
        return np.asarray(np.exp(-decay_1_s * ahead_s) * x + _held(decay_1_s, ahead_s) * own)

    steady = first_order(np.full(len(command), command[0]), rate_1_s, step_s)
    if lag_s < 0.01 * step_s:
        x, y = followed(rate_1_s), own
    else:
        # Partial fractions of 1 / ((s + rate) (1 + lag s)); they part where both poles are the same.
        pole = 1.0 / lag_s
        rate_1_s = rate_1_s if abs(rate_1_s / pole - 1.0) > 1e-4 else rate_1_s * 1.0002
        late = followed(pole)
        x, y = (followed(rate_1_s) - late) / (1.0 - rate_1_s * lag_s), pole * late
    # Of y' the answer is y - rate x.
    return np.asarray((1.0 - lead_s * rate_1_s) * x + lead_s * y + steady)


def _held(decay_1_s: float, time_s: float) -> float:
    """Integral of the decay over a time: (1 - exp(-decay time)) / decay."""
    z = decay_1_s * time_s
    return float(time_s * -np.expm1(-z) / z) if abs(z) > 1e-5 else time_s * (1.0 - z / 2.0)


@dataclass(frozen=True, eq=False)
class SteadyFilter:
    """Steady Kalman filter: x[k+1] = A x[k] + K (y[k] - x[k, 0])."""

    transition: Floats
    """A, shape (m, m)."""
    gain: Floats
    """K, shape (m,)."""
    variance: float
    """Variance of the innovations, y[k] - x[k, 0]."""

    def whitened(self, signal: Floats) -> Floats:
        """Innovations of a signal, along the last axis: the signal through the inverse of the noise's filter."""
        return np.asarray(lfilter(*self._inverse, signal, axis=-1))

    @cached_property
    def _inverse(self) -> tuple[Floats, Floats]:
        closed = self.transition - np.outer(self.gain, np.eye(len(self.gain))[0])
        return np.real(np.poly(self.transition)), np.real(np.poly(closed))


def steady_filter(drift: Floats, diffusion: Floats, noise: float, step_s: float) -> SteadyFilter:
    """Filter of dx = drift x dt + noise of spectral density `diffusion`, both of shape (m, m), seen as x[0] with white
    noise of this variance (Van Loan 1978, IEEE TAC 23(3), over a part of the step in which nothing fades by much, and
    doubled; discrete Riccati equation)."""
    m = len(drift)
    doublings = max(0, int(np.ceil(np.log2(np.abs(drift).max() * step_s))))
    joint = expm(np.block([[-drift, diffusion], [np.zeros((m, m)), drift.T]]) * step_s / 2**doublings)
    transition = joint[m:, m:].T
    walk = transition @ joint[:m, m:]
    for _ in range(doublings):
        transition, walk = transition @ transition, walk + transition @ walk @ transition.T
    seen = np.eye(m)[:1]
    covariance = solve_discrete_are(transition.T, seen.T, 0.5 * (walk + walk.T), np.array([[noise]]))
    variance = float(covariance[0, 0] + noise)
    return SteadyFilter(transition, transition @ covariance[:, 0] / variance, variance)


@dataclass(frozen=True)
class Noise:
    """Disturbances of one axis, relative to the quick one: two Ornstein-Uhlenbeck processes and the sensor's noise.

    The quick one is what the rotors add to their thrust, the slow one gusts, batteries and rotors that warm up.
    """

    quick_s: float
    """Memory of the quick disturbance, of standard deviation 1."""
    slow_s: float
    slow: float
    """Standard deviation of the slow disturbance."""
    sensor: float
    """Standard deviation of the sensor's noise, each sample."""

    @property
    def diffusion(self) -> tuple[float, float]:
        """Spectral densities of what drives the quick and the slow disturbance."""
        return 2.0 / self.quick_s, 2.0 * self.slow**2 / self.slow_s


@lru_cache(maxsize=64)  # most steps of a search vary something else than the noise
def force_filter(noise: Noise, step_s: float) -> SteadyFilter:
    """Filter of the disturbances that a sensor measures themselves. Its first state is their sum."""
    fast, slowly = 1.0 / noise.quick_s, 1.0 / noise.slow_s
    quick, slow = noise.diffusion
    drift = np.array([[-fast, fast - slowly], [0.0, -slowly]])
    return steady_filter(drift, np.array([[quick + slow, slow], [slow, slow]]), noise.sensor**2, step_s)


@lru_cache(maxsize=64)
def rate_filter(noise: Noise, damping_1_s: float, step_s: float) -> SteadyFilter:
    """Filter of a rate that the disturbances drive, and that damps itself. Its last state is the slow one."""
    drift = np.array([[-damping_1_s, 1.0, 1.0], [0.0, -1.0 / noise.quick_s, 0.0], [0.0, 0.0, -1.0 / noise.slow_s]])
    return steady_filter(drift, np.diag([0.0, *noise.diffusion]), noise.sensor**2, step_s)


NOISE_NAMES = ("log_quick_s", "log_slow_s", "log_slow", "log_sensor")


def noise_of(logarithms: Sequence[float] | Floats) -> Noise:
    """Noise of the logarithms that a fit varies, in the order of `NOISE_NAMES`."""
    return Noise(*(float(np.exp(x)) for x in logarithms))


def estimate(
    regress: Callable[[Floats], Sequence[Regression]],
    start: Floats,
    bounds: tuple[Floats, Floats],
    scale: Floats,
    names: Sequence[str],
    shared: Sequence[str],
    block_rows: int,
) -> Estimated:
    """Estimate the parameters `names`, of the size `scale`, from `start` within `bounds`, and the linear ones `shared`.

    The linear ones hold the errors apart from their instruments, where they have some (instrumental variables, Ljung
    1999, ch. 7.6). The intervals are a sandwich over blocks of `block_rows` samples, or over flights where they are
    many (White 1982, Econometrica 50(1)), with Student's t of their number: they hold where the innovations' variance
    changes.
    """

    def errors_at(x: Floats) -> Floats:
        wanted, design = _stacked(regress(x))
        return np.asarray(wanted - solved(design, wanted) @ design)

    at = list(names).index("log_sensor")
    tried = [np.where(np.arange(len(start)) == at, level, start) for level in (start[at], *SENSOR_NOISE)]
    start = min(tried, key=lambda x: float(np.sum(errors_at(x) ** 2)))
    steps = np.full(len(start), 1e-4)
    found = least_squares(errors_at, start, bounds=bounds, x_scale=scale, diff_step=steps, ftol=1e-6)
    flights = regress(found.x)
    wanted, design = _stacked(flights)
    block = _blocks([len(f.wanted) for f in flights], block_rows)
    plain = solved(design, wanted)
    slopes = [_slope(regress, found.x, i, plain) for i in range(len(start))]
    rows = np.vstack([*slopes, design])
    linear, errors = plain, wanted - plain @ design
    moved = _influences(rows, errors, block)
    if any(f.instruments is not None for f in flights):
        instruments = _beside_own(flights, [f.shared if f.instruments is None else f.instruments for f in flights])
        linear = solved(design, wanted, instruments)
        errors = wanted - linear @ design
        # What the parameters before miss by, these miss by, too.
        cross = rows[: len(start)] @ instruments.T
        own = _by_block(instruments * errors, block) - moved[:, : len(start)] @ cross
        moved[:, len(start) :] = np.linalg.lstsq(instruments @ design.T, own.T, rcond=1e-13)[0].T
    count = len(moved)
    variance = np.sum(moved**2, axis=0) * count / max(count - 1, 1)
    reach = float(student.ppf(0.975, max(count - 1, 1)))
    half = np.where(np.any(rows != 0.0, axis=1), reach * np.sqrt(variance), np.inf)  # what moves nothing is unknown
    named = {
        name: Value(float(v), float(v - h), float(v + h))
        for name, v, h in zip([*names, *shared], [*found.x, *linear], half, strict=True)
    }
    correlation = max(abs(float(errors[k:] @ errors[:-k])) for k in range(1, 6)) / float(errors @ errors)
    rests = np.min(np.abs(np.array(bounds) - found.x), axis=0) < 1e-3 * scale
    at_bound = frozenset(name for name, at in zip(names, rests, strict=True) if at)
    return Estimated(named, float(np.std(errors)), correlation, len(errors), at_bound)


def _influences(slopes: Floats, errors: Floats, block: NDArray[np.int64]) -> Floats:
    """Influence of each block of samples on the parameters, shape (blocks, p), of least squares whose predictions have
    these slopes, shape (p, n), and these errors, shape (n,)."""
    size = np.linalg.norm(slopes, axis=1)
    size[size == 0.0] = 1.0
    unit = slopes / size[:, None]
    bread = np.linalg.pinv(unit @ unit.T, rcond=1e-12)
    return np.asarray(_by_block(unit * errors, block) @ bread / size)


def _by_block(rows: Floats, block: NDArray[np.int64]) -> Floats:
    """Sums of rows, shape (p, n), over blocks, shape (blocks, p)."""
    return np.array([np.bincount(block, row) for row in rows]).T


def _stacked(flights: Sequence[Regression]) -> tuple[Floats, Floats]:
    """Wanted signal, shape (n,), and shared ones, shape (p, n), of all flights."""
    joined = _beside_own(flights, [np.vstack([f.wanted, f.shared]) for f in flights])
    return joined[0], joined[1:]


def _beside_own(flights: Sequence[Regression], signals: Sequence[Floats]) -> Floats:
    """Signals of each flight, shape (q, n), without what its own ones explain (Frisch & Waugh 1933), joined: the shared
    parameters and their scores stay the same."""
    pairs = zip(flights, signals, strict=True)
    return np.concatenate([of - solved(f.own, of) @ f.own for f, of in pairs], axis=1)


def solved(design: Floats, wanted: Floats, instruments: Floats | None = None) -> Floats:
    """Least squares, shape (..., p), of signals, shape (..., n), by those of a design, shape (p, n), of any size; or by
    instruments, of the same shape as the design."""
    held = design if instruments is None else instruments
    size = np.linalg.norm(design, axis=1)
    size[size == 0.0] = 1.0
    unit, by = held @ design.T / np.outer(size, size), wanted @ held.T / size
    return np.asarray(np.linalg.lstsq(unit, by.T, rcond=1e-13)[0].T / size)


def _slope(regress: Callable[[Floats], Sequence[Regression]], at: Floats, i: int, linear: Floats) -> Floats:
    """Slope of what is predicted over parameter `i`, the linear ones held, shape (n,)."""
    step = np.zeros(len(at))
    step[i] = STEP * max(abs(at[i]), 1e-2)
    (more, by_more), (less, by_less) = (_stacked(regress(at + sign * step)) for sign in (1.0, -1.0))
    return np.asarray(((less - linear @ by_less) - (more - linear @ by_more)) / (2.0 * step[i]))


def unforeseen(command: Floats, rate: Floats, reach: int) -> Floats:
    """Part of a command that the rate until then and the command before do not tell, all of shape (n,), by least
    squares over `reach` samples."""
    late = [earlier(x, k) for k in range(reach + 1) for x in ((rate, command) if k else (rate,))]
    design = np.vstack([*late, np.ones(len(command))])
    return np.asarray(command - solved(design[:, reach:], command[reach:]) @ design)


def earlier(signals: Floats, rows: int) -> Floats:
    """Signals, along the last axis, of so many rows before; 0 where there are none."""
    late = np.zeros_like(signals)
    late[..., rows:] = signals[..., : max(signals.shape[-1] - rows, 0)]
    return late


def _blocks(lengths: Sequence[int], rows: int) -> NDArray[np.int64]:
    """Number of the block of each sample, shape (n,): whole flights where they are many."""
    if len(lengths) >= FEW_FLIGHTS:
        return np.repeat(np.arange(len(lengths)), lengths)
    parts, first = [], 0
    for length in lengths:
        count = max(length // rows, 1)
        parts.append(first + np.minimum(np.arange(length) * count // length, count - 1))
        first += count
    return np.concatenate(parts)
