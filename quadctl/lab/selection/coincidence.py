"""Effects that the record of these flights cannot tell: those that begin at a moment at which something else of the
flight or of the record changes, too, and those of a height that is wrong.

A load or a damage is a step in time, and so is anything that goes with speed or tilt in a flight whose regime changes
once. It is told from these only where the flight was in the same regime before and after, and where the record itself
does not change then.
"""

import numpy as np

from quadctl.effects import Effect
from quadctl.effects.onset import Sudden
from quadctl.lab.arrays import Floats, Mask
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.flights.flight import Flight
from quadctl.logs.findings import Kind, of_kind

NEAR_S = 2.0
"""Time within which a change of the record coincides with a moment."""
LEAST_OVERLAP = 0.25
"""Least share of the time before and after a moment that was flown in the same regime."""
SPEED_M_S, TILT_DEG, BINS = 0.5, 2.0, 8
"""Least width of a range of speeds and of tilts that count as the same, and the number of ranges that the flight's
largest are divided into."""


def is_of_wrong_height(effect: Effect, dataset: Dataset) -> bool:
    """Tell whether an effect goes with a height above the ground that the record shows to be wrong."""
    by_height = "height_over_radius" in effect.depends_on
    return by_height and any(of_kind(flight.findings, Kind.BELOW_REST) for flight in dataset.flights)


def coincides(effect: Effect, dataset: Dataset) -> bool:
    """Tell whether an effect begins where these data cannot tell it from what else changes then."""
    if not isinstance(effect, Sudden):
        return False
    for number, flight in enumerate(dataset.flights, start=1):
        for time_s in effect.moments_of(float(number) if len(dataset.flights) > 1 else 0.0):
            if flight.time_s[0] < time_s < flight.time_s[-1] and _coincides(flight, time_s):
                return True
    return False


def _coincides(flight: Flight, time_s: float) -> bool:
    if any(abs(change - time_s) < NEAR_S for change in flight.changes_s):
        return True
    return overlap(flight, time_s) < LEAST_OVERLAP


def overlap(flight: Flight, time_s: float) -> float:
    """Share of the time before and after a moment that was flown at the same speeds and tilts: the least of the shares
    of each, as a flight that never repeats itself is in few of their combinations twice."""
    v = flight.variables
    regime = (
        (np.hypot(v["speed_forward"], v["speed_right"]), SPEED_M_S),
        (v["climb_rate"], SPEED_M_S),
        (np.hypot(v["roll"], v["pitch"]), TILT_DEG),
    )
    before = flight.time_s < time_s
    return min(_overlap(_ranges(values, least), before) for values, least in regime)


def _overlap(cell: Floats, before: Mask) -> float:
    """Share of the samples before and of the others that lie in the same cells."""
    _, number = np.unique(cell, return_inverse=True)
    shares = [np.bincount(number[part], minlength=int(number.max()) + 1) for part in (before, ~before)]
    return float(np.minimum(*(count / max(count.sum(), 1) for count in shares)).sum())


def _ranges(values: Floats, least: float) -> Floats:
    """Number of the range that each value lies in."""
    low, high = np.percentile(values, [1.0, 99.0])
    return np.floor(values / max(least, float(high - low) / BINS))
