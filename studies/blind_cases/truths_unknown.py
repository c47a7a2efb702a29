"""Hidden truths that no catalogue has."""

import math
import random

from quadctl.vehicle import Vehicle

from .world import Instant, Truth


class Updraft(Truth):
    """Air rises at one place, as over a vent: it lifts by 0.8 m/s^2 there, a Gaussian 0.8 m wide."""

    family = ""

    def __init__(self, vehicle: Vehicle, strength: float, chance: random.Random) -> None:
        super().__init__(vehicle, strength, chance)
        toward = chance.choice((0.0, 0.5, 1.0, 1.5)) * math.pi
        self.place = (1.7 * math.cos(toward), 1.7 * math.sin(toward))

    def act(self, now: Instant) -> None:
        north, east = now.position[0] - self.place[0], now.position[1] - self.place[1]
        lift = 0.8 * math.exp(-0.5 * (north * north + east * east) / 0.8**2)
        now.push_ned(0.0, 0.0, -self.strength * self.vehicle.mass_kg * lift)


class Resonance(Truth):
    """At one rotor speed, 12 % above hover, the frame resonates and each rotor loses 20 % of its thrust."""

    family = ""

    def act(self, now: Instant) -> None:
        for i, rpm in enumerate(now.rpm):
            off = (rpm / self.hover_rpm - 1.12) / 0.03
            now.thrusts[i] *= 1.0 - self.strength * 0.2 * math.exp(-0.5 * off * off)


class Magnet(Truth):
    """A pull toward a point in the room, 0.9 m/s^2 at the most and falling off with the distance."""

    family = ""

    def __init__(self, vehicle: Vehicle, strength: float, chance: random.Random) -> None:
        super().__init__(vehicle, strength, chance)
        self.place = (chance.uniform(-0.5, 0.5), chance.uniform(-0.5, 0.5), -1.3)

    def act(self, now: Instant) -> None:
        north, east, down = (p - x for p, x in zip(self.place, now.position, strict=True))
        size = self.strength * 1.8 * self.vehicle.mass_kg / (1.0 + north * north + east * east + down * down)
        now.push_ned(size * north, size * east, size * down)
