"""Wind: the air moves over the ground, and whatever the vehicle feels of the air it feels of the moving air."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from quadctl.effects.base import Conditions, Effect, parameter
from quadctl.effects.body_drag import are_possible_areas
from quadctl.effects.per_flight import PerFlight, own_name, with_own_values
from quadctl.frames import euler_from_quaternion, quaternion_from_euler, rotate_inverse
from quadctl.numeric import Number, Vector, sqrt
from quadctl.vehicle import Vehicle

LEAST_M_S = 0.3
"""Slower air than this moves in any hall."""
LEAST_PUSH_M_S2 = 0.05
"""Least acceleration by a wind: a floor that slopes by 0.3 degrees in the frame of the log gives as much."""
LEAST_DRAG_PER_S = 0.04
"""Least drag of a multirotor; published coefficients are 0.1 to 0.6 1/s."""
ANOTHER_DAY = "the wind of another day is not that of today"
TURNED_DEG = 60.0
"""Difference of headings that tells a wind from a tilted thrust."""
TILT_M_S2 = 0.4
"""Largest acceleration taken for that of a tilted thrust: a tilt of 2.3 degrees."""


class _Wind(Effect):
    """A horizontal wind of constant velocity, with a drag of its own where the model holds none.

    The effects of the air that the model holds (drag, inflow, translational lift) feel the velocity relative to the
    air. In hover a wind is felt by its drag alone.
    """

    depends_on: ClassVar[tuple[str, ...]] = ()
    physics: ClassVar[str] = (
        "A steady wind: the moving air drags on the vehicle, a push with its own direction over ground."
    )
    distinguished_by: ClassVar[str] = "headings that differ: a tilted thrust turns with the body, the wind does not"
    mission: ClassVar[str] = "missions/headings.yaml"
    essential: ClassVar[tuple[str, ...]] = ("north_m_s", "east_m_s")
    stands_back_for: ClassVar[tuple[str, ...]] = ("rotor_drag", "body_drag")
    not_for_flight: ClassVar[str] = ANOTHER_DAY

    north_m_s: float
    east_m_s: float

    def of_flight_m_s(self, flight: int) -> tuple[float, float]:
        """Velocity of the air toward north and east in the flight with this number."""
        return self.north_m_s, self.east_m_s

    def push_m_s2(self, c: Conditions, vehicle: Vehicle) -> float:
        """Acceleration of the vehicle by the drag of the wind in hover, at the heading of a flight."""
        north, east = self.of_flight_m_s(c.flight)
        heading = float(np.median(np.unwrap(euler_from_quaternion(c.attitude)[2])))
        level = quaternion_from_euler(0.0, 0.0, heading)
        x, y, _ = self.force(0.0, Conditions(1.0, rotate_inverse(level, (-north, -east, 0.0)), level), vehicle)
        return math.hypot(x, y) / vehicle.mass_kg

    @classmethod
    def starts(cls, flights: Sequence[Conditions], vehicle: Vehicle) -> Sequence[Effect]:
        """Initial guesses from four directions: at zero wind the drag has no gradient."""
        signs = ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0))
        return [cls.from_values({"north_m_s": north, "east_m_s": east}, cls.name) for north, east in signs]

    def negligible(self) -> bool:
        return math.hypot(self.north_m_s, self.east_m_s) < LEAST_M_S

    def believable(self, flights: Sequence[Conditions], vehicle: Vehicle) -> bool:
        """True for a push that is more than that of an uneven floor, and not that of a storm on a vehicle without drag,
        nor of air that hardly moves, which is a drag; beside a drag of the model the wind has none of its own."""
        if self == self.standing_back():
            return True
        if self.negligible():
            return False
        strongest = max(flights, key=lambda c: math.hypot(*self.of_flight_m_s(c.flight)))
        speed_m_s = math.hypot(*self.of_flight_m_s(strongest.flight))
        return self.push_m_s2(strongest, vehicle) > max(LEAST_PUSH_M_S2, LEAST_DRAG_PER_S * speed_m_s)

    def distinct(self, flights: Sequence[Conditions], vehicle: Vehicle) -> bool:
        """True with different headings, or with a push larger than a tilted thrust would give."""
        return _turned_deg(flights) > TURNED_DEG or max(self.push_m_s2(c, vehicle) for c in flights) > TILT_M_S2

    def wind_ned_m_s(self, c: Conditions) -> Vector:
        return *self.of_flight_m_s(c.flight), 0.0


def _turned_deg(flights: Sequence[Conditions]) -> float:
    """Difference of the headings within these flights."""
    headings = [np.degrees(np.unwrap(euler_from_quaternion(c.attitude)[2])) for c in flights]
    return max(float(h.max()) for h in headings) - min(float(h.min()) for h in headings)


@dataclass(frozen=True)
class SteadyWind(_Wind):
    """A steady wind with a drag that is linear in the airspeed: F = -m (drag u, drag v, drag_z w) in body axes."""

    name: ClassVar[str] = "wind.steady"
    source: ClassVar[str] = "Galilean relativity; drag as in Faessler et al. 2018, eq. 2-3"

    north_m_s: float = parameter(0.5, -25.0, 25.0, "m/s", "velocity of the air toward north")
    east_m_s: float = parameter(0.5, -25.0, 25.0, "m/s", "velocity of the air toward east")
    drag: float = parameter(0.3, 0.0, 3.0, "1/s", "deceleration per airspeed, where the model holds no drag")
    drag_z: float = parameter(0.0, 0.0, 3.0, "1/s", "the same along body z")

    def standing_back(self) -> Self:
        """The same wind without its own drag, beside an effect that models the drag."""
        return replace(self, drag=0.0, drag_z=0.0)

    def force(self, total_thrust_n: Number, c: Conditions, vehicle: Vehicle) -> Vector:
        u, v, w = c.velocity_body_m_s
        m = vehicle.mass_kg
        return -m * self.drag * u, -m * self.drag * v, -m * self.drag_z * w


@dataclass(frozen=True)
class WindOfBothDrags(_Wind):
    """A steady wind with a drag of rotors and frame: F = -(m drag + 1/2 rho |v| area) (u, v) in body axes, and the same
    along z."""

    name: ClassVar[str] = "wind.both_drags"
    source: ClassVar[str] = (
        "Galilean relativity; Hattenberger et al. 2022: rotors drag linearly, the frame quadratically"
    )

    north_m_s: float = parameter(0.5, -25.0, 25.0, "m/s", "velocity of the air toward north")
    east_m_s: float = parameter(0.5, -25.0, 25.0, "m/s", "velocity of the air toward east")
    drag: float = parameter(0.2, 0.0, 3.0, "1/s", "deceleration per airspeed, where the model holds no drag")
    drag_z: float = parameter(0.0, 0.0, 3.0, "1/s", "the same along body z")
    area_m2: float = parameter(0.0, 0.0, 1.0, "m^2", "drag area, seen from the front and from the side")
    area_z_m2: float = parameter(0.0, 0.0, 1.0, "m^2", "drag area seen from above")

    def believable(self, flights: Sequence[Conditions], vehicle: Vehicle) -> bool:
        areas_m2 = (self.area_m2, self.area_z_m2)
        return are_possible_areas(areas_m2, vehicle) and super().believable(flights, vehicle)

    def standing_back(self) -> Self:
        """The same wind without its own drag, beside an effect that models the drag."""
        return replace(self, drag=0.0, drag_z=0.0, area_m2=0.0, area_z_m2=0.0)

    def force(self, total_thrust_n: Number, c: Conditions, vehicle: Vehicle) -> Vector:
        u, v, w = c.velocity_body_m_s
        m = vehicle.mass_kg
        half = 0.5 * vehicle.air_density_kg_m3 * sqrt(u * u + v * v + w * w)
        level, upright = m * self.drag + half * self.area_m2, m * self.drag_z + half * self.area_z_m2
        return -level * u, -level * v, -upright * w


@dataclass(frozen=True)
class WindOfEachFlight(PerFlight, WindOfBothDrags):
    """A steady wind as `wind.both_drags`, with a velocity of its own for each flight after the first: `north_2_m_s` is
    that of the second flight."""

    name: ClassVar[str] = "wind.each_flight"
    physics: ClassVar[str] = "A wind that is steady in each flight, and not the same in all of them."
    per_flight: ClassVar[tuple[str, ...]] = ("north_m_s", "east_m_s")
    only_of_several_flights: ClassVar[bool] = True

    @classmethod
    def starts(cls, flights: Sequence[Conditions], vehicle: Vehicle) -> Sequence[Effect]:
        """The guesses of a wind that is the same in all flights, for each flight by itself."""
        numbers = [c.flight for c in flights[1:]]
        kind = with_own_values(cls.plain(), numbers)
        found = []
        for start in WindOfBothDrags.starts(flights, vehicle):
            common = start.values()
            own = {own_name(name, number): common[name] for name in cls.per_flight for number in numbers}
            found.append(kind(**common, **own))
        return found

    def of_flight_m_s(self, flight: int) -> tuple[float, float]:
        return self.of_flight("north_m_s", flight), self.of_flight("east_m_s", flight)

    def negligible(self) -> bool:
        return all(math.hypot(*self.of_flight_m_s(number)) < LEAST_M_S for number in (1, *self.numbers))

    def distinct(self, flights: Sequence[Conditions], vehicle: Vehicle) -> bool:
        """True where one flight by itself tells a wind from a tilted thrust (see `SteadyWind`)."""
        return any(super(WindOfEachFlight, self).distinct([c], vehicle) for c in flights)


@dataclass(frozen=True)
class Push(Effect):
    """A constant force over ground, F = m (north, east, 0): a wind on a vehicle that is slow beside it.

    Flights that hover tell the product of the wind and the drag, and neither of the two.
    """

    name: ClassVar[str] = "wind.push"
    source: ClassVar[str] = "Galilean relativity; drag of a speed that is small beside the wind's"
    depends_on: ClassVar[tuple[str, ...]] = ()
    physics: ClassVar[str] = (
        "A steady wind on a vehicle that moves little: a push with its own direction over ground. Only the product "
        "of wind speed and drag is identified."
    )
    distinguished_by: ClassVar[str] = "headings that differ, and runs as fast as the wind, which tell its speed"
    mission: ClassVar[str] = "missions/headings.yaml"
    essential: ClassVar[tuple[str, ...]] = ("north_m_s2", "east_m_s2")
    not_for_flight: ClassVar[str] = ANOTHER_DAY

    north_m_s2: float = parameter(0.0, -8.0, 8.0, "m/s^2", "acceleration toward north")
    east_m_s2: float = parameter(0.0, -8.0, 8.0, "m/s^2", "acceleration toward east")

    def negligible(self) -> bool:
        return math.hypot(self.north_m_s2, self.east_m_s2) < LEAST_PUSH_M_S2

    def believable(self, flights: Sequence[Conditions], vehicle: Vehicle) -> bool:
        """True for more than a frame that is askew gives: it has a part of the weight to the side, whatever the
        heading."""
        return math.hypot(self.north_m_s2, self.east_m_s2) > TILT_M_S2

    def force(self, total_thrust_n: Number, c: Conditions, vehicle: Vehicle) -> Vector:
        m = vehicle.mass_kg
        return rotate_inverse(c.attitude, (m * self.north_m_s2, m * self.east_m_s2, 0.0))
