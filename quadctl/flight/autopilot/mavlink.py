"""MAVLink's common numbers: commands, results, flags, and the messages that any autopilot may send."""

MAV_COMP_ID_AUTOPILOT = 1
OWN_SYSTEM_ID = 1
"""System id of quadctl's messages, unless the user chooses another: that of the vehicle whose companion it is."""
MOCAP_SYSTEM_ID = 250
"""System id of `quadctl mocap`, whose heartbeats must not stand for those of a flight that has died."""
TALKERS = {255: "most ground stations use", MOCAP_SYSTEM_ID: "`quadctl mocap` uses"}
"""System ids of others whose heartbeats go on after a flight has died."""
MAV_MODE_FLAG_CUSTOM_MODE_ENABLED = 1
MAV_MODE_FLAG_SAFETY_ARMED = 128
MAV_LANDED_STATE_ON_GROUND = 1
MAV_SYS_STATUS_PREARM_CHECK = 1 << 28
HEALTH_BITS = {
    0: "gyroscope",
    1: "accelerometer",
    2: "magnetometer",
    3: "barometer",
    5: "GPS",
    6: "optical flow",
    7: "vision or motion capture",
    8: "range finder",
    15: "motor outputs",
    16: "remote control",
    20: "geofence",
    21: "attitude estimate (AHRS)",
    22: "terrain data",
    24: "logging",
    25: "battery",
    26: "proximity sensor",
    29: "obstacle avoidance",
    30: "propulsion",
}
"""Names of parts by their bit of SYS_STATUS (MAV_SYS_STATUS_SENSOR)."""
RC_RECEIVER = 1 << 16
"""Remote control in SYS_STATUS: MAV_SYS_STATUS_SENSOR_RC_RECEIVER."""
BATTERY_ALARMS = {3: "critical", 4: "empty (emergency)", 5: "failed", 6: "unhealthy"}
"""Values of MAV_BATTERY_CHARGE_STATE with which nobody should take off, in the order of their gravity."""
GPS, VISION_POSITION = 1 << 5, 1 << 7
"""Sensors of SYS_STATUS that measure the position: MAV_SYS_STATUS_SENSOR_GPS and ..._VISION_POSITION."""
GPS_FIX_3D = 3
"""Least `fix_type` of GPS_RAW_INT with which a GPS measures the position."""

STATION, COMPANION = 6, 18
"""MAV_TYPE_GCS, MAV_TYPE_ONBOARD_CONTROLLER."""
HEARTBEAT = {
    "autopilot": 8,  # MAV_AUTOPILOT_INVALID
    "base_mode": 0,
    "custom_mode": 0,
    "system_status": 4,  # MAV_STATE_ACTIVE
    "mavlink_version": 3,
}
"""Fields of a heartbeat of ours but its type."""

CMD_NAV_TAKEOFF = 22
CMD_DO_SET_MODE = 176
CMD_DO_MOTOR_TEST = 209
CMD_COMPONENT_ARM_DISARM = 400
CMD_RUN_PREARM_CHECKS = 401
CMD_SET_MESSAGE_INTERVAL = 511
CMD_REQUEST_MESSAGE = 512

AUTOPILOT_VERSION_ID = 148
GPS_GLOBAL_ORIGIN_ID = 49

ATTITUDE_TARGET_IGNORE_RATES = 0b111
"""Type mask of SET_ATTITUDE_TARGET: fly the attitude and the thrust, leave the body rates to the autopilot."""
ATTITUDE_TARGET_THRUST_BODY_SET = 0b10_0000
"""Bit of the type mask: take `thrust_body`, in three dimensions, and not `thrust`."""

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


def failing_parts(enabled: int, health: int) -> tuple[str, ...]:
    """Names of the parts that are in use and not healthy, from the flags of SYS_STATUS."""
    return tuple(name for bit, name in HEALTH_BITS.items() if enabled & ~health & 1 << bit)


def result_name(result: int) -> str:
    """Name of a COMMAND_ACK's `result`."""
    return RESULTS.get(result, f"result {result}")
