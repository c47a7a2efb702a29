"""Errors of a range finder that looks down: where it sits, and where it points."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from quadctl.effects.base import parameter
from quadctl.effects.sensor_error import SensorConditions, SensorError
from quadctl.frames import rotate_inverse
from quadctl.numeric import Number


@dataclass(frozen=True)
class MountingError(SensorError):
    """The range finder sits above or below the body's origin, points to another side than down, or has a scale error.

    The error is that of the distance times the cosine of the tilt, to first order in the angles.
    """

    name: ClassVar[str] = "rangefinder.mounting"
    sensor: ClassVar[str] = "rangefinder"
    source: ClassVar[str] = "geometry of a beam that meets a flat floor"
    formula: ClassVar[str] = r"\Delta h = a + s h + h (\tan\theta \, \delta_\theta - \tan\phi \, \delta_\phi)"
    physics: ClassVar[str] = "A range finder that is tilted on the body reads too far where the vehicle leans that way."
    distinguished_by: ClassVar[str] = "leaning to all sides at a height that motion capture or GPS measures"
    mission: ClassVar[str] = "missions/barometer_runs.yaml"

    offset_m: float = parameter(0.0, -2.0, 2.0, "m", "distance above the point that touches the ground")
    scale: float = parameter(0.0, -0.5, 0.5, "", "share by which it reads too far")
    roll_rad: float = parameter(0.0, -0.5, 0.5, "rad", "angle by which the beam is turned about the body's x axis")
    pitch_rad: float = parameter(0.0, -0.5, 0.5, "rad", "angle by which the beam is turned about the body's y axis")

    def error_m(self, c: SensorConditions) -> Number:
        x, y, z = rotate_inverse(c.attitude, (0.0, 0.0, 1.0))  # the vertical in the body
        down = np.maximum(z, 0.2)
        leaning = self.pitch_rad * -x / down + self.roll_rad * y / down
        return self.offset_m + c.height_m * (self.scale + leaning)
