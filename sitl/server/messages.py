"""The estimate as MAVLink messages: one function for each message, the same for all autopilots."""

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from quadctl.frames import GRAVITY_M_S2, euler_from_quaternion
from quadctl.sitl.server import dialect
from quadctl.state import VehicleState
from quadctl.thrust_chain.atmosphere import GAS_CONSTANT_J_KG_K

Message = Any
Builder = Callable[[VehicleState], Iterator[Message]]

UNKNOWN_16_BIT = 65535
CHUNK = 50
"""Length of a text in one STATUSTEXT."""
CHARGE_STATES = {
    "critical": mavlink.MAV_BATTERY_CHARGE_STATE_CRITICAL,
    "empty (emergency)": mavlink.MAV_BATTERY_CHARGE_STATE_EMERGENCY,
}
ESTIMATOR_FLAGS = 0b11_1111
"""Attitude, velocities, position horizontal and vertical, relative and absolute: all good."""


def local_position(estimate: VehicleState) -> Iterator[Message]:
    yield mavlink.MAVLink_local_position_ned_message(
        _boot_ms(estimate), *estimate.position_ned_m, *estimate.velocity_ned_m_s
    )


def attitude_quaternion(estimate: VehicleState) -> Iterator[Message]:
    yield mavlink.MAVLink_attitude_quaternion_message(_boot_ms(estimate), *estimate.attitude, *estimate.rates_rad_s)


def attitude(estimate: VehicleState) -> Iterator[Message]:
    yield mavlink.MAVLink_attitude_message(
        _boot_ms(estimate), *euler_from_quaternion(estimate.attitude), *estimate.rates_rad_s
    )


def esc_status(estimate: VehicleState) -> Iterator[Message]:
    """ESC_STATUS of four motors each; no message where there are no rotor speeds."""
    unknown = [math.nan] * 4
    for first, rpm in _by_fours(estimate.rotor_rpm):
        current = (list(estimate.motor_current_a[first : first + 4]) + unknown)[:4]
        yield dialect.EscStatus(first, 1000 * _boot_ms(estimate), rpm, unknown, current)


def esc_telemetry(estimate: VehicleState) -> Iterator[Message]:
    """ESC_TELEMETRY, with zeros where there are no rotor speeds, as ArduPilot's simulator sends it."""
    kinds = (mavlink.MAVLink_esc_telemetry_1_to_4_message, mavlink.MAVLink_esc_telemetry_5_to_8_message)
    groups = list(_by_fours(estimate.rotor_rpm)) or [(0, [0] * 4)]
    centivolts = round(100.0 * estimate.battery_v) if math.isfinite(estimate.battery_v) else 0
    for kind, (first, rpm) in zip(kinds, groups, strict=False):
        amperes = estimate.motor_current_a[first : first + 4]
        centiamperes = ([round(100.0 * a) if math.isfinite(a) else 0 for a in amperes] + [0] * 4)[:4]
        yield kind([25] * 4, [centivolts] * 4, centiamperes, [0] * 4, rpm, [1] * 4)


def actuator_output_status(estimate: VehicleState) -> Iterator[Message]:
    pulses = [1000.0 + 1000.0 * output for output in estimate.motor_output]
    padded = (pulses + [math.nan] * 32)[:32]
    yield mavlink.MAVLink_actuator_output_status_message(1000 * _boot_ms(estimate), len(pulses), padded)


def servo_output_raw(pulse_us: Callable[[float], float]) -> Builder:
    """Builder of SERVO_OUTPUT_RAW; `pulse_us` is the autopilot's function from throttle to pulse length."""

    def build(estimate: VehicleState) -> Iterator[Message]:
        pulses = ([round(pulse_us(output)) for output in estimate.motor_output] + [0] * 16)[:16]
        yield mavlink.MAVLink_servo_output_raw_message(1000 * _boot_ms(estimate), 0, *pulses)

    return build


def scaled_pressure(pressure_pa: float, temperature_c: float) -> Builder:
    """Builder of SCALED_PRESSURE, for air that does not change: that of the ground, or of the barometer's height."""

    def build(estimate: VehicleState) -> Iterator[Message]:
        temperature = round(100.0 * temperature_c)
        height_m = estimate.baro_m if math.isfinite(estimate.baro_m) else 0.0
        read_pa = pressure_pa * math.exp(-height_m * GRAVITY_M_S2 / (GAS_CONSTANT_J_KG_K * (temperature_c + 273.15)))
        yield mavlink.MAVLink_scaled_pressure_message(_boot_ms(estimate), 0.01 * read_pa, 0.0, temperature)

    return build


def altitude(estimate: VehicleState) -> Iterator[Message]:
    """ALTITUDE, whose monotonic height is that of the barometer alone; no message where there is none."""
    if math.isfinite(estimate.baro_m):
        height_m = -estimate.position_ned_m[2]
        yield mavlink.MAVLink_altitude_message(
            1000 * _boot_ms(estimate), estimate.baro_m, height_m, height_m, height_m, estimate.range_m, math.nan
        )


def distance_sensor(estimate: VehicleState) -> Iterator[Message]:
    """DISTANCE_SENSOR of a range finder that looks down; no message where it sees nothing."""
    if math.isfinite(estimate.range_m):
        kind, down = mavlink.MAV_DISTANCE_SENSOR_LASER, mavlink.MAV_SENSOR_ROTATION_PITCH_270
        distance_cm = round(100.0 * estimate.range_m)
        yield mavlink.MAVLink_distance_sensor_message(_boot_ms(estimate), 1, 1000, distance_cm, kind, 0, down, 255)


def global_position(ground_m: float) -> Builder:
    """Builder of GLOBAL_POSITION_INT, for a ground that lies `ground_m` above the sea; no message without numbers."""

    def build(estimate: VehicleState) -> Iterator[Message]:
        if not estimate.finite:  # whole numbers cannot say so
            return
        height_m = -estimate.position_ned_m[2]
        altitude_mm, above_mm = round(1000.0 * (ground_m + height_m)), round(1000.0 * height_m)
        velocity_cm_s = (round(100.0 * v) for v in estimate.velocity_ned_m_s)
        yield mavlink.MAVLink_global_position_int_message(
            _boot_ms(estimate), 473977000, 85456000, altitude_mm, above_mm, *velocity_cm_s, UNKNOWN_16_BIT
        )

    return build


def sys_status(lists_prearm: bool) -> Builder:
    """Builder of SYS_STATUS; `lists_prearm`: the pre-arm check is present, as on ArduPilot; else only health tells."""
    # A GPS without a fix is healthy, too: PX4's was not looked at, ArduPilot's stayed so for 20 s.
    checked, gps = mavlink.MAV_SYS_STATUS_PREARM_CHECK, mavlink.MAV_SYS_STATUS_SENSOR_GPS
    own = gps | checked if lists_prearm else gps

    def build(estimate: VehicleState) -> Iterator[Message]:
        remote = mavlink.MAV_SYS_STATUS_SENSOR_RC_RECEIVER if estimate.remote else 0
        present = own | remote
        enabled = present & ~checked if estimate.checks_off else present
        ready = estimate.ready_to_arm and not estimate.checks_off
        healthy = (checked if ready else 0) | gps | remote
        yield mavlink.MAVLink_sys_status_message(
            present, enabled, healthy, 0, _millivolts(estimate), -1, _percent(estimate), 0, 0, 0, 0, 0, 0
        )

    return build


def gps_raw(estimate: VehicleState) -> Iterator[Message]:
    """GPS_RAW_INT, of which the fix is what counts here."""
    fix = mavlink.GPS_FIX_TYPE_NO_FIX if estimate.aid_lost else mavlink.GPS_FIX_TYPE_3D_FIX
    yield mavlink.MAVLink_gps_raw_int_message(
        1000 * _boot_ms(estimate), fix, 473977000, 85456000, 0, UNKNOWN_16_BIT, UNKNOWN_16_BIT, 0, UNKNOWN_16_BIT, 10
    )


def battery_status(estimate: VehicleState) -> Iterator[Message]:
    cells = [_millivolts(estimate)] + [UNKNOWN_16_BIT] * 9
    charge = CHARGE_STATES.get(estimate.battery_alarm, mavlink.MAV_BATTERY_CHARGE_STATE_OK)
    yield mavlink.MAVLink_battery_status_message(
        0, 0, 0, 32767, cells, -1, -1, -1, _percent(estimate), charge_state=charge
    )


def _percent(estimate: VehicleState) -> int:
    """Charge of the battery that remains; -1 where it is not known."""
    return round(100.0 * estimate.battery_remaining) if math.isfinite(estimate.battery_remaining) else -1


def extended_sys_state(estimate: VehicleState) -> Iterator[Message]:
    landed = mavlink.MAV_LANDED_STATE_ON_GROUND if estimate.landed else mavlink.MAV_LANDED_STATE_IN_AIR
    yield mavlink.MAVLink_extended_sys_state_message(mavlink.MAV_VTOL_STATE_UNDEFINED, landed)


def estimator_status(estimate: VehicleState) -> Iterator[Message]:
    flags = ESTIMATOR_FLAGS if estimate.estimator_ok else 0
    ratio = estimate.estimator_ratio
    unknown = math.nan
    yield mavlink.MAVLink_estimator_status_message(
        1000 * _boot_ms(estimate),
        flags,
        0.1,
        ratio,
        0.1,
        0.1,
        unknown,
        unknown,
        estimate.horizontal_std_m,
        estimate.vertical_std_m,
    )


def ekf_status_report(estimate: VehicleState) -> Iterator[Message]:
    flags = ESTIMATOR_FLAGS if estimate.estimator_ok else 0
    yield mavlink.MAVLink_ekf_status_report_message(flags, 0.1, estimate.estimator_ratio, 0.1, 0.1, 0.1)


def timesync(estimate: VehicleState) -> Iterator[Message]:
    """Question of its own about the other side's clock, which nobody has to answer."""
    yield mavlink.MAVLink_timesync_message(0, round(1e9 * estimate.time_s))


def statustext(severity: int, text: str, number: int) -> Iterator[Message]:
    """STATUSTEXT in as many chunks as the text needs."""
    data = text.encode()
    for place, first in enumerate(range(0, len(data), CHUNK)):
        yield mavlink.MAVLink_statustext_message(severity, data[first : first + CHUNK], number, place)


ARMING_SUMMARY, WAITING_FOR_ESTIMATOR, NO_POSITION, NO_SETPOINTS = 11047904, 6054338, 13835193, 3087815
"""Numbers of PX4's events about arming, as recorded."""
EVERY_MODE, MODES_BY_POSITION, OFFBOARD = 0xFFFFFFFF, 0x7E007C, 1 << 14
"""Modes that those events concern."""
ERROR, PROTOCOL = 0x33, 0x88
"""Log levels of events."""


def arming_report(ready: bool, boot_ms: int) -> Iterator[Message]:
    """PX4's report of its checks as events: what is wrong before it is `ready`, and that offboard has no setpoints."""
    events = [(ARMING_SUMMARY, PROTOCOL, 0), (NO_SETPOINTS, ERROR, OFFBOARD)]
    if not ready:
        events[1:1] = [(WAITING_FOR_ESTIMATOR, ERROR, EVERY_MODE), (NO_POSITION, ERROR, MODES_BY_POSITION)]
    for sequence, (number, level, modes) in enumerate(events):
        arguments = [*modes.to_bytes(4, "little"), *[0] * 36]
        yield dialect.Event(0, 0, 1 << 24 | number, boot_ms, sequence, level, arguments)


def _by_fours(rpm: Sequence[float]) -> Iterator[tuple[int, list[int]]]:
    """Groups of four motors with the number of the first, the last one filled with zeros; none without speeds."""
    if all(map(math.isfinite, rpm)):
        for first in range(0, len(rpm), 4):
            group = [round(v) for v in rpm[first : first + 4]]
            yield first, group + [0] * (4 - len(group))


def _boot_ms(estimate: VehicleState) -> int:
    return round(1000.0 * estimate.time_s)


def _millivolts(estimate: VehicleState) -> int:
    return round(1000.0 * estimate.battery_v) if math.isfinite(estimate.battery_v) else UNKNOWN_16_BIT
