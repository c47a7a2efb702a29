"""Wind: the air moves over the ground, and whatever the vehicle feels of the air it feels of the moving air."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from quadctl.effects.base import Conditions, Effect, parameter
from quadctl.frames import euler_from_quaternion
from quadctl.numeric import Number, Vector
from quadctl.vehicle import Vehicle

LEAST_M_S = 0.3
"""Slower air than this moves in any hall."""
TURNED_DEG = 60.0
"""Difference of headings that tells a wind from a tilted thrust."""
TILT_M_S2 = 0.4
"""Largest acceleration taken for that of a tilted thrust: a tilt of 2.3 degrees."""


@dataclass(frozen=True)
class SteadyWind(Effect):
    """A horizontal wind of constant velocity.

    The effects of the air that the model holds (drag, inflow, translational lift) feel the velocity relative to the
    air. Where the model holds no drag, the wind brings one, F = -m drag (u, v, w) in body axes, by which alone it is
    felt in hover.
    """

    name: ClassVar[str] = "wind.steady"
    source: ClassVar[str] = "Galilean relativity; drag as in Faessler et al. 2018, eq. 2-3"
    depends_on: ClassVar[tuple[str, ...]] = ()
    physics: ClassVar[str] = (
        "A steady wind: the moving air drags on the vehicle, a push with its own direction over ground."
    )
    distinguished_by: ClassVar[str] = "headings that differ: a tilted thrust turns with the body, the wind does not"
    mission: ClassVar[str] = "missions/headings.yaml"
    stands_back_for: ClassVar[tuple[str, ...]] = ("rotor_drag", "body_drag")
    not_for_flight: ClassVar[str] = "the wind of another day is not that of today"

    north_m_s: float = parameter(0.5, -25.0, 25.0, "m/s", "velocity of the air toward north")
    east_m_s: float = parameter(0.5, -25.0, 25.0, "m/s", "velocity of the air toward east")
    drag: float = parameter(0.3, 0.0, 3.0, "1/s", "deceleration per airspeed, where the model holds no drag")

    @classmethod
    def starts(cls, flights: Sequence[Conditions], vehicle: Vehicle) -> Sequence[Effect]:
        """Initial guesses from four directions: at zero wind the drag has no gradient."""
        return [cls(north, east) for north, east in ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0))]

    def negligible(self) -> bool:
        return math.hypot(self.north_m_s, self.east_m_s) < LEAST_M_S

    def distinct(self, flights: Sequence[Conditions], vehicle: Vehicle) -> bool:
        """True with different headings, or with a push larger than a tilted thrust would give."""
        headings = [np.degrees(np.unwrap(euler_from_quaternion(c.attitude)[2])) for c in flights]
        turned = max(float(h.max()) for h in headings) - min(float(h.min()) for h in headings) > TURNED_DEG
        return turned or self.drag * math.hypot(self.north_m_s, self.east_m_s) > TILT_M_S2

    def standing_back(self) -> Self:
        """The same wind without its own drag, beside an effect that models the drag."""
        return replace(self, drag=0.0)

    def wind_ned_m_s(self, c: Conditions) -> Vector:
        return self.north_m_s, self.east_m_s, 0.0

    def force(self, total_thrust_n: Number, c: Conditions, vehicle: Vehicle) -> Vector:
        u, v, w = c.velocity_body_m_s
        push = -vehicle.mass_kg * self.drag
        return push * u, push * v, push * w
