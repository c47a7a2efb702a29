"""The flight in space, seen from above: the vehicle at its attitude, its path, the ground, and the setpoint."""

import math
from collections.abc import Iterable, Sequence
from typing import TypeAlias

import numpy as np

from quadctl.flight.record.view_link import Record
from quadctl.vehicle import Vehicle
from quadctl.web.elements.figure import Figure, figure
from quadctl.web.elements.space import (
    Box,
    Points,
    arrow_look,
    coordinates,
    level,
    line_look,
    scene,
    vehicle_at,
    vehicle_looks,
    vehicle_shape,
)
from quadctl.web.elements.theme import Theme
from quadctl.web.live.history import Row

HEIGHT_PX = 460
EYE = (0.0, -0.9, 2.0)
"""From above, and a little from the south: north is up on the screen, and heights can be told."""
ROOM = 1.3
"""A box that has become too small is made larger than it must be, so that it seldom changes."""
BELOW = 0.1
"""Depth of the box below the ground, as a share of its half."""
NO_BOX = Box(0.0, 0.0, 1.0 - BELOW, 1.0)
"""Space that is shown before anything is known of a place."""
Point: TypeAlias = tuple[float, float, float]
"""East, north and height, m; NaN where they are not known."""
_EMPTY = np.full((1, 3), np.nan)


def box_for(box: Box, points: Iterable[Point]) -> Box:
    """`box`, or where some of the points are outside of it, a larger one that holds it and them.

    `NO_BOX` is replaced by a small one around the first point.
    """
    known = [point for point in points if all(map(math.isfinite, point))]
    if box == NO_BOX and known:
        east, north, _ = known[0]
        box = _on_the_ground(east, north, NO_BOX.half)
    outside = [point for point in known if not _holds(box, point)]
    if not outside:
        return box
    corners = [(box.east + s * box.half, box.north + s * box.half, box.up + s * box.half) for s in (-1.0, 1.0)]
    all_points = np.array([*corners, *outside])
    low, high = all_points.min(axis=0), all_points.max(axis=0)
    half = ROOM * max(*(0.5 * (high - low)[:2]), high[2] / (2.0 - BELOW))
    east, north, _ = (0.5 * (low + high)).tolist()
    return _on_the_ground(east, north, float(half))


def _on_the_ground(east: float, north: float, half: float) -> Box:
    return Box(east, north, (1.0 - BELOW) * half, half)


def _holds(box: Box, point: Point) -> bool:
    """True for a point in the box; below the ground a vehicle is not looked for."""
    east, north, up = point
    return max(abs(east - box.east), abs(north - box.north)) <= box.half and up <= box.up + box.half


def space_figure(rows: Sequence[Row], record: Record | None, vehicle: Vehicle, box: Box, theme: Theme) -> Figure:
    """The path of the rows, and the vehicle and its setpoint as in the record, in the space of `box`."""
    path = np.array([place(row) for row in rows]) if rows else _EMPTY
    looks = [
        line_look("path", theme.muted, 3),
        *vehicle_looks(theme),
        arrow_look("setpoint", theme.before),
    ]
    lines = [coordinates(points) for points in (path, *moving(record, vehicle, box))]
    data = [{**look, **line} for look, line in zip(looks, lines, strict=True)]
    ground = level("ground", 0.0, box, theme.floor)
    return figure(
        [*data, ground], theme, HEIGHT_PX, scene=scene(box, theme, EYE), margin={"l": 0, "r": 0, "t": 20, "b": 0}
    )


def moving(record: Record | None, vehicle: Vehicle, box: Box) -> list[Points]:
    """Points of the rotors, of the nose, and of the line to the setpoint; NaN where they are not known."""
    shape = vehicle_shape(vehicle, box.half)
    points = np.array(present(record))
    if record is None or np.isnan(points[0]).any():
        return [np.full_like(shape.rotors, np.nan), np.full_like(shape.nose, np.nan), np.full((2, 3), np.nan)]
    return [*vehicle_at(shape, record.attitude, points[0]), points]


def additions(
    rows: Sequence[Row], record: Record | None, vehicle: Vehicle, box: Box, most: int
) -> tuple[dict[str, list[list[float | None]]], dict[str, list[int]]]:
    """New points of the curves by coordinate, and the most points that each keeps: the path grows, others are replaced.

    They are the second and fourth arguments of Plotly's `extendTraces`.
    """
    path = np.array([place(row) for row in rows]).reshape(-1, 3)
    curves = [path, *moving(record, vehicle, box)]
    points = {
        letter: [[_known(value) for value in coordinates(curve)[letter].tolist()] for curve in curves]
        for letter in "xyz"
    }
    kept = [most, *(len(curve) for curve in curves[1:])]
    return points, dict.fromkeys("xyz", kept)


def place(row: Row) -> Point:
    """Point of the path; not known on the ground, which is no part of it."""
    return row.east_m, row.north_m, row.height_m


def present(record: Record | None) -> list[Point]:
    """Points where the vehicle and its setpoint are."""
    if record is None:
        return []
    here = (record.east_m, record.north_m, record.height_m)
    return [here, (record.east_ref_m, record.north_ref_m, record.height_ref_m)]


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None
