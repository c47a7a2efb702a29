"""ArduPilot Copter on the MAVLink wire: GUIDED follows targets, after a take-off by command.

Lifting off by targets works too, but leaves an internal error behind that blocks the next arming. A fresh boot sends
nothing but heartbeats: every message has to be asked for.
"""

from quadctl.flight.autopilot import mavlink
from quadctl.flight.autopilot.firmware import (
    Check,
    Firmware,
    Renamed,
    Requirement,
    Stream,
    above_ceiling,
    hover_throttle_check,
    rotor_count_check,
)
from quadctl.thrust_chain.ardupilot import CHAIN
from quadctl.words import When

THRUST_AS_THRUST = 8
"""Bit 3 of GUID_OPTIONS: the thrust of a target is a thrust, not a climb rate."""
SILENCE_S = 0.5
"""Longest silence after which GUIDED should act: ten setpoints or more are missing then."""
HEARTBEATS_LOST_S = 3.0
"""Longest silence after which the ground-station failsafe should act: quadctl's heartbeats come every second."""
LAND_WITHOUT_STATION = 5
"""FS_GCS_ENABLE: Land."""
LOST_STATION = {
    1: "then it goes to RTL",
    3: "then it goes to SmartRTL or RTL",
    4: "then it goes to SmartRTL or Land",
    5: "then it goes to Land",
    6: "then it goes to the mission's landing or RTL",
    7: "then it goes to Brake or Land",
}
"""FS_GCS_ENABLE: the action when the heartbeats of SYSID_MYGCS stop. All of them end on the ground."""
LOST_REMOTE = {0: "it does nothing", 1: "it goes to RTL", 2: "it goes to RTL, or on with its mission",
               3: "it goes to Land", 4: "it goes to SmartRTL or RTL", 5: "it goes to SmartRTL or Land",
               6: "it goes to the mission's landing or RTL", 7: "it goes to Brake or Land"}  # fmt: skip
"""FS_THR_ENABLE: the action when the remote control is lost."""
LOST_ESTIMATE = {0: "it only says so", 1: "it lands", 2: "it goes to AltHold", 3: "it lands, in Stabilize too"}
"""FS_EKF_ACTION: the action when the estimator's variances are too large."""
ROTORS = {1: 4, 2: 6, 3: 8, 4: 8, 5: 6, 7: 3, 12: 12, 14: 10}
"""FRAME_CLASS: number of rotors of the frame, where the class has one."""


def _requirements(own_system_id: int) -> tuple[Requirement, ...]:
    return (
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
        Requirement(
            "FS_GCS_ENABLE",
            lambda value: value if round(value) in LOST_STATION else float(LAND_WITHOUT_STATION),
            "when quadctl dies, ArduPilot stays in GUIDED in the air until somebody lands it",
            failsafe=True,
            finding="{meaning} ({value:g})",
            meaning=lambda value: LOST_STATION.get(round(value), "after quadctl has died it goes on"),
        ),
        Requirement(
            "SYSID_MYGCS",
            lambda value: float(own_system_id),
            "its ground-station failsafe watches the heartbeats of that system and never notices that quadctl dies",
            failsafe=True,
            finding="the ground-station failsafe watches the heartbeats of system {value:g}",
        ),
        Requirement(
            "FS_GCS_TIMEOUT",
            lambda value: min(value, HEARTBEATS_LOST_S),
            "for so many seconds it holds its height before its failsafe lands it",
            advice=True,
            finding="the ground-station failsafe acts {value:g} s after the last heartbeat",
        ),
    )


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
        "FLIP": 14,
        "AUTOTUNE": 15,
        "POSHOLD": 16,
        "BRAKE": 17,
        "THROW": 18,
        "AVOID_ADSB": 19,
        "GUIDED_NOGPS": 20,
        "SMART_RTL": 21,
        "FLOWHOLD": 22,
        "FOLLOW": 23,
        "ZIGZAG": 24,
        "SYSTEMID": 25,
        "AUTOROTATE": 26,
        "AUTO_RTL": 27,
        "TURTLE": 28,
    },
    unknown_mode=lambda custom_mode: f"mode {custom_mode}",
    set_mode_parameters=lambda custom_mode: (custom_mode, 0),
    offboard_mode="GUIDED",
    land_mode="LAND",
    hold_mode="BRAKE",
    takes_off_itself=True,
    stays_up=True,
    streams=(
        Stream("LOCAL_POSITION_NED", 32, 100.0, required=True),
        Stream("ATTITUDE_QUATERNION", 31, 100.0, required=True),
        # It brings ESC_TELEMETRY_5_TO_8 along; asked for that, ArduPilot announces an unknown message.
        Stream("ESC_TELEMETRY_1_TO_4", 11030, 50.0, alternative=True),
        Stream("SERVO_OUTPUT_RAW", 36, 50.0, alternative=True),
        Stream("SCALED_PRESSURE", 29, 1.0, alternative=True),
        Stream("GLOBAL_POSITION_INT", 33, 1.0, alternative=True),
        Stream("SYS_STATUS", 1, 5.0),
        Stream("BATTERY_STATUS", 147, 1.0, alternative=True),
        Stream("EXTENDED_SYS_STATE", 245, 5.0),
        Stream("EKF_STATUS_REPORT", 193, 5.0),
        # SYS_STATUS calls a GPS without a fix healthy.
        Stream("GPS_RAW_INT", 24, 5.0, alternative=True),
        # The only message that it sends about its mode.
        Stream("HEARTBEAT", 0, 20.0, without="A change of mode is seen after up to a second, a short one never."),
    ),
    tells_readiness=lambda mode: True,
    lists_prearm=True,
    heartbeat_type=mavlink.COMPANION,
    disarming_text="",
    tells_aids=True,
    thrust_chain=CHAIN,
    tests_motors_clockwise=True,
    renamed={"SYSID_MYGCS": Renamed("MAV_GCS_SYSID", (4, 7)), "RTL_ALT": Renamed("RTL_ALT_M", (4, 7), 100.0)},
    requirements=_requirements,
    checks=(
        Check(
            "FS_THR_ENABLE",
            "when the remote control is lost {meaning} ({value:g})",
            lambda value, vehicle: not value or round(value) not in LOST_REMOTE,
            "expected 3 (Land)",
            LOST_REMOTE,
        ),
        Check(
            "FS_EKF_ACTION",
            "when the estimate is lost {meaning} ({value:g})",
            lambda value, vehicle: round(value) not in (1, 3),
            "expected 1 (Land)",
            LOST_ESTIMATE,
        ),
        Check(
            "RTL_ALT",
            When("value", "a return climbs to {meaning:g} m first", "a return keeps its height"),
            above_ceiling(0.01),
            "there is a ceiling at {vehicle.ceiling_m:g} m; expected failsafes that land, or 0 (keep the height)",
            lambda centimetres: 0.01 * centimetres,
        ),
        hover_throttle_check("MOT_THST_HOVER"),
        rotor_count_check("FRAME_CLASS", lambda value: ROTORS.get(round(value))),
    ),
    serial_parameters=("SERIAL2_PROTOCOL", "SERIAL2_BAUD"),
    attitude_parameters=(
        # ATC_INPUT_TC shapes the setpoint, and is most of the lag.
        "ATC_INPUT_TC",
        "ATC_RATE_FF_ENAB",
        *(f"ATC_ANG_{axis}_P" for axis in ("RLL", "PIT")),
        *(
            f"ATC_RAT_{axis}_{term}"
            for axis in ("RLL", "PIT")
            for term in ("P", "I", "D", "FF", "FLTT", "FLTE", "FLTD")
        ),
        *(f"ATC_ACCEL_{axis}_MAX" for axis in ("R", "P")),
        *(f"ATC_RATE_{axis}_MAX" for axis in ("R", "P")),
        "INS_GYRO_FILTER",
    ),
    rate_limits=("ATC_RATE_R_MAX", "ATC_RATE_P_MAX"),
)
