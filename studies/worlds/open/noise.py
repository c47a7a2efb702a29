"""Random processes: slow drifts, turbulence and the unsteady hand of a controller."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from studies.worlds.open.vehicles import Array


def drift(rng: np.random.Generator, rows: int, step_s: float, time_s: float, size: float, columns: int = 3) -> Array:
    """Gauss-Markov processes of a standard deviation and a correlation time."""
    keep = np.exp(-step_s / time_s)
    start = rng.normal(0.0, size, (1, columns)) * keep
    white = rng.normal(0.0, size * np.sqrt(1.0 - keep**2), (rows, columns))
    out, _ = lfilter([1.0], [1.0, -keep], white, axis=0, zi=start)
    return np.asarray(out)


def turbulence(rng: np.random.Generator, rows: int, step_s: float, size: float) -> Array:
    """Acceleration by light turbulence: Dryden-like, slow and quick eddies, with a total of the given size."""
    time = rng.uniform(1.5, 4.0)
    slow = drift(rng, rows, step_s, time, 0.8)
    quick = drift(rng, rows, step_s, 0.3 * time, 0.6)
    mixed = (slow + quick) * np.array([1.0, 1.0, 0.7])
    return np.asarray(mixed * size / np.sqrt(2.49))


def low_pass(values: Array, step_s: float, time_s: float) -> Array:
    """First-order lag along the rows, starting settled."""
    share = 1.0 - np.exp(-step_s / time_s)
    out, _ = lfilter([share], [1.0, share - 1.0], values, axis=0, zi=(1.0 - share) * values[:1])
    return np.asarray(out)
