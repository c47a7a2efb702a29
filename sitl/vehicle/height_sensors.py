"""Barometer and range finder of the simulated vehicle, with hidden errors, and the height that leans on the barometer.

The estimator follows the barometer's error with a lag, in height and climb rate, as a complementary filter of second
order does whose other half is an accelerometer.
"""

import math
import random
from collections.abc import Callable, Sequence

from pydantic import Field, NonNegativeFloat

from quadctl.effects.sensor_error import SensorConditions, SensorError
from quadctl.frames import rotate, rotate_inverse
from quadctl.settings import Settings
from quadctl.sitl.vehicle.body import REST_HEIGHT_M, Motion
from quadctl.state import NAN, Vec3
from quadctl.vehicle import Vehicle

DAMPING = 0.7
WARM_S = 120.0
"""Time in which a barometer warms to 1/e."""
Correction = Callable[[Vec3, Vec3], float]
"""Height, m, that a firmware adds to the barometer's, by the velocities over ground and through the air, m/s, FRD."""


class Barometer(Settings):
    """The barometer of a simulated vehicle."""

    noise_m: NonNegativeFloat = 0.06
    """Standard deviation of a reading."""
    follow_rad_s: float = Field(default=1.0, ge=0.0, le=20.0)
    """Frequency with which the estimated height follows it; 0: the height is that of another sensor."""
    warming_k: float = 0.0
    """Temperature by which it warms up."""


class RangeFinder(Settings):
    """A range finder that looks down."""

    noise_m: NonNegativeFloat = 0.02
    most_m: float = Field(default=10.0, gt=0.0)
    """Distance beyond which it sees nothing."""


class HeightSensors:
    """Readings of the sensors of the height, and the error of the height that leans on the barometer."""

    def __init__(
        self,
        vehicle: Vehicle,
        errors: Sequence[SensorError],
        barometer: Barometer,
        range_finder: RangeFinder | None,
        wind_ne_m_s: tuple[float, float],
        seed: int,
    ) -> None:
        self._thrust_share = vehicle.rotor.thrust_n_per_rpm2 / vehicle.weight_n
        self._of_barometer = [error for error in errors if error.sensor == "barometer"]
        self._of_finder = [error for error in errors if error.sensor == "rangefinder"]
        self._barometer, self._finder, self._wind = barometer, range_finder, wind_ne_m_s
        self._random = random.Random(f"height sensors {seed}")
        self._first_m: float | None = None
        self.correction: Correction = lambda over_ground, through_air: 0.0
        self.height_error_m = 0.0
        """Error of the estimated height, up."""
        self.climb_error_m_s = 0.0
        self.baro_m = NAN
        """Reading of the barometer, above where it was at the begin, without the firmware's correction."""
        self.range_m = NAN
        """Distance along the body's axis down; NaN where the range finder sees nothing."""

    def update(self, motion: Motion, dt: float) -> None:
        """Read both at the motion of `dt` seconds later than the last one."""
        c = self._conditions(motion)
        error = sum(float(one.error_m(c)) for one in self._of_barometer)
        if self._first_m is None:  # the height is 0 where the estimator begins
            self._first_m = error
        error += self._random.gauss(0.0, self._barometer.noise_m) - self._first_m
        self.baro_m = -motion.position_ned_m[2] + error
        w = self._barometer.follow_rad_s
        if w > 0.0:
            north, east, down = motion.velocity_ned_m_s
            over_ground = rotate_inverse(motion.attitude, (north, east, down - self.climb_error_m_s))
            apart = error + self.correction(over_ground, c.velocity_body_m_s) - self.height_error_m
            self.climb_error_m_s += dt * w * w * apart
            self.height_error_m += dt * (self.climb_error_m_s + 2.0 * DAMPING * w * apart)
        if self._finder is not None:
            self.range_m = self._range(motion, c, self._finder)

    def _range(self, motion: Motion, c: SensorConditions, finder: RangeFinder) -> float:
        upright = rotate(motion.attitude, (0.0, 0.0, 1.0))[2]
        above = -motion.position_ned_m[2] + sum(float(one.error_m(c)) for one in self._of_finder)
        distance = above / max(upright, 0.2) + self._random.gauss(0.0, finder.noise_m)
        return max(distance, 0.0) if distance < finder.most_m else NAN

    def _conditions(self, motion: Motion) -> SensorConditions:
        north, east, down = motion.velocity_ned_m_s
        relative = (north - self._wind[0], east - self._wind[1], down)
        return SensorConditions(
            max(-motion.position_ned_m[2] - REST_HEIGHT_M, 0.0),
            rotate_inverse(motion.attitude, relative),
            motion.attitude,
            self._thrust_share * sum(rpm * rpm for rpm in motion.rotor_rpm),
            motion.time_s,
            self._barometer.warming_k * -math.expm1(-motion.time_s / WARM_S),
        )
