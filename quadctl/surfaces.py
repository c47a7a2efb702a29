"""Surfaces of the ground: the names of what a vehicle flies over, and where in the world each of them lies."""

from collections.abc import Mapping
from typing import Any, Self, TypeAlias

from pydantic import Field, model_validator

from quadctl.errors import SettingsError
from quadctl.numeric import Number, maximum, minimum
from quadctl.settings import Settings, validate

Shares: TypeAlias = tuple[tuple[str, Number], ...]
"""Share of each named surface in the ground below the vehicle, 0..1; what is left of 1 is no named surface."""


class Area(Settings):
    """A rectangle in the world's frame, metres north and east of the origin."""

    north_m: tuple[float, float]
    east_m: tuple[float, float]

    @model_validator(mode="after")
    def _is_ordered(self) -> Self:
        for name, (low, high) in (("north_m", self.north_m), ("east_m", self.east_m)):
            if low >= high:
                raise ValueError(f"{name} is [{low:g}, {high:g}], expected the smaller number first")
        return self


class Place(Settings):
    """Map of the surfaces that a flight passes over, as in a mission file and in the meta file of a log."""

    surfaces: dict[str, Area | None] = Field(min_length=1)
    """Area of each surface; None: it is everywhere, and then the only one."""
    edge_m: float = Field(default=0.3, gt=0.0)
    """Width of the strip in which one surface passes into the other, about two rotor radii."""

    @model_validator(mode="after")
    def _is_a_map(self) -> Self:
        for name, area in self.surfaces.items():
            if not name.isidentifier() or name != name.lower():
                raise ValueError(f"surfaces: '{name}', expected lower-case letters, digits and underscores: dry_soil")
            if area is None and len(self.surfaces) > 1:
                raise ValueError(f"surfaces: {name} has no area, expected north_m and east_m where there are several")
        areas = [(name, area) for name, area in self.surfaces.items() if area is not None]
        for i, (name, area) in enumerate(areas):
            for other, there in areas[:i]:
                if _overlap(area.north_m, there.north_m) and _overlap(area.east_m, there.east_m):
                    raise ValueError(f"surfaces: {other} and {name} overlap, expected one surface at each point")
        return self

    def shares(self, position_ne_m: tuple[Number, Number]) -> Shares:
        """Share of each surface below a vehicle at this position, linear over `edge_m` across the edges."""
        north, east = position_ne_m
        return tuple(
            (name, 1.0 if area is None else self._within(north, area.north_m) * self._within(east, area.east_m))
            for name, area in self.surfaces.items()
        )

    def _within(self, at: Number, limits: tuple[float, float]) -> Number:
        inside = minimum(at - limits[0], limits[1] - at) / self.edge_m + 0.5
        return minimum(maximum(inside, 0.0), 1.0)


def read_place(data: Mapping[str, Any], source: str) -> Place | None:
    """Place that a mission file, or the meta file of a log, says: one `surface`, or a map of `surfaces` with `edge_m`.

    None where it says nothing of them.

    Raises
    ------
    SettingsError
        Both are given, or the map cannot be right; `source` is named.
    """
    surface, surfaces, edge_m = (data.get(key) for key in ("surface", "surfaces", "edge_m"))
    if surface is not None and surfaces is not None:
        raise SettingsError(f"{source}: has surface and surfaces, expected one of them")
    if surfaces is None and edge_m is not None:
        raise SettingsError(f"{source}: edge_m is {edge_m}, expected surfaces with it")
    if surface is not None:
        surfaces = {str(surface): None}
    if surfaces is None:
        return None
    return validate({"surfaces": surfaces} | ({} if edge_m is None else {"edge_m": edge_m}), Place, source)


def _overlap(a: tuple[float, float], b: tuple[float, float]) -> bool:
    return a[0] < b[1] and b[0] < a[1]
