"""A flight in space with the vehicle at one moment of it, which its frames move."""

from typing import Any

import numpy as np

from quadctl.frames import rotate
from quadctl.lab.arrays import Floats, Mask
from quadctl.lab.flights.flight import Flight
from quadctl.web.elements.figure import Figure
from quadctl.web.elements.theme import Theme
from quadctl.web.figures.path import path_figure

MOST_FRAMES = 150
LEAST_SIZE = 0.08
"""Least span of the drawn vehicle, as a share of the half space that is shown: a small one is enlarged."""
ARROW = 0.5
"""Length of the arrow of a large residual, as a share of the half space that is shown."""
NEAR = 1.0
"""Largest distance of the flight from the ground or a ceiling that is drawn, as a share of its own extent."""
_CIRCLE = np.linspace(0.0, 2.0 * np.pi, 9)


def replay_figure(flight: Flight, residual: Floats, brushed: Mask | None, theme: Theme) -> Figure:
    """The path, ground and ceiling, and the vehicle with its residual; `residual` is north, east, up, m/s^2, (n, 3).

    Each of the `frames` is named by its number and holds the vehicle at a time of `frame_times`.
    """
    drawn = path_figure(flight, brushed, theme)
    path = drawn["data"][0]
    places = np.column_stack([path["x"], path["y"], path["z"]])
    reach = max(float(np.ptp(places, axis=0).max()) / 2.0, 0.1)
    times = frame_times(flight)
    largest = max(float(np.quantile(np.linalg.norm(residual, axis=1), 0.99)), 1e-3)
    m_per_m_s2 = ARROW * reach / largest
    states = [_vehicle_at(flight, places, residual, time, reach, m_per_m_s2) for time in times]
    looks = _looks(theme, m_per_m_s2)
    first = [{**look, **lines} for look, lines in zip(looks, states[0], strict=True)]
    moving = list(range(len(drawn["data"]), len(drawn["data"]) + len(first)))
    frames = [{"name": str(i), "data": state, "traces": moving} for i, state in enumerate(states)]
    scene = drawn["layout"]["scene"]
    near = _near_planes(flight, places, reach, theme)
    heights = [places[:, 2].min(), places[:, 2].max(), *(height for _, height, _ in near)]
    half = 1.05 * max(reach, (max(heights) - min(heights)) / 2.0)
    east, north = (float(places[:, a].min() + places[:, a].max()) / 2.0 for a in (0, 1))
    for name, centre in (("xaxis", east), ("yaxis", north), ("zaxis", (max(heights) + min(heights)) / 2.0)):
        scene[name]["range"] = [centre - half, centre + half]
    scene["camera"] = {"eye": {"x": 1.6, "y": 1.6, "z": 0.8}}
    planes = [
        {
            "type": "mesh3d", "name": name, "x": [east - half, east + half, east + half, east - half],
            "y": [north - half, north - half, north + half, north + half], "z": [height] * 4,
            "i": [0, 0], "j": [1, 2], "k": [2, 3], "color": colour, "opacity": 0.18, "hoverinfo": "skip",
            "showlegend": True,
        }
        for name, height, colour in near
    ]  # fmt: skip
    drawn["data"] = [*drawn["data"], *first, *planes]
    drawn["layout"] |= {"height": 420}
    return {**drawn, "frames": frames}


def frame_times(flight: Flight) -> Floats:
    """Times of the frames, evenly spaced over the flight, s."""
    n = min(MOST_FRAMES, len(flight.time_s))
    return np.linspace(float(flight.time_s[0]), float(flight.time_s[-1]), n)


def _vehicle_at(
    flight: Flight, places: Floats, residual: Floats, time_s: float, reach: float, m_per_m_s2: float
) -> list[dict[str, Floats]]:
    """Lines of the rotors, of the nose, and of the residual at one time, in metres east, north, up."""
    sample = min(int(np.searchsorted(flight.time_s, time_s)), len(flight.time_s) - 1)
    on_grid = min(int(np.searchsorted(flight.grid_s, time_s)), len(flight.grid_s) - 1)
    w, x, y, z = (float(np.asarray(part)[on_grid]) for part in flight.conditions.attitude)
    here = places[sample]
    rotors, nose = _cross(flight, reach)

    def in_world(body: Floats) -> Floats:
        north, east, down = rotate((w, x, y, z), (body[:, 0], body[:, 1], body[:, 2]))
        return np.asarray(here + np.column_stack([east, north, -np.asarray(down)]))

    north, east, up = residual[sample]
    arrow = np.array([here, here + m_per_m_s2 * np.array([east, north, up])])
    return [_xyz(in_world(rotors)), _xyz(in_world(nose)), _xyz(arrow)]


def _cross(flight: Flight, reach: float) -> tuple[Floats, Floats]:
    """Arms and circles of the rotors, and a line to the front, FRD, m; a vehicle too small to be seen is enlarged."""
    vehicle = flight.vehicle
    span = max(float(np.hypot(*place.position_m[:2])) for place in vehicle.rotors) + vehicle.rotor.radius_m
    scale = max(1.0, LEAST_SIZE * reach / span)
    gap = np.full((1, 3), np.nan)
    lines = []
    for place in vehicle.rotors:
        hub = np.array(place.position_m)
        circle = hub + vehicle.rotor.radius_m * np.column_stack([np.cos(_CIRCLE), np.sin(_CIRCLE), 0.0 * _CIRCLE])
        lines += [np.zeros((1, 3)), hub[None, :], gap, circle, gap]
    cross = np.asarray(scale * np.concatenate(lines))
    return cross, scale * span * np.array([[0.0, 0.0, 0.0], [1.2, 0.0, 0.0]])


def _xyz(points: Floats) -> dict[str, Floats]:
    return {axis: np.round(points[:, a], 4) for a, axis in enumerate("xyz")}


def _looks(theme: Theme, m_per_m_s2: float) -> list[dict[str, Any]]:
    line = {"type": "scatter3d", "mode": "lines", "hoverinfo": "skip", "connectgaps": False}
    head = {"size": [0, 4], "color": theme.before}
    return [
        {**line, "name": "vehicle", "line": {"color": theme.measured, "width": 4}},
        {**line, "name": "its nose", "line": {"color": theme.after, "width": 6}},
        {
            **line, "mode": "lines+markers", "name": f"residual ({m_per_m_s2:.2g} m long: 1 m/s²)",
            "line": {"color": theme.before, "width": 6}, "marker": head,
        },
    ]  # fmt: skip


def _near_planes(flight: Flight, places: Floats, reach: float, theme: Theme) -> list[tuple[str, float, str]]:
    """Name, height in m and colour of the ground, and of the ceiling of the vehicle file, if the flight comes near."""
    ceiling = flight.vehicle.ceiling_m
    known = [("ground", 0.0, theme.floor), *([] if ceiling is None else [("ceiling", ceiling, theme.highlight)])]
    return [plane for plane in known if np.min(np.abs(places[:, 2] - plane[1])) < NEAR * 2.0 * reach]
