"""One flight over time: phases, acceleration, residual, height, speed, rotors, voltage; and its path."""

from dataclasses import dataclass

from nicegui import ui

from quadctl.lab.flights.prediction import AXES
from quadctl.web.elements.html import empty, heading, tag
from quadctl.web.panels.chosen_flight import ChosenFlightPanel, selected
from quadctl.web.panels.panel import Controls, Tab


@dataclass(frozen=True)
class OverTime(ChosenFlightPanel):
    """All channels of the chosen flight over time, and its path, with the selected samples marked."""

    def draw(self, do: Controls) -> None:
        flight = self.flight
        if flight is None:
            empty("timeline", "No flight yet", "Open a flight log to see it over time.")
            return
        brushed = selected(flight, self.brush)
        with tag("section", "card"):
            with tag("div", "line wrap"):
                tag("h2", "title grow", "Measured and predicted acceleration")
                self.draw_flight_choice(do, flight)
                ui.toggle(list(AXES), value=self.axis, on_change=lambda e: do.look_at(axis=e.value)).props(
                    'dense no-caps unelevated aria-label="Axis"'
                )
            self.draw_brush_note(do, brushed)
            self.draw_timeline(flight, brushed, f"{flight.name}_{self.axis}", "Flight over time")
            tag("p", "muted", "Drag to zoom, double-click to see all. The cursor is the same in all panes.")
        with tag("section", "card"):
            heading("The flight path")
            self.draw_path(flight, brushed)


TAB = Tab("time", "Over time", "timeline", (OverTime,))
