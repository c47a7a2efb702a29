"""One flight over time, all of it: phases, acceleration, residual, height, speed, rotors, voltage."""

from typing import TYPE_CHECKING

from nicegui import ui

from quadctl.lab.comparison.wording import percent
from quadctl.lab.flights.dataset import AXES
from quadctl.web.elements.html import empty, heading, plot, tag
from quadctl.web.figures.path import path_figure
from quadctl.web.figures.timeline import full_timeline
from quadctl.web.panels.zoomed import zoomed_plot

if TYPE_CHECKING:
    from quadctl.web.page.page import Page


def draw_over_time(page: "Page") -> None:
    flight, bench = page.flight, page.bench
    if flight is None or bench.opened is None:
        empty("timeline", "No flight yet", "Open a flight log to see it over time.")
        return
    with tag("section", "card"):
        with tag("div", "line wrap"):
            tag("h2", "title grow", "Measured against predicted")
            choose_flight(page)
            ui.toggle(list(AXES), value=page.axis, on_change=lambda e: page.look_at(axis=e.value)).props(
                'dense no-caps unelevated aria-label="Axis"'
            )
        brush_note(page)
        timeline = full_timeline(
            flight, bench.opened.log(flight.name), page.predictions(flight), page.axis, page.theme, page.brushed(flight)
        )
        zoomed_plot(timeline, page.theme, f"{flight.name}_{page.axis}", "Flight over time")
        tag("p", "muted", "Drag to zoom, double-click to see all. The cursor is the same in all panes.")
    with tag("section", "card"):
        heading("The flight path")
        plot(path_figure(flight, page.brushed(flight), page.theme), f"{flight.name}_path", "Flight path")


def choose_flight(page: "Page") -> None:
    names = [flight.name for flight in page.flights]
    if len(names) > 1:
        select = ui.select(names, value=page.flight.name if page.flight else None, label="Flight")
        select.props("dense outlined options-dense").on_value_change(lambda e: page.look_at(flight=e.value))


def brush_note(page: "Page") -> None:
    """What is selected, wherever it is shown."""
    flight = page.flight
    selected = None if flight is None else page.brushed(flight)
    if selected is None:
        return
    with tag("div", "line brush"):
        tag("span", "brush-mark")
        share = percent(float(selected.mean()))
        tag("span", "grow", f"Selected: {page.brush_in_words()}, {share} of this flight")
        ui.button("Clear", on_click=page.clear_brush).props("flat dense no-caps")
