"""Long lines reduced to as many points as a screen can show, without losing a peak."""

import numpy as np

from quadctl.lab.arrays import Floats

POINTS = 2400
"""About two for each pixel of the width of a page."""


def downsampled(x: Floats, y: Floats, window: tuple[float, float] | None = None) -> tuple[Floats, Floats]:
    """The part of a line in `window`, and one point to either side, in at most about `POINTS` points.

    `x` rises. Of every stretch of samples its smallest and its largest value are kept, in their order; where a value is
    missing (NaN, a gap) one of them stays, so that the line stays broken.
    """
    if window is not None:
        first, last = np.searchsorted(x, window)
        inside = slice(max(int(first) - 1, 0), int(last) + 1)
        x, y = x[inside], y[inside]
    if len(x) <= POINTS:
        return x, y
    size = -(-len(x) // (POINTS // 2))
    count = len(x) // size
    stretches = y[: count * size].reshape(count, size)
    missing = np.isnan(stretches)
    start = np.arange(count) * size
    lowest = start + np.argmin(np.where(missing, np.inf, stretches), axis=1)
    highest = start + np.argmax(np.where(missing, -np.inf, stretches), axis=1)
    gaps = (start + np.argmax(missing, axis=1))[missing.any(axis=1)]
    kept = np.unique(np.concatenate([lowest, highest, gaps, np.arange(count * size, len(x))]))
    return x[kept], y[kept]
