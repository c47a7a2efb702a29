"""Hidden truths of the rotation: a moment by the airspeed, other moments of inertia, a centre of mass that is off."""

import random
from typing import ClassVar

from quadctl.vehicle import Vehicle

from .world import HiddenBody, Instant, Truth


class StiffHubs(Truth):
    """The rotors' discs flap back in the airflow, and stiff blades hand the moment on to the hubs.

    In hover 1.1 mm of the thrust per m/s: a Crazyflie 2.1 has 0.8 in roll and 1.0 in pitch (NanoBench, Ullah & Baca
    2026). It grows with the rotor speed and not with the thrust.
    """

    family = "airspeed_moment"
    MM: ClassVar[float] = 1.1

    def act(self, now: Instant) -> None:
        u, v, _ = now.air_velocity
        turning = self.vehicle.weight_n * sum(now.rpm) / len(now.rpm) / self.hover_rpm
        lever_m = 1e-3 * self.MM * self.strength
        now.turn(-lever_m * turning * v, lever_m * turning * u, 0.0)


class OtherInertia(Truth):
    """Moments of inertia up to 20 % larger or smaller than those of the file, each by its own share."""

    nameless = True

    def __init__(self, vehicle: Vehicle, strength: float, chance: random.Random) -> None:
        super().__init__(vehicle, strength, chance)
        self.shares = [chance.choice((-1.0, 1.0)) * chance.uniform(0.1, 0.2) * strength for _ in range(3)]

    def enter(self, body: HiddenBody) -> None:
        body.weigh_moments([1.0 + share for share in self.shares])


class OffCentre(Truth):
    """The centre of mass lies 4 mm off the middle: a battery that slipped in its strap."""

    nameless = True

    def __init__(self, vehicle: Vehicle, strength: float, chance: random.Random) -> None:
        super().__init__(vehicle, strength, chance)
        self.forward_m, self.right_m = (chance.choice((-1.0, 1.0)) * 0.0028 * strength for _ in range(2))

    def act(self, now: Instant) -> None:
        lift = sum(now.thrusts)
        now.turn(self.right_m * lift, -self.forward_m * lift, 0.0)
