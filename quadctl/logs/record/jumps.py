"""Jumps of the estimated state: a value that leaves and comes back is wrong, one that stays is a reset.

A position changes as its velocity says, a heading as the yaw rate says, and a velocity no faster than a multirotor can
accelerate. What changes otherwise between two updates, by far more than is usual in the log, has jumped.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from quadctl.logs.findings import Finding, Kind, finding
from quadctl.logs.flight_log import POSITION, RATES, VELOCITY, FlightLog, Floats
from quadctl.logs.kinematics import integral

LONGEST_GAP_S = 1.0
"""Time between updates over which a value may change by more than its slope says."""
LONGEST_SPIKE_S = 5.0
"""A value that comes back after a longer time was not a spike: the state was reset twice."""
SIGMA = 10.0
"""A change counts as a jump from so many robust standard deviations of the usual one."""
RETURNS = 0.3
"""Largest part of a jump that a spike leaves behind."""


@dataclass(frozen=True)
class _Quantity:
    name: str
    """Name in findings, as readers name what an estimator resets."""
    columns: tuple[str, ...]
    least: float
    """Least jump, in the unit of the columns."""
    slopes: tuple[str, ...] = ()
    """Columns that say how each of them changes."""
    slope_factor: float = 1.0
    wraps: float | None = None
    """Value at which an angle begins anew."""


QUANTITIES = (
    _Quantity("velocity", VELOCITY, 3.0),
    _Quantity("horizontal position", POSITION[:2], 0.5, VELOCITY[:2]),
    _Quantity("height", POSITION[2:], 0.5, VELOCITY[2:]),
    _Quantity("heading", ("yaw_deg",), 5.0, RATES[2:], np.degrees(1.0), 360.0),
)


@dataclass(frozen=True)
class Jump:
    """Change of a quantity that nothing explains."""

    quantity: str
    time_s: float
    """Time of the first value after it."""
    by: tuple[float, ...]
    """Size, for each of the quantity's columns."""


def without_spikes(log: FlightLog) -> tuple[FlightLog, list[Finding], list[Jump]]:
    """The log without values that jump away and back, findings about these, and the jumps that stay."""
    findings, steps = [], []
    for quantity in QUANTITIES:
        if not all(log.has(name) for name in (*quantity.columns, *quantity.slopes)):
            continue
        spikes, stays = _jumps(log, quantity)
        steps += stays
        if not spikes:
            continue
        wrong = np.zeros(len(log), dtype=bool)
        for begin, end, _ in spikes:
            wrong |= (log.time_s >= begin) & (log.time_s < end)
        largest = max(spikes, key=lambda spike: max(map(abs, spike[2])))
        cleaned = {name: np.where(wrong, np.nan, log[name]) for name in quantity.columns}
        log = replace(log, columns={**log.columns, **cleaned})
        findings.append(
            finding(
                Kind.SPIKE,
                [(begin, end) for begin, end, _ in spikes],
                of=quantity.name,
                largest=max(largest[2], key=abs),
                unit="m/s" if quantity.name == "velocity" else "deg" if quantity.wraps else "m",
            )
        )
    return log, findings, steps


def _jumps(log: FlightLog, quantity: _Quantity) -> tuple[list[tuple[float, float, tuple[float, ...]]], list[Jump]]:
    """Spikes, as begin, end and size, and jumps that stay."""
    rows = log.updates(*quantity.columns)
    if len(rows) < 3:
        return [], []
    time_s = log.time_s[rows]
    extra = np.array([_unexplained(log, quantity, i, rows) for i in range(len(quantity.columns))])
    scale = 1.4826 * np.median(np.abs(extra), axis=1, keepdims=True)
    limit = np.maximum(quantity.least, SIGMA * scale)
    places = np.flatnonzero(np.any(np.abs(extra) > limit, axis=0))
    spikes: list[tuple[float, float, tuple[float, ...]]] = []
    stays: list[Jump] = []
    i = 0
    while i < len(places):
        back = _return(extra, time_s, places, i)
        here = places[i]
        size = tuple(float(v) for v in extra[:, here])
        if back is None:
            stays.append(Jump(quantity.name, float(time_s[here + 1]), size))
            i += 1
        else:
            spikes.append((float(time_s[here + 1]), float(time_s[places[back] + 1]), size))
            i = back + 1
    return spikes, stays


def _return(extra: Floats, time_s: Floats, places: NDArray[np.intp], first: int) -> int | None:
    """Index among the jumps of the one that takes the jump `first` back; None where it stays."""
    begin = int(places[first])
    gone = extra[:, begin].copy()
    size = float(np.max(np.abs(gone)))
    for later in range(first + 1, len(places)):
        place = int(places[later])
        if time_s[place + 1] - time_s[begin + 1] > LONGEST_SPIKE_S:
            return None
        gone = gone + extra[:, place]
        if float(np.max(np.abs(gone))) < RETURNS * size:
            return later
    return None


def _unexplained(log: FlightLog, quantity: _Quantity, column: int, rows: NDArray[np.intp]) -> Floats:
    """Change of one column from update to update, less what its slope explains, shape (updates - 1,).

    Over gaps, and where the slope is not known, nothing is said.
    """
    long = np.diff(log.time_s[rows]) > LONGEST_GAP_S
    change = np.diff(log[quantity.columns[column]][rows])
    if quantity.wraps is not None:
        change = (change + 0.5 * quantity.wraps) % quantity.wraps - 0.5 * quantity.wraps
    if not quantity.slopes:
        return np.where(long, 0.0, change)
    known = np.isfinite(log[quantity.slopes[column]])
    unknown = np.diff(np.concatenate([[0], np.cumsum(~known)])[rows]) > 0
    slope = quantity.slope_factor * np.nan_to_num(log[quantity.slopes[column]])
    return np.where(long | unknown, 0.0, change - np.diff(integral(log.time_s, slope)[rows]))
