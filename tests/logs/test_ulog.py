"""A PX4 log becomes the lab's table; the simulator's truth never gets into it."""

from pathlib import Path

import numpy as np
import pytest
from pyulog import ULog

from quadctl.errors import LogError
from quadctl.logs import ulog
from quadctl.logs.findings import Kind, of_kind
from quadctl.logs.flight_log import ATTITUDE, RATES, FlightLog
from quadctl.logs.quality import quality
from quadctl.logs.read import read_log
from tests.support.log_files import (
    PX4,
    G,
    Topic,
    assert_same,
    needs_px4,
    sentence_of,
    small_ulog,
    tilt_correlation,
    ulog_without,
)


class TestULog:
    def test_signs_frames_and_units(self, tmp_path: Path) -> None:
        path = tmp_path / "a.ulg"
        path.write_bytes(small_ulog())
        log = read_log(path)
        last = {name: values[-1] for name, values in log.columns.items()}
        assert (last["x_m"], last["y_m"], last["z_m"]) == (99.0, 2.0, 49.5)
        assert (last["vx_m_s"], last["vy_m_s"], last["vz_m_s"]) == (4.0, 5.0, 6.0)
        assert [last[name] for name in ATTITUDE] == pytest.approx([0.0, 0.0, 90.0], abs=1e-4)
        assert [last[name] for name in RATES] == pytest.approx([0.1, 0.2, 0.3], rel=1e-6)
        assert last["imu_z_m_s2"] == pytest.approx(-G)
        assert last["battery_v"] == 16.0

    def test_a_log_that_ends_within_a_message_says_so_and_so_does_what_it_lacks(self, tmp_path: Path) -> None:
        path = tmp_path / "a.ulg"
        whole = small_ulog()
        path.write_bytes(whole)
        assert not of_kind(read_log(path).findings, Kind.CUT_SHORT)
        for missing in (1, 2, 30):
            path.write_bytes(whole[:-missing])
            assert of_kind(read_log(path).findings, Kind.CUT_SHORT)
        path.write_bytes(whole[:20])
        with pytest.raises(LogError, match=r"holds no values of x_m.*message is cut short: was the whole log copied\?"):
            read_log(path)
        path.write_bytes(small_ulog(without="vehicle_attitude")[:-1])
        with pytest.raises(LogError, match=r"holds no values of roll_deg.*was the whole log copied\?"):
            read_log(path)

    def test_resets_of_the_estimator_are_events_and_one_note(self, tmp_path: Path) -> None:
        path = tmp_path / "a.ulg"
        path.write_bytes(small_ulog())  # its counter changes at the sample of 1 + 60 * 0.02 - 0.008 s
        log = read_log(path)
        reset_s = 1.0 + 1.2 - 0.008 - log.meta["time_zero_s"]
        assert {"time_s": pytest.approx(reset_s, abs=1e-3), "what": "estimator reset its height"} in log.meta["events"]
        (reset,) = of_kind(quality(log).findings, Kind.RESET)
        assert reset.figures["of"] == "height" and reset.times_s[0][0] == pytest.approx(reset_s, abs=1e-3)

    def test_positions_stand_at_the_time_of_their_sample_and_only_where_valid(self, tmp_path: Path) -> None:
        path = tmp_path / "a.ulg"
        path.write_bytes(small_ulog())
        log = read_log(path)
        first = log.updates("x_m")[0]
        assert log["x_m"][first] == 10.0
        assert log.time_s[first] + log.meta["time_zero_s"] == pytest.approx(1.0 + 0.2 - 0.008)

    def test_motor_outputs_stop_where_px4_says_nan(self, tmp_path: Path) -> None:
        nan = np.nan
        rows = [(1_000_000, *[nan] * 12), (1_500_000, 0.1, 0.2, 0.3, 0.4, *[nan] * 8), (2_000_000, *[nan] * 12)]
        path = tmp_path / "a.ulg"
        path.write_bytes(small_ulog(Topic("actuator_motors", "uint64_t timestamp;float[12] control", rows)))
        log = read_log(path)
        assert "motor5_output" not in log.columns
        assert log["motor3_output"][log.updates("motor3_output")] == pytest.approx([0.0, 0.3, 0.0])

    def test_speeds_go_to_the_motors_that_the_escs_drive(self, tmp_path: Path) -> None:
        nobody = (0, 0.0, 0) * 6
        rows = [(1_000_000 + 4000 * i, 2, 4000 + i, 16.5, 102, -(5000 + i), 16.0, 101, *nobody) for i in range(500)]
        path = tmp_path / "a.ulg"
        fields = "uint64_t timestamp;uint8_t esc_count;esc_report[8] esc"
        path.write_bytes(small_ulog(Topic("esc_status", fields, rows)))
        log = read_log(path)
        first = log.updates("motor1_rpm")[0]
        assert log.n_rotors == 2
        assert (log["motor2_rpm"][first], log["motor1_rpm"][first]) == (4000.0, 5000.0)
        assert (log["motor2_voltage_v"][first], log["motor1_voltage_v"][first]) == (16.5, 16.0)

    def test_outputs_and_setpoints_of_px4_1_12(self, tmp_path: Path) -> None:
        """Half of the PWM range at THR_MDL_FAC 0.3 is 0.3 * 0.25 + 0.7 * 0.5 of the thrust."""
        us = [1_000_000 + 4000 * i for i in range(500)]
        outputs = [
            (t, 6, 1100.0, 1500.0 + i % 2, 1900.0, 1300.0, 1500.0, 1500.0, *[0.0] * 10) for i, t in enumerate(us)
        ]
        outputs[0] = (us[0], 6, *[900.0] * 4, 1500.0, 1500.0, *[0.0] * 10)  # disarmed
        setpoints = [(t, 0.01, 0.02, 0.03, 0.45, *[0.0] * 4) for t in us]
        path = tmp_path / "a.ulg"
        path.write_bytes(
            small_ulog(
                Topic("actuator_outputs", "uint64_t timestamp;uint32_t noutputs;float[16] output", outputs),
                Topic("actuator_controls_0", "uint64_t timestamp;float[8] control", setpoints),
                parameters={"MAV_TYPE": 2, "PWM_MAIN_MIN": 1100, "PWM_MAIN_MAX": 1900, "THR_MDL_FAC": 0.3},
            )
        )
        log = read_log(path)
        row = log.updates("motor2_output")[1]
        found = [log[f"motor{i}_output"][row + 20] for i in (1, 3, 4)]
        assert found == pytest.approx([0.0, 1.0, 0.3 * 0.25**2 + 0.7 * 0.25], abs=1e-6)
        assert np.min(log["motor2_output"][row:]) == pytest.approx(0.3 * 0.25 + 0.7 * 0.5, abs=1e-6)
        assert "motor5_output" not in log.columns
        assert log["throttle_cmd"][-1] == pytest.approx(0.45)
        assert any("THR_MDL_FAC = 0.3" in note for note in log.notes)
        assert "actuator_outputs" in log.meta["sources"]

    def test_outputs_of_later_versions_are_shares_of_thrust_already(self, tmp_path: Path) -> None:
        rows = [(1_000_000 + 4000 * i, *[0.4] * 4, *[np.nan] * 8) for i in range(500)]
        pulses = [(t, 4, *[1500.0 + t % 3] * 4, *[0.0] * 12) for t, *_ in rows]
        path = tmp_path / "a.ulg"
        path.write_bytes(
            small_ulog(
                Topic("actuator_motors", "uint64_t timestamp;float[12] control", rows),
                Topic("actuator_outputs", "uint64_t timestamp;uint32_t noutputs;float[16] output", pulses),
                parameters={"THR_MDL_FAC": 0.3},
            )
        )
        assert read_log(path)["motor1_output"][-1] == pytest.approx(0.4)

    @pytest.mark.parametrize(("enabled", "thrust"), [(0, 0.48), (1, 0.4)])
    def test_scaling_with_the_battery_is_removed_where_it_is_on(
        self, enabled: int, thrust: float, tmp_path: Path
    ) -> None:
        us = [1_000_000 + 4000 * i for i in range(500)]
        path = tmp_path / "a.ulg"
        path.write_bytes(
            small_ulog(
                Topic("actuator_motors", "uint64_t timestamp;float[12] control", [(t, *[0.48] * 12) for t in us]),
                Topic("vehicle_thrust_setpoint", "uint64_t timestamp;float[3] xyz", [(t, 0.0, 0.0, -0.48) for t in us]),
                Topic("battery_status", "uint64_t timestamp;float voltage_v;float scale", [(t, 15.0, 1.2) for t in us]),
                parameters={"MC_BAT_SCALE_EN": enabled},
            )
        )
        log = read_log(path)
        assert log["motor1_output"][-1] == pytest.approx(thrust)
        assert log["throttle_cmd"][-1] == pytest.approx(thrust)
        assert any("MC_BAT_SCALE_EN" in note for note in log.notes) == bool(enabled)

    def test_thrust_in_three_dimensions_is_read_and_that_of_upright_rotors_has_no_lateral_columns(
        self, tmp_path: Path
    ) -> None:
        for name, lateral in (("full.ulg", (0.1, -0.2)), ("tilt.ulg", (0.0, 0.0))):
            rows = [(1_000_000 + 4000 * i, *lateral, -0.48) for i in range(500)]
            topic = Topic("vehicle_thrust_setpoint", "uint64_t timestamp;float[3] xyz", rows)
            (tmp_path / name).write_bytes(small_ulog(topic))
        full, tilt = read_log(tmp_path / "full.ulg"), read_log(tmp_path / "tilt.ulg")
        names = ("throttle_x_cmd", "throttle_y_cmd", "throttle_cmd")
        assert [full[name][-1] for name in names] == pytest.approx([0.1, -0.2, 0.48])
        assert tilt["throttle_cmd"][-1] == pytest.approx(0.48)
        assert not {"throttle_x_cmd", "throttle_y_cmd"} & tilt.columns.keys()

    def test_outputs_that_are_no_pulses_are_said(self, tmp_path: Path) -> None:
        rows = [(1_000_000 + 4000 * i, 4, *[4000.0 + i] * 4, *[0.0] * 12) for i in range(500)]
        path = tmp_path / "a.ulg"
        topic = Topic("actuator_outputs", "uint64_t timestamp;uint32_t noutputs;float[16] output", rows)
        path.write_bytes(small_ulog(topic))
        log = read_log(path)
        assert "motor1_output" not in log.columns
        assert any("no pulse lengths" in note for note in log.notes)

    def test_a_position_that_the_estimator_never_called_valid_is_said(self, tmp_path: Path) -> None:
        path = tmp_path / "a.ulg"
        path.write_bytes(small_ulog(valid_from=1000))
        assert (
            "holds no values of x_m, y_m (PX4's estimator calls x_m and y_m invalid throughout: xy_valid is false), "
            "expected a flight in which they are valid"
        ) in sentence_of(path)

    def test_a_position_that_the_estimator_called_invalid_for_a_while_is_noted(self, tmp_path: Path) -> None:
        path = tmp_path / "a.ulg"
        path.write_bytes(small_ulog())
        assert any("x_m and y_m invalid in 10.0% of its messages" in note for note in read_log(path).notes)

    def test_missing_attitude_is_one_sentence(self, tmp_path: Path) -> None:
        path = tmp_path / "a.ulg"
        path.write_bytes(small_ulog(without="vehicle_attitude"))
        assert "holds no values of roll_deg, pitch_deg, yaw_deg, expected messages vehicle_local" in sentence_of(path)

    def test_truth_is_not_asked_for(self) -> None:
        assert not [topic for topic in ulog.TOPICS if "groundtruth" in topic or "sim" in topic]


@pytest.fixture(scope="module")
def px4_stairs() -> FlightLog:
    return read_log(PX4 / "A_staircase.ulg")


@pytest.fixture(scope="module")
def px4_forward() -> FlightLog:
    return read_log(PX4 / "B_forward.ulg")


@needs_px4
class TestRealPX4:
    def test_rates_are_those_logged(self, px4_stairs: FlightLog) -> None:
        span = px4_stairs.time_s[-1]
        expected = {"x_m": 50, "roll_deg": 125, "roll_rate_rad_s": 125, "motor1_output": 124, "battery_v": 5}
        for name, rate in expected.items():
            assert len(px4_stairs.updates(name)) / span == pytest.approx(rate, rel=0.01), name
        assert np.all(np.diff(px4_stairs.time_s) > 0.0)
        assert px4_stairs.n_rotors == 0

    def test_staircase_from_3_to_half_a_metre_and_back(self, px4_stairs: FlightLog) -> None:
        at = {t: float(np.interp(t, px4_stairs.time_s, px4_stairs["z_m"])) for t in (0, 9, 55, 100, 118)}
        error = 0.35  # of the estimator, which starts off by 0.18 m
        assert at[9] == pytest.approx(3.0, abs=error)
        assert at[55] == pytest.approx(0.55, abs=error)
        assert at[100] == pytest.approx(2.8, abs=error)

    @pytest.mark.parametrize("name", ["A_staircase", "B_forward"])
    def test_state_is_the_true_one_within_the_estimators_error(self, name: str) -> None:
        log = read_log(PX4 / f"{name}.ulg")
        truth = ULog(str(PX4 / f"{name}.ulg"), ["vehicle_local_position_groundtruth"]).data_list[0].data
        time = 1e-6 * truth["timestamp"] - log.meta["time_zero_s"]
        flying = (time > 8.0) & (time < log.time_s[-1] - 6.0)
        for column, field, sign, limit in (
            ("x_m", "x", 1, 0.5),
            ("y_m", "y", 1, 0.6),
            ("z_m", "z", -1, 0.7),
            ("vx_m_s", "vx", 1, 0.45),
            ("vz_m_s", "vz", -1, 0.45),
        ):
            error = np.interp(time, log.time_s, log[column]) - sign * truth[field]
            assert np.abs(error[flying]).max() < limit, column

    def test_hover(self, px4_stairs: FlightLog) -> None:
        flying = (px4_stairs.time_s > 8.0) & (px4_stairs.time_s < px4_stairs.time_s[-1] - 8.0)
        assert np.median(px4_stairs["throttle_cmd"][flying]) == pytest.approx(0.491, abs=0.005)
        for motor in range(1, 5):
            assert np.median(px4_stairs[f"motor{motor}_output"][flying]) == pytest.approx(0.49, abs=0.01)
        assert px4_stairs["imu_z_m_s2"][flying].mean() == pytest.approx(-G, abs=0.05)
        assert px4_stairs["az_m_s2"][flying].mean() == pytest.approx(0.0, abs=0.05)
        assert 15.0 < px4_stairs["battery_v"][-1] < 17.0

    def test_nose_down_goes_north_and_right_wing_down_goes_east(
        self, px4_forward: FlightLog, px4_stairs: FlightLog
    ) -> None:
        assert tilt_correlation(px4_forward, "vx_m_s", "pitch_deg", -1.0) > 0.9
        assert tilt_correlation(px4_stairs, "vy_m_s", "roll_deg", 1.0) > 0.5

    def test_attitude_follows_its_command(self, px4_forward: FlightLog) -> None:
        known = np.isfinite(px4_forward["pitch_cmd_deg"]) & np.isfinite(px4_forward["pitch_deg"])
        assert np.corrcoef(px4_forward["pitch_cmd_deg"][known], px4_forward["pitch_deg"][known])[0, 1] > 0.7

    def test_without_the_simulators_truth_in_the_file_nothing_changes(self, tmp_path: Path) -> None:
        path = PX4 / "B_forward.ulg"
        stripped = tmp_path / path.name
        stripped.write_bytes(ulog_without(path.read_bytes(), lambda name: "groundtruth" in name or "_sim" in name))
        assert_same(read_log(path), read_log(stripped))

    def test_a_cut_file_is_read_to_where_it_ends(self, px4_forward: FlightLog, tmp_path: Path) -> None:
        data = (PX4 / "B_forward.ulg").read_bytes()
        path = tmp_path / "cut.ulg"
        path.write_bytes(data[: len(data) // 2])
        half = read_log(path)
        assert 0.4 * len(px4_forward) < len(half) < 0.6 * len(px4_forward)
        path.write_bytes(data[:40_000])
        assert "holds no values of x_m" in sentence_of(path)

    def test_damage_in_the_middle_is_said(self, tmp_path: Path) -> None:
        data = bytearray((PX4 / "B_forward.ulg").read_bytes())
        data[3_000_000:3_002_000] = bytes(2000)
        path = tmp_path / "damaged.ulg"
        path.write_bytes(data)
        assert "the file is damaged: what could not be read was left out" in read_log(path).notes
