"""Fits of regressions to records of rotation: bounds of their noise, and means over blocks with their intervals."""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.stats import t as student

from quadctl.lab.arrays import Floats
from quadctl.lab.rotation.innovations import (
    BLOCK_S,
    Estimated,
    Regression,
    estimate,
)
from quadctl.lab.rotation.records import Record

SHARED = (0.5, 0.1, 0.0, 0.98)
"""Start, scale and bounds of the share of its noise that a sample of an integrated sensor has from the sample before,
over its own: by a trapezoid between two samples it is 1, where what began is never forgotten."""
SETTLED_S = 1.5
"""Time until the filter's start is forgotten."""
LOW_NOISE, HIGH_NOISE = np.array([-5.0, -1.5, -7.0, -9.0]), np.array([-1.5, 3.0, 3.0, 5.0])
"""Bounds of the noise's logarithms: the quick disturbance is quicker than the slow one."""


def estimated(
    records: Sequence[Record],
    regress: Callable[[Floats], Sequence[Regression]],
    names: list[str],
    linear: list[str],
    start: Floats,
    scale: Floats,
    low: Floats,
    high: Floats,
) -> Estimated:
    """The fit of `regress`, with a parameter more at its end where an integrated sensor's neighbours share noise."""
    if any(r.integrated for r in records):
        names = [*names, "shared"]
        pairs = zip((start, scale, low, high), SHARED, strict=True)
        start, scale, low, high = (np.append(array, more) for array, more in pairs)
    rows = round(BLOCK_S / min(r.measured_s for r in records))
    return estimate(regress, start, (low, high), scale, names, linear, rows)


def means(signal: Floats, rows: int) -> Floats:
    """Means of `rows` samples each."""
    whole = len(signal) // rows * rows
    return np.asarray(signal[:whole].reshape(-1, rows, *signal.shape[1:]).mean(axis=1))


def block_means(records: Sequence[Record], signals: Sequence[Floats]) -> Floats:
    """Means of signals, each of shape (n, q), over blocks of `BLOCK_S`, shape (blocks, q)."""
    pairs = zip(records, signals, strict=True)
    return np.concatenate([means(signal, max(round(BLOCK_S / r.step_s), 1)) for r, signal in pairs])


def half_interval(blocks: Floats) -> Floats:
    """Half of the 95 % interval of the mean of blocks, shape (blocks, q), as if each depended on none but itself."""
    n = len(blocks)
    if n < 2:
        return np.full(blocks.shape[1], np.inf)
    return np.asarray(student.ppf(0.975, n - 1) * blocks.std(axis=0, ddof=1) / np.sqrt(n))
