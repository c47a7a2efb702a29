"""An ArduPilot DataFlash log becomes the lab's table; the simulator's truth never gets into it."""

from pathlib import Path

import numpy as np
import pytest
from pymavlink.DFReader import DFReader_binary

from quadctl.logs import dataflash
from quadctl.logs.findings import Kind, of_kind
from quadctl.logs.flight_log import ATTITUDE, POSITION, RATES, FlightLog
from quadctl.logs.read import read_log
from tests.support.log_files import (
    ARDUPILOT,
    G,
    assert_same,
    dataflash_without,
    needs_ardupilot,
    sentence_of,
    small_dataflash,
    tilt_correlation,
)


class TestDataFlash:
    def test_a_position_that_the_estimator_did_not_call_valid_is_noted(self, tmp_path: Path) -> None:
        path = tmp_path / "a.bin"
        path.write_bytes(small_dataflash(status=0b10_0111))
        assert [note for note in read_log(path).notes if "valid" in note] == [
            "ArduPilot's estimator did not call x_m and y_m valid in 100.0% of its messages (XKF4.SS): "
            "they are read all the same"
        ]
        path.write_bytes(small_dataflash())
        assert not [note for note in read_log(path).notes if "valid" in note]

    def test_signs_frames_units_and_the_core_that_flies(self, tmp_path: Path) -> None:
        path = tmp_path / "a.bin"
        path.write_bytes(small_dataflash())
        log = read_log(path)
        last = {name: values[-1] for name, values in log.columns.items()}
        assert last["x_m"] == pytest.approx(10.099)
        assert (last["y_m"], last["z_m"]) == (5.0, 6.0)
        assert (last["vx_m_s"], last["vy_m_s"], last["vz_m_s"]) == (1.0, 2.0, 3.0)
        assert [last[name] for name in ATTITUDE] == pytest.approx([1.1, -2.1, -1.0])
        assert [last[f"{name}_cmd_deg"] for name in ("roll", "pitch", "yaw")] == pytest.approx([1.0, -2.0, -10.0])
        assert [last[name] for name in RATES] == pytest.approx([np.pi, np.pi / 2, -np.pi / 2])
        assert last["throttle_cmd"] == pytest.approx(0.35)
        assert last["imu_z_m_s2"] == pytest.approx(-9.8)

    def test_outputs_are_mapped_by_function_and_scaled_by_their_range(self, tmp_path: Path) -> None:
        path = tmp_path / "a.bin"
        path.write_bytes(small_dataflash())
        log = read_log(path)
        assert (log["motor1_output"][-1], log["motor2_output"][-1]) == (0.25, 0.5)
        assert "motor3_output" not in log.columns

    def test_standing_rotors_are_said_and_turning_ones_loaded(self, tmp_path: Path) -> None:
        def esc(rpm: int) -> bytes:
            rows = [(5_000_000 + 20_000 * i, n, 100 * rpm * (n + 1)) for i in range(100) for n in (0, 1)]
            return small_dataflash(("ESC", "QBe", "TimeUS,Instance,RPM", rows))

        path = tmp_path / "a.bin"
        path.write_bytes(esc(0))
        still = read_log(path)
        assert still.n_rotors == 0
        assert "ESC reports no rotor speeds: they are all zero" in still.notes
        path.write_bytes(esc(4000))
        turning = read_log(path)
        assert (turning["motor2_rpm"][-1], turning["motor1_rpm"][-1]) == (4000.0, 8000.0)

    def test_what_is_missing_is_named_beside_what_is_there(self, tmp_path: Path) -> None:
        path = tmp_path / "a.bin"
        path.write_bytes(small_dataflash(without="XKF1"))
        assert "holds PARM, XKF4, ATT, RATE, IMU, RCOU, SIM2 of ArduPilot, but no XKF1 or NKF1 or EKF1" in sentence_of(
            path
        )
        path.write_bytes(small_dataflash(without="ATT"))
        assert "but no ATT: expected XKF1 (NKF1 or EKF1 of older versions) and ATT" in sentence_of(path)

    def test_a_log_without_data_is_told_so(self, tmp_path: Path) -> None:
        path = tmp_path / "a.bin"
        whole = small_dataflash()
        path.write_bytes(whole[: 6 * 89])
        assert "ends after 6 formats and holds no data" in sentence_of(path)
        path.write_bytes(whole[:120])
        assert "ends after 1 format and holds no data" in sentence_of(path)

    @pytest.mark.parametrize("missing", [1, 5, 10, 11, 12])
    def test_an_end_within_a_message_is_said_however_little_of_it_is_there(self, missing: int, tmp_path: Path) -> None:
        path = tmp_path / "a.bin"
        path.write_bytes(small_dataflash(("ARM", "QB", "TimeUS,ArmState", [(6_900_000, 1)]))[:-missing])
        nothing_of_it = missing == 12
        assert bool(of_kind(read_log(path).findings, Kind.CUT_SHORT)) != nothing_of_it

    def test_damage_costs_the_damaged_messages_only(self, tmp_path: Path) -> None:
        whole = small_dataflash()
        path = tmp_path / "a.bin"
        path.write_bytes(whole)
        clean = read_log(path)
        at = whole.index(b"\xa3\x95", len(whole) // 2)
        path.write_bytes(whole[:at] + b"\x00\xa3garbage" + whole[at:-4])
        log = read_log(path)
        assert f"9 damaged bytes left out, the first at byte {at}" in log.notes
        assert "the last message is cut short and was left out" in log.notes
        assert len(log) == len(clean)

    def test_truth_is_not_asked_for(self) -> None:
        assert not [name for name in dataflash.MESSAGES if name.startswith("SIM")]


@pytest.fixture(scope="module")
def flash_stairs() -> FlightLog:
    return read_log(ARDUPILOT / "stair_eq0.bin")


@pytest.fixture(scope="module")
def flash_forward() -> FlightLog:
    return read_log(ARDUPILOT / "fwd_vib.bin")


@needs_ardupilot
class TestRealDataFlash:
    def test_rates_are_those_logged(self, flash_stairs: FlightLog, flash_forward: FlightLog) -> None:
        rates = {name: source["rate_hz"] for name, source in flash_forward.meta["sources"].items()}
        # two EKF cores and two IMUs share 50 Hz
        expected = {"XKF1 of core 0": 25, "ATT": 50, "RATE": 50, "IMU": 25, "ESC 0": 50, "RCOU": 10, "BAT": 10}
        assert {name: rates[name] for name in expected} == pytest.approx(expected, rel=0.01)
        assert len(flash_stairs.updates(*RATES)) / flash_stairs.time_s[-1] == pytest.approx(50, rel=0.01)
        assert len(flash_stairs.updates(*POSITION)) / flash_stairs.time_s[-1] == pytest.approx(25, rel=0.01)

    def test_staircase_from_3_to_a_third_of_a_metre_and_back(self, flash_stairs: FlightLog) -> None:
        moving = np.abs(np.interp(np.arange(16.0, 116.0, 0.5), flash_stairs.time_s, flash_stairs["vz_m_s"])) > 0.03
        z = np.interp(np.arange(16.0, 116.0, 0.5), flash_stairs.time_s, flash_stairs["z_m"])[~moving]
        for height in (3.0, 2.0, 1.5, 1.0, 0.7, 0.5, 0.35):
            assert np.abs(z - height).min() < 0.05, height
        assert np.argmin(z) == pytest.approx(len(z) / 2, abs=len(z) / 6)

    @pytest.mark.parametrize(("name", "z_limit"), [("stair_eq0", 0.16), ("fwd_vib", 0.17)])
    def test_state_is_the_true_one_within_the_estimators_error(self, name: str, z_limit: float) -> None:
        log = read_log(ARDUPILOT / f"{name}.bin")
        reader = DFReader_binary(str(ARDUPILOT / f"{name}.bin"))
        rows = []
        while (m := reader.recv_match(type=["SIM2"])) is not None:
            rows.append((1e-6 * m.TimeUS - log.meta["time_zero_s"], m.PN, m.PE, -m.PD, m.VN))
        truth = np.array(rows)
        truth = truth[(truth[:, 0] > 1.0) & (truth[:, 0] < log.time_s[-1] - 1.0)]
        for i, (column, limit) in enumerate((("x_m", 0.12), ("y_m", 0.05), ("z_m", z_limit), ("vx_m_s", 0.06)), 1):
            updates = log.updates(column)
            error = np.interp(truth[:, 0], log.time_s[updates], log[column][updates]) - truth[:, i]
            assert np.abs(error).max() < limit, column

    def test_values_are_those_that_pymavlink_decodes(self, flash_forward: FlightLog) -> None:
        reader = DFReader_binary(str(ARDUPILOT / "fwd_vib.bin"))
        checked = 0
        while (m := reader.recv_match(type=["ATT"])) is not None and checked < 3000:
            row = (
                np.searchsorted(
                    flash_forward.time_s, 1e-6 * m.TimeUS - flash_forward.meta["time_zero_s"] + 2e-6, "right"
                )
                - 1
            )
            assert (flash_forward["roll_deg"][row], flash_forward["pitch_deg"][row]) == pytest.approx((m.Roll, m.Pitch))
            checked += 1
        assert checked == 3000

    def test_hover(self, flash_stairs: FlightLog) -> None:
        flying = (flash_stairs.time_s > 12.0) & (flash_stairs.time_s < flash_stairs.time_s[-1] - 12.0)
        assert np.median(flash_stairs["throttle_cmd"][flying]) == pytest.approx(0.345, abs=0.003)
        # The outputs hold the command again: without the compensations removed they are 1.115 times it.
        outputs = np.mean([flash_stairs[f"motor{i}_output"][flying] for i in range(1, 5)], axis=0)
        assert np.median(outputs) == pytest.approx(0.345, abs=0.003)
        assert flash_stairs["imu_z_m_s2"][flying].mean() == pytest.approx(-G, abs=0.05)
        assert flash_stairs["battery_v"][-1] == pytest.approx(12.6)
        assert flash_stairs.meta["armed_s"][0][1] == pytest.approx(124.5, abs=0.5)

    def test_rotor_speeds_where_they_are_real_numbers(self, flash_stairs: FlightLog, flash_forward: FlightLog) -> None:
        assert flash_stairs.n_rotors == 0
        assert "ESC reports no rotor speeds: they are all zero" in flash_stairs.notes
        assert flash_forward.n_rotors == 4
        assert np.nanmedian(flash_forward["motor3_rpm"]) == pytest.approx(3932.0, abs=20.0)

    def test_nose_down_goes_north(self, flash_forward: FlightLog) -> None:
        assert tilt_correlation(flash_forward, "vx_m_s", "pitch_deg", -1.0) > 0.9

    def test_without_the_simulators_truth_in_the_file_nothing_changes(self, tmp_path: Path) -> None:
        path = ARDUPILOT / "fwd_vib.bin"
        stripped = tmp_path / path.name
        stripped.write_bytes(dataflash_without(path.read_bytes(), lambda name: name.startswith("SIM")))
        assert stripped.stat().st_size < path.stat().st_size - 300_000
        assert_same(read_log(path), read_log(stripped))
