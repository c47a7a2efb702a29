"""Measured points of a thrust stand, one for each throttle step: as CSV, and checked for plausibility."""

import csv
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple, TextIO

from quadctl.errors import LogError
from quadctl.state import NAN
from quadctl.thrust_stand.table import NEWTONS_PER, Row, read_rows, thrust_column
from quadctl.vehicle import Vehicle
from quadctl.words import nearest

THRUSTS = tuple(f"thrust_{unit}" for unit in NEWTONS_PER)
MIN_POINTS = 3
"""One more than the two numbers that a line has: what fits exactly says nothing about how well."""
DROP = 0.05
"""Share of the greatest thrust or rotor speed: a larger fall while the throttle rises is no noise."""
NOISE = 0.2
"""Share of the greatest values of the vehicle's rotor from which `DROP` counts, because idling motors are noisy."""
WRONG_UNIT = 20.0
"""A thrust so many times the vehicle's greatest is in another unit: grams for newtons are 102."""


class Point(NamedTuple):
    """The means over one throttle step; nan where nothing is known."""

    throttle: float
    """On the scale of the flight's throttle target, 0..1."""
    rpm: float
    thrust_n: float
    """Thrust of the one rotor."""
    voltage_v: float = NAN
    current_a: float = NAN


class PointWriter:
    """Writes each point as it is measured, so that an interrupted run is not lost."""

    def __init__(self, path: Path) -> None:
        """Raises LogError when the file is there already or cannot be written."""
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file: TextIO = path.open("x", encoding="utf-8", newline="")
        except FileExistsError:
            raise LogError(f"{path}: is there already, expected a new file: no measurement is written over") from None
        except OSError as error:
            raise LogError(f"{path}: cannot be written ({error.strerror})") from None
        self._csv = csv.writer(self._file)
        self._csv.writerow(Point._fields)
        self._file.flush()

    def write(self, point: Point) -> None:
        self._csv.writerow([f"{value:.6g}" for value in point])
        self._file.flush()

    def close(self) -> None:
        self._file.close()


def read_points(path: Path) -> list[Point]:
    """The points of a CSV: `throttle`, `thrust_n` (or `thrust_g`, `thrust_kg`), and where known `rpm`, `voltage_v`,
    `current_a`.

    Raises
    ------
    LogError
        One sentence: the file, the line, the value and what was expected.
    """
    header, rows = read_rows(path, "throttle step")
    known = (*Point._fields, *THRUSTS)
    if "throttle" not in header or not any(thrust in header for thrust in THRUSTS):
        for column in header:
            if column not in known and (hint := nearest(column, known)):
                raise LogError(f"{path}: unknown column '{column}'{hint}")
    thrust = thrust_column(
        *(path, header, "throttle", THRUSTS),
        "throttle, rpm, thrust_n (or thrust_g, thrust_kg) and, where known, voltage_v and current_a",
    )
    return [_point(row, thrust) for row in rows]


def check_points(points: Sequence[Point], vehicle: Vehicle, source: str) -> None:
    """Raises LogError with one sentence when these cannot be measurements of one of the vehicle's rotors."""
    throttles = {round(point.throttle, 6) for point in points}
    if len(throttles) < MIN_POINTS:
        raise LogError(
            f"{source}: holds {len(throttles)} throttle steps, expected {MIN_POINTS} or more (better eight) to fit"
        )
    check_plausible(points, vehicle, source)


def check_plausible(points: Sequence[Point], vehicle: Vehicle, source: str) -> None:
    """As `check_points`, for as many points as there are so far."""
    if not points:
        return
    most_n, expected_n = max(point.thrust_n for point in points), vehicle.throttle.max_thrust_per_rotor_n
    if most_n > WRONG_UNIT * expected_n:
        raise LogError(
            f"{source}: thrust reaches {most_n:.3g} N, {most_n / expected_n:.0f} times the {expected_n:g} N of the "
            "vehicle's rotor: are these grams (thrust_g, or --unit g)?"
        )
    full = max(point.throttle for point in points) > 0.5
    if full and most_n < expected_n / WRONG_UNIT:
        raise LogError(
            f"{source}: thrust stays below {max(most_n, 0.0):.3g} N, where the vehicle's rotor gives up to "
            f"{expected_n:g} N: expected newtons (or thrust_g, thrust_kg, --unit), and a motor that turns"
        )
    by_throttle = _means(points)
    thrusts, speeds = [point.thrust_n for point in by_throttle], [point.rpm for point in by_throttle]
    _check_rises(by_throttle, thrusts, "thrust", "N", NOISE * expected_n, source)
    expected_rpm = math.sqrt(expected_n / vehicle.rotor.thrust_n_per_rpm2)
    _check_rises(by_throttle, speeds, "the rotor speed", "rpm", NOISE * expected_rpm, source)


def _means(points: Iterable[Point]) -> list[Point]:
    """One point for each throttle, rising: repeated steps are averaged."""
    groups: dict[float, list[Point]] = {}
    for point in sorted(points):
        groups.setdefault(round(point.throttle, 6), []).append(point)
    return [Point(*(sum(values) / len(values) for values in zip(*group, strict=True))) for group in groups.values()]


def _check_rises(
    points: Sequence[Point], values: Sequence[float], what: str, unit: str, least: float, source: str
) -> None:
    known = [(point.throttle, value) for point, value in zip(points, values, strict=True) if math.isfinite(value)]
    for i in range(1, len(known)):
        (before, was), (now, value) = known[i - 1], known[i]
        if was - value > DROP * max(least, *(v for _, v in known)):
            raise LogError(
                f"{source}: {what} falls from {was:.4g} {unit} at throttle {before:.3g} to {value:.4g} {unit} at "
                f"{now:.3g}, expected it to rise: check the scale's sign, the supply and the columns"
            )


def _point(row: Row, thrust: str) -> Point:
    throttle, rpm = row.number("throttle"), row.number("rpm", NAN)
    if not 0.0 <= throttle <= 1.0:
        raise LogError(f"{row.where}: throttle is {throttle:g}, expected a share from 0 to 1 (not percent)")
    if rpm < 0.0:
        raise LogError(f"{row.where}: rpm is {rpm:g}, expected 0 or more")
    thrust_n = NEWTONS_PER[thrust.removeprefix("thrust_")] * row.number(thrust)
    return Point(throttle, rpm, thrust_n, row.number("voltage_v", NAN), row.number("current_a", NAN))
