"""Messages of PX4 and ArduPilot become one state of the vehicle."""

import math
from typing import Any

import pytest

from quadctl.flight.autopilot.ardupilot import ARDUPILOT
from quadctl.flight.autopilot.px4 import PX4
from quadctl.flight.autopilot.telemetry import Telemetry
from quadctl.thrust_chain.ardupilot import DEFAULT_CURVE, output_of_thrust
from quadctl.thrust_chain.chain import Ambient

VOLTAGE = {
    "voltage_battery": 15000,
    "battery_remaining": -1,
    "onboard_control_sensors_present": 0,
    "onboard_control_sensors_enabled": 0,
    "onboard_control_sensors_health": 0,
}


COPTER = {"autopilot": 3, "base_mode": 1, "custom_mode": 4}


def test_without_heartbeats_the_link_counts_as_lost_though_data_come() -> None:
    telemetry = Telemetry(n_rotors=4)
    telemetry.receive("HEARTBEAT", {"autopilot": 12, "base_mode": 129, "custom_mode": 6 << 16}, now_s=10.0)
    telemetry.receive("SYS_STATUS", VOLTAGE, now_s=12.9)
    assert telemetry.state(now_s=12.9).connected
    telemetry.receive("SYS_STATUS", VOLTAGE, now_s=13.1)
    state = telemetry.state(now_s=13.1)
    assert not state.connected
    assert state.age_s("heartbeat") == pytest.approx(3.1)
    assert state.age_s("battery") == 0.0


def test_on_a_link_that_loses_heartbeats_the_mode_stands_in_for_them_for_six_seconds() -> None:
    telemetry = Telemetry(n_rotors=4)
    telemetry.receive("HEARTBEAT", {"autopilot": 12, "base_mode": 129, "custom_mode": 6 << 16}, now_s=10.0)
    for now_s in (12.0, 13.0, 14.0, 15.0):
        telemetry.receive("CURRENT_MODE", {"custom_mode": 6 << 16}, now_s=now_s)
    assert telemetry.state(now_s=15.9).connected
    assert not telemetry.state(now_s=16.1).connected
    silent = Telemetry(n_rotors=4)
    silent.receive("HEARTBEAT", {"autopilot": 12, "base_mode": 129, "custom_mode": 6 << 16}, now_s=10.0)
    silent.receive("CURRENT_MODE", {"custom_mode": 6 << 16}, now_s=11.0)
    assert silent.state(now_s=13.9).connected
    assert not silent.state(now_s=14.1).connected


def test_before_the_first_message_nothing_looks_like_data() -> None:
    state = Telemetry(n_rotors=4).state(now_s=100.0)
    assert not state.finite
    assert not state.connected
    assert len(state.rotor_rpm) == 4
    assert all(map(math.isnan, (*state.rotor_rpm, state.battery_v)))
    assert state.control_age_s == math.inf


def test_mode_names_are_read_from_the_custom_mode() -> None:
    assert PX4.mode_name(6 << 16) == "OFFBOARD"
    assert PX4.mode_name(4 << 16 | 6 << 24) == "LAND"
    assert PX4.mode_name(10 << 16) == "TERMINATION"
    assert PX4.mode_name(9 << 16 | 1 << 24) == "9/1"
    assert ARDUPILOT.mode_name(4) == "GUIDED"
    assert ARDUPILOT.mode_name(99) == "mode 99"


def heard(*messages: tuple[str, dict[str, Any]]) -> Telemetry:
    telemetry = Telemetry(n_rotors=4)
    telemetry.receive("HEARTBEAT", COPTER, now_s=1.0)
    for name, fields in messages:
        telemetry.receive(name, fields, now_s=1.0)
    return telemetry


def test_rotor_speeds_come_from_esc_telemetry() -> None:
    fields = {"rpm": [1, 2, 3, 4], "voltage": [1600] * 4, "current": [250] * 4}
    state = heard(("ESC_TELEMETRY_1_TO_4", fields)).state(1.0)
    assert state.rotor_rpm == (1.0, 2.0, 3.0, 4.0)
    assert state.motor_voltage_v == (16.0,) * 4
    assert state.motor_current_a == (2.5,) * 4


def test_zeros_for_all_rotors_are_no_speeds() -> None:
    fields = {"rpm": [0] * 4, "voltage": [1600] * 4, "current": [250] * 4}
    assert all(map(math.isnan, heard(("ESC_TELEMETRY_1_TO_4", fields)).state(1.0).rotor_rpm))


def test_rotor_speeds_come_from_rpm_sensors_where_there_is_nothing_else() -> None:
    state = heard(*(("RAW_RPM", {"index": i, "frequency": 1000.0 + i}) for i in range(4))).state(1.0)
    assert state.rotor_rpm == (1000.0, 1001.0, 1002.0, 1003.0)
    assert state.age_s("rpm") == 0.0


AIR = {"press_abs": 955.98, "temperature": 2816}
"""Air of 0.9016 of that at sea level."""
COMPENSATED = DEFAULT_CURVE | {"MOT_BAT_VOLT_MAX": 16.0, "MOT_BAT_VOLT_MIN": 12.0}


def test_motor_outputs_are_thrusts_without_the_compensations_of_the_autopilot() -> None:
    ambient = Ambient(15.0, 0.9016)
    outputs = {i: output_of_thrust(0.1 * i, COMPENSATED, ambient) for i in range(1, 5)}
    pulses = {f"servo{i}_raw": round(1000.0 * (1.0 + outputs.get(i, -1.0))) for i in range(1, 17)}
    telemetry = heard(("SYS_STATUS", VOLTAGE), ("SCALED_PRESSURE", AIR))
    telemetry.thrust_parameters = COMPENSATED
    telemetry.receive("SERVO_OUTPUT_RAW", {"port": 0, **pulses}, now_s=1.0)
    assert telemetry.state(1.0).motor_output == pytest.approx((0.1, 0.2, 0.3, 0.4), abs=0.002)


@pytest.mark.parametrize(
    ("number", "ratio", "atmosphere"),
    [(0x04060000, 0.9540, "standard"), (0x04050000, 0.9016, "ground"), (0, 0.9016, "assumed")],
    ids=["since 4.6", "before", "unknown"],
)
def test_the_density_of_the_air_is_that_of_the_version(number: int, ratio: float, atmosphere: str) -> None:
    telemetry = heard(("SCALED_PRESSURE", AIR), ("AUTOPILOT_VERSION", {"flight_sw_version": number}))
    telemetry.receive("GLOBAL_POSITION_INT", {"alt": 488_100}, now_s=1.0)
    telemetry.receive("GLOBAL_POSITION_INT", {"alt": 600_000}, now_s=2.0)  # in flight: the ground was told before
    assert telemetry.ambient.density_ratio == pytest.approx(ratio, abs=1e-4)
    assert telemetry.ambient.atmosphere == atmosphere


def test_the_standard_atmosphere_waits_for_the_altitude() -> None:
    telemetry = heard(("SCALED_PRESSURE", AIR), ("AUTOPILOT_VERSION", {"flight_sw_version": 0x04060000}))
    assert not telemetry.knows_air
    telemetry.receive("GLOBAL_POSITION_INT", {"alt": 488_100}, now_s=1.0)
    assert telemetry.knows_air


def test_the_voltage_compensated_is_that_at_rest_not_that_under_load() -> None:
    telemetry = heard(("SYS_STATUS", VOLTAGE))
    telemetry.receive("HEARTBEAT", COPTER | {"base_mode": 129}, now_s=2.0)
    telemetry.receive("SYS_STATUS", VOLTAGE | {"voltage_battery": 14000}, now_s=2.0)
    assert telemetry.state(2.0).battery_v == 14.0
    assert telemetry.ambient.battery_v == 15.0


def test_an_estimator_in_doubt_is_seen() -> None:
    tests = {"velocity_variance": 0.1, "pos_horiz_variance": 1.5, "pos_vert_variance": 0.2}
    good = heard(("EKF_STATUS_REPORT", {"flags": 0b11_1111, **tests})).state(1.0)
    assert good.estimator_ok
    assert good.estimator_ratio == 1.5
    assert not heard(("EKF_STATUS_REPORT", {"flags": 0b10_0111, **tests})).state(1.0).estimator_ok


PX4_HEARTBEAT = {"autopilot": 12, "base_mode": 1, "custom_mode": 6 << 16}
RATIOS = {"flags": 0b11_1111, "vel_ratio": 0.1, "pos_horiz_ratio": 0.1, "pos_vert_ratio": None}
GPS, VISION = 1 << 5, 1 << 7


def test_the_accuracy_that_px4_states_is_read() -> None:
    telemetry = Telemetry(n_rotors=4)
    accuracy = {"pos_horiz_accuracy": 0.56, "pos_vert_accuracy": None}
    telemetry.receive("ESTIMATOR_STATUS", {**RATIOS, **accuracy}, now_s=1.0)
    state = telemetry.state(1.0)
    assert state.horizontal_std_m == 0.56
    assert math.isnan(state.vertical_std_m)


def sensors(*healths: int) -> list[tuple[str, dict[str, Any]]]:
    return [("SYS_STATUS", {**VOLTAGE, "onboard_control_sensors_health": health}) for health in healths]


@pytest.mark.parametrize(
    ("healths", "lost"),
    [
        ((0,), False),  # it never had one
        ((GPS,), False),
        ((GPS, 0), True),
        ((VISION, 0, 0), True),
        ((GPS | VISION, VISION), False),  # another one works
        ((GPS, 0, GPS), False),
    ],
)
def test_ardupilot_has_lost_its_source_of_position_when_none_works_any_more(
    healths: tuple[int, ...], lost: bool
) -> None:
    assert heard(*sensors(*healths)).state(1.0).aid_lost == lost


def test_the_sensor_bits_of_px4_say_nothing_about_what_its_estimator_uses() -> None:
    assert not heard(("HEARTBEAT", PX4_HEARTBEAT), *sensors(GPS, 0)).state(1.0).aid_lost


PREARM = 1 << 28


@pytest.mark.parametrize(("health", "ready"), [(0, False), (PREARM, True)])
def test_px4s_health_bit_alone_says_if_it_would_arm(health: int, ready: bool) -> None:
    """It never lists the check as present. In offboard it waits for setpoints, so there the bit says nothing."""
    hold = {**PX4_HEARTBEAT, "custom_mode": 4 << 16 | 3 << 24}
    state = heard(("HEARTBEAT", hold), *sensors(health)).state(1.0)
    assert (state.ready_to_arm, state.tells_readiness) == (ready, True)
    state = heard(("HEARTBEAT", PX4_HEARTBEAT), *sensors(health)).state(1.0)
    assert (state.ready_to_arm, state.tells_readiness) == (True, False)


@pytest.mark.parametrize(("present", "health", "ready"), [(0, 0, True), (PREARM, 0, False), (PREARM, PREARM, True)])
def test_ardupilot_lists_its_check_as_present(present: int, health: int, ready: bool) -> None:
    assert heard(status(present, present, health)).state(1.0).ready_to_arm == ready


def test_ardupilot_whose_checks_are_off_lists_them_as_not_in_use_and_says_nothing_of_readiness() -> None:
    """With ARMING_CHECK 0 the health bit never comes: waiting for it would never end."""
    state = heard(status(PREARM, 0, 0)).state(1.0)
    assert (state.checks_off, state.ready_to_arm, state.tells_readiness) == (True, True, False)
    state = heard(status(PREARM, PREARM, 0)).state(1.0)
    assert (state.checks_off, state.ready_to_arm, state.tells_readiness) == (False, False, True)


def test_parts_that_are_in_use_and_not_healthy_are_named() -> None:
    battery, magnetometer = 1 << 25, 1 << 2
    state = heard(status(GPS | battery, GPS | battery | PREARM, GPS | magnetometer)).state(1.0)
    assert state.failing == ("battery",)


def status(present: int, enabled: int, health: int) -> tuple[str, dict[str, Any]]:
    kinds = {"present": present, "enabled": enabled, "health": health}
    return "SYS_STATUS", VOLTAGE | {f"onboard_control_sensors_{kind}": flags for kind, flags in kinds.items()}


def told(text: str) -> tuple[str, dict[str, Any]]:
    return "STATUSTEXT", {"id": 0, "chunk_seq": 0, "severity": 6, "text": text}


def test_px4_says_that_it_is_disarmed_a_second_before_its_heartbeats_do() -> None:
    armed = {"autopilot": 12, "base_mode": 129, "custom_mode": 6 << 16}
    px4 = Telemetry(n_rotors=4)
    for text, expected in (("Armed by external command", True), ("Disarmed by external command", False)):
        px4.receive("HEARTBEAT", armed, now_s=5.0)
        px4.receive(*told(text), now_s=5.3)
        assert px4.state(5.3).armed is expected
    px4.receive("HEARTBEAT", armed, now_s=6.0)  # armed again
    assert px4.state(6.0).armed


GPS, VISION = 1 << 5, 1 << 7


@pytest.mark.parametrize(("healthy", "lost"), [(GPS, True), (GPS | VISION, False), (VISION, False)])
def test_a_gps_without_a_fix_is_lost_though_ardupilot_calls_it_healthy(healthy: int, lost: bool) -> None:
    status = VOLTAGE | {"onboard_control_sensors_health": healthy}
    copter = heard(("SYS_STATUS", status), ("GPS_RAW_INT", {"fix_type": 3}))
    assert not copter.state(1.0).aid_lost
    for name, fields in (("GPS_RAW_INT", {"fix_type": 1}), ("SYS_STATUS", status)):
        copter.receive(name, fields, now_s=1.2)
        assert copter.state(1.2).aid_lost is lost
    copter.receive("GPS_RAW_INT", {"fix_type": 4}, now_s=1.4)
    assert not copter.state(1.4).aid_lost


def test_a_gps_that_never_had_a_fix_is_not_lost() -> None:
    copter = heard(("GPS_RAW_INT", {"fix_type": 0}), ("SYS_STATUS", VOLTAGE | {"onboard_control_sensors_health": GPS}))
    copter.receive("GPS_RAW_INT", {"fix_type": 1}, now_s=1.2)
    assert not copter.state(1.2).aid_lost


@pytest.mark.parametrize(
    ("percent", "charges", "said"),
    [
        (-1, (), None),
        (1, (1, 2), None),
        (0, (), "0 % of the battery is left"),
        (3, (3, 1), "the autopilot calls the battery critical (3 % of the battery is left)"),
        (-1, (3, 5), "the autopilot calls the battery failed"),
    ],
)
def test_a_battery_that_is_empty_or_worse_is_said(percent: int, charges: tuple[int, ...], said: str | None) -> None:
    told = heard(("SYS_STATUS", VOLTAGE | {"battery_remaining": percent}))
    for number, charge in enumerate(charges):
        told.receive("BATTERY_STATUS", {"id": number, "charge_state": charge}, now_s=1.0)
    assert told.state(1.0).why_battery_empty == said


def test_a_remote_control_is_received_if_it_is_there_and_healthy() -> None:
    assert heard().state(1.0).remote is None
    for present, health, expected in ((0, 1 << 16, False), (1 << 16, 0, False), (1 << 16, 1 << 16, True)):
        flags = {"onboard_control_sensors_present": present, "onboard_control_sensors_health": health}
        assert heard(("SYS_STATUS", VOLTAGE | flags)).state(1.0).remote is expected
