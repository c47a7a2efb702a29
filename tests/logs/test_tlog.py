"""A telemetry log becomes the lab's table, on the autopilot's clock whatever the link does."""

import struct
from pathlib import Path

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from quadctl.logs import tlog
from quadctl.logs.findings import Kind, of_kind
from quadctl.logs.flight_log import ATTITUDE, POSITION, RATES, FlightLog, Floats
from quadctl.logs.read import read_log
from tests.support.log_files import (
    ARDUPILOT,
    G,
    assert_same,
    needs_ardupilot,
    sentence_of,
    telemetry,
    tlog_bytes,
    tlog_without,
)


class TestTlog:
    def write(self, tmp_path: Path, data: bytes) -> Path:
        path = tmp_path / "a.tlog"
        path.write_bytes(data)
        return path

    def test_signs_frames_and_units(self, tmp_path: Path) -> None:
        log = read_log(self.write(tmp_path, tlog_bytes(telemetry())))
        last = {name: values[-1] for name, values in log.columns.items()}
        assert [last[name] for name in POSITION] == pytest.approx([9.9, 2.0, 3.0])
        assert [last[name] for name in ("vx_m_s", "vy_m_s", "vz_m_s")] == [4.0, 5.0, 6.0]
        assert [last[name] for name in ATTITUDE] == pytest.approx(np.degrees([0.1, -0.2, 0.99]).tolist())
        assert [last[name] for name in RATES] == pytest.approx([0.4, 0.5, 0.6])
        assert (last["motor1_rpm"], last["motor4_rpm"]) == (4095.0, 4300.0)
        assert (last["motor1_voltage_v"], last["motor1_current_a"]) == pytest.approx((16.5, 2.1))
        assert last["motor1_output"] == pytest.approx(0.495)
        assert "motor5_output" not in log.columns

    @pytest.mark.parametrize("kind", ["ALTITUDE", "SCALED_PRESSURE"])
    def test_the_sensors_of_the_height_are_read(self, tmp_path: Path, kind: str) -> None:
        """A climb from 150 m, 40 cm each second, over a floor 1.5 m below it; another sensor looks forward."""
        records = telemetry()
        for i in range(40):
            ms, at_s, height = 4_000_000 + 100 * i, 0.1 * i + 0.3, 150.0 + 0.04 * i
            pascal = 101325.0 * (1.0 - 0.0065 * height / 288.15) ** (9.80665 / (0.0065 * 287.053))
            told: object = mavlink.MAVLink_scaled_pressure_message(ms, 0.01 * pascal, 0.0, 2350)
            if kind == "ALTITUDE":
                told = mavlink.MAVLink_altitude_message(1000 * ms, height, 9.0, 9.0, 9.0, 9.0, 9.0)
            down, forward = (
                mavlink.MAVLink_distance_sensor_message(ms, 20, 1000, distance, 0, which, orientation, 255)
                for which, distance, orientation in ((1, round(150 + 4 * i) if i else 1200, 25), (0, 700, 0))
            )
            records += [(at_s, told), (at_s, forward), (at_s, down)]
        log = read_log(self.write(tmp_path, tlog_bytes(sorted(records, key=lambda record: record[0]))))
        expected = np.interp(log.time_s, 0.1 * np.arange(40), 150.0 + 0.04 * np.arange(40))
        inside = (log.time_s > 0.2) & (log.time_s < 3.7)
        np.testing.assert_allclose(log["baro_m"][inside], expected[inside], atol=0.06)
        np.testing.assert_allclose(log["range_m"][inside], expected[inside] - 148.5, atol=0.06)
        assert np.nanmax(log["range_m"]) < 4.0  # what was beyond its reach is not there
        assert log.has("baro_temperature_c") == (kind == "SCALED_PRESSURE")

    def test_time_is_the_autopilots_whatever_the_link_does(self, tmp_path: Path) -> None:
        log = read_log(self.write(tmp_path, tlog_bytes(telemetry())))
        np.testing.assert_allclose(log.time_s[log.updates(*POSITION)], 0.04 * np.arange(100), atol=0.0015)

    def test_32_bit_microseconds_are_unwrapped(self, tmp_path: Path) -> None:
        log = read_log(self.write(tmp_path, tlog_bytes(telemetry(boot_s=5000.0))))  # they overflow at 4295 s
        np.testing.assert_allclose(log.time_s[log.updates("motor1_output")], 0.2 * np.arange(20), atol=0.0025)

    def test_messages_without_a_stamp_get_the_time_of_those_around_them(self, tmp_path: Path) -> None:
        log = read_log(self.write(tmp_path, tlog_bytes(telemetry())))
        np.testing.assert_allclose(log.time_s[log.updates("motor1_rpm")], 0.2 * np.arange(20), atol=0.05)

    def test_esc_status_is_known_though_pymavlink_does_not_know_it(self, tmp_path: Path) -> None:
        payload = struct.pack("<Q4i4f4fB", 4_000_500_000, 5000, 5100, 5200, 5300, *[16.0] * 4, *[3.0] * 4, 0)
        frame = bytes([0xFD, len(payload), 0, 0, 0, 1, 1]) + (291).to_bytes(3, "little") + payload + b"\0\0"
        arrival = struct.pack(">Q", 1_700_000_000_800_000)
        records = [record for record in telemetry() if "ESC" not in record[1].get_type()]  # type: ignore[attr-defined]
        before = [record for record in records if record[0] <= 0.8]
        data = tlog_bytes(before) + arrival + frame + tlog_bytes(records[len(before) :])
        log = read_log(self.write(tmp_path, data))
        first = log.updates("motor1_rpm")[0]
        assert (log["motor1_rpm"][first], log["motor4_rpm"][first]) == (5000.0, 5300.0)
        assert log.time_s[first] == pytest.approx(0.5, abs=0.003)

    def test_of_two_boots_the_longer_is_read(self, tmp_path: Path) -> None:
        early = tlog_bytes(telemetry(20))
        late = tlog_bytes([(t + 60.0, m) for t, m in telemetry(80, boot_s=5.0)])
        log = read_log(self.write(tmp_path, early + late))
        assert log.meta["time_zero_s"] == pytest.approx(5.0, abs=0.01)
        assert any("booted 1 times" in note for note in log.notes)

    def test_of_two_vehicles_the_one_with_more_positions_is_read(self, tmp_path: Path) -> None:
        log = read_log(self.write(tmp_path, tlog_bytes(telemetry(50), system=7) + tlog_bytes(telemetry(80))))
        assert log.meta["system"] == 1
        assert any("system 1 was read" in note and "7/1" in note for note in log.notes)

    @pytest.mark.parametrize("missing", [1, 7, 20, 30])
    def test_an_end_within_a_record_is_said(self, missing: int, tmp_path: Path) -> None:
        log = read_log(self.write(tmp_path, tlog_bytes(telemetry())[:-missing]))
        assert of_kind(log.findings, Kind.CUT_SHORT) and not of_kind(log.findings, Kind.DAMAGED_BYTES)

    def test_an_end_of_which_only_some_bytes_are_there_is_said(self, tmp_path: Path) -> None:
        whole = tlog_bytes(telemetry())
        for more in (1, 2, 5, 12):
            log = read_log(self.write(tmp_path, whole + whole[:more]))
            assert of_kind(log.findings, Kind.CUT_SHORT) and not of_kind(log.findings, Kind.DAMAGED_BYTES), more
        log = read_log(self.write(tmp_path, whole + b"garbage that is no record"))
        assert not of_kind(log.findings, Kind.CUT_SHORT) and of_kind(log.findings, Kind.DAMAGED_BYTES)
        log = read_log(self.write(tmp_path, whole))
        assert not of_kind(log.findings, Kind.CUT_SHORT, Kind.DAMAGED_BYTES)

    def test_what_is_there_is_named_where_something_is_missing(self, tmp_path: Path) -> None:
        without = [record for record in telemetry() if "LOCAL_POSITION" not in record[1].get_type()]  # type: ignore[attr-defined]
        said = sentence_of(self.write(tmp_path, tlog_bytes(without)))
        assert "expected messages LOCAL_POSITION_NED and ATTITUDE (or ATTITUDE_QUATERNION) beside ATTITUDE" in said

    def test_damaged_bytes_cost_their_messages_only(self, tmp_path: Path) -> None:
        data = bytearray(tlog_bytes(telemetry()))
        data[2000:2010] = b"\xff" * 10
        log = read_log(self.write(tmp_path, bytes(data)))
        assert any("damaged bytes left out" in note for note in log.notes)
        assert len(log.updates(*POSITION)) >= 98

    def test_without_positions_is_one_sentence(self, tmp_path: Path) -> None:
        records = [record for record in telemetry() if isinstance(record[1], mavlink.MAVLink_attitude_message)]
        message = sentence_of(self.write(tmp_path, tlog_bytes(records)))
        assert "holds no values of x_m" in message
        assert "expected messages LOCAL_POSITION_NED" in message

    def test_truth_is_not_asked_for(self) -> None:
        assert not [name for name in tlog.MESSAGES.values() if "SIM" in name or name.startswith("HIL")]


@pytest.fixture(scope="module")
def streamed() -> FlightLog:
    return read_log(ARDUPILOT / "fwd_vib.tlog")


@needs_ardupilot
class TestRealTlog:
    def test_rates_are_those_streamed(self, streamed: FlightLog) -> None:
        for names, rate in ((POSITION, 25.0), (ATTITUDE, 25.0), (RATES, 25.0)):
            assert len(streamed.updates(*names)) / streamed.time_s[-1] == pytest.approx(rate, rel=0.01)
        assert streamed.meta["sources"]["ESC_TELEMETRY_1_TO_4 from 1"]["rate_hz"] == pytest.approx(10.0, abs=0.1)

    def test_is_the_same_flight_as_the_dataflash_log(self, streamed: FlightLog) -> None:
        flash = read_log(ARDUPILOT / "fwd_vib.bin")
        shift = streamed.meta["time_zero_s"] - flash.meta["time_zero_s"]
        clock = np.arange(15.0, 100.0, 0.1)

        def signal(of: FlightLog, name: str, offset: float) -> Floats:
            rows = of.updates(name)
            return np.interp(clock - offset, of.time_s[rows], of[name][rows])

        limits = {"x_m": 0.05, "z_m": 0.02, "vx_m_s": 0.05, "pitch_deg": 0.5, "pitch_cmd_deg": 1.5}
        for name, limit in limits.items():
            difference = np.abs(signal(streamed, name, shift) - signal(flash, name, 0.0))
            assert np.quantile(difference, 0.99) < limit, name

    def test_hover(self, streamed: FlightLog) -> None:
        flying = (streamed.time_s > 15.0) & (streamed.time_s < streamed.time_s[-1] - 12.0)
        assert np.median(streamed["throttle_cmd"][flying]) == pytest.approx(0.345, abs=0.003)
        assert np.median(streamed["motor2_output"][flying]) == pytest.approx(0.587, abs=0.005)
        assert streamed["imu_z_m_s2"][flying].mean() == pytest.approx(-G, abs=0.05)
        assert streamed.n_rotors == 4

    def test_without_the_simulators_truth_in_the_file_nothing_changes(
        self, streamed: FlightLog, tmp_path: Path
    ) -> None:
        data = (ARDUPILOT / "fwd_vib.tlog").read_bytes()
        path = tmp_path / "fwd_vib.tlog"
        path.write_bytes(tlog_without(data, lambda number: number in (108, 164)))  # SIM_STATE, SIMSTATE
        assert path.stat().st_size < len(data) - 50_000
        assert_same(streamed, read_log(path))
