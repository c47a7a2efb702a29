"""The first figure that a person sees: measured and predicted acceleration of a flight, with its errors."""

from dataclasses import dataclass

import numpy as np

from quadctl.lab.comparison.wording import (
    quantity,
    sentence,
)
from quadctl.lab.evaluation import Evaluation
from quadctl.lab.flights.flight import Flight
from quadctl.lab.flights.prediction import AXES, rmse
from quadctl.logs.flight_log import FlightLog
from quadctl.model import Model
from quadctl.web.elements.html import empty, heading, loading, plot, tag
from quadctl.web.elements.theme import Theme
from quadctl.web.figures.channels import channel_timeline
from quadctl.web.figures.timeline import short_timeline
from quadctl.web.panels.glossary import explained
from quadctl.web.panels.panel import Controls, Panel
from quadctl.web.panels.stack import kind_of
from quadctl.web.panels.words import Said
from quadctl.web.panels.zoomed import zoomed_plot
from quadctl.web.work.predictions import predictions
from quadctl.words import Fact, fact

AS_LOGGED = ("z_m", "z_ref_m", "vx_m_s", "vy_m_s", "vz_m_s")
BIAS_SEEN = 1.1
"""Least ratio of the error of a line as it is drawn to that without per-flight bias at which it is said."""


@dataclass(frozen=True)
class Overview(Panel):
    """Measured and predicted acceleration: the first figure that a person sees."""

    flight: Flight | None
    reading: bool
    as_read: tuple[FlightLog, ...]
    models: dict[str, Model]
    axis: str
    theme: Theme

    def draw(self, do: Controls) -> None:
        flight = self.flight
        if flight is None and self.reading and self.as_read:
            first = self.as_read[0]
            with tag("section", "card"):
                heading(f"{first.name}, as it was logged", "It is being prepared: a prediction follows.")
                timeline = channel_timeline(self.as_read[:1], AS_LOGGED, self.theme)
                plot(timeline.figure(self.theme), "as_logged", "Height and velocity as logged")
        elif flight is None and self.reading:
            loading("Reading the flights")
        elif flight is None:
            empty("insights", "No flight yet", "Open a flight log to see where your model is wrong.")
        else:
            with tag("section", "card"):
                heading(f"{flight.name}: measured and predicted acceleration")
                do.nest(ErrorsByAxis)
                timeline = short_timeline(flight, predictions(self.models, flight), self.axis, self.theme)
                label = "Measured and predicted acceleration over time"
                zoomed_plot(timeline, self.theme, "measured_and_predicted", label)


@dataclass(frozen=True)
class ErrorsByAxis(Panel):
    """Errors in the flight that is shown, of all axes and of the one that is shown; a panel of its own, so that the
    figure below stays."""

    evaluation: Evaluation | None
    flight: Flight | None
    model: Model | None
    axis: str

    def draw(self, do: Controls) -> None:
        if self.evaluation is None or self.flight is None or self.flight.name not in self.evaluation.by_flight:
            return
        errors = self.evaluation.by_flight[self.flight.name]
        worst = max(AXES, key=errors.__getitem__)
        where = "Error" if len(self.evaluation.by_flight) == 1 else "Error in this flight"
        plotted = f"of the axis that is plotted, {self.axis}: {quantity(errors[self.axis])}"
        shown = f"{where}, all axes: {quantity(errors['total'])}; {plotted}"
        largest = f". It is largest {worst}: {quantity(errors[worst])}"
        kind = sentence(str(kind_of(self.evaluation)))
        with tag("p", "muted"):
            at_worst = ", the axis with the largest error"
            drawn = [] if self.model is None else as_drawn(errors[self.axis], self.model, self.flight, self.axis)
            quiet = beside_the_motion(errors[self.axis], self.flight, self.axis)
            first = f"{shown}{at_worst if self.axis == worst else largest}. {kind}."
            explained(" ".join([first, *map(str, (*drawn, *quiet))]))


def as_drawn(error_m_s2: float, model: Model, flight: Flight, axis: str) -> list[Fact]:
    """The error of a line that is farther from the measured one than the error says, which leaves per-flight biases
    out; none where it is not."""
    off = rmse(flight.measured - predictions({"": model}, flight)[""])[axis]
    return [] if off < BIAS_SEEN * error_m_s2 else [fact(Said.DRAWN_WITHOUT_BIAS, off_m_s2=off, axis=axis)]


def beside_the_motion(error_m_s2: float, flight: Flight, axis: str) -> list[Fact]:
    """The motion of a flight that accelerates less along an axis than the model is wrong by; none where it does not."""
    moves = float(np.sqrt(np.mean(flight.measured[:, AXES.index(axis)] ** 2)))
    return [] if error_m_s2 <= moves else [fact(Said.NO_ACCELERATION_IS_CLOSER, moves_m_s2=moves, axis=axis)]
