"""One flight over time: measured and predicted acceleration, residual, and the state of the vehicle."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from quadctl.lab.arrays import Floats, Mask
from quadctl.lab.flights.flight import Flight
from quadctl.lab.flights.prediction import AXES
from quadctl.logs.columns import rpm_columns
from quadctl.logs.flight_log import FlightLog
from quadctl.web.elements.figure import Figure, axis, faded, figure, stacked
from quadctl.web.elements.theme import Theme
from quadctl.web.figures.downsample import downsampled

GAP_FACTOR = 3.0
"""Shortest gap in a line, in median sample intervals."""
NAMED_SHARE = 0.08
"""Shortest phase that gets its name, as a share of all phases."""
FIRST_PANE_PX, PANE_PX = 170, 84


@dataclass(frozen=True, eq=False)
class Series:
    """One line, at full resolution."""

    pane: str
    name: str
    colour: str
    time_s: Floats
    values: Floats
    width: float = 1.3
    marked: bool = False
    """Draw dots instead of a line."""


@dataclass(frozen=True, eq=False)
class Timeline:
    """Lines over a common time, in panes below each other."""

    panes: list[str]
    """Titles, with units."""
    series: list[Series]
    phases: list[tuple[str, float, float]] = field(default_factory=list)
    marks: list[tuple[str, float]] = field(default_factory=list)
    """Text and time of events."""
    legend_of_all: bool = False
    """Name the lines of every pane in the legend, not only those of the first."""

    def points(self, window: tuple[float, float] | None = None) -> tuple[list[Floats], list[Floats]]:
        """Times and values of every line inside a window of time, downsampled for a screen."""
        pairs = [downsampled(s.time_s, s.values, window) for s in self.series]
        return [x for x, _ in pairs], [y for _, y in pairs]

    def figure(self, theme: Theme) -> Figure:
        heights = [FIRST_PANE_PX if i == 0 else PANE_PX for i in range(len(self.panes))]
        domains, total = stacked(heights)
        layout: dict[str, Any] = {
            "xaxis": axis("time in the log / s", theme, anchor="free", position=0, showgrid=False),
            "hovermode": "x",
            "hoversubplots": "axis",
            "dragmode": "zoom",
            "shapes": [],
            "annotations": [],
        }
        for i, (title, domain) in enumerate(zip(self.panes, domains, strict=True)):
            layout[f"yaxis{_number(i)}"] = axis(title, theme, domain=domain, nticks=4, fixedrange=True)
        for name, start, end in self.phases:
            least_s = NAMED_SHARE * (self.phases[-1][2] - self.phases[0][1])
            _draw_phase(layout, name if end - start > least_s else "", start, theme)
        for text, time_s in self.marks:
            _draw_mark(layout, text, time_s, theme)
        xs, ys = self.points()
        data = [
            {
                "type": "scatter",
                "mode": "markers" if s.marked else "lines",
                "name": s.name,
                "x": x,
                "y": y,
                "yaxis": f"y{_number(self.panes.index(s.pane))}",
                "line": {"color": s.colour, "width": s.width},
                "marker": {"color": s.colour, "size": 5},
                "showlegend": self.legend_of_all or s.pane == self.panes[0],
                "hovertemplate": "%{y:.4~g}",
                "connectgaps": False,
            }
            for s, x, y in zip(self.series, xs, ys, strict=True)
        ]
        return figure(data, theme, total + 84, **layout)


def _number(pane: int) -> str:
    return "" if pane == 0 else str(pane + 1)


def _draw_phase(layout: dict[str, Any], name: str, start: float, theme: Theme) -> None:
    """Draw a line at the begin of a phase, with its name at the top."""
    line = {"color": theme.muted, "width": 1, "dash": "dot"}
    layout["shapes"].append({"type": "line", "x0": start, "x1": start, "yref": "paper", "y0": 0, "y1": 1, "line": line})
    layout["annotations"].append(
        {
            "x": start, "y": 1, "yref": "paper", "text": name, "showarrow": False, "xanchor": "left", "yanchor": "top",
            "font": {"size": 10, "color": theme.muted}, "xshift": 3,
        }
    )  # fmt: skip


def _draw_mark(layout: dict[str, Any], text: str, time_s: float, theme: Theme) -> None:
    """Draw a line at an event, with its text along it."""
    mark = {"color": theme.highlight, "width": 1.5}
    ends = {"x0": time_s, "x1": time_s, "yref": "paper", "y0": 0, "y1": 1}
    layout["shapes"].append({"type": "line", **ends, "line": mark})
    layout["annotations"].append(
        {
            "x": time_s, "y": 0, "yref": "paper", "text": text, "showarrow": False, "xanchor": "right",
            "yanchor": "bottom", "textangle": -90, "font": {"size": 10, "color": theme.muted},
        }
    )  # fmt: skip


def short_timeline(flight: Flight, predicted: Mapping[str, Floats], axis_name: str, theme: Theme) -> Timeline:
    """Measured acceleration on one axis, the prediction of up to three models, and the height."""
    a = AXES.index(axis_name)
    first, height = f"{axis_name} / m/s²", "height / m"
    series = [line(first, "measured", theme.measured, flight.time_s, flight.measured[:, a], 1.7)]
    for (name, values), colour in zip(predicted.items(), (theme.before, theme.after, theme.others[0]), strict=False):
        series.append(line(first, name, colour, flight.time_s, values[:, a]))
    series.append(line(height, "rotor height", theme.muted, flight.grid_s, np.asarray(flight.conditions.height_m)))
    return Timeline([first, height], series)


def full_timeline(
    flight: Flight,
    log: FlightLog | None,
    predicted: Mapping[str, Floats],
    axis_name: str,
    theme: Theme,
    brushed: Mask | None = None,
) -> Timeline:
    """`short_timeline` with residual, speed, rotor speed, voltage and mission phases; `brushed` samples are marked."""
    short = short_timeline(flight, predicted, axis_name, theme)
    residual = "residual / m/s²"
    panes, series = [short.panes[0], residual, *short.panes[1:]], list(short.series)
    measured = flight.measured[:, AXES.index(axis_name)]
    for (name, values), colour in zip(predicted.items(), (theme.before, theme.after, theme.others[0]), strict=False):
        left = measured - values[:, AXES.index(axis_name)]
        series.append(line(residual, f"residual, {name}", colour, flight.time_s, left))
    if brushed is not None and brushed.any():
        series.append(_brushed(series[0], brushed, theme))
    speed = np.sqrt(sum(np.asarray(v) ** 2 for v in flight.conditions.velocity_body_m_s))
    panes.append("speed / m/s")
    series.append(line("speed / m/s", "speed", theme.muted, flight.grid_s, speed))
    for title, values in _logged(log):
        panes.append(title)
        series.append(line(title, title.partition(" / ")[0], theme.muted, log.time_s if log else values, values))
    return Timeline(panes, series, phases_of(log))


def gaps_in(time_s: Floats) -> NDArray[np.int64]:
    """Numbers of the samples before which there is a gap."""
    steps = np.diff(time_s)
    return np.flatnonzero(steps > GAP_FACTOR * np.median(steps)) + 1


def line(pane: str, name: str, colour: str, time_s: Floats, values: Floats, width: float = 1.3) -> Series:
    """A line that is broken where the log has a gap."""
    gaps = gaps_in(time_s)
    return Series(pane, name, colour, np.insert(time_s, gaps, time_s[gaps]), np.insert(values, gaps, np.nan), width)


def _brushed(line: Series, brushed: Mask, theme: Theme) -> Series:
    known = np.isfinite(line.values)
    time, values = line.time_s[known][brushed], line.values[known][brushed]
    return Series(line.pane, "selected", faded(theme.highlight, 0.9), time, values, marked=True)


def _logged(log: FlightLog | None) -> list[tuple[str, Floats]]:
    """Mean rotor speed, and the voltage of the battery or, without it, of the motors."""
    if log is None:
        return []
    found = []
    if log.n_rotors:
        found.append(("rotors / rpm", _mean(log, rpm_columns(log.n_rotors))))
    motors = [f"motor{i + 1}_voltage_v" for i in range(max(log.n_rotors, 1))]
    voltage = ["battery_v"] if log.has("battery_v") else [name for name in motors if log.has(name)]
    if voltage:
        found.append(("voltage / V", _mean(log, voltage)))
    return found


def _mean(log: FlightLog, columns: Sequence[str]) -> Floats:
    return np.asarray(np.mean([log[column] for column in columns], axis=0))


def phases_of(log: FlightLog | None) -> list[tuple[str, float, float]]:
    """Name, begin and end of each phase of the mission, s; none where the log names none."""
    if log is None or log.phase is None or not len(log):
        return []
    starts = np.flatnonzero(np.concatenate([[True], log.phase[1:] != log.phase[:-1]]))
    ends = [*starts[1:], len(log) - 1]
    spans = zip(starts, ends, strict=True)
    return [(str(log.phase[a]), float(log.time_s[a]), float(log.time_s[b])) for a, b in spans if log.phase[a]]
