"""Onset: the moment of a flight from which an effect acts, and the moments at which a fit looks for it."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from quadctl.effects.base import Conditions
from quadctl.numeric import Number, step

MARGIN_S = 5.0
COARSE_S, FINE_S = 4.0, 0.5
"""Distance of the moments that a fit may start from: first all over the flights, then about the best of them. A step
explains little less of another one that is a few seconds off."""


def since(time_s: float, flight: float, c: Conditions) -> Number:
    """1 from `time_s` of the log on, else 0, in the flight with this number; 0 in the others. Flight 0 is every one."""
    return step(c.time_s - time_s) if flight in (0.0, c.flight) else 0.0


def onsets(flights: Sequence[Conditions]) -> list[tuple[float, float]]:
    """Moments all over the flights: time of the log, s, and number of the flight. None is near the ends of a flight,
    where an effect would look like one that lasts, or like none; nor in a gap of the data."""
    return [(float(t), float(c.flight)) for c in flights for t in _searched(c)[:: _samples(COARSE_S, c)]]


def onsets_near(time_s: float, flight: float, flights: Sequence[Conditions]) -> list[float]:
    """Times of the log, s, about one of `onsets`, in the flights with its number."""
    found: list[float] = []
    for c in flights:
        if c.flight == flight:
            times, every, reach = _searched(c), _samples(FINE_S, c), _samples(COARSE_S, c)
            middle = int(np.searchsorted(times, time_s))
            near = np.arange(middle - reach + every, middle + reach, every)
            found += [float(t) for t in times[near[(near >= 0) & (near < len(times))]] if t != time_s]
    return found


def _searched(c: Conditions) -> NDArray[np.float64]:
    """Moments of one flight, s, that are looked at: those of its data, but for the ends."""
    times = np.asarray(c.time_s)
    margin = _samples(MARGIN_S, c)
    return times[margin : len(times) - margin - 1]


def _samples(seconds: float, c: Conditions) -> int:
    """Number of moments of the data within some seconds, at least 1."""
    return max(1, round(seconds / float(np.median(np.diff(c.time_s)))))
