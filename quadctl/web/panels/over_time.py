"""One flight over time: phases, acceleration, residual, height, speed, rotors, voltage; and its path."""

from dataclasses import dataclass

from nicegui import ui

from quadctl.lab.arrays import Mask
from quadctl.lab.comparison.wording import listed, percent
from quadctl.lab.flights.flight import VARIABLE_NAMES, VARIABLE_UNITS, Flight
from quadctl.lab.flights.prediction import AXES
from quadctl.logs.flight_log import FlightLog
from quadctl.model import Model
from quadctl.web.elements.html import empty, heading, plot, tag
from quadctl.web.elements.theme import Theme
from quadctl.web.figures.path import path_figure
from quadctl.web.figures.timeline import full_timeline
from quadctl.web.panels.panel import Controls, Panel, Tab
from quadctl.web.panels.view import Brush
from quadctl.web.panels.zoomed import zoomed_plot
from quadctl.web.work.predictions import predictions


@dataclass(frozen=True)
class OverTime(Panel):
    """All channels of the chosen flight over time, and its path, with the selected samples marked."""

    flight: Flight | None
    flight_names: tuple[str, ...]
    log: FlightLog | None
    models: dict[str, Model]
    axis: str
    brush: Brush
    theme: Theme

    def draw(self, do: Controls) -> None:
        flight, theme = self.flight, self.theme
        if flight is None:
            empty("timeline", "No flight yet", "Open a flight log to see it over time.")
            return
        brushed = selected(flight, self.brush)
        with tag("section", "card"):
            with tag("div", "line wrap"):
                tag("h2", "title grow", "Measured and predicted acceleration")
                draw_flight_choice(do, flight, self.flight_names)
                ui.toggle(list(AXES), value=self.axis, on_change=lambda e: do.look_at(axis=e.value)).props(
                    'dense no-caps unelevated aria-label="Axis"'
                )
            draw_brush_note(do, self.brush, brushed)
            timeline = full_timeline(flight, self.log, predictions(self.models, flight), self.axis, theme, brushed)
            zoomed_plot(timeline, theme, f"{flight.name}_{self.axis}", "Flight over time")
            tag("p", "muted", "Drag to zoom, double-click to see all. The cursor is the same in all panes.")
        with tag("section", "card"):
            heading("The flight path")
            plot(path_figure(flight, brushed, theme), f"{flight.name}_path", "Flight path")


def draw_flight_choice(do: Controls, flight: Flight, names: tuple[str, ...]) -> None:
    if len(names) > 1:
        select = ui.select(list(names), value=flight.name, label="Flight")
        select.props("dense outlined options-dense").on_value_change(lambda e: do.look_at(flight=e.value))


def selected(flight: Flight, brush: Brush) -> Mask | None:
    """Samples of `flight` inside all ranges of `brush`, shape (n,); None where nothing is selected."""
    inside: Mask | None = None
    for name, (low, high) in brush.items():
        within = (flight.variables[name] >= low) & (flight.variables[name] <= high)
        inside = within if inside is None else inside & within
    return inside


def draw_brush_note(do: Controls, brush: Brush, brushed: Mask | None) -> None:
    """Draw the selected ranges in words, with a button that clears them."""
    if brushed is None:
        return
    ranges = [f"{VARIABLE_NAMES[n]} {a:.3g} to {b:.3g} {VARIABLE_UNITS[n]}" for n, (a, b) in brush.items()]
    with tag("div", "line brush"):
        tag("span", "brush-mark")
        tag("span", "grow", f"Selected: {listed(ranges)}, {percent(float(brushed.mean()))} of this flight")
        ui.button("Clear", on_click=do.clear_brush).props("flat dense no-caps")


TAB = Tab("time", "Over time", "timeline", (OverTime,))
