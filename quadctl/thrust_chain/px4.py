"""PX4: scaling with the battery and curve of the motors; attitude targets pass by its hover thrust.

Sources: `MulticopterRateControl::Run` (MC_BAT_SCALE_EN), `Battery::computeScale`, and for THR_MDL_FAC
`FunctionMotors::updateValues`, before PX4 1.13 `MultirotorMixer::mix`.
"""

import math

from quadctl.numeric import Number, clip, known_or, maximum
from quadctl.thrust_chain.chain import (
    PLAIN,
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

CURVE = "THR_MDL_FAC"
BATTERY = "MC_BAT_SCALE_EN"
BATTERY_SCALES = (1.0, 1.3)
"""Range of the factor that compensates the battery."""


def battery_scale(ambient: Ambient, parameters: Parameters) -> Number:
    """Factor on the thrust for the battery; 1 where MC_BAT_SCALE_EN is 0, or the factor is not known."""
    if not parameters.get(BATTERY, 0.0):
        return 1.0
    return known_or(clip(ambient.battery_scale, *BATTERY_SCALES), 1.0)


def thrust_of_output(output: Number, parameters: Parameters, ambient: Ambient) -> Number:
    """Thrust that the firmware means by an output, 0..1 of the range of pulses."""
    return bent(share(output), bend_of(parameters)) / battery_scale(ambient, parameters)


def output_of_thrust(thrust: Number, parameters: Parameters, ambient: Ambient) -> Number:
    """Output that the firmware gives a motor for a thrust."""
    return unbent(share(maximum(thrust, 0.0) * battery_scale(ambient, parameters)), bend_of(parameters))


def bend_of(parameters: Parameters) -> float:
    """THR_MDL_FAC; 0, no bend, where it is not known or not possible."""
    bend = parameters.get(CURVE, 0.0)
    return bend if 0.0 < bend <= 1.0 else 0.0


def additions(hover: float, parameters: Parameters, ambient: Ambient) -> list[Addition]:
    """Table of what the firmware adds, for a vehicle that hovers at a thrust `hover`."""
    tilted = min(hover / math.cos(math.radians(TABLE_TILT_DEG)), 1.0)
    scale = float(battery_scale(ambient, parameters)) - 1.0

    def outputs(thrust: float) -> float:
        return float(output_of_thrust(thrust, parameters, Ambient())) / thrust - 1.0 if thrust > 0.0 else 0.0

    if not parameters.get(BATTERY, 0.0):
        battery = "off"
    else:
        most = f"{BATTERY_SCALES[1] - 1.0:.0%}"
        battery = f"thrust grows as the battery empties, by up to {most}, which MAVLink does not tell: switch it off"
    return [
        Addition(said(parameters, CURVE), outputs(hover), outputs(tilted), "curve of the motors: removed in the log"),
        Addition(said(parameters, BATTERY), scale, scale, battery),
        Addition(said(parameters, "MC_AIRMODE"), 0.0, 0.0, "changes the thrust only while a motor is at its limit"),
        Addition(said(parameters, "MPC_THR_HOVER"), 0.0, 0.0, "for its own modes: targets pass by it"),
    ]


CHAIN = ThrustChain(
    parameters=(CURVE, BATTERY, "MC_AIRMODE", "MPC_THR_HOVER"),
    defaults={},
    boost=PLAIN.boost,  # PX4 takes the thrust of a target along the body
    thrust_of_output=thrust_of_output,
    output_of_thrust=output_of_thrust,
    additions=additions,
)
