"""Numbers that only the report needs."""

import numpy as np

from quadctl.errors import LogError
from quadctl.lab.arrays import Floats
from quadctl.lab.comparison.comparison import floor_on
from quadctl.lab.fitting.bootstrap import resampled_means
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.flights.prediction import rmse
from quadctl.lab.report.results import Results


def rmse_interval(residual: Floats, dataset: Dataset) -> tuple[float, float]:
    """95% interval of the total RMSE, from resampled blocks of time."""
    means = resampled_means(np.sum(residual**2, axis=1, keepdims=True), dataset.block)
    low, high = np.percentile(np.sqrt(means), [2.5, 97.5])
    return float(low), float(high)


def lowest_floors(r: Results) -> dict[str, float]:
    """Reference error per axis and total on the flights of the fit, m/s^2: the lowest of all models that were compared,
    as each estimate is an upper bound."""
    models = [r.diagnosis.best] if r.diagnosis is not None and r.diagnosis.missing else []
    models += [r.addition.model] if r.addition is not None else []
    aligned = [(model, r.comparison.dataset.aligned_for(model)) for model in models]
    floors = [r.comparison.noise_floor, *(floor_on(dataset, dataset.residual(model)) for model, dataset in aligned)]
    if r.diagnosis is not None and r.diagnosis.fit is not None:
        floors.append(floor_on(r.diagnosis.fit.dataset, r.diagnosis.fit.held_out_residual[:, :3]))
    lowest = {name: min(floor[name] for floor in floors) for name in r.comparison.noise_floor}
    shown = r.shown.floor_m_s2
    return lowest if shown is None or r.shown.on_unseen else lowest | {"total": shown}


def floor_total(r: Results) -> float:
    """Reference error of all axes on the flights of the fit, m/s^2."""
    return (r.floors or r.comparison.noise_floor)["total"]


def unseen_floor(r: Results) -> float:
    """Reference error of all axes on the flights of `after`, m/s^2."""
    if r.shown.on_unseen and r.shown.floor_m_s2 is not None:
        return r.shown.floor_m_s2
    return min(c.noise_floor["total"] for c in (r.before_unseen, r.after) if c is not None)


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
