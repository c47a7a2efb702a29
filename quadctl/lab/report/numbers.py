"""Numbers that only the report needs."""

import numpy as np

from quadctl.errors import LogError
from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.bootstrap import resampled_means
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.flights.prediction import rmse
from quadctl.lab.report.parts import Results


def rmse_interval(residual: Floats, dataset: Dataset) -> tuple[float, float]:
    """95% interval of the total RMSE, from resampled blocks of time."""
    means = resampled_means(np.sum(residual**2, axis=1, keepdims=True), dataset.block)
    low, high = np.percentile(np.sqrt(means), [2.5, 97.5])
    return float(low), float(high)


def unseen_residuals(r: Results) -> tuple[Floats, Floats]:
    """Residuals of the model before and after the change, on the flights of `after`, shape (n, 3) each."""
    if r.after is None:
        raise LogError("no unseen flights are given, expected the comparison of the improved model on some")
    if r.before_unseen is not None:
        return r.before_unseen.residual, r.after.residual
    before = r.comparison.model
    return r.after.dataset.aligned_for(before).residual(before), r.after.residual


def unseen_before(r: Results) -> dict[str, float]:
    return rmse(unseen_residuals(r)[0])


def total(residual: Floats) -> float:
    return float(np.sqrt(np.mean(np.sum(residual**2, axis=1))))
