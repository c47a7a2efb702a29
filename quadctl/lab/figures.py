"""Figure of each kind of result, registered for `Result.plot`.

matplotlib is loaded when a figure is drawn, not when a result is made.
"""

from typing import TYPE_CHECKING

import numpy as np

from quadctl.lab.comparison.comparison import Comparison
from quadctl.lab.fitting.flexible_regression import flexible_residual, noise_floor
from quadctl.lab.flights.prediction import predict, rmse
from quadctl.lab.planning.suggestion import Suggestion
from quadctl.lab.results import draws
from quadctl.lab.selection.diagnosis import Diagnosis
from quadctl.lab.selection.discovery import Discovery
from quadctl.lab.selection.refit import Refit

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@draws(Comparison)
def draw_comparison(result: Comparison) -> "Figure":
    """Measured against predicted acceleration of the flight with the largest error."""
    from quadctl.lab import plots

    index = result.dataset.flight_index
    errors = [np.mean(result.residual[index == i] ** 2) for i in range(len(result.dataset.flights))]
    flight = result.dataset.flights[int(np.argmax(errors))]
    return plots.acceleration_over_time(flight, flight.measured, {result.model.name: predict(result.model, flight)})


@draws(Diagnosis)
def draw_diagnosis(result: Diagnosis) -> "Figure":
    """Held-out improvement by each candidate."""
    from quadctl.lab import plots

    residual = result.dataset.aligned_for(result.model).residual(result.model)
    floor = rmse(noise_floor(residual, flexible_residual(residual, result.dataset)))
    return plots.ranking(result, floor["total"])


@draws(Refit)
def draw_refit(result: Refit) -> "Figure":
    """Held-out errors before and after."""
    from quadctl.lab import plots

    return plots.before_after(result.before, result.after, None)


@draws(Discovery)
def draw_discovery(result: Discovery) -> "Figure":
    """Held-out error after each selection step."""
    from quadctl.lab import plots

    return plots.model_sequence(result.diagnosis, result.noise_floor["total"])


@draws(Suggestion)
def draw_suggestion(result: Suggestion) -> "Figure":
    """Expected gain of each mission."""
    from quadctl.lab import plots

    return plots.mission_gains(result)
