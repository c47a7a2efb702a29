"""ArduPilot Copter on the MAVLink wire: GUIDED follows targets, after a take-off by command.

Lifting off by targets works too, but leaves an internal error behind that blocks the next arming. A fresh boot sends
nothing but heartbeats: every message has to be asked for.
"""

from quadctl.flight.autopilot.firmware import Firmware, Requirement, Stream, hover_throttle_check, share_of_pulse

THRUST_AS_THRUST = 8
"""Bit 3 of GUID_OPTIONS: the thrust of a target is a thrust, not a climb rate."""
SILENCE_S = 0.5
"""Longest silence after which GUIDED should act: ten setpoints or more are missing then."""
SPIN_MIN, SPIN_MAX, THRUST_EXPO = 0.15, 0.95, 0.65
"""Defaults of MOT_SPIN_MIN, MOT_SPIN_MAX, MOT_THST_EXPO."""


def throttle_of_pulse(pulse_us: float) -> float:
    """Throttle from the pulse length of a motor: the inverse of ArduPilot's thrust linearisation.

    By the default parameters; the battery's voltage, which it compensates too, is left out.
    """
    x = min(max((share_of_pulse(pulse_us) - SPIN_MIN) / (SPIN_MAX - SPIN_MIN), 0.0), 1.0)
    return (1.0 - THRUST_EXPO) * x + THRUST_EXPO * x * x


ARDUPILOT = Firmware(
    name="ArduPilot",
    mav_autopilot=3,
    modes={
        "STABILIZE": 0,
        "ACRO": 1,
        "ALT_HOLD": 2,
        "AUTO": 3,
        "GUIDED": 4,
        "LOITER": 5,
        "RTL": 6,
        "CIRCLE": 7,
        "LAND": 9,
        "DRIFT": 11,
        "SPORT": 13,
        "AUTOTUNE": 15,
        "POSHOLD": 16,
        "BRAKE": 17,
        "THROW": 18,
        "GUIDED_NOGPS": 20,
        "SMART_RTL": 21,
    },
    unknown_mode=lambda custom_mode: f"mode {custom_mode}",
    set_mode_parameters=lambda custom_mode: (custom_mode, 0),
    offboard_mode="GUIDED",
    land_mode="LAND",
    hold_mode="BRAKE",
    takes_off_itself=True,
    streams=(
        Stream("LOCAL_POSITION_NED", 32, 100.0, required=True),
        Stream("ATTITUDE_QUATERNION", 31, 100.0, required=True),
        Stream("ESC_TELEMETRY_1_TO_4", 11030, 50.0, alternative=True),
        Stream("ESC_TELEMETRY_5_TO_8", 11031, 50.0, alternative=True),
        Stream("SERVO_OUTPUT_RAW", 36, 50.0, alternative=True),
        Stream("SYS_STATUS", 1, 5.0),
        Stream("EXTENDED_SYS_STATE", 245, 5.0),
        Stream("EKF_STATUS_REPORT", 193, 5.0),
        # The only message that it sends about its mode.
        Stream("HEARTBEAT", 0, 20.0, without="A change of mode is seen after up to a second, a short one never."),
    ),
    tells_readiness=True,
    motor_throttle=throttle_of_pulse,
    tests_motors_clockwise=True,
    requirements=(
        Requirement(
            "GUID_OPTIONS",
            lambda value: float(int(value) | THRUST_AS_THRUST),
            "with bit 3 (value 8) clear, ArduPilot takes thrust for a climb rate",
        ),
        Requirement(
            "GUID_TIMEOUT",
            lambda value: min(value, SILENCE_S),
            "for so many seconds ArduPilot keeps its last tilt when setpoints stop",
            advice=True,
        ),
    ),
    checks=(hover_throttle_check("MOT_THST_HOVER"),),
    serial_parameters=("SERIAL2_PROTOCOL", "SERIAL2_BAUD"),
)
