"""One flight over time: phases, acceleration, residual, height, speed, rotors, voltage; its path; and any channel."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from nicegui import ui

from quadctl.lab.comparison.wording import listed
from quadctl.lab.flights.flight import Flight
from quadctl.lab.flights.prediction import AXES
from quadctl.logs.columns import motor_columns
from quadctl.logs.events import events_of
from quadctl.logs.flight_log import FlightLog
from quadctl.web.elements.html import empty, heading, plot, table, tag
from quadctl.web.elements.theme import Theme
from quadctl.web.elements.upload import StreamedUpload, choose_button
from quadctl.web.figures.channels import (
    Statistics,
    channel_timeline,
    channels_of,
    in_words,
    spectrum_figure,
    statistics_of,
)
from quadctl.web.figures.replay import frame_times, replay_figure
from quadctl.web.panels.chosen_flight import ChosenFlightPanel, selected
from quadctl.web.panels.panel import Controls, Panel, Tab
from quadctl.web.panels.replayed import replayed_plot
from quadctl.web.panels.view import CURRENT
from quadctl.web.panels.zoomed import zoomed_plot
from quadctl.web.work.predictions import predictions

MOST_MOTORS = 12
PRESETS = {
    "Position and setpoint": ("x_m", "x_ref_m", "y_m", "y_ref_m", "z_m", "z_ref_m"),
    "Attitude and setpoint": ("roll_deg", "roll_cmd_deg", "pitch_deg", "pitch_cmd_deg"),
    "Speed of each motor": tuple(motor_columns(MOST_MOTORS, "rpm")),
    "Command to each motor": tuple(motor_columns(MOST_MOTORS, "output")),
    "Accelerometer": ("imu_x_m_s2", "imu_y_m_s2", "imu_z_m_s2"),
}
"""Channels that are often looked at together."""


@dataclass(frozen=True)
class OverTime(ChosenFlightPanel):
    """All channels of the chosen flight over time, and its path, with the selected samples marked."""

    comparable: dict[str, str]
    beside: str

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
                ui.toggle(list(AXES), value=self.axis, on_change=lambda e: do.choose(axis=e.value)).props(
                    'dense no-caps unelevated aria-label="Axis"'
                )
            self._draw_other_model(do)
            self.draw_brush_note(do, brushed)
            timeline = self.draw_timeline(flight, brushed, f"{flight.name}_{self.axis}", "Flight over time")
            tag("p", "muted", "Drag to zoom, double-click to see all. The cursor is the same in all panes.")
        with tag("section", "card"):
            text = (
                "The vehicle is drawn at the time of the cursor in the figures above; press Play, or move the slider."
            )
            heading("The flight path", text)
            predicted = predictions(self.models, flight)
            residual = flight.measured - predicted.get(CURRENT, next(iter(predicted.values()), flight.measured))
            replay = replay_figure(flight, residual, brushed, self.theme)
            replayed_plot(replay, frame_times(flight), timeline, f"{flight.name}_path", "Flight path")

    def _draw_other_model(self, do: Controls) -> None:
        """Draw the choice of a further model, which is drawn over the others: a step of the sequence, or a file."""
        with tag("div", "line wrap beside"):
            options = {"": "none", **self.comparable}
            chosen = self.beside if self.beside in options else ""
            ui.select(
                options, value=chosen, label="Another model", on_change=lambda e: do.choose(beside=e.value)
            ).props("dense outlined options-dense")
            upload = StreamedUpload()
            do.intake.receive(upload, lambda files: do.act(do.take_model(files[0])))
            upload.props('accept=".yaml,.yml"').classes("hidden")
            choose_button(upload, "From a file", "file_open", "flat dense")


@dataclass(frozen=True)
class AnyChannel(Panel):
    """Channels that a person has chosen: over time, as statistics, and the last one as a spectrum."""

    flight: Flight | None
    flight_names: tuple[str, ...]
    shown_logs: tuple[FlightLog, ...]
    channels: tuple[str, ...]
    over_each_other: bool
    theme: Theme

    def draw(self, do: Controls) -> None:
        flight = self.flight
        if flight is None or not self.shown_logs:
            return
        offered = channels_of(self.shown_logs)
        chosen = tuple(channel for channel in self.channels if channel in offered)
        with tag("section", "card"):
            heading("Any channel over time", "Search by name. Channels of one unit share a pane.")
            self._draw_choice(do, offered, chosen)
            if not chosen:
                tag("p", "muted", "Choose a channel to see it.")
                return
            timeline = channel_timeline(self.shown_logs, chosen, self.theme)
            zoomed_plot(timeline, self.theme, "channels", f"Channels over time: {listed(list(chosen))}")
            _draw_events(self.shown_logs[0])
            _draw_statistics(statistics_of(self.shown_logs, chosen))
            drawn = spectrum_figure(self.shown_logs, chosen[-1], flight, self.theme)
            tag("h3", "spectrum", f"Spectrum of {offered[chosen[-1]]}")
            if drawn is None:
                tag("p", "muted", "It has too few updates for a spectrum.")
            else:
                tag("p", "muted", "The analysis uses the frequencies below its filter; vibration lies above.")
                plot(drawn, f"spectrum_of_{chosen[-1]}", f"Spectrum of {chosen[-1]}")

    def _draw_choice(self, do: Controls, offered: dict[str, str], chosen: tuple[str, ...]) -> None:
        with tag("div", "line wrap"):
            search = ui.select(offered, value=list(chosen), multiple=True, with_input=True, label="Channels")
            search.props("dense outlined options-dense use-chips").classes("grow channels")
            # Drawn again when the list closes: a list that closes at every choice would have to be opened again.
            for event in ("popup-hide", "remove"):
                search.on(event, lambda: do.choose(channels=tuple(search.value)), args=[])
            if len(self.flight_names) > 1:
                ui.switch(
                    "all flights over each other",
                    value=self.over_each_other,
                    on_change=lambda e: do.choose(over_each_other=e.value),
                ).props("dense")
        with tag("div", "line wrap"):
            for name, columns in PRESETS.items():
                wanted = tuple(column for column in columns if column in offered)
                if wanted:
                    choose = partial(do.choose, channels=wanted)
                    ui.button(name, on_click=choose).props("flat dense no-caps size=sm")


def _draw_events(log: FlightLog) -> None:
    """Draw a folded list of the events of a flight: on the axis of time there is no room for whole texts."""
    found = events_of(log.meta)
    if not found:
        return
    with (
        ui.expansion(f"Modes, messages and parameter changes of {log.name} ({len(found)})").classes("more"),
        tag("div", "scroll tall").props('tabindex="0"'),
    ):
        rows = [(f"{event.time_s:.2f}", event.what) for event in found]
        table("small", {"time / s": "number", "event": ""}, rows)


def _draw_statistics(found: Mapping[tuple[str, str], Statistics]) -> None:
    several = len({flight for flight, _ in found}) > 1
    numbers = dict.fromkeys(("mean", "std", "min", "max", "rate / Hz"), "number")
    rows = [
        (
            *((flight,) if several else ()),
            in_words(column),
            *(f"{value:.4g}".replace("-", "\u2212") for value in values[:-1]),
            f"{values.rate_hz:.1f}" if np.isfinite(values.rate_hz) else "\u2013",
        )
        for (flight, column), values in found.items()
    ]
    with tag("div", "scroll").props('tabindex="0"'):
        table("small", {**({"flight": ""} if several else {}), "channel": "", **numbers}, rows)


TAB = Tab("time", "Over time", "timeline", (OverTime, AnyChannel))
