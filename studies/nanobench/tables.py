"""Tables of rollouts of flights that no fit saw."""

from collections.abc import Sequence

import numpy as np

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


def horizons_table(found: dict[str, Judged], horizons_s: Sequence[float], told: Sequence[int]) -> str:
    """Mean of the flights at several horizons, of each model."""
    rows = []
    for i in told:
        means = {name: np.mean([e[i] for e in of.errors], axis=0) for name, of in found.items()}
        rows += [[f"{horizons_s[i]:g}", name, *(f"{m:.3g}" for m in mean)] for name, mean in means.items()]
    return table(["after s", "model", *QUANTITIES], rows, texts=(1,))


def times_table(found: dict[str, Judged]) -> str:
    rows = [[name, _two_digits(np.mean(of.fit_s)), _two_digits(np.mean(of.window_us))] for name, of in found.items()]
    return table(["model", "fit, s", "window, µs"], rows)


def _two_digits(value: float) -> str:
    """Number to two digits; 0 below a hundredth."""
    return f"{float(f'{value:.2g}'):g}" if value >= 0.01 else "0"
