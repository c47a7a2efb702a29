"""Motor outputs of ArduPilot, as its parameters describe them; shared by its two kinds of log."""

from collections.abc import Mapping

import numpy as np

from quadctl.logs.findings import Finding, Kind, finding
from quadctl.logs.flight_log import Floats
from quadctl.thrust_chain.ardupilot import CURVE, compensates_voltage, knows_curve, thrust_of_output
from quadctl.thrust_chain.chain import Ambient

PARAMETERS = (
    "ATC_ANGLE_BOOST",
    "FRAME_CLASS",
    "FRAME_TYPE",
    "MOT_BAT_VOLT_MAX",
    "MOT_BAT_VOLT_MIN",
    "MOT_PWM_MAX",
    "MOT_PWM_MIN",
    "MOT_SPIN_MAX",
    "MOT_SPIN_MIN",
    "MOT_THST_EXPO",
    "MOT_THST_HOVER",
)
"""Parameters that an analysis of motor outputs may need, kept in the log's `meta`."""
VOLT_MAX = "MOT_BAT_VOLT_MAX"
PWM_US = (1000.0, 2000.0)
"""Range of the motor outputs where MOT_PWM_MIN and MOT_PWM_MAX do not say."""


def motor_of_servo(servo: int, parameters: Mapping[str, float]) -> int | None:
    """Number of the motor on output `servo` (both from 1), None when SERVOn_FUNCTION says that there is none.

    Without SERVOn_FUNCTION in the log, the outputs are taken to be the motors, in order.
    """
    function = parameters.get(f"SERVO{servo}_FUNCTION")
    if function is None:
        return servo
    if 33 <= function <= 40:
        return int(function) - 32
    return int(function) - 73 if 82 <= function <= 85 else None


def motor_outputs(
    pulses_us: Mapping[int, Floats], parameters: Mapping[str, float], ambient: Ambient
) -> dict[str, Floats]:
    """`motorN_output`, 0..1, from pulse lengths by number of output, those without pulses left out.

    The outputs are shares of the PWM range, from which the firmware's curve and compensations are removed where its
    parameters are known: then they are proportional to thrust, as `throttle_cmd` is. `ambient` holds arrays as long as
    the pulses.
    """
    low, high = parameters.get("MOT_PWM_MIN", 0.0), parameters.get("MOT_PWM_MAX", 0.0)
    if not 0.0 < low < high:
        low, high = PWM_US
    found: dict[int, Floats] = {}
    for servo, pulses in pulses_us.items():
        motor = motor_of_servo(servo, parameters)
        if motor is not None and pulses.any():
            share = np.clip((pulses - low) / (high - low), 0.0, 1.0)
            found[motor] = np.asarray(thrust_of_output(share, parameters, ambient))
    return {f"motor{motor}_output": found[motor] for motor in sorted(found)}


def output_finding(parameters: Mapping[str, float], ambient: Ambient) -> Finding:
    """Finding on the motor outputs: which steps of the firmware's thrust chain are removed from them."""
    if not knows_curve(parameters):
        return finding(Kind.OUTPUT_CHAIN, lacking=list(CURVE))
    removed: list[dict[str, float | str]] = []
    kept: list[dict[str, float | str]] = []
    if compensates_voltage(parameters):
        known = np.isfinite(ambient.battery_v).any()
        (removed if known else kept).append({"of": "voltage", "volt_max": parameters[VOLT_MAX]})
    if np.isfinite(ambient.density_ratio).any():
        atmosphere = str(ambient.atmosphere or "")
        ratio = float(np.nanmedian(ambient.density_ratio))
        removed.append({"of": "density", "density_ratio": ratio, "atmosphere": atmosphere})
    else:
        kept.append({"of": "density"})
    curve = {name: parameters[name] for name in CURVE}
    return finding(Kind.OUTPUT_CHAIN, lacking=[], curve=curve, removed=removed, kept=kept)
