"""Base of the panels that show the chosen flight: its timeline, its path, and the samples that are selected."""

from dataclasses import dataclass

from nicegui import ui

from quadctl.lab.arrays import Mask
from quadctl.lab.comparison.wording import listed, percent
from quadctl.lab.flights.flight import VARIABLE_NAMES, VARIABLE_UNITS, Flight
from quadctl.logs.flight_log import FlightLog
from quadctl.model import Model
from quadctl.web.elements.html import plot, tag
from quadctl.web.elements.theme import Theme
from quadctl.web.figures.path import path_figure
from quadctl.web.figures.timeline import full_timeline, gaps_in
from quadctl.web.panels.choices import Brush
from quadctl.web.panels.panel import Controls, Panel
from quadctl.web.panels.zoomed import zoomed_plot
from quadctl.web.work.predictions import predictions


@dataclass(frozen=True)
class ChosenFlightPanel(Panel):
    """Base of a panel about the chosen flight; `draw` of the subclass says which parts it shows."""

    flight: Flight | None
    flight_names: tuple[str, ...]
    log: FlightLog | None
    models: dict[str, Model]
    axis: str
    brush: Brush
    theme: Theme

    def draw_flight_choice(self, do: Controls, flight: Flight) -> None:
        """Draw a list to choose another flight, where there is more than one."""
        if len(self.flight_names) > 1:
            select = ui.select(list(self.flight_names), value=flight.name, label="Flight")
            select.props("dense outlined options-dense").on_value_change(lambda e: do.choose(flight=e.value))

    def draw_brush_note(self, do: Controls, brushed: Mask | None) -> None:
        """Draw the selected ranges in words, with a button that clears them."""
        if brushed is None:
            return
        ranges = [f"{VARIABLE_NAMES[n]} {a:.3g} to {b:.3g} {VARIABLE_UNITS[n]}" for n, (a, b) in self.brush.items()]
        with tag("div", "line brush"):
            tag("span", "brush-mark")
            tag("span", "grow", f"Selected: {listed(ranges)}, {percent(float(brushed.mean()))} of this flight")
            ui.button("Clear", on_click=lambda: do.choose(brush={})).props("flat dense no-caps")

    def draw_timeline(self, flight: Flight, brushed: Mask | None, name: str, label: str) -> ui.plotly:
        """Draw all channels over time, with the prediction of each model; files of the figure are called `name`."""
        predicted = predictions(self.models, flight)
        timeline = full_timeline(flight, self.log, predicted, self.axis, self.theme, brushed)
        shown = zoomed_plot(timeline, self.theme, name, label)
        if len(gaps_in(flight.time_s)):
            tag(
                "p",
                "muted",
                "Lines are broken where the analysis leaves samples out: on the ground, at take-off and "
                "landing, and where the log has gaps.",
            )
        return shown

    def draw_path(self, flight: Flight, brushed: Mask | None) -> None:
        plot(path_figure(flight, brushed, self.theme), f"{flight.name}_path", "Flight path")


def selected(flight: Flight, brush: Brush) -> Mask | None:
    """Samples of `flight` inside all ranges of `brush`, shape (n,); None where nothing is selected."""
    inside: Mask | None = None
    for name, (low, high) in brush.items():
        within = (flight.variables[name] >= low) & (flight.variables[name] <= high)
        inside = within if inside is None else inside & within
    return inside
