"""Motor outputs of ArduPilot, as its parameters describe them; shared by its two kinds of log."""

from collections.abc import Mapping

import numpy as np

from quadctl.logs.flight_log import Floats

PARAMETERS = (
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
CURVE = ("MOT_THST_EXPO", "MOT_SPIN_MIN", "MOT_SPIN_MAX")
"""Parameters of the firmware's curve from thrust to output."""
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


def motor_outputs(pulses_us: Mapping[int, Floats], parameters: Mapping[str, float]) -> dict[str, Floats]:
    """`motorN_output`, 0..1, from pulse lengths by number of output, those without pulses left out.

    The outputs are shares of the PWM range, from which the firmware's thrust curve is removed where its parameters are
    known: then they are proportional to thrust, as `throttle_cmd` is.
    """
    low, high = parameters.get("MOT_PWM_MIN", 0.0), parameters.get("MOT_PWM_MAX", 0.0)
    if not 0.0 < low < high:
        low, high = PWM_US
    found: dict[int, Floats] = {}
    for servo, pulses in pulses_us.items():
        motor = motor_of_servo(servo, parameters)
        if motor is not None and pulses.any():
            found[motor] = thrust_share(np.clip((pulses - low) / (high - low), 0.0, 1.0), parameters)
    return {f"motor{motor}_output": found[motor] for motor in sorted(found)}


def thrust_share(output: Floats, parameters: Mapping[str, float]) -> Floats:
    """Share of the full thrust, 0..1, that the firmware means by an output, 0..1 of the PWM range.

    The inverse of AP_MotorsMulticopter: the output is SPIN_MIN + (SPIN_MAX - SPIN_MIN) t, with
    thrust = (1 - EXPO) t + EXPO t^2. The output itself where the log lacks one of the parameters.
    """
    if not knows_curve(parameters):
        return output
    expo, lowest, highest = (parameters[name] for name in CURVE)
    t = np.clip((output - lowest) / (highest - lowest), 0.0, 1.0)
    return np.asarray((1.0 - expo) * t + expo * t**2)


def knows_curve(parameters: Mapping[str, float]) -> bool:
    """True where the log holds the parameters of the firmware's thrust curve, and they are possible."""
    if any(name not in parameters for name in CURVE):
        return False
    expo, lowest, highest = (parameters[name] for name in CURVE)
    return -1.0 <= expo <= 1.0 and 0.0 <= lowest < highest <= 1.0


def output_note(parameters: Mapping[str, float]) -> str:
    """Note on the motor outputs, to be read before thrust is taken from them."""
    if knows_curve(parameters):
        curve = ", ".join(f"{name} = {parameters[name]:.4g}" for name in CURVE)
        return f"motor outputs are shares of the full thrust: ArduPilot's thrust curve ({curve}) is removed"
    return (
        f"motor outputs are shares of the PWM range, as the log lacks one of {', '.join(CURVE)}: not proportional to "
        "thrust, as throttle_cmd should be"
    )
