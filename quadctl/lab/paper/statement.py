"""Statement of a fitted model: every number that a paper needs, with the conditions under which it was computed."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy import special

from quadctl import __version__
from quadctl.lab.arrays import Floats
from quadctl.lab.comparison.wording import held_out
from quadctl.lab.fitting.fitted_model import FittedModel, fit_model
from quadctl.lab.fitting.fitter import BOOTSTRAP_SEED
from quadctl.lab.fitting.parameters import values_of
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.selection.rule import RULE
from quadctl.model import Model

AXES = ("north", "east", "up")
MAX_LAGS = 20
"""Largest number of lags of the portmanteau test."""
SAMPLES_PER_LAG = 5
"""Least number of samples of a flight for each lag."""


@dataclass(frozen=True)
class ParameterRow:
    """A fitted parameter with its 95 % interval."""

    effect: str
    name: str
    value: float
    ci95: tuple[float, float]
    unit: str
    meaning: str


@dataclass(frozen=True)
class Whiteness:
    """Result of the portmanteau test of Ljung & Box (1978, Biometrika 65) on one axis of the residual."""

    statistic: float
    degrees: int
    p_value: float


@dataclass(frozen=True, eq=False)
class Statement:
    """A model fitted to flights, as a paper states it."""

    fit: FittedModel
    parameters: list[ParameterRow]
    correlation: Floats
    """Correlation of the bootstrap draws of the parameters, shape (p, p), in their order."""
    r_squared: dict[str, float]
    """Share of the variance of the held-out acceleration that the model explains, per axis; negative where the mean
    would predict better."""
    rmse: dict[str, float]
    """Held-out RMSE per axis and total, m/s^2."""
    whiteness: dict[str, Whiteness]
    """Per axis; axes of flights that are too short are absent."""
    command: str
    thresholds: dict[str, float]
    """Numbers of the decision rule, by the names of `quadctl.lab.selection.rule.Rule`, in capitals."""

    @property
    def model(self) -> Model:
        return self.fit.model

    @property
    def dataset(self) -> Dataset:
        return self.fit.dataset

    @property
    def hold_out(self) -> str:
        return str(held_out(self.dataset))

    def to_dict(self) -> dict[str, Any]:
        return {
            "model": self.model.name,
            "vehicle": self.model.vehicle.name,
            "effects": [effect.name for effect in self.model.effects],
            "parameters": [
                {
                    "effect": row.effect,
                    "name": row.name,
                    "value": row.value,
                    "ci95": list(row.ci95),
                    "unit": row.unit,
                    "meaning": row.meaning,
                }
                for row in self.parameters
            ],
            "correlation": [[float(value) for value in row] for row in self.correlation],
            "held_out": self.hold_out,
            "unit": "m/s^2",
            "rmse": self.rmse,
            "r_squared": self.r_squared,
            "whiteness": {
                axis: {"test": "Ljung-Box", "statistic": w.statistic, "degrees": w.degrees, "p_value": w.p_value}
                for axis, w in self.whiteness.items()
            },
            "logs": {flight.name: flight.sha256 for flight in self.dataset.flights},
            "version": __version__,
            "command": self.command,
            "seed": BOOTSTRAP_SEED,
            "thresholds": self.thresholds,
        }


def state(model: Model, dataset: Dataset, command: str) -> Statement:
    """Fit all parameters of `model` to the flights, and gather what a paper says of it.

    `command` is the command line that the statement was asked for with.
    """
    fit = fit_model(model, dataset)
    residual = fit.held_out_residual[:, :3]
    measured = dataset.targets[:, :3]
    spread = np.sum((measured - measured.mean(axis=0)) ** 2, axis=0)
    r_squared = 1.0 - np.sum(residual**2, axis=0) / np.maximum(spread, np.finfo(float).tiny)
    return Statement(
        fit=fit,
        parameters=_parameters(fit),
        correlation=_correlation(fit.draws) if fit.free else np.empty((0, 0)),
        r_squared=dict(zip(AXES, map(float, r_squared), strict=True)),
        rmse={name: float(fit.held_out_rmse[name]) for name in (*AXES, "total")},
        whiteness=_whiteness(residual, dataset),
        command=command,
        thresholds={name.upper(): float(value) for name, value in asdict(RULE).items()},
    )


def ljung_box(series: Sequence[Floats]) -> Whiteness | None:
    """Test whether several independent series, each of shape (n,), are white; None where all are too short.

    The statistics of the series are added, as are their degrees of freedom.
    """
    total, degrees = 0.0, 0
    for values in series:
        n, centred = len(values), values - values.mean()
        lags = min(MAX_LAGS, n // SAMPLES_PER_LAG)
        power = float(centred @ centred)
        if lags < 1 or power == 0.0:
            continue
        r = np.array([centred[lag:] @ centred[:-lag] / power for lag in range(1, lags + 1)])
        total += float(n * (n + 2) * np.sum(r**2 / (n - np.arange(1, lags + 1))))
        degrees += lags
    return Whiteness(total, degrees, float(special.chdtrc(degrees, total))) if degrees else None


def _parameters(fit: FittedModel) -> list[ParameterRow]:
    values = values_of(fit.model, fit.free)
    return [
        ParameterRow(
            fit.model.effects[f.effect].name,
            f.parameter.name,
            float(value),
            (float(low), float(high)),
            f.parameter.unit,
            f.parameter.meaning,
        )
        for f, value, (low, high) in zip(fit.free, values, fit.intervals, strict=True)
    ]


def _correlation(draws: Floats) -> Floats:
    """Correlation of the columns, shape (p, p); 0 beside a parameter that stands at a bound in every draw."""
    centred = draws - draws.mean(axis=0)
    size = np.sqrt(np.sum(centred**2, axis=0))
    product = centred.T @ centred / np.maximum(np.outer(size, size), np.finfo(float).tiny)
    np.fill_diagonal(product, 1.0)
    return np.asarray(product)


def _whiteness(residual: Floats, dataset: Dataset) -> dict[str, Whiteness]:
    found = {}
    for column, axis in enumerate(AXES):
        flights = [residual[dataset.flight_index == i, column] for i in range(len(dataset.flights))]
        if (whiteness := ljung_box(flights)) is not None:
            found[axis] = whiteness
    return found
