"""PX4's reasons against arming: EVENT messages of its health and arming checks, numbers that become words again.

A reason often exists as an event only: of six in a recorded boot, one came as a text too. An event carries the hash
of its name, so the words below hold for every version that has the check. They are those of the metadata that PX4 (BSD
licence) writes into its logs, of March 2026; a check that it did not have then is not shown.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

AUTOPILOT = 1
"""First byte of the number of an event that the autopilot itself sends."""
SUMMARY = 11047904
"""Event that begins a report of the arming checks; those of the report follow."""
NO_SETPOINTS = 3087815
"""Reason against offboard that always holds before the first setpoint."""
WARNING = 4
"""Log level of a warning; levels above it are no objections."""
MODES = {
    "MANUAL": 1 << 0,
    "ALTCTL": 1 << 1,
    "POSCTL": 1 << 2,
    "MISSION": 1 << 3,
    "HOLD": 1 << 4,
    "RTL": 1 << 5,
    "ACRO": 1 << 10,
    "OFFBOARD": 1 << 14,
    "STABILIZED": 1 << 15,
    "TAKEOFF": 1 << 17,
    "LAND": 1 << 18,
}
"""Bit of each mode in the set of modes that a reason concerns (navigation_mode_group_t)."""


class _Reason(NamedTuple):
    modes: int
    """Modes that it bars."""
    text: str


class ArmingReport:
    """The last report of PX4's arming checks, of which an event that is lost is simply missing."""

    def __init__(self) -> None:
        self._reasons: list[_Reason] = []

    def take(self, fields: Mapping[str, Any]) -> None:
        """Take in the fields of one EVENT."""
        component, number = divmod(int(fields["id"]), 1 << 24)
        if component != AUTOPILOT:
            return
        if number == SUMMARY:
            self._reasons = []
        elif number in TEXTS and number != NO_SETPOINTS and int(fields["log_levels"]) & 0xF <= WARNING:
            data: Sequence[int] = fields["arguments"]
            # Each begins with the modes, 4 bytes, and the part that it is about; then an instance, where it has one.
            self._reasons.append(_Reason(int.from_bytes(bytes(data[:4]), "little"), TEXTS[number].format(data[5])))

    def against(self, *modes: str) -> tuple[str, ...]:
        """Reasons that bar any of these modes, each once."""
        wanted = sum({MODES.get(mode, 0) for mode in modes})
        return tuple(dict.fromkeys(reason.text for reason in self._reasons if reason.modes & wanted))


TEXTS = {
    3061044: "Accel {} inconsistent",
    8227839: "Accelerometer sensor {} missing",
    5444856: "Accelerometer {} uncalibrated",
    4643123: "Airspeed invalid",
    1802995: "Airspeed too high",
    4549029: "Altitude failure detected",
    9643369: "Angular velocity not valid",
    5704353: "Arm authorization denied",
    8538897: "Attitude failure detected",
    16745468: "Attitude failure detected",
    15289843: "Avionics Power high",
    1670367: "Avionics Power low",
    5095593: "Barometer {} missing",
    13344346: "Battery unhealthy",
    8799553: "Battery {} disconnected",
    15602498: "Battery {} has a fault",
    10318274: "Battery {} missing",
    1058956: "CPU load too high",
    5273740: "Compass inconsistent",
    15388760: "Compass sensor {} missing",
    16716537: "Compass {} uncalibrated",
    4448091: "Crash dumps present on SD card",
    2627595: "Critical battery",
    14221469: "Distance sensor {} missing",
    15793174: "ESC failure",
    9191449: "ESC telemetry missing",
    6948489: "ESC {} has a fault",
    14566046: "ESC {} offline",
    11344647: "Emergency battery level",
    6258044: "Estimator fault due to Compass {}",
    9608226: "Estimator not using GPS",
    4261821: "Failure triggered by external system",
    12754954: "Flight termination active",
    9965819: "GNSS heading not reliable",
    5717196: "GPS Horizontal Position Drift too high",
    1049276: "GPS Horizontal Position Error too high",
    4975227: "GPS Horizontal Speed Drift too high",
    10198977: "GPS PDOP too high",
    10678671: "GPS Speed Accuracy too low",
    11497430: "GPS Vertical Position Drift too high",
    516062: "GPS Vertical Position Error too high",
    6558257: "GPS Vertical Speed Drift too high",
    12369553: "GPS fix too low",
    12780289: "GPS jamming detected",
    14995448: "GPS signal jammed",
    8713942: "GPS signal spoofed",
    124285: "Geofence RTL requires valid home",
    143019: "Geofence violation: approaching or outside geofence",
    13923616: "Geofence violation: exceeding maximum altitude above Home",
    4065583: "Geofence violation: exceeding maximum distance to Home",
    12276004: "Global position estimate required",
    3568720: "Gyro sensor {} missing",
    2481841: "Gyro {} inconsistent",
    1326449: "Gyro {} uncalibrated",
    16642797: "Heading estimate not stable",
    9634798: "Height estimate not stable",
    3613628: "High Accelerometer Bias",
    9307221: "High Gyro Bias",
    79408: "Home position not set",
    6491364: "Home position required",
    9697819: "Horizontal position unstable",
    8902208: "Horizontal velocity unstable",
    4877352: "Imbalanced propeller detected",
    9077977: "Kill switch engaged",
    16158540: "Landing gear switch set in UP position",
    5049764: "Low battery",
    14644618: "Maximum flight time reached",
    10996333: "Missing FMU SD Card",
    12805643: "Mission cannot be completed",
    14748737: "Mode is not registered",
    9815168: "Mode is unresponsive",
    1871713: "Mode not suitable for arming",
    666479: "Motor failure detected",
    12689900: "Navigation error: No valid altitude estimate",
    10011251: "Navigation error: No valid global position estimate",
    13835193: "Navigation error: No valid position estimate",
    9266821: "No CPU and RAM load information",
    9493632: "No airspeed data",
    6801787: "No connection to the ground control station",
    453929: "No manual control input",
    3087815: "No offboard signal",
    10450063: "No valid attitude estimate",
    16230031: "No valid data from Accelerometer {}",
    6410608: "No valid data from Compass {}",
    11478328: "No valid data from Gyro {}",
    3189229: "No valid data from barometer {}",
    8544646: "No valid data from distance sensor {}",
    11125932: "No valid data from optical flow sensor",
    377561: "No valid mission available",
    13094458: "Not enough GPS Satellites",
    5943233: "Not enough compasses found",
    10161216: "Open Drone ID system missing",
    8441780: "Open Drone ID system not ready",
    8792768: "Optical flow sensor missing",
    6962647: "Overcurrent detected for the hipower 5V supply",
    5699115: "Overcurrent detected for the peripheral 5V supply",
    15965684: "Parachute system missing",
    13372152: "Parachute system not ready",
    2088119: "Poor GPS Quality",
    10960133: "Position estimate has low accuracy",
    7908333: "Power module not connected",
    2229864: "Power redundancy not met",
    276785: "Press safety button first",
    14421482: "RAM usage too high",
    7847312: "RC calibration for channel {} invalid: MAX too great",
    6979701: "RC calibration for channel {} invalid: MIN too small",
    1917030: "RC calibration for channel {} invalid: TRIM above MAX",
    8495477: "RC calibration for channel {} invalid: TRIM below MIN",
    7884377: "RTL switch engaged",
    2228586: "Remaining flight time low",
    3603209: "Stopping compass use",
    15713375: "Strong magnetic interference",
    7214714: "System power unavailable",
    9409869: "Task watchdog dumps present on SD card",
    9134139: "Traffic avoidance system missing",
    7662152: "USB connected",
    15180799: "VTOL fixed-wing system failure detected",
    7959667: "Vehicle is in safety configuration",
    13528143: "Vehicle is in transition state",
    14200647: "Vehicle is not in multicopter mode",
    9171208: "Vertical velocity unstable",
    6054338: "Waiting for estimator to initialize",
    810921: "Waypoint above maximum height",
    11413600: "Wind speed is above limit",
}
"""Words of the checks, by the number of their event; {} is the number of the sensor, battery or channel."""
