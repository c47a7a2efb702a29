"""A vehicle in space, as curves of Plotly in three dimensions: its rotors and nose, what it stands over, the axes.

Points are metres east, north, up, shape (n, 3). The replay of a log and the live view of a flight draw with these.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from quadctl.frames import Quaternion, rotate
from quadctl.vehicle import Vehicle
from quadctl.web.elements.figure import axis
from quadctl.web.elements.theme import Theme

Points: TypeAlias = npt.NDArray[np.float64]
LEAST_SIZE = 0.08
"""Least span of the drawn vehicle, as a share of half the space that is shown: a small one is enlarged."""
DIGITS = 4
"""Decimals of a coordinate: more than a screen can show of a metre."""
_CIRCLE = np.linspace(0.0, 2.0 * np.pi, 9)


class Box(NamedTuple):
    """The cube of space that is shown, m."""

    east: float
    north: float
    up: float
    half: float
    """Half the length of an edge."""


class Shape(NamedTuple):
    """Lines of a vehicle in its own axes, FRD, m; a row of NaN ends a line."""

    rotors: Points
    """Arms, and circles of the rotors."""
    nose: Points


def vehicle_shape(vehicle: Vehicle, half: float) -> Shape:
    """Lines of `vehicle` in a space of `half` the edge, m: enlarged where it is too small to be seen."""
    span = max(float(np.hypot(*place.position_m[:2])) for place in vehicle.rotors) + vehicle.rotor.radius_m
    scale = max(1.0, LEAST_SIZE * half / span)
    gap = np.full((1, 3), np.nan)
    lines = []
    for place in vehicle.rotors:
        hub = np.array(place.position_m)
        circle = hub + vehicle.rotor.radius_m * np.column_stack([np.cos(_CIRCLE), np.sin(_CIRCLE), 0.0 * _CIRCLE])
        lines += [np.zeros((1, 3)), hub[None, :], gap, circle, gap]
    rotors = np.asarray(scale * np.concatenate(lines))
    return Shape(rotors, scale * span * np.array([[0.0, 0.0, 0.0], [1.2, 0.0, 0.0]]))


def vehicle_at(shape: Shape, attitude: Quaternion, here: Points) -> list[Points]:
    """Rotors and nose of a vehicle at the point `here` with an attitude (FRD to NED)."""

    def in_world(body: Points) -> Points:
        north, east, down = rotate(attitude, (body[:, 0], body[:, 1], body[:, 2]))
        return np.asarray(here + np.column_stack([east, north, -np.asarray(down)]))

    return [in_world(shape.rotors), in_world(shape.nose)]


def vehicle_looks(theme: Theme) -> list[dict[str, Any]]:
    """Look of the rotors and of the nose, in the order of `vehicle_at`."""
    return [line_look("vehicle", theme.measured, 4), line_look("its nose", theme.after, 6)]


def line_look(name: str, colour: str, width: float) -> dict[str, Any]:
    """Look of a line in space, `width` pixels wide."""
    return {
        "type": "scatter3d", "mode": "lines", "name": name, "line": {"color": colour, "width": width},
        "hoverinfo": "skip", "connectgaps": False,
    }  # fmt: skip


def arrow_look(name: str, colour: str) -> dict[str, Any]:
    """Look of a line of two points with a dot at its end."""
    return {
        **line_look(name, colour, 6), "mode": "lines+markers", "marker": {"size": [0, 4], "color": colour},
    }  # fmt: skip


def coordinates(points: Points) -> dict[str, Points]:
    """The points as `x`, `y` and `z` of a curve."""
    return {name: np.round(points[:, a], DIGITS) for a, name in enumerate("xyz")}


def level(name: str, height: float, box: Box, colour: str) -> dict[str, Any]:
    """A horizontal plane through the box: the ground, a ceiling."""
    (west, east), (south, north) = (_ends(middle, box.half) for middle in (box.east, box.north))
    return {
        "type": "mesh3d", "name": name, "x": [west, east, east, west], "y": [south, south, north, north],
        "z": [height] * 4, "i": [0, 0], "j": [1, 2], "k": [2, 3], "color": colour, "opacity": 0.18,
        "hoverinfo": "skip", "showlegend": True,
    }  # fmt: skip


def scene(box: Box, theme: Theme, eye: Sequence[float]) -> dict[str, Any]:
    """Axes to the same scale, seen from `eye`, in halves of an edge east, north and up of the middle."""
    titles: Mapping[str, float] = {"east / m": box.east, "north / m": box.north, "height / m": box.up}
    axes = {
        f"{letter}axis": _axis(title, _ends(middle, box.half), theme)
        for letter, (title, middle) in zip("xyz", titles.items(), strict=True)
    }
    return {**axes, "aspectmode": "cube", "camera": {"eye": dict(zip("xyz", eye, strict=True))}}


def _axis(title: str, ends: tuple[float, float], theme: Theme) -> dict[str, Any]:
    """Axis in space; Plotly refuses some settings of plane axes here."""
    words = axis(title, theme, range=list(ends), nticks=5, backgroundcolor=theme.surface)
    return {**{key: word for key, word in words.items() if key != "automargin"}, "title": {"text": title}}


def _ends(middle: float, half: float) -> tuple[float, float]:
    return middle - half, middle + half
