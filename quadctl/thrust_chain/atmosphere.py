"""Density of the air as ArduPilot takes it for its compensation of the thrust: three formulas, by its version.

Source: `AP_Baro::get_EAS2TAS` up to Copter 4.5, `AP_Baro::_get_EAS2TAS` and `AP_Baro_atmosphere.cpp` since 4.6.
"""

import re
from enum import StrEnum
from typing import NamedTuple, TypeAlias

import numpy as np

from quadctl.numeric import Number

Version: TypeAlias = tuple[int, int]
"""Major and minor number of a firmware."""

SEA_LEVEL_DENSITY_KG_M3, SEA_LEVEL_PA, LAPSE_K_M, ICE_POINT_K = 1.225, 101325.0, 0.0065, 273.15
GAS_CONSTANT_J_KG_K = 287.26
"""Gas constant of ArduPilot outside of its standard atmosphere."""
STANDARD_SINCE: Version = (4, 6)
"""Version since which the density is that of the standard atmosphere, where the board has room for it."""
SEA_LEVEL_K, DENSITY_EXPONENT, EARTH_RADIUS_M = 288.15, 9.80665 / (0.0065 * 287.053072) - 1.0, 6356766.0
"""Temperature, and exponent of the density over it, in the lowest layer of the 1976 U.S. Standard Atmosphere."""
PRESSURE_EXPONENT = 0.190259
"""Exponent of the temperature over the pressure in ArduPilot's barometric height."""
LEAST_SPAN_PA = 5.0
"""Least change of the pressure, that of 40 cm, whose height tells the temperature that the firmware takes."""
LEAST_DIFFERENCE = 0.004
"""Least relative difference between two temperatures that such a height tells apart."""


class Atmosphere(StrEnum):
    """Formula by which a firmware takes the density of the air."""

    GROUND = "ground"
    """Pressure and temperature, which falls with the height above the ground: before 4.6."""
    ASSUMED = "assumed"
    """The same, as the version is not known."""
    SEA_LEVEL = "sea level"
    """Pressure and temperature, which falls with the altitude above the sea from that at the ground: since 4.6, on
    boards whose estimator has single precision."""
    STANDARD = "standard"
    """Altitude above the sea alone, by the standard atmosphere: since 4.6, on the other boards and in SITL."""


class Air(NamedTuple):
    """Measurements of the air; nan where there are none."""

    pressure_pa: Number
    ground_temperature_c: Number
    height_m: Number
    """Above the ground, by the barometer."""
    altitude_m: Number
    """Above the sea."""


def atmosphere_of(version: Version | None, is_standard: bool) -> Atmosphere:
    """Formula of a firmware; `is_standard`: since 4.6 its board takes the standard atmosphere."""
    if version is None:
        return Atmosphere.ASSUMED
    if version < STANDARD_SINCE:
        return Atmosphere.GROUND
    return Atmosphere.STANDARD if is_standard else Atmosphere.SEA_LEVEL


def version_in(text: str) -> Version | None:
    """Version in a text such as `ArduCopter V4.7.0-dev (d0cf3149)`; None where it holds none."""
    found = re.search(r"(?:Copter|Plane|Rover|Sub|Heli)\s+V(\d+)\.(\d+)", text)
    return (int(found[1]), int(found[2])) if found else None


def version_of_number(number: int) -> Version | None:
    """Version in the number of AUTOPILOT_VERSION (flight_sw_version); None where it is 0."""
    return (number >> 24, number >> 16 & 0xFF) if number else None


def air_density_ratio(air: Air, atmosphere: Atmosphere) -> Number:
    """Density of the air over 1.225 kg/m³, as the firmware takes it."""
    if atmosphere is Atmosphere.STANDARD:
        return standard_density_ratio(air.altitude_m)
    below_m = air.altitude_m if atmosphere is Atmosphere.SEA_LEVEL else air.height_m
    kelvin = air.ground_temperature_c + ICE_POINT_K - LAPSE_K_M * below_m
    return air.pressure_pa / (GAS_CONSTANT_J_KG_K * kelvin) / SEA_LEVEL_DENSITY_KG_M3


def standard_density_ratio(altitude_m: Number) -> Number:
    """Density ratio of the 1976 U.S. Standard Atmosphere up to 11 km."""
    geopotential_m = EARTH_RADIUS_M * altitude_m / (EARTH_RADIUS_M + altitude_m)
    return (1.0 - LAPSE_K_M * geopotential_m / SEA_LEVEL_K) ** DENSITY_EXPONENT


def pressure_altitude_m(pressure_pa: Number) -> Number:
    """Altitude above the sea at which the standard atmosphere has this pressure."""
    return SEA_LEVEL_K / LAPSE_K_M * (1.0 - (pressure_pa / SEA_LEVEL_PA) ** PRESSURE_EXPONENT)


def takes_standard(air: Air) -> bool:
    """Tell from the barometric height in a log whether its board takes the standard atmosphere.

    Where it does, the height over the logarithm of the pressure has the slope of the standard temperature, else that of
    the temperature at the ground. Where the log does not tell, as both are alike or the pressure hardly changes, it
    counts as taken: most boards do.
    """
    known = np.isfinite(air.pressure_pa) & np.isfinite(air.height_m) & (np.asarray(air.pressure_pa) > 0.0)
    pressure_pa, height_m = np.asarray(air.pressure_pa)[known], np.asarray(air.height_m)[known]
    if not len(pressure_pa) or np.ptp(pressure_pa) < LEAST_SPAN_PA:
        return True
    slope_m = np.polyfit(np.log(pressure_pa), height_m, 1)[0]
    seen_k = -slope_m * LAPSE_K_M / PRESSURE_EXPONENT
    ground_k = float(np.nanmedian(air.ground_temperature_c)) + ICE_POINT_K
    standard_k = SEA_LEVEL_K * float(np.median(pressure_pa) / SEA_LEVEL_PA) ** PRESSURE_EXPONENT
    if not abs(ground_k - standard_k) > 2.0 * LEAST_DIFFERENCE * standard_k:
        return True
    return bool(abs(seen_k - standard_k) < abs(seen_k - ground_k))
