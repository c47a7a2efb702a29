"""The one figure by which each result of the lab draws itself."""

from functools import singledispatch

import numpy as np
from matplotlib.figure import Figure

from quadctl.lab import plots
from quadctl.lab.comparison.comparison import Comparison
from quadctl.lab.comparison.noise_floor import flexible_residual, noise_floor
from quadctl.lab.flights.prediction import predict, rmse
from quadctl.lab.planning.suggestion import Suggestion
from quadctl.lab.results import Result
from quadctl.lab.selection.diagnosis import Diagnosis
from quadctl.lab.selection.discovery import Discovery
from quadctl.lab.selection.refit import Refit


@singledispatch
def drawn(result: Result) -> Figure:
    """The figure that says most of `result`."""
    raise TypeError(f"{type(result).__name__} has no figure")


@drawn.register
def _(result: Comparison) -> Figure:
    """Measured against predicted acceleration of the flight with the largest error."""
    index = result.dataset.flight_index
    errors = [np.mean(result.residual[index == i] ** 2) for i in range(len(result.dataset.flights))]
    flight = result.dataset.flights[int(np.argmax(errors))]
    return plots.acceleration_over_time(flight, flight.measured, {result.model.name: predict(result.model, flight)})


@drawn.register
def _(result: Diagnosis) -> Figure:
    """The ranking."""
    residual = result.dataset.aligned_for(result.model).residual(result.model)
    floor = rmse(noise_floor(residual, flexible_residual(residual, result.dataset)))
    return plots.ranking(result, floor["total"])


@drawn.register
def _(result: Refit) -> Figure:
    """Held-out errors before and after."""
    return plots.before_after(result.before, result.after, None)


@drawn.register
def _(result: Discovery) -> Figure:
    """The ladder of held-out errors."""
    return plots.ladder(result.diagnosis, result.before.noise_floor["total"])


@drawn.register
def _(result: Suggestion) -> Figure:
    """What each mission would tell."""
    return plots.mission_gains(result)
