"""The correction that an autopilot makes by itself near the ground: motor outputs over the command, against height.

A firmware that corrects for ground effect gives less output than it is told, the less the nearer the ground. Thrust
taken from the command then looks like an inverse ground effect; thrust taken from the outputs does not.
"""

import itertools
from dataclasses import dataclass

import numpy as np

from quadctl.logs.findings import Finding, Kind, finding
from quadctl.logs.flight_log import FlightLog, Floats

HEIGHTS_M = (0.05, 0.15, 0.25, 0.35, 0.5, 0.7, 0.8)
"""Edges of the ranges of height; above the last one lies the comparison."""
MAX_TILT_DEG = 5.0
MIN_THROTTLE = 0.05
MIN_ROWS = 25
"""Rows in a range below which nothing is said about it."""
NOTABLE, MIN_NOTABLE = 0.015, 2
"""Difference from the output high above the ground that is notable, and number of ranges that must show one."""


@dataclass(frozen=True)
class HeightRange:
    """Motor outputs over the command in one range of height, relative to those above the highest edge."""

    height_m: float
    """Median."""
    ratio: float


def own_correction(log: FlightLog) -> list[HeightRange]:
    """Ranges from the ground up, in level flight; empty where the log cannot tell or the autopilot corrects nothing."""
    outputs = [values for name, values in log.columns.items() if name.endswith("_output")]
    if not outputs or "throttle_cmd" not in log.columns:
        return []
    throttle, height = log["throttle_cmd"], log["z_m"]
    level = np.hypot(log["roll_deg"], log["pitch_deg"]) < MAX_TILT_DEG
    flown = level & (throttle > MIN_THROTTLE) & np.isfinite(height)
    ratio = np.full(len(throttle), np.nan)
    ratio[flown] = np.mean(outputs, axis=0)[flown] / throttle[flown]
    high = ratio[flown & (height > HEIGHTS_M[-1])]
    if np.count_nonzero(np.isfinite(high)) < MIN_ROWS:
        return []
    reference = float(np.nanmedian(high))
    ranges = []
    for low, top in itertools.pairwise(HEIGHTS_M):
        rows = flown & (height > low) & (height <= top) & np.isfinite(ratio)
        if np.count_nonzero(rows) >= MIN_ROWS:
            ranges.append(HeightRange(float(np.median(height[rows])), _median(ratio[rows]) / reference))
    notable = [found for found in ranges if abs(found.ratio - 1.0) > NOTABLE]
    return ranges if len(notable) >= MIN_NOTABLE else []


def correction_findings(log: FlightLog) -> list[Finding]:
    """Finding about the correction, or none."""
    found = own_correction(log)
    if not found:
        return []
    steps = [[step.height_m, step.ratio] for step in found]
    return [finding(Kind.OWN_CORRECTION, ratio_at_height_m=steps, above_m=HEIGHTS_M[-1])]


def _median(values: Floats) -> float:
    return float(np.median(values))
