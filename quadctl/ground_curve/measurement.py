"""Measured thrusts near the ground, one row for each reading: from CSV, and checked for plausibility."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from quadctl.errors import LogError
from quadctl.thrust_stand.table import NEWTONS_PER, Row, read_rows, thrust_column
from quadctl.vehicle import Vehicle
from quadctl.words import nearest

MIN_HEIGHTS = 4
"""One more than the numbers that a formula may have (two, and the thrust far from the ground)."""
SAME_HEIGHT = 0.05
"""Rotor radii: heights no further apart than this are repeats of one height."""
FAR = 8.0
"""Rotor radii: above this height no formula of the catalogue has an effect worth measuring."""
MOST_RATIO = 3.0
"""Mean thrust ratio above which it is taken for percent: hovers below one rotor radius reach about 1.5."""
LEAST_RATIO = 0.5
"""Mean thrust ratio below which it is taken for a gain (0.12 for 1.12)."""
LEAST_OF_WEIGHT = 0.02
"""Thrusts whose greatest is a smaller share of the weight are in another unit."""

THRUSTS = ("thrust_ratio", *(f"thrust_{unit}" for unit in NEWTONS_PER))
OPTIONAL = ("surface", "cant_deg", "dihedral_deg", "speed_m_s")
METRES_PER = {"cm": 0.01, "mm": 0.001}


class Point(NamedTuple):
    """One reading."""

    height_m: float
    """Height of the rotor plane above the ground."""
    thrust: float
    """Newtons of the whole vehicle (or of as many rotors as the bench has), or the ratio to the thrust far away."""
    surface: str = ""
    cant_deg: float = math.nan
    """Tilt of the rotors; nan: as in the vehicle file."""
    dihedral_deg: float = math.nan
    speed_m_s: float = 0.0


@dataclass(frozen=True)
class Measurement:
    """All readings of one table."""

    points: tuple[Point, ...]
    is_ratio: bool
    """True: thrusts are ratios to the thrust far from the ground; False: newtons, and that thrust is fitted."""

    @property
    def surfaces(self) -> tuple[str, ...]:
        return tuple(sorted({point.surface for point in self.points}))

    def height_groups(self, radius_m: float) -> list[list[int]]:
        """Indices of the repeats of each height, from the lowest up."""
        groups: list[list[int]] = []
        for i in sorted(range(len(self.points)), key=lambda i: self.points[i].height_m):
            above_m = self.points[i].height_m - self.points[groups[-1][0]].height_m if groups else math.inf
            if above_m > SAME_HEIGHT * radius_m:
                groups.append([])
            groups[-1].append(i)
        return groups


def read_measurement(path: Path, vehicle: Vehicle) -> Measurement:
    """The readings of a CSV: `height_m`, one of `THRUSTS`, and where known the columns of `OPTIONAL`.

    Raises
    ------
    LogError
        One sentence: the file, the line or column, the value and what was expected.
    """
    header, rows = read_rows(path, "reading")
    thrust = _checked_columns(path, header)
    measurement = Measurement(tuple(_point(row, thrust) for row in rows), thrust == "thrust_ratio")
    _check(measurement, vehicle, path)
    return measurement


def _checked_columns(path: Path, header: Sequence[str]) -> str:
    """The name of the column of thrust."""
    known = ("height_m", *THRUSTS, *OPTIONAL)
    for unit in METRES_PER:
        if f"height_{unit}" in header:
            raise LogError(f"{path}: has the column height_{unit}, expected height_m in metres")
    for column in header:
        if column not in known:
            hint = nearest(column, known) or f", expected some of: {', '.join(known)}"
            raise LogError(f"{path}: unknown column '{column}'{hint}")
        if header.count(column) > 1:
            raise LogError(f"{path}: has the column {column} twice, expected it once")
    expected = f"height_m (rotor plane above the ground) and one of {', '.join(THRUSTS)}"
    return thrust_column(path, header, "height_m", THRUSTS, expected)


def _point(row: Row, thrust: str) -> Point:
    height_m, measured = row.number("height_m"), row.number(thrust)
    if height_m <= 0.0:
        raise LogError(f"{row.where}: height_m is {height_m:g}, expected the rotors' height above the ground, above 0")
    if measured <= 0.0:
        raise LogError(f"{row.where}: {thrust} is {measured:g}, expected a thrust above 0")
    surface = row.cells.get("surface", "")
    if "surface" in row.cells and not surface:
        raise LogError(f"{row.where}: surface is empty, expected its name in every row or no such column")
    newtons = NEWTONS_PER.get(thrust.removeprefix("thrust_"), 1.0)
    tilt = row.number("cant_deg", math.nan), row.number("dihedral_deg", math.nan)
    return Point(height_m, newtons * measured, surface, *tilt, row.number("speed_m_s", 0.0))


def _check(measurement: Measurement, vehicle: Vehicle, path: Path) -> None:
    """Refuse what cannot be thrusts of `vehicle` near the ground."""
    points, radius_m = measurement.points, vehicle.rotor.radius_m
    if not points:
        raise LogError(f"{path}: holds no readings, expected {MIN_HEIGHTS} heights or more")
    lowest_m = min(point.height_m for point in points)
    if lowest_m > FAR * radius_m:
        unit = min(METRES_PER, key=lambda u: abs(math.log(METRES_PER[u] * lowest_m / radius_m)))
        raise LogError(
            f"{path}: the lowest height_m is {lowest_m:g}, {lowest_m / radius_m:.0f} rotor radii, where there is no "
            f"ground effect; expected metres, some below {FAR * radius_m:.2g}: are these {unit}?"
        )
    heights = len(measurement.height_groups(radius_m))
    if heights < MIN_HEIGHTS:
        only = "one height only" if heights == 1 else f"{heights} heights"
        raise LogError(f"{path}: holds {only}, expected {MIN_HEIGHTS} or more (better eight) to fit a curve")
    thrusts = [point.thrust for point in points]
    mean, most = sum(thrusts) / len(thrusts), max(thrusts)
    if measurement.is_ratio and mean > MOST_RATIO:
        raise LogError(f"{path}: thrust_ratio is {mean:.3g} on average: is it in percent? expected 1.12, not 112 or 12")
    if measurement.is_ratio and mean < LEAST_RATIO:
        raise LogError(
            f"{path}: thrust_ratio is {mean:.3g} on average, expected the thrust over that far from the ground (1.12), "
            "not its gain (0.12)"
        )
    if not measurement.is_ratio and not LEAST_OF_WEIGHT * vehicle.weight_n < most < 20.0 * vehicle.max_thrust_n:
        raise LogError(
            f"{path}: thrust reaches {most:.3g} N, where the vehicle weighs {vehicle.weight_n:.3g} N: expected newtons "
            "(or thrust_g, thrust_kg)"
        )
    if most - min(thrusts) < 1e-6 * most:
        raise LogError(f"{path}: thrust is {most:g} at every height, expected one that changes: is this the setpoint?")
