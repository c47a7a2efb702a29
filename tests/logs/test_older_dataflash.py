"""DataFlash logs of ArduCopter 3.2 and 3.3, and DataFlash logs as text: the same flight, by the same reader."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from quadctl.errors import LogError
from quadctl.logs.findings import Kind, of_kind
from quadctl.logs.flight_log import ATTITUDE, RATES
from quadctl.logs.parameters import read_present_parameters
from quadctl.logs.read import read_log
from tests.support.log_files import (
    ARDUPILOT,
    assert_same,
    dataflash_bytes,
    dataflash_text,
    needs_ardupilot,
    old_dataflash,
    sentence_of,
    small_dataflash,
)
from tests.support.places import DATA

EXAMPLES = DATA / "reports"
needs_examples = pytest.mark.skipif(not EXAMPLES.is_dir(), reason="the examples of bug reports are not here")
FORMS = [dataflash_bytes, dataflash_text]


@pytest.mark.parametrize("written", FORMS)
class TestOlderVersions:
    @pytest.mark.parametrize("version", ["3.2.1", "3.3.3"])
    def test_state_battery_and_outputs(self, version: str, written: Callable[..., bytes], tmp_path: Path) -> None:
        path = tmp_path / "a.bin"
        path.write_bytes(old_dataflash(version, written=written))
        log = read_log(path)
        last = {name: values[-1] for name, values in log.columns.items()}
        assert (last["x_m"], last["y_m"], last["z_m"]) == (10.0, 5.0, 6.0)
        assert (last["vx_m_s"], last["vy_m_s"], last["vz_m_s"]) == (1.0, 2.0, 3.0)
        assert [last[name] for name in ATTITUDE] == pytest.approx([1.1, -2.1, -1.0])
        assert last["imu_z_m_s2"] == pytest.approx(-9.8)
        assert last["battery_v"] == pytest.approx(16.44)
        assert [last[f"motor{i}_output"] for i in range(1, 5)] == pytest.approx([0.5, 0.25, 0.75, 0.0])
        assert "motor5_output" not in log.columns
        assert np.diff(log.time_s) == pytest.approx(0.02)
        assert log.meta["software"].startswith(f"ArduCopter V{version}")

    def test_rates_and_throttle_are_in_their_units(self, written: Callable[..., bytes], tmp_path: Path) -> None:
        path = tmp_path / "a.bin"
        path.write_bytes(old_dataflash("3.2.1", written=written))
        log = read_log(path)  # which has the gyro's only
        assert [log[name][-1] for name in RATES] == pytest.approx([0.1, 0.2, 0.3])
        assert log["throttle_cmd"][-1] == pytest.approx(0.45)
        path.write_bytes(old_dataflash("3.3.3", written=written))
        log = read_log(path)  # centidegrees per second, and thousandths
        assert [log[name][-1] for name in RATES] == pytest.approx([np.pi, np.pi / 2, -np.pi / 2])
        assert log["throttle_cmd"][-1] == pytest.approx(0.35)

    def test_messages_without_a_time_have_that_of_those_before_them(
        self, written: Callable[..., bytes], tmp_path: Path
    ) -> None:
        path = tmp_path / "a.bin"
        path.write_bytes(old_dataflash(written=written))
        log = read_log(path)
        assert log.meta["armed_s"] == [[pytest.approx(1.98), pytest.approx(1.98)]]
        events = {event["what"]: event["time_s"] for event in log.meta["events"]}
        assert events["ArduCopter V3.2.1 (36b405fb)"] == 0.0
        assert events["Frame: QUAD, X"] == 0.0
        assert events["mode LOITER"] == pytest.approx(1.98)

    def test_parameters_of_the_log(self, written: Callable[..., bytes], tmp_path: Path) -> None:
        path = tmp_path / "a.log"
        path.write_bytes(old_dataflash(written=written))
        assert read_present_parameters(path)["RC3_MAX"] == 1900.0

    def test_one_without_an_estimate_is_told_what_it_has(self, written: Callable[..., bytes], tmp_path: Path) -> None:
        path = tmp_path / "a.bin"
        path.write_bytes(old_dataflash("3.1.5", without="EKF1", written=written))
        said = sentence_of(path)
        assert (
            "holds PARM, MSG, ATT, IMU, RCOU, CURR, CTUN, MODE, EV of ArduCopter V3.1.5 (36b405fb), but no XKF1" in said
        )
        assert "as ArduCopter logs them since 3.2" in said

    @pytest.mark.parametrize("version", ["3.2.1", "3.3.3"])
    def test_damage_gives_a_log_or_one_sentence(
        self, version: str, written: Callable[..., bytes], tmp_path: Path
    ) -> None:
        random = np.random.default_rng(7)
        whole = old_dataflash(version, written=written)
        path = tmp_path / "a.bin"
        outcomes = set()
        for _ in range(60):
            data = bytearray(whole[: random.integers(1, len(whole) + 1)])
            for at in random.integers(0, len(data), 4):
                data[at : at + random.integers(1, 20)] = random.bytes(int(random.integers(0, 20)))
            path.write_bytes(data)
            try:
                outcomes.add(len(read_log(path)) > 0)
            except LogError as error:
                assert "\n" not in str(error)
                outcomes.add(False)
        assert outcomes == {True, False}


class TestText:
    @pytest.mark.parametrize("suffix", [".log", ".txt", ".csv", ".bin"])
    def test_is_the_same_flight_whatever_its_name(self, suffix: str, tmp_path: Path) -> None:
        binary, text = tmp_path / "binary" / f"a{suffix}", tmp_path / "text" / f"a{suffix}"
        for path, written in ((binary, dataflash_bytes), (text, dataflash_text)):
            path.parent.mkdir()
            path.write_bytes(small_dataflash(written=written))
        a, b = read_log(binary), read_log(text)
        assert a.columns.keys() == b.columns.keys()
        for name in a.columns:
            assert b[name] == pytest.approx(a[name], rel=1e-6, nan_ok=True), name
        assert (a.notes, a.meta) == (b.notes, b.meta)

    def test_lines_before_the_formats_and_other_ends_of_lines(self, tmp_path: Path) -> None:
        """As the terminal of the boards of 2013 writes them."""
        plain, headed = tmp_path / "plain" / "a.log", tmp_path / "headed" / "a.log"
        text = old_dataflash(written=dataflash_text)
        head = b"\r\nArduCopter V3.1.5 (3c57e771)\r\nFree RAM: 1331\r\nAPM 2\r\n"
        for path, data in ((plain, text), (headed, head + text.replace(b"\n", b"\r\n"))):
            path.parent.mkdir()
            path.write_bytes(data)
        assert_same(read_log(plain), read_log(headed))

    def test_modes_may_have_their_names(self, tmp_path: Path) -> None:
        path = tmp_path / "a.log"
        path.write_bytes(old_dataflash(written=dataflash_text).replace(b"MODE, 5,", b"MODE, AltHold,"))
        assert "mode ALTHOLD" in [event["what"] for event in read_log(path).meta["events"]]

    def test_damaged_lines_are_left_out_and_said(self, tmp_path: Path) -> None:
        path = tmp_path / "a.log"
        lines = small_dataflash(written=dataflash_text).split(b"\n")
        att = [i for i, line in enumerate(lines) if line.startswith(b"ATT,")]
        lines[att[3]], lines[att[5]] = lines[att[3]].rpartition(b",")[0], lines[att[5]].replace(b", 1.1,", b", x,")
        lines[att[7]] = b"\xff\xfegarbage"
        path.write_bytes(b"\n".join(lines))
        log = read_log(path)
        (found,) = of_kind(log.findings, Kind.DAMAGED_LINES)
        assert found.figures == {"lines": 3, "line": att[3] + 1, "what": "6 fields instead of 7"}
        assert len(log) == 100

    def test_a_last_line_without_an_end_is_left_out_and_said(self, tmp_path: Path) -> None:
        path = tmp_path / "a.log"
        text = small_dataflash(without="SIM2", written=dataflash_text)
        path.write_bytes(text[:-4])
        log = read_log(path)
        assert of_kind(log.findings, Kind.LAST_LINE_CUT)[0].figures == {"line": text.count(b"\n")}
        assert len(log.updates("motor1_output")) == 1 and len(log) == 100

    def test_formats_without_data_are_told_so(self, tmp_path: Path) -> None:
        path = tmp_path / "a.log"
        path.write_bytes(b"\n".join(small_dataflash(written=dataflash_text).split(b"\n")[:6]) + b"\n")
        assert "ends after 6 formats and holds no data" in sentence_of(path)

    def test_a_table_that_only_mentions_a_format_is_none(self, tmp_path: Path) -> None:
        path = tmp_path / "a.csv"
        path.write_text("time_s,x_m\n0,1\n# FMT, 128\n")
        assert "the header lacks y_m" in sentence_of(path)

    @needs_ardupilot
    def test_a_real_log_is_read_as_pymavlink_writes_it(self, tmp_path: Path) -> None:
        """The text that mavlogdump and MAVExplorer make of a log."""
        from pymavlink.DFReader import DFReader_binary

        reader = DFReader_binary(str(ARDUPILOT / "fwd_vib.bin"))
        lines, n = [], 0
        while (message := reader.recv_msg()) is not None and n < 60_000:
            n += 1
            if message.get_type() == "FMT" or message.get_type() in (
                "ATT",
                "XKF1",
                "XKF4",
                "RATE",
                "RCOU",
                "PARM",
                "MSG",
            ):
                lines.append(
                    ", ".join([message.get_type(), *(str(getattr(message, f)) for f in message.get_fieldnames())])
                )
        (tmp_path / "a.log").write_text("\n".join(lines) + "\n")
        text, binary = read_log(tmp_path / "a.log"), read_log(ARDUPILOT / "fwd_vib.bin")
        rows = min(len(text), len(binary)) - 100
        assert rows > 1000
        for name in ("roll_deg", "z_m", "vx_m_s", "yaw_rate_rad_s", "throttle_cmd"):
            ours = np.interp(
                text.time_s[:rows] + text.meta["time_zero_s"], binary.time_s + binary.meta["time_zero_s"], binary[name]
            )
            assert np.nanmedian(np.abs(text[name][:rows] - ours)) < 1e-3, name


@needs_examples
class TestExamples:
    def test_a_log_as_text(self) -> None:
        log = read_log(EXAMPLES / "15-text-dataflash" / "flight.log")
        assert log.time_s[-1] == pytest.approx(66.8)
        assert {"x_m", "roll_deg", "throttle_cmd", "motor4_output", "battery_v"} <= log.columns.keys()
        assert not of_kind(log.findings, Kind.DAMAGED_LINES, Kind.CUT_SHORT)

    def test_a_log_of_3_2(self) -> None:
        log = read_log(EXAMPLES / "16-older-estimator-name" / "flight.bin")
        assert log.meta["software"] == "ArduCopter V3.2.1 (36b405fb)"
        flying = (log.time_s > 60.0) & (log.time_s < 110.0)
        assert np.nanmedian(log["imu_z_m_s2"][flying]) == pytest.approx(-9.8, abs=0.3)
        assert 14.0 < np.nanmedian(log["battery_v"]) < 16.8
        assert np.nanmax(np.abs(log["roll_rate_rad_s"][flying])) < 5.0
