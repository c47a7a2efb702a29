"""Path of a flight in space, with the selected samples marked."""

from typing import Any

import numpy as np

from quadctl.lab.arrays import Floats, Mask
from quadctl.lab.flights.flight import Flight
from quadctl.web.elements.figure import Figure, figure
from quadctl.web.elements.space import Box, scene
from quadctl.web.elements.theme import Theme

EYE = (1.85, 1.85, 1.0)


def path_figure(flight: Flight, brushed: Mask | None, theme: Theme) -> Figure:
    """North, east and rotor height of the samples, m; those in `brushed`, shape (n,), are marked."""
    places = path_of(flight)
    east, north, height = places.T
    some = np.zeros(len(north), dtype=bool) if brushed is None else brushed
    line: dict[str, Any] = {
        "type": "scatter3d", "mode": "lines", "name": "flight", "x": east, "y": north, "z": height,
        "line": {"color": theme.muted, "width": 3}, "hoverinfo": "skip",
    }  # fmt: skip
    dots: dict[str, Any] = {
        "type": "scatter3d", "mode": "markers", "name": "selected", "x": east[some], "y": north[some],
        "z": height[some], "marker": {"color": theme.highlight, "size": 3.5}, "hoverinfo": "skip",
    }  # fmt: skip
    shown = scene(box_around(places), theme, EYE)
    return figure([line, dots], theme, 330, scene=shown, margin={"l": 0, "r": 0, "t": 20, "b": 0})


def path_of(flight: Flight) -> Floats:
    """East, north and rotor height of the samples, m, shape (n, 3)."""
    height = flight.filtered(np.asarray(flight.conditions.height_m))
    return np.column_stack([flight.variables["east"], flight.variables["north"], height])


def box_around(places: Floats) -> Box:
    """The least cube around points."""
    low, high = places.min(axis=0), places.max(axis=0)
    east, north, up = ((low + high) / 2.0).tolist()
    return Box(east, north, up, float((high - low).max()) / 2.0)
