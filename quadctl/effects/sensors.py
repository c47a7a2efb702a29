"""The errors of height sensors that the project knows, by name. A new one is one class in one file and a line here."""

from quadctl.effects.barometer import AirspeedError, DriftError, GroundError, ThrottleError
from quadctl.effects.rangefinder import MountingError
from quadctl.effects.sensor_error import SensorError

SENSOR_ERRORS: dict[str, type[SensorError]] = {
    error.name: error for error in (AirspeedError, GroundError, ThrottleError, DriftError, MountingError)
}
