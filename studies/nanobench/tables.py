"""Tables of rollouts of flights that no fit saw."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from quadctl.lab.arrays import Floats
from studies.page import table

from .rollouts import Judged

QUANTITIES = ("position m", "velocity m/s", "rotation rad", "rates rad/s")


def errors_table(found: dict[str, Judged], horizon: int) -> str:
    """Mean of the flights, with its 95 % interval, of each model."""
    rows = []
    for name, of in found.items():
        values = np.array([e[horizon] for e in of.errors])
        half = 1.96 * values.std(axis=0, ddof=1) / np.sqrt(len(values))
        cells = [f"{m:.3g} ± {h:.1g}" for m, h in zip(values.mean(axis=0), half, strict=True)]
        rows.append([name, *cells])
    return table(["model", *QUANTITIES], rows)


def means(found: dict[str, Judged]) -> dict[str, Floats]:
    """Mean of the flights of each model, each of shape (horizons, 4)."""
    return {name: np.mean(of.errors, axis=0) for name, of in found.items()}


def horizons_table(of_models: Mapping[str, ArrayLike], horizons_s: Sequence[float]) -> str:
    """Errors in `QUANTITIES` after several horizons, of shape (horizons, 4) of each model."""
    rows = [
        [name, *("/".join(f"{m:.3g}" for m in of) for of in np.asarray(values))] for name, values in of_models.items()
    ]
    return table(["model", *(f"after {horizon_s:g} s" for horizon_s in horizons_s)], rows)


def times_table(found: dict[str, Judged]) -> str:
    rows = [
        [name, _two_digits(float(np.mean(of.fit_s))), _two_digits(float(np.mean(of.window_us)))]
        for name, of in found.items()
    ]
    return table(["model", "fit, s", "window, µs"], rows)


def _two_digits(value: float) -> str:
    """Number to two digits; 0 below a hundredth."""
    return f"{float(f'{value:.2g}'):g}" if value >= 0.01 else "0"
