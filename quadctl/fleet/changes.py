"""Changes of vehicles over their flights: drifts and jumps, with the false discoveries among all tests controlled.

Kendall's tau with the order of the flights (Mann 1945, Econometrica 13) tests for a drift, Student's t before and after
each flight, with one scatter for both, for a jump. One strange flight makes no finding: tau uses ranks, and t gets the
strange flight in its scatter. The p-value of a vehicle's quantity counts both tests, and the number of places at which
it could have jumped.
Benjamini & Hochberg (1995, J. R. Stat. Soc. B 57) control the share
of false ones among all findings.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple

import numpy as np
from scipy import stats
from scipy.special import stdtr, stdtrit

from quadctl.lab.arrays import Floats

LEAST_FLIGHTS = 8
"""Least number of flights of a vehicle for a test: fewer cannot be significant among many tests."""
LEAST_BESIDE = 3
"""Least number of flights before and after a jump."""
FALSE_DISCOVERIES = 0.05
"""Share of the findings that may be false, on average."""


class Change(NamedTuple):
    """A quantity of one vehicle that changed."""

    vehicle: str
    quantity: str
    kind: Literal["drift", "jump"]
    size: float
    """Change over ten flights for a drift; from before to after for a jump."""
    ci95: tuple[float, float]
    since: str
    """First flight after a jump; the first flight of all for a drift."""
    p_value: float
    adjusted: float
    """p-value adjusted for all tests: the smallest share of false discoveries at which this is a finding."""


class Series(NamedTuple):
    """One quantity of one vehicle, flight by flight."""

    vehicle: str
    quantity: str
    flights: tuple[str, ...]
    number: Floats
    """Number of each flight among all of the vehicle, from 0, shape (n,); flights may lack."""
    values: Floats
    """Shape (n,)."""


def find_changes(series: Sequence[Series], false_discoveries: float = FALSE_DISCOVERIES) -> list[Change]:
    """Changes in any of `series`, the surest first; of one vehicle's quantity the surer one of drift and jump."""
    candidates = [_surest(one) for one in series if len(one.values) >= LEAST_FLIGHTS]
    if not candidates:
        return []
    adjusted = stats.false_discovery_control([c.p_value for c in candidates])
    found = [c._replace(adjusted=float(q)) for c, q in zip(candidates, adjusted, strict=True) if q <= false_discoveries]
    return sorted(found, key=lambda change: change.p_value)


def number_of_tests(series: Sequence[Series]) -> int:
    """Number of series that are long enough for a test."""
    return sum(len(one.values) >= LEAST_FLIGHTS for one in series)


def _surest(series: Series) -> Change:
    """Change with the p-value of the surer test; a drift or a jump, whichever leaves the smaller deviations."""
    drift, jump = _drift(series), _jump(series)
    p = min(1.0, 2.0 * min(drift.p_value, jump.p_value))
    return min(drift, jump, key=lambda change: _deviation(series, change))._replace(p_value=p)


def _deviation(series: Series, change: Change) -> float:
    """Mean absolute deviation of the values from a line, or from the medians before and after a jump."""
    if change.kind == "drift":
        along = series.values - change.size / 10.0 * series.number
        return float(np.abs(along - np.median(along)).mean())
    at = series.flights.index(change.since)
    parts = (series.values[:at], series.values[at:])
    return float(np.concatenate([np.abs(part - np.median(part)) for part in parts]).mean())


def _drift(series: Series) -> Change:
    """Drift with its p-value; slope and interval by Theil & Sen."""
    p = float(stats.kendalltau(series.number, series.values).pvalue)
    slope, _, low, high = stats.theilslopes(series.values, series.number)
    ten = (10.0 * float(low), 10.0 * float(high))
    return Change(series.vehicle, series.quantity, "drift", 10.0 * float(slope), ten, series.flights[0], _sure(p), 1.0)


def _jump(series: Series) -> Change:
    """Jump at the likeliest flight; its p-value counts the flights at which it could have been.

    Its interval is Student's, with the same scatter before and after, for a jump at that flight.
    """
    places = range(LEAST_BESIDE, len(series.values) - LEAST_BESIDE + 1)
    p_values = [_sure(_student_p(series.values[:at], series.values[at:])) for at in places]
    best = int(np.argmin(p_values))
    at = places[best]
    before, after = series.values[:at], series.values[at:]
    size = float(after.mean() - before.mean())
    reach = float(stdtrit(len(series.values) - 2, 0.975)) * _standard_error(before, after)
    p = min(1.0, p_values[best] * len(places))
    ci95 = (size - reach, size + reach)
    return Change(series.vehicle, series.quantity, "jump", size, ci95, series.flights[at], p, 1.0)


def _student_p(before: Floats, after: Floats) -> float:
    """Two-sided p-value of Student's test that the means are the same; nan where no value differs."""
    size, free = float(after.mean() - before.mean()), len(before) + len(after) - 2
    error = _standard_error(before, after)
    return float(2.0 * stdtr(free, -abs(size) / error)) if error > 0.0 else float("nan")


def _standard_error(before: Floats, after: Floats) -> float:
    """Standard error of the difference of the means, with one scatter for both."""
    variance = (before.var() * len(before) + after.var() * len(after)) / (len(before) + len(after) - 2)
    return math.sqrt(variance * (1.0 / len(before) + 1.0 / len(after)))


def _sure(p: float) -> float:
    """A test of values that are all alike has no p-value: nothing changes."""
    return 1.0 if np.isnan(p) else p


def by_quantity(series: Sequence[Series]) -> Mapping[str, list[Series]]:
    """The series of each quantity, over all vehicles."""
    found: dict[str, list[Series]] = {}
    for one in series:
        found.setdefault(one.quantity, []).append(one)
    return found
