"""Delays between the sources of a log, found where two channels say the same: body rates and the attitude's change,
thrust and the vertical acceleration.

A motion capture, an onboard logger and a logger of the rotors have clocks and links of their own, so that the delay
between their channels may change within a flight. The gyro and the accelerometer come together: what is found by the
rates holds for both.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from quadctl.frames import body_rates
from quadctl.logs.channel_groups import channel_groups
from quadctl.logs.findings import Finding, Kind, Span, finding
from quadctl.logs.flight_log import ATTITUDE, IMU, RATES, VELOCITY, FlightLog, Floats
from quadctl.logs.record.flight_time import THRUST_SOURCES, averaged, on_clock, thrust_drive, within
from quadctl.logs.record.heading import INDEPENDENT_S as INDEPENDENT_LEAN_S
from quadctl.logs.record.heading import STEP_S as CLOCK_S
from quadctl.logs.record.heading import directions, motion_of

LEAST_CORRELATION = 0.8
"""Correlation at the best delay below which a window tells nothing."""
INDEPENDENT_S = 0.1
"""Time after which the difference of the rates is independent."""
NOTABLE_S = 0.01
"""Range of a delay that is told and corrected: faster motion than a quarter of its inverse is not analysed."""
SIGMA = 4.0
"""Standard errors by which the delays must differ, or the delay from zero."""
NORMAL_PER_MEDIAN, STD_OF_SCATTER = 1.4826, 1.17
"""Standard deviation of normal values over the median of their size, and the standard deviation of that estimate times
the root of their number."""
DRIFTS_S, STRAIGHT, DRIFT_WINDOWS = 0.1, 0.9, 6
"""Range over which the rotors' delay drifts, share of its variance in a straight line, and number of windows, from
which on they have a clock of their own. A constant delay belongs to the fit, as motors lag; one that only scatters is
drag."""


class Search(NamedTuple):
    """Comparison of two channels."""

    step_s: float
    smoothed_steps: int
    """Step of the clock, and half the width of the filter of both."""
    searched_s: float
    """Largest delay that is looked for."""
    window_s: float
    every_s: float
    """Length of the windows in which a delay is estimated, and the time between them."""


OF_RATES = Search(0.005, 6, 0.25, 4.0, 2.0)
OF_ROTORS = Search(0.02, 5, 0.8, 12.0, 6.0)


@dataclass(frozen=True)
class Delay:
    """Delay of the rates behind the attitude, in windows that tell it."""

    time_s: Floats
    """Middle of each window."""
    delay_s: Floats
    error_s: Floats
    """Standard error of each."""
    interval_s: float
    """Time between updates of the slower channel: what is faster than twice of it cannot be compared."""

    @property
    def range_s(self) -> tuple[float, float]:
        """Least and largest delay, one window in twenty left out at each end."""
        low, high = np.percentile(self.delay_s, [5.0, 95.0])
        return float(low), float(high)

    def without_scatter(self) -> "Delay":
        """The median in every window where the delays scatter about it as their errors say; by the median deviation,
        as a window in which hardly anything turns may be far off."""
        middle = float(np.median(self.delay_s))
        scatter = NORMAL_PER_MEDIAN * float(np.median(np.abs(self.delay_s - middle) / self.error_s))
        usual = 1.0 + SIGMA * STD_OF_SCATTER / math.sqrt(len(self.delay_s))
        return self if scatter > usual else replace(self, delay_s=np.full(len(self.delay_s), middle))

    def is_clear(self) -> bool:
        """Tell whether it is there, beyond its error and beyond what matters."""
        low, high = self.range_s
        least = max(NOTABLE_S, self.interval_s)
        if abs(float(np.median(self.delay_s))) < least and high - low < 1.5 * least:
            return False
        chi2 = float(np.sum((self.delay_s / self.error_s) ** 2))
        return chi2 > len(self.delay_s) + SIGMA * math.sqrt(2.0 * len(self.delay_s))

    def drifting(self) -> "Delay | None":
        """The same as a straight line over time; None where it is none, or too flat to matter."""
        if len(self.delay_s) < DRIFT_WINDOWS:
            return None
        slope, at_zero = np.polyfit(self.time_s, self.delay_s, 1)
        line = at_zero + slope * self.time_s
        left = float(np.var(self.delay_s - line)) / max(float(np.var(self.delay_s)), 1e-12)
        if left > 1.0 - STRAIGHT or float(np.ptp(line)) < DRIFTS_S:
            return None
        around_s = np.array([self.time_s[0] - OF_ROTORS.window_s, *self.time_s, self.time_s[-1] + OF_ROTORS.window_s])
        return replace(self, time_s=around_s, delay_s=at_zero + slope * around_s)


def delay_of_rates(log: FlightLog, flights: tuple[Span, ...]) -> Delay | None:
    """Delay of the rates behind the attitude over the flights; None where the log cannot tell."""
    if not all(log.has(name) for name in (*ATTITUDE, *RATES)):
        return None

    def both(grid: Floats) -> tuple[Floats, Floats]:
        return _rates_by_attitude(log, grid, OF_RATES.step_s)[:2], np.array(
            [on_clock(grid, log, name) for name in RATES[:2]]
        )

    return _delay(both, OF_RATES, flights, (log.time_s[log.updates(*ATTITUDE)], log.time_s[log.updates(*RATES)]))


def delay_of_rotors(log: FlightLog, source: str | None, flights: tuple[Span, ...]) -> Delay | None:
    """Delay of the thrust's signal behind the vertical acceleration; None where the log cannot tell."""
    drive = thrust_drive(log, source)
    if drive is None or not all(log.has(name) for name in (*ATTITUDE, VELOCITY[2])):
        return None
    upright = np.cos(np.radians(log["roll_deg"])) * np.cos(np.radians(log["pitch_deg"]))
    known = np.isfinite(drive) & np.isfinite(upright)
    if not known.any():
        return None
    lift = drive[known] * upright[known]

    def both(grid: Floats) -> tuple[Floats, Floats]:
        climb = averaged(on_clock(grid, log, VELOCITY[2]), OF_ROTORS.smoothed_steps)
        return np.gradient(climb, OF_ROTORS.step_s)[None], np.interp(grid, log.time_s[known], lift)[None]

    return _delay(both, OF_ROTORS, flights, (log.time_s[log.updates(VELOCITY[2])], log.time_s[known]))


def rotors_aligned(log: FlightLog, source: str | None, flights: tuple[Span, ...]) -> tuple[FlightLog, list[Finding]]:
    """The log whose thrust is on the clock of its motion, and the finding where the two clocks drift apart."""
    found = delay_of_rotors(log, source, flights)
    delay = None if found is None else found.drifting()
    if delay is None:
        return log, []
    groups = channel_groups(log)
    columns = [name for group in THRUST_SOURCES for name in groups.get(group, ()) if log.has(name)]
    moved = _moved(log, delay, [[name] for name in columns], 1.0)
    return moved, [_told(delay, "thrust", "motion", "thrust")]


def _told(delay: Delay, of: str, behind: str, moved: str) -> Finding:
    least, most = delay.range_s
    return finding(
        Kind.DELAY,
        of=of,
        behind=behind,
        moved=moved,
        least_s=least,
        most_s=most,
        median_s=float(np.median(delay.delay_s)),
        standard_error_s=float(np.median(delay.error_s)),
        windows=len(delay.time_s),
    )


def _delay(
    both: Callable[[Floats], tuple[Floats, Floats]],
    search: Search,
    flights: tuple[Span, ...],
    updates_s: Sequence[Floats],
) -> Delay | None:
    """Delay of the second of `both` behind the first, each a function of the clock with shape (axes, n)."""
    found = [window for flight in flights for window in _windows(both, search, flight)]
    if len(found) < 2:
        return None
    time_s, delay_s, error_s = (np.array(column) for column in zip(*found, strict=True))
    steps = [np.diff(times[within(times, flights)]) for times in updates_s]
    return Delay(time_s, delay_s, error_s, max(float(np.median(own)) for own in steps))


def aligned(log: FlightLog, flights: tuple[Span, ...]) -> tuple[FlightLog, list[Finding]]:
    """The log whose attitude, rates and accelerometer have one clock, and the finding about their delay.

    The motion is the third witness: a vehicle accelerates to where it leans. Where the attitude is early and the rates
    are in time with the motion, it is the attitude that is moved: it may be a setpoint.
    """
    found = delay_of_rates(log, flights)
    delay = None if found is None else found.without_scatter()
    if delay is None or not delay.is_clear():
        return log, []
    groups = [group for group in (RATES, IMU) if all(log.has(name) for name in group)]
    by_rates = _moved(log, delay, groups, 1.0)
    by_attitude = _moved(log, delay, [ATTITUDE], -1.0)
    odd = lag_of_motion(by_attitude, flights).is_nearer_than(lag_of_motion(log, flights))
    of = "imu" if len(groups) == 2 else "rates"
    return by_attitude if odd else by_rates, [_told(delay, of, "attitude", "attitude" if odd else of)]


def _moved(log: FlightLog, delay: Delay, groups: Sequence[Sequence[str]], sign: float) -> FlightLog:
    """The log with the delay, times `sign`, taken out of some channels."""
    by_s = sign * np.interp(log.time_s, delay.time_s, delay.delay_s)
    columns = dict(log.columns)
    for group in groups:
        rows = log.updates(*group)
        # A value that is late by a delay was measured that long before.
        measured_s = np.maximum.accumulate(log.time_s[rows] - by_s[rows])
        for name in group:
            values = log[name][rows]
            own = np.unwrap(values, period=360.0) if name in ATTITUDE else values
            moved = np.full(len(log), np.nan)
            moved[rows] = np.interp(log.time_s[rows], measured_s, own)
            columns[name] = (moved + 180.0) % 360.0 - 180.0 if name in ATTITUDE else moved
    return replace(log, columns=columns)


@dataclass(frozen=True)
class Lag:
    """Lag of the horizontal acceleration behind the lean of the thrust, and its standard error."""

    lag_s: float = 0.0
    std_s: float = math.inf

    def is_nearer_than(self, other: "Lag") -> bool:
        """Tell whether this lag is clearly nearer to none than another one."""
        return abs(other.lag_s) - abs(self.lag_s) > SIGMA * math.hypot(self.std_s, other.std_s)


def lag_of_motion(log: FlightLog, flights: tuple[Span, ...]) -> Lag:
    """Lag of the acceleration behind the lean, by regression on the lean, its slope, and the velocity (drag)."""
    motion = motion_of(log)
    if motion is None:
        return Lag()
    parts = [directions(motion, span) for span in flights if span[1] - span[0] > OF_RATES.window_s]
    if not parts:
        return Lag()
    columns = np.concatenate(
        [np.column_stack([lean, -np.gradient(lean, CLOCK_S), speed, np.ones(len(lean))]) for _, lean, speed in parts]
    )
    acceleration = np.concatenate([part[0] for part in parts])
    inverse = np.linalg.pinv(columns.conj().T @ columns)
    found = inverse @ columns.conj().T @ acceleration
    left = acceleration - columns @ found
    variance = float(np.mean(np.abs(left) ** 2)) * INDEPENDENT_LEAN_S / CLOCK_S
    gain = max(abs(found[0]), 1e-9)
    return Lag(float(np.real(found[1] / found[0])), math.sqrt(variance * float(np.real(inverse[1, 1]))) / gain)


def _windows(
    both: Callable[[Floats], tuple[Floats, Floats]], search: Search, flight: Span
) -> list[tuple[float, float, float]]:
    """Middle, delay and its standard error of each window that tells it."""
    begin, end = flight
    grid = np.arange(begin - search.searched_s, end + search.searched_s, search.step_s)
    if end - begin < search.window_s:
        return []
    expected, found = (_smoothed(values, search.smoothed_steps) for values in both(grid))
    reach, length = round(search.searched_s / search.step_s), round(search.window_s / search.step_s)
    known = within(grid, [flight])
    windows = []
    for first in range(reach, len(grid) - length - reach, round(search.every_s / search.step_s)):
        here = slice(first, first + length)
        if not known[here].all():
            continue
        told = _best(expected, found, here, search)
        if told is not None:
            windows.append((float(grid[first + length // 2]), *told))
    return windows


def _best(expected: Floats, found: Floats, here: slice, search: Search) -> tuple[float, float] | None:
    """Delay of `found` behind `expected`, shape (axes, n), in a part of the clock, and its standard error."""
    reach = round(search.searched_s / search.step_s)
    own = expected[:, here] - expected[:, here].mean(axis=1, keepdims=True)
    shifts = np.arange(-reach, reach + 1)
    others = np.lib.stride_tricks.sliding_window_view(
        found[:, here.start - reach : here.stop + reach], here.stop - here.start, axis=1
    )
    others = others - others.mean(axis=2, keepdims=True)
    # Axes of one window share the delay: their sums of products are added.
    power = np.sqrt((own**2).sum() * (others**2).sum(axis=(0, 2)))
    correlation = (own[:, None, :] * others).sum(axis=(0, 2)) / np.maximum(power, 1e-12)
    best = int(np.argmax(correlation))
    if not 0 < best < len(shifts) - 1 or correlation[best] < LEAST_CORRELATION:
        return None
    before, top, after = correlation[best - 1 : best + 2]
    between = 0.5 * (before - after) / (before - 2.0 * top + after)
    other = others[:, best, :]
    gain = float((own * other).sum() / (own**2).sum())
    error = other - gain * own
    slope = gain * np.gradient(own, search.step_s, axis=1)
    independent = search.window_s / INDEPENDENT_S
    std = math.sqrt(float(np.mean(error**2)) / (float(np.mean(slope**2)) * own.shape[0] * independent) + 1e-12)
    return float((shifts[best] + between) * search.step_s), std


def _rates_by_attitude(log: FlightLog, grid: Floats, step_s: float) -> Floats:
    """Body rates from the attitude's change, rad/s, shape (3, n)."""
    rows = log.updates(*ATTITUDE)
    angles = [np.interp(grid, log.time_s[rows], np.unwrap(np.radians(log[name][rows]))) for name in ATTITUDE]
    slopes = [np.gradient(angle, step_s) for angle in angles]
    return np.array(body_rates(angles[0], angles[1], slopes[0], slopes[1], slopes[2]))


def _smoothed(values: Floats, steps: int) -> Floats:
    """Both signals through one filter: a running mean, twice."""
    width = 2 * steps + 1
    kernel = np.convolve(np.ones(width), np.ones(width)) / width**2
    return np.array([np.convolve(row, kernel, "same") for row in values])
