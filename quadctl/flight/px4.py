"""PX4's numbers on the MAVLink wire: modes, commands, results, and the messages that control stands on."""

from dataclasses import dataclass

MAV_AUTOPILOT_PX4 = 12
MAV_COMP_ID_AUTOPILOT = 1
MAV_MODE_FLAG_CUSTOM_MODE_ENABLED = 1
MAV_MODE_FLAG_SAFETY_ARMED = 128
MAV_LANDED_STATE_ON_GROUND = 1
MAV_SEVERITY_WARNING = 4
"""Of a STATUSTEXT; smaller numbers are graver."""

CMD_DO_SET_MODE = 176
CMD_COMPONENT_ARM_DISARM = 400
CMD_SET_MESSAGE_INTERVAL = 511

ATTITUDE_TARGET_IGNORE_RATES = 0b111
"""Type mask of SET_ATTITUDE_TARGET: fly the attitude and the thrust, leave the body rates to the autopilot."""

ACCEPTED = 0
RESULTS = {
    0: "ACCEPTED",
    1: "TEMPORARILY_REJECTED",
    2: "DENIED",
    3: "UNSUPPORTED",
    4: "FAILED",
    5: "IN_PROGRESS",
    6: "CANCELLED",
}
"""MAV_RESULT of a COMMAND_ACK."""

MODES = {
    "MANUAL": (1, 0),
    "ALTCTL": (2, 0),
    "POSCTL": (3, 0),
    "ORBIT": (3, 1),
    "READY": (4, 1),
    "TAKEOFF": (4, 2),
    "HOLD": (4, 3),
    "MISSION": (4, 4),
    "RTL": (4, 5),
    "LAND": (4, 6),
    "FOLLOW": (4, 8),
    "PRECLAND": (4, 9),
    "ACRO": (5, 0),
    "OFFBOARD": (6, 0),
    "STABILIZED": (7, 0),
}
"""(main mode, sub mode) by name."""

_MODE_NAMES = {numbers: name for name, numbers in MODES.items()}


def mode_name(custom_mode: int) -> str:
    """Name of a HEARTBEAT's `custom_mode`; "main/sub" in numbers for one that has no name here."""
    main, sub = custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF
    return _MODE_NAMES.get((main, sub), f"{main}/{sub}")


def result_name(result: int) -> str:
    """Name of a COMMAND_ACK's `result`."""
    return RESULTS.get(result, f"result {result}")


@dataclass(frozen=True, slots=True)
class Stream:
    """A message that the autopilot is asked to send."""

    name: str
    message_id: int
    rate_hz: float
    required: bool
    """Control cannot fly without it."""


STREAMS = (
    Stream("LOCAL_POSITION_NED", 32, 100.0, required=True),
    Stream("ATTITUDE_QUATERNION", 31, 100.0, required=True),
    Stream("ESC_STATUS", 291, 50.0, required=False),
    Stream("SYS_STATUS", 1, 5.0, required=False),
    Stream("EXTENDED_SYS_STATE", 245, 5.0, required=False),
    Stream("ESTIMATOR_STATUS", 230, 5.0, required=False),
    Stream("HEARTBEAT", 0, 5.0, required=False),
)
"""HEARTBEAT comes at 1 Hz anyway; more of it shortens the time until a change of mode or a disarming is seen."""
