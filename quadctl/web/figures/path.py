"""Path of a flight in space, with the selected samples marked."""

from typing import Any

import numpy as np

from quadctl.lab.arrays import Floats, Mask
from quadctl.lab.flights.flight import Flight
from quadctl.web.elements.figure import Figure, axis, figure
from quadctl.web.elements.theme import Theme


def path_figure(flight: Flight, brushed: Mask | None, theme: Theme) -> Figure:
    """North, east and rotor height of the samples, m; those in `brushed`, shape (n,), are marked."""
    north, east = flight.variables["north"], flight.variables["east"]
    height = flight.filtered(np.asarray(flight.conditions.height_m))
    some = np.zeros(len(north), dtype=bool) if brushed is None else brushed
    line: dict[str, Any] = {
        "type": "scatter3d", "mode": "lines", "name": "flight", "x": east, "y": north, "z": height,
        "line": {"color": theme.muted, "width": 3}, "hoverinfo": "skip",
    }  # fmt: skip
    dots: dict[str, Any] = {
        "type": "scatter3d", "mode": "markers", "name": "selected", "x": east[some], "y": north[some],
        "z": height[some], "marker": {"color": theme.highlight, "size": 3.5}, "hoverinfo": "skip",
    }  # fmt: skip
    reach = max(float(np.ptp(values)) for values in (north, east, height)) / 2.0
    scene = {
        "xaxis": _space_axis("east / m", east, reach, theme),
        "yaxis": _space_axis("north / m", north, reach, theme),
        "zaxis": _space_axis("height / m", height, reach, theme),
        "aspectmode": "cube",
        "camera": {"eye": {"x": 1.7, "y": 1.7, "z": 0.9}},
    }
    return figure([line, dots], theme, 330, scene=scene, margin={"l": 0, "r": 0, "t": 20, "b": 0})


def _space_axis(title: str, values: Floats, reach: float, theme: Theme) -> dict[str, Any]:
    """Axis in space, to the scale of the others; Plotly refuses some settings of plane axes here."""
    middle = float(values.min() + values.max()) / 2.0
    words = axis(title, theme, range=[middle - reach, middle + reach], nticks=5, backgroundcolor=theme.surface)
    return {**{key: word for key, word in words.items() if key != "automargin"}, "title": {"text": title}}
