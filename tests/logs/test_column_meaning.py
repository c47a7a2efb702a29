"""The meaning of a column of another program's table, as far as its name tells."""

from pathlib import Path

import pytest

from quadctl.logs.column_meaning import is_it, meaning
from tests.support.log_files import sentence_of
from tests.support.places import DATA

EXAMPLE = DATA / "reports" / "20-dates-as-time" / "flight.csv"


@pytest.mark.parametrize(
    ("name", "kind", "part", "unit"),
    [
        ("timestamp", "time", "", ""),
        ("Time [ms]", "time", "", "ms"),
        ("pos_x", "position", "x", ""),
        ("stateEstimate.z", "position", "z", ""),
        ("x (m)", "position", "x", "m"),
        ("PN", "position", "north", ""),
        ("VelocityY", "velocity", "y", ""),
        ("stateEstimate.vx", "velocity", "x", ""),
        ("north_m_s", "velocity", "north", "m/s"),
        ("vel_d", "velocity", "down", ""),
        ("q[0]", "attitude", "0", ""),
        ("orientation_w", "attitude", "w", ""),
        ("stabilizer.roll", "attitude", "roll", ""),
        ("heading_deg", "attitude", "yaw", "deg"),
        ("rollspeed", "rates", "roll", ""),
        ("pitch_rate_deg_s", "rates", "pitch", "deg/s"),
        ("gyro.x", "rates", "x", ""),
        ("omega_z_rad_s", "rates", "z", "rad/s"),
        ("acc.x", "imu", "x", ""),
        ("imu_acc_z_m_s2", "imu", "z", "m/s2"),
        ("latitude_deg", "place", "latitude", "deg"),
        ("lng", "place", "longitude", ""),
        ("relative_altitude_m", "place", "relative_altitude", "m"),
        ("height_above_takeoff(feet)", "place", "height_above_takeoff", "ft"),
        ("xSpeed(mph)", "velocity", "x", "mph"),
        ("v_RS_R_x [m s^-1]", "velocity", "x", "m/s"),
        ("q_RS_w []", "attitude", "w", ""),
        ("motor.m3", "motor", "3", ""),
        ("rpm[2]", "motor", "2", "rpm"),
        ("motor1_pwm", "motor", "1", "pwm"),
        ("pm.vbat", "battery", "", ""),
        ("battery_mv", "battery", "", "mV"),
    ],
)
def test_quantity_part_and_unit(name: str, kind: str, part: str, unit: str) -> None:
    found = meaning(name)
    assert found is not None and (found.kind, found.part, found.unit) == (kind, part, unit)


@pytest.mark.parametrize(
    "name",
    (
        "ctrltarget.x x_ref_m pos_sp_x roll_cmd desroll vel_std_x stateEstimate.ax ang_acc_x phase motor1_voltage_v "
        f"foo speed {'x' * 100_000}"
    ).split(),
)
def test_what_was_wanted_or_is_something_else_has_none(name: str) -> None:
    found = meaning(name)
    assert found is None or found.kind not in ("position", "velocity", "attitude", "rates", "imu", "motor")


@pytest.mark.parametrize(
    ("column", "names", "hint"),
    [
        ("time_s", ["latitude_deg", "timestamp"], " (is it 'timestamp'?)"),
        ("vx_m_s", ["east_m_s", "down_m_s", "north_m_s"], " (is it 'north_m_s'?)"),
        ("vz_m_s", ["east_m_s", "down_m_s"], ""),
        ("roll_rate_rad_s", ["relative_altitude_m", "roll_speed"], " (is it 'roll_speed'?)"),
        ("roll_rate_rad_s", ["rollspeed_deg_s"], ""),
        ("yaw_deg", ["heading_deg"], " (is it 'heading_deg'?)"),
        ("z_m", ["zm"], " (is it 'zm'?)"),
        ("pitch_deg", ["pich_deg"], " (is it 'pich_deg'?)"),
        ("vx_m_s", ["ax_m_s"], ""),
    ],
)
def test_only_a_name_that_means_the_same_is_proposed(column: str, names: list[str], hint: str) -> None:
    assert is_it(column, names) == hint


@pytest.mark.skipif(not EXAMPLE.is_file(), reason="the examples of bug reports are not here")
def test_a_table_of_telemetry_is_told_what_can_read_it() -> None:
    said = sentence_of(Path(EXAMPLE))
    assert "time_s (is it 'timestamp'?), x_m, y_m, z_m, vx_m_s (is it 'north_m_s'?), vy_m_s (is it 'east_m_s'?)" in said
    assert said.count("is it") == 3
    assert said.endswith("or a map of its columns beside it (`quadctl logs --guess` proposes one)")
