"""Motor outputs of ArduPilot, as its parameters describe them; shared by its two kinds of log."""

import re
from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from quadctl.logs.findings import Finding, Kind, finding
from quadctl.logs.flight_log import Floats
from quadctl.logs.parameter_history import ParameterHistory
from quadctl.numeric import Number
from quadctl.thrust_chain.ardupilot import BOOST, CURVE, VOLTAGE, compensates_voltage, knows_curve, thrust_of_output
from quadctl.thrust_chain.chain import Ambient

PARAMETERS = (
    "ATC_ANGLE_BOOST",
    "BARO_PRIMARY",
    "EK2_ALT_SOURCE",
    "EK3_DRAG_BCOEF_X",
    "EK3_SRC1_POSZ",
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
"""Parameters that an analysis of motor outputs or of heights may need, kept in the log's `meta`."""
VOLT_MAX = "MOT_BAT_VOLT_MAX"
PULSE_RANGES = (("MOT_PWM_MIN", "MOT_PWM_MAX"), ("RC3_MIN", "RC3_MAX"))
"""Parameters of the range of the outputs: where those of the motors are 0, or not there, that of the throttle."""
CHAIN_PARAMETERS = (BOOST, *CURVE, *VOLTAGE, *(name for pair in PULSE_RANGES for name in pair))
"""Parameters on which the thrust depends that an output or a command stands for."""
MOTORS_OF_CLASS = {1: 4, 2: 6, 3: 8, 4: 8, 5: 6, 7: 3, 12: 12, 14: 10}
"""Number of motors by FRAME_CLASS: quadrotor, hexarotor, octorotor, coaxial octorotor and hexarotor, tricopter..."""
MOTORS_OF_FRAME = {"QUAD": 4, "HEXA": 6, "OCTA": 8, "OCTA_QUAD": 8, "Y6": 6, "TRI": 3, "DODECA": 12, "DECA": 10}
"""Number of motors by the name of the frame in messages."""
_FRAME = re.compile(rf"Frame: ({'|'.join(sorted(MOTORS_OF_FRAME, key=len, reverse=True))})", re.IGNORECASE)
PWM_US = (1000.0, 2000.0)
"""Range of the motor outputs where no parameters say."""
CLASS, TYPE, OLDER = "FRAME_CLASS", "FRAME_TYPE", "FRAME"
"""Parameters of the frame; up to Copter 3.4 there was one, and the class was that of the firmware."""
CLASSES = {"QUAD": 1.0, "HEXA": 2.0, "OCTA": 3.0, "OCTAQUAD": 4.0, "Y6": 5.0, "HELI": 6.0, "TRI": 7.0, "DECA": 14.0}
"""FRAME_CLASS by its name in the messages of the start."""
TYPES = {"PLUS": 0.0, "X": 1.0, "V": 2.0, "H": 3.0}
"""FRAME_TYPE by its name in the messages, and FRAME likewise."""
_MESSAGE = re.compile(r"Frame: (?P<kind>[A-Z_]*[A-Z]\d?)(?:/(?P<shape>\w+))?")


def motors_of_frame(parameters: Mapping[str, float], texts: Iterable[str] = ()) -> int | None:
    """Number of motors by FRAME_CLASS, or by the message that names the frame; None where neither tells."""
    known = MOTORS_OF_CLASS.get(int(parameters.get("FRAME_CLASS", 0.0)))
    named = (_FRAME.search(text) for text in texts)
    return known or next((MOTORS_OF_FRAME[frame[1].upper()] for frame in named if frame), None)


def with_frame(parameters: Mapping[str, float], texts: Iterable[str]) -> dict[str, float]:
    """The parameters with FRAME_CLASS and FRAME_TYPE, where they or FRAME and the messages of a log tell them."""
    found = next((match for text in texts if (match := _MESSAGE.search(text))), None)
    kind, shape = (found["kind"].replace("_", ""), found["shape"]) if found is not None else ("", None)
    told = {CLASS: parameters.get(CLASS) or CLASSES.get(kind)}
    told[TYPE] = parameters.get(TYPE, parameters.get(OLDER, TYPES.get(shape or "")))
    return {**parameters, **{name: value for name, value in told.items() if value is not None}}


def motor_of_servo(servo: int, parameters: Mapping[str, float], n_motors: int | None = None) -> int | None:
    """Number of the motor on output `servo` (both from 1), None where there is none.

    The function of the output tells (SERVOn_FUNCTION; up to 3.5 RCn_FUNCTION, of whose functions none is a motor).
    Where the log holds neither, the first `n_motors` outputs are the motors, in order.
    """
    function = parameters.get(f"SERVO{servo}_FUNCTION")
    if function is None:
        idle = not parameters.get(f"RC{servo}_FUNCTION", 0.0)
        return servo if idle and servo <= (n_motors or servo) else None
    if 33 <= function <= 40:
        return int(function) - 32
    return int(function) - 73 if 82 <= function <= 85 else None


def motor_outputs(
    time_s: Floats, pulses_us: Mapping[int, Floats], history: ParameterHistory, ambient: Ambient, n_motors: int | None
) -> dict[str, Floats]:
    """`motorN_output`, 0..1, from pulse lengths by number of output, those without pulses left out.

    The outputs are shares of the PWM range, from which the firmware's curve and compensations are removed where its
    parameters are known: then they are proportional to thrust, as `throttle_cmd` is. Each period is converted with the
    parameters that held then. `ambient` holds arrays as long as the pulses.
    """
    last = history.last
    moves = {servo: bool(pulses.any()) and np.ptp(pulses) > 0.0 for servo, pulses in pulses_us.items()}
    found: dict[int, Floats] = {}
    for servo, pulses in pulses_us.items():
        motor = motor_of_servo(servo, last, n_motors)
        # What never changes beside outputs that do drives no motor, unless the log says that it is one.
        said = f"SERVO{servo}_FUNCTION" in last
        if motor is None or not pulses.any() or not (moves[servo] or said or not any(moves.values())):
            continue
        found[motor] = np.full(len(pulses), np.nan)
        for period in history.periods(CHAIN_PARAMETERS):
            rows = (time_s >= period.begin_s) & (time_s < period.end_s)
            given = ((period.values.get(low, 0.0), period.values.get(high, 0.0)) for low, high in PULSE_RANGES)
            low, high = next(((low, high) for low, high in given if 0.0 < low < high), PWM_US)
            share = np.clip((pulses[rows] - low) / (high - low), 0.0, 1.0)
            found[motor][rows] = thrust_of_output(share, period.values, _at(ambient, rows))
    return {f"motor{motor}_output": found[motor] for motor in sorted(found)}


def _at(ambient: Ambient, rows: NDArray[np.bool_]) -> Ambient:
    def at(part: Number) -> Number:
        return part[rows] if isinstance(part, np.ndarray) else part

    return ambient._replace(battery_v=at(ambient.battery_v), density_ratio=at(ambient.density_ratio))


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
