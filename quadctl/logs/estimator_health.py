"""Findings of an estimator: sensors that it rejected, a GPS that was lost, and the core that flew.

Both firmwares log test ratios of their sensors' innovations: above 1 a measurement is not used, and the state runs on
the accelerometer alone.
"""

from collections.abc import Mapping

import numpy as np

from quadctl.logs.findings import Finding, Kind, finding
from quadctl.logs.flight_log import Floats
from quadctl.logs.merge import intervals

REJECTED_S = 1.0
"""Least time for which a sensor is rejected that counts: single outliers are what the test is for."""
MIN_FIX = 3
"""Least kind of a GPS fix that gives a position: three dimensions, in both firmwares' numbers."""


def rejections(time_s: Floats, ratios: Mapping[str, Floats]) -> list[Finding]:
    """Findings on measurements that were rejected for long, by the test ratio of each, shape (n,)."""
    found = []
    for name, ratio in ratios.items():
        spans = [span for span in intervals(time_s, ratio > 1.0) if span[1] - span[0] >= REJECTED_S]
        if spans:
            found.append(finding(Kind.REJECTED, spans, of=name))
    return found


def lost_fixes(time_s: Floats, fix: Floats) -> list[Finding]:
    """Finding on the times without a fix of a GPS that had one before."""
    had = np.flatnonzero(fix >= MIN_FIX)
    if not len(had):
        return []
    spans = intervals(time_s[had[0] :], fix[had[0] :] < MIN_FIX)
    spans = [span for span in spans if span[1] - span[0] >= REJECTED_S]
    return [finding(Kind.GPS_LOST, spans)] if spans else []


def lane_switches(time_s: Floats, primary: Floats) -> list[Finding]:
    """Finding on the changes of the estimator's primary core."""
    changed = time_s[1:][np.diff(primary) != 0.0]
    return [finding(Kind.LANE_SWITCH, [(float(at), float(at)) for at in changed])] if len(changed) else []
