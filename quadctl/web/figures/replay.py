"""A flight in space with the vehicle at one moment of it, which its frames move."""

import numpy as np

from quadctl.lab.arrays import Floats, Mask
from quadctl.lab.flights.flight import Flight
from quadctl.web.elements.figure import Figure
from quadctl.web.elements.space import (
    Box,
    Shape,
    arrow_look,
    coordinates,
    level,
    scene,
    vehicle_at,
    vehicle_looks,
    vehicle_shape,
)
from quadctl.web.elements.theme import Theme
from quadctl.web.figures.path import box_around, path_figure, path_of

MOST_FRAMES = 150
ARROW = 0.5
"""Length of the arrow of a large residual, as a share of the half space that is shown."""
NEAR = 1.0
"""Largest distance of the flight from the ground or a ceiling that is drawn, as a share of its own extent."""
LEAST_HALF_M = 0.1
EYE = (1.85, 1.85, 0.95)


def replay_figure(flight: Flight, residual: Floats, brushed: Mask | None, theme: Theme) -> Figure:
    """The path, ground and ceiling, and the vehicle with its residual; `residual` is north, east, up, m/s^2, (n, 3).

    Each of the `frames` is named by its number and holds the vehicle at a time of `frame_times`.
    """
    drawn = path_figure(flight, brushed, theme)
    places = path_of(flight)
    east, north, _, half = box_around(places)
    reach = max(half, LEAST_HALF_M)
    times = frame_times(flight)
    largest = max(float(np.quantile(np.linalg.norm(residual, axis=1), 0.99)), 1e-3)
    m_per_m_s2 = ARROW * reach / largest
    shape = vehicle_shape(flight.vehicle, reach)
    states = [_vehicle_at(flight, shape, places, residual, time, m_per_m_s2) for time in times]
    arrow = arrow_look(f"residual (scale: {m_per_m_s2:.2g} m is 1 m/s²)", theme.before)
    first = [{**look, **lines} for look, lines in zip([*vehicle_looks(theme), arrow], states[0], strict=True)]
    moving = list(range(len(drawn["data"]), len(drawn["data"]) + len(first)))
    frames = [{"name": str(i), "data": state, "traces": moving} for i, state in enumerate(states)]
    near = _near_levels(flight, places, reach, theme)
    heights = [places[:, 2].min(), places[:, 2].max(), *(height for _, height, _ in near)]
    low, high = float(min(heights)), float(max(heights))
    box = Box(east, north, (low + high) / 2.0, 1.05 * max(reach, (high - low) / 2.0))
    drawn["data"] = [*drawn["data"], *first, *(level(name, height, box, colour) for name, height, colour in near)]
    drawn["layout"] |= {"height": 420, "scene": scene(box, theme, EYE)}
    return {**drawn, "frames": frames}


def frame_times(flight: Flight) -> Floats:
    """Times of the frames, evenly spaced over the flight, s."""
    n = min(MOST_FRAMES, len(flight.time_s))
    return np.linspace(float(flight.time_s[0]), float(flight.time_s[-1]), n)


def _vehicle_at(
    flight: Flight, shape: Shape, places: Floats, residual: Floats, time_s: float, m_per_m_s2: float
) -> list[dict[str, Floats]]:
    """Lines of the rotors, of the nose, and of the residual at one time."""
    sample = min(int(np.searchsorted(flight.time_s, time_s)), len(flight.time_s) - 1)
    on_grid = min(int(np.searchsorted(flight.grid_s, time_s)), len(flight.grid_s) - 1)
    w, x, y, z = (float(np.asarray(part)[on_grid]) for part in flight.conditions.attitude)
    here = places[sample]
    north, east, up = residual[sample]
    arrow = np.array([here, here + m_per_m_s2 * np.array([east, north, up])])
    return [coordinates(line) for line in (*vehicle_at(shape, (w, x, y, z), here), arrow)]


def _near_levels(flight: Flight, places: Floats, reach: float, theme: Theme) -> list[tuple[str, float, str]]:
    """Name, height in m and colour of the ground, and of the ceiling of the vehicle file, if the flight comes near."""
    ceiling = flight.vehicle.ceiling_m
    known = [("ground", 0.0, theme.floor), *([] if ceiling is None else [("ceiling", ceiling, theme.highlight)])]
    return [plane for plane in known if np.min(np.abs(places[:, 2] - plane[1])) < NEAR * 2.0 * reach]
