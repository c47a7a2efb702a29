"""The flight's way through space, with what is selected standing out."""

from typing import Any

import numpy as np

from quadctl.lab.arrays import Mask
from quadctl.lab.flight import Flight
from quadctl.web.figures.base import Figure, axis, figure
from quadctl.web.theme import Theme


def path_figure(flight: Flight, brushed: Mask | None, theme: Theme) -> Figure:
    """North, east and height of the rotors at the samples, shape (n,) each; `brushed` has the same shape."""
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
    box = {"backgroundcolor": theme.surface, "showspikes": False}
    scene = {
        "xaxis": axis("east / m", theme, **box),
        "yaxis": axis("north / m", theme, **box),
        "zaxis": axis("height / m", theme, **box),
        "aspectmode": "cube",
    }
    for each in ("xaxis", "yaxis", "zaxis"):
        del scene[each]["automargin"]  # type: ignore[attr-defined]
        del scene[each]["title"]["standoff"]  # type: ignore[index]
    return figure([line, dots], theme, 330, scene=scene, margin={"l": 0, "r": 0, "t": 20, "b": 0})
