"""The correction that an autopilot makes by itself near the ground: motor outputs over the command, against height.

A firmware that corrects for ground effect gives less output than it is told, the less the nearer the ground. Thrust
taken from the command then looks like an inverse ground effect; thrust taken from the outputs does not.
"""

import itertools
from dataclasses import dataclass

import numpy as np

from quadctl.logs.findings import Finding, Kind, finding
from quadctl.logs.flight_log import ATTITUDE, FlightLog, Floats

HEIGHTS_M = (0.05, 0.15, 0.25, 0.35, 0.5, 0.7, 0.8)
"""Edges of the ranges of height; above the last one lies the comparison."""
MAX_TILT_DEG = 5.0
MIN_THROTTLE = 0.05
MIN_ROWS = 25
"""Rows in a range below which nothing is said about it."""
NOTABLE, MIN_NOTABLE = 0.015, 2
"""Difference from the output high above the ground that is notable, and number of ranges that must show one."""
SIGMA = 3.0
"""Standard errors by which a range must differ to be notable, and by which heights may disagree about the fall of a
correction."""
INDEPENDENT_S = 1.0
"""Time after which ratios are independent."""


@dataclass(frozen=True)
class HeightRange:
    """Motor outputs over the command in one range of height, relative to those above the highest edge."""

    height_m: float
    """Median."""
    ratio: float
    error: float
    """Standard error of the ratio."""


def own_correction(log: FlightLog) -> list[HeightRange]:
    """Ranges from the ground up, in level flight; empty where the log cannot tell or the autopilot corrects nothing.

    A correction has one sign and fades with height; what scatters to both sides, or grows with height, is noise.
    """
    outputs = [values for name, values in log.columns.items() if name.endswith("_output")]
    needed = ("throttle_cmd", "z_m", *ATTITUDE[:2])
    if not outputs or not all(log.has(name) for name in needed):
        return []
    throttle, height = log["throttle_cmd"], log["z_m"]
    level = np.hypot(log["roll_deg"], log["pitch_deg"]) < MAX_TILT_DEG
    flown = level & (throttle > MIN_THROTTLE) & np.isfinite(height)
    ratio = np.full(len(throttle), np.nan)
    ratio[flown] = np.mean(outputs, axis=0)[flown] / throttle[flown]
    high = flown & (height > HEIGHTS_M[-1]) & np.isfinite(ratio)
    if np.count_nonzero(high) < MIN_ROWS:
        return []
    reference, reference_error = _median(log.time_s[high], ratio[high])
    ranges = []
    for low, top in itertools.pairwise(HEIGHTS_M):
        rows = flown & (height > low) & (height <= top) & np.isfinite(ratio)
        if np.count_nonzero(rows) >= MIN_ROWS:
            middle, error = _median(log.time_s[rows], ratio[rows])
            error = float(np.hypot(error, reference_error)) / reference
            ranges.append(HeightRange(float(np.median(height[rows])), middle / reference, error))
    return ranges if _fades(ranges) else []


def _fades(ranges: list[HeightRange]) -> bool:
    """Tell whether the ratios are off by more than chance, all to one side, and less so the higher."""
    notable = [found for found in ranges if abs(found.ratio - 1.0) > max(NOTABLE, SIGMA * found.error)]
    if len(notable) < MIN_NOTABLE:
        return False
    side = np.sign(notable[0].ratio - 1.0)
    one_sided = all(side * (found.ratio - 1.0) > -SIGMA * found.error for found in ranges)
    falls = all(
        side * (upper.ratio - lower.ratio) < SIGMA * np.hypot(upper.error, lower.error)
        for lower, upper in itertools.pairwise(ranges)
    )
    first, last = ranges[0], ranges[-1]
    return one_sided and falls and side * (first.ratio - last.ratio) > SIGMA * np.hypot(first.error, last.error)


def correction_findings(log: FlightLog) -> list[Finding]:
    """Finding about the correction, or none."""
    found = own_correction(log)
    if not found:
        return []
    steps = [[step.height_m, step.ratio, step.error] for step in found]
    return [finding(Kind.OWN_CORRECTION, ratio_at_height_m=steps, above_m=HEIGHTS_M[-1])]


def _median(time_s: Floats, values: Floats) -> tuple[float, float]:
    """Median, and its standard error by the spread of the means over stretches of `INDEPENDENT_S`."""
    stretch = np.unique(np.floor(time_s / INDEPENDENT_S), return_inverse=True)[1]
    means = np.bincount(stretch, values) / np.bincount(stretch)
    spread = float(np.std(means)) if len(means) > 2 else float(np.std(values))
    return float(np.median(values)), 1.25 * spread / max(len(means) - 1, 1) ** 0.5
