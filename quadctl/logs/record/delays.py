"""Delays between the sources of a log, found where two channels say the same: body rates, and the attitude's change.

A motion capture and an onboard logger have clocks and links of their own, so that the delay between their channels may
change within a flight. The gyro and the accelerometer come together: what is found by the rates holds for both.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from quadctl.frames import body_rates
from quadctl.logs.findings import Finding, Kind, Span, finding
from quadctl.logs.flight_log import ATTITUDE, IMU, RATES, FlightLog, Floats
from quadctl.logs.record.flight_time import within

WINDOW_S, EVERY_S = 4.0, 2.0
"""Length of the windows in which a delay is estimated, and the time between them."""
STEP_S, SMOOTHED_STEPS = 0.005, 6
"""Step of the clock on which the rates are compared, and half the width of the filter of both."""
SEARCHED_S = 0.25
"""Largest delay that is looked for."""
LEAST_CORRELATION = 0.8
"""Correlation at the best delay below which a window tells nothing."""
INDEPENDENT_S = 0.1
"""Time after which the difference of the rates is independent."""
NOTABLE_S = 0.01
"""Range of a delay that is told and corrected: faster motion than a quarter of its inverse is not analysed."""
SIGMA = 4.0
"""Standard errors by which the delays must differ, or the delay from zero."""


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

    def is_clear(self) -> bool:
        """Tell whether it is there, beyond its error and beyond what matters."""
        low, high = self.range_s
        least = max(NOTABLE_S, self.interval_s)
        if abs(float(np.median(self.delay_s))) < least and high - low < 1.5 * least:
            return False
        chi2 = float(np.sum((self.delay_s / self.error_s) ** 2))
        return chi2 > len(self.delay_s) + SIGMA * math.sqrt(2.0 * len(self.delay_s))


def delay_of_rates(log: FlightLog, flights: tuple[Span, ...]) -> Delay | None:
    """Delay of the rates behind the attitude over the flights; None where the log cannot tell."""
    if not all(log.has(name) for name in (*ATTITUDE, *RATES)):
        return None
    found = [window for flight in flights for window in _windows(log, flight)]
    if len(found) < 2:
        return None
    time_s, delay_s, error_s = (np.array(column) for column in zip(*found, strict=True))
    inside = [log.time_s[rows] for rows in (log.updates(*ATTITUDE), log.updates(*RATES))]
    steps = [np.diff(times[within(times, flights)]) for times in inside]
    return Delay(time_s, delay_s, error_s, max(float(np.median(own)) for own in steps))


def aligned(log: FlightLog, flights: tuple[Span, ...]) -> tuple[FlightLog, list[Finding]]:
    """The log whose rates and accelerometer are on the clock of its attitude, and the finding about their delay."""
    delay = delay_of_rates(log, flights)
    if delay is None or not delay.is_clear():
        return log, []
    at = np.interp(log.time_s, delay.time_s, delay.delay_s)
    columns = dict(log.columns)
    groups = [group for group in (RATES, IMU) if all(log.has(name) for name in group)]
    for group in groups:
        rows = log.updates(*group)
        # A value that is late by a delay was measured that long before.
        measured_s = np.maximum.accumulate(log.time_s[rows] - at[rows])
        for name in group:
            moved = np.full(len(log), np.nan)
            moved[rows] = np.interp(log.time_s[rows], measured_s, log[name][rows])
            columns[name] = moved
    least, most = delay.range_s
    told = finding(
        Kind.DELAY,
        of="imu" if len(groups) == 2 else "rates",
        behind="attitude",
        least_s=least,
        most_s=most,
        median_s=float(np.median(delay.delay_s)),
        standard_error_s=float(np.median(delay.error_s)),
        windows=len(delay.time_s),
    )
    return replace(log, columns=columns), [told]


def _windows(log: FlightLog, flight: Span) -> list[tuple[float, float, float]]:
    """Middle, delay and its standard error of each window that tells it."""
    begin, end = flight
    grid = np.arange(begin - SEARCHED_S, end + SEARCHED_S, STEP_S)
    if end - begin < WINDOW_S:
        return []
    by_attitude = _smoothed(_rates_by_attitude(log, grid))
    by_gyro = _smoothed(np.array([_on(log, name, grid) for name in RATES]))
    reach, length = round(SEARCHED_S / STEP_S), round(WINDOW_S / STEP_S)
    known = within(grid, [flight])
    found = []
    for first in range(reach, len(grid) - length - reach, round(EVERY_S / STEP_S)):
        here = slice(first, first + length)
        if not known[here].all():
            continue
        told = _best(by_attitude[:2], by_gyro[:2], here, reach)
        if told is not None:
            found.append((float(grid[first + length // 2]), *told))
    return found


def _best(expected: Floats, found: Floats, here: slice, reach: int) -> tuple[float, float] | None:
    """Delay of `found` behind `expected`, shape (axes, n), in a part of the clock, and its standard error."""
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
    slope = gain * np.gradient(own, STEP_S, axis=1)
    independent = WINDOW_S / INDEPENDENT_S
    std = math.sqrt(float(np.mean(error**2)) / (float(np.mean(slope**2)) * own.shape[0] * independent) + 1e-12)
    return float((shifts[best] + between) * STEP_S), std


def _rates_by_attitude(log: FlightLog, grid: Floats) -> Floats:
    """Body rates from the attitude's change, rad/s, shape (3, n)."""
    rows = log.updates(*ATTITUDE)
    angles = [np.interp(grid, log.time_s[rows], np.unwrap(np.radians(log[name][rows]))) for name in ATTITUDE]
    slopes = [np.gradient(angle, STEP_S) for angle in angles]
    return np.array(body_rates(angles[0], angles[1], slopes[0], slopes[1], slopes[2]))


def _on(log: FlightLog, name: str, grid: Floats) -> Floats:
    rows = log.updates(name)
    return np.interp(grid, log.time_s[rows], log[name][rows])


def _smoothed(values: Floats) -> Floats:
    """Both signals through one filter: a mean over three updates of a usual log, twice."""
    width = 2 * SMOOTHED_STEPS + 1
    kernel = np.convolve(np.ones(width), np.ones(width)) / width**2
    return np.array([np.convolve(row, kernel, "same") for row in values])
