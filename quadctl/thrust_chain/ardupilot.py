"""ArduPilot Copter: angle boost, compensation of voltage and air density, curve of the motors, spin limits.

Sources: `AC_AttitudeControl_Multi::get_throttle_boosted`, `Thrust_Linearization` (AP_Motors; before 4.5 part of
`AP_MotorsMulticopter`) of Copter 4.5, whose recorded outputs follow these formulas to 0.2 %; the density of the air is
that of `atmosphere`.
"""

import math

from quadctl.numeric import Number, clip, known_or, maximum
from quadctl.thrust_chain.atmosphere import Atmosphere
from quadctl.thrust_chain.chain import (
    TABLE_TILT_DEG,
    Addition,
    Ambient,
    Parameters,
    ThrustChain,
    bent,
    said,
    share,
    unbent,
)

BOOST = "ATC_ANGLE_BOOST"
CURVE = ("MOT_THST_EXPO", "MOT_SPIN_MIN", "MOT_SPIN_MAX")
"""Parameters of the curve from thrust to output."""
VOLTAGE = ("MOT_BAT_VOLT_MAX", "MOT_BAT_VOLT_MIN")
"""Parameters of the voltage compensation; a MOT_BAT_VOLT_MAX of 0 switches it off."""
DEFAULT_CURVE = {"MOT_THST_EXPO": 0.65, "MOT_SPIN_MIN": 0.15, "MOT_SPIN_MAX": 0.95}
LEAST_COS_TILT = 0.5
"""Cosine of the tilt up to which all versions divide by the cosine: beyond 60 degrees they differ."""
LEAST_VOLTAGE_SHARE = 0.6
"""MOT_BAT_VOLT_MIN counts as at least this share of MOT_BAT_VOLT_MAX."""
DENSITY_RATIOS = (0.5, 1.25)
"""Range to which the density ratio is limited."""
ATMOSPHERES = {
    Atmosphere.GROUND: "by pressure and temperature",
    Atmosphere.ASSUMED: "by pressure and temperature, as before version 4.6, as the version is not told",
    Atmosphere.SEA_LEVEL: "by pressure and temperature, which falls with the altitude above the sea",
    Atmosphere.STANDARD: "by the standard atmosphere at its altitude above the sea",
}
"""Words for the formula of the density."""


def angle_boost(cos_tilt: Number, parameters: Parameters) -> Number:
    """Factor on the thrust at this cosine of the tilt; 1 where ATC_ANGLE_BOOST is 0 or not known."""
    if not parameters.get(BOOST, 0.0):
        return 1.0
    return 1.0 / clip(cos_tilt, LEAST_COS_TILT, 1.0)


def knows_curve(parameters: Parameters) -> bool:
    """True where the parameters of the curve are known and possible."""
    if any(name not in parameters for name in CURVE):
        return False
    bend, lowest, highest = (parameters[name] for name in CURVE)
    return -1.0 <= bend <= 1.0 and 0.0 <= lowest < highest <= 1.0


def compensates_voltage(parameters: Parameters) -> bool:
    """True where the parameters of the voltage compensation are known and switch it on."""
    if any(name not in parameters for name in VOLTAGE):
        return False
    highest, lowest = (parameters[name] for name in VOLTAGE)
    return highest > 0.0 and lowest < highest


def voltage_ratio(battery_v: Number, parameters: Parameters) -> Number:
    """Voltage of the battery over MOT_BAT_VOLT_MAX, as the compensation sees it; 1 without a compensation."""
    if not compensates_voltage(parameters):
        return 1.0
    highest, lowest = (parameters[name] for name in VOLTAGE)
    return known_or(clip(battery_v / highest, max(lowest / highest, LEAST_VOLTAGE_SHARE), 1.0), 1.0)


def thrust_of_output(output: Number, parameters: Parameters, ambient: Ambient) -> Number:
    """Thrust that the firmware means by an output; the output itself where the curve is not known.

    The motor's thrust is the curve of output times voltage, times the density of the air.
    """
    if not knows_curve(parameters):
        return output
    bend, lowest, highest = (parameters[name] for name in CURVE)
    actual = share((output - lowest) / (highest - lowest)) * voltage_ratio(ambient.battery_v, parameters)
    return bent(actual, bend) * _density_ratio(ambient)


def output_of_thrust(thrust: Number, parameters: Parameters, ambient: Ambient) -> Number:
    """Output that the firmware gives a motor for a thrust."""
    if not knows_curve(parameters):
        return thrust
    bend, lowest, highest = (parameters[name] for name in CURVE)
    actual = unbent(maximum(thrust, 0.0) / _density_ratio(ambient), bend)
    return lowest + (highest - lowest) * share(actual / voltage_ratio(ambient.battery_v, parameters))


def additions(hover: float, parameters: Parameters, ambient: Ambient) -> list[Addition]:
    """Table of what the firmware adds, for a vehicle that hovers at a thrust `hover`."""
    cos_tilt = math.cos(math.radians(TABLE_TILT_DEG))
    tilted = min(hover / cos_tilt, 1.0)
    compensated = 1.0 / _density_ratio(ambient) - 1.0
    boosts = bool(parameters.get(BOOST, 0.0))

    def outputs(thrust: float) -> float:
        return float(output_of_thrust(thrust, parameters, Ambient())) / thrust - 1.0 if thrust > 0.0 else 0.0

    def voltage(thrust: float) -> float:
        """Change of the thrust that an output stands for, if its voltage were not known."""
        known = output_of_thrust(thrust, parameters, Ambient(ambient.battery_v))
        return float(thrust_of_output(known, parameters, Ambient())) / thrust - 1.0 if thrust > 0.0 else 0.0

    known_air = math.isfinite(ambient.density_ratio)
    by = f", {ATMOSPHERES[ambient.atmosphere]}" if ambient.atmosphere is not None else ""
    return [
        Addition(
            said(parameters, BOOST),
            float(angle_boost(1.0, parameters)) - 1.0,
            float(angle_boost(cos_tilt, parameters)) - 1.0,
            "thrust over the cosine of the tilt: quadctl divides it out"
            if boosts
            else "off"
            if BOOST in parameters
            else "not known: nothing is divided out",
        ),
        Addition(said(parameters, *CURVE), outputs(hover), outputs(tilted), "curve of the motors: removed in the log"),
        Addition(
            said(parameters, *VOLTAGE),
            voltage(hover),
            voltage(tilted),
            f"voltage compensation at {ambient.battery_v:.2f} V: removed in the log"
            if compensates_voltage(parameters)
            else "no voltage compensation"
            if all(name in parameters for name in VOLTAGE)
            else "not known: nothing is removed in the log",
        ),
        Addition(
            f"air density {ambient.density_ratio:.3f} of sea level" + by if known_air else "air density not told",
            compensated,
            compensated,
            "density compensation, always on: " + ("removed in the log" if known_air else "not removed in the log"),
        ),
    ]


def _density_ratio(ambient: Ambient) -> Number:
    return known_or(clip(ambient.density_ratio, *DENSITY_RATIOS), 1.0)


CHAIN = ThrustChain(
    parameters=(BOOST, *CURVE, *VOLTAGE),
    defaults=DEFAULT_CURVE,
    boost=angle_boost,
    thrust_of_output=thrust_of_output,
    output_of_thrust=output_of_thrust,
    additions=additions,
)
