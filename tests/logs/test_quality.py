"""The quality report says what is in a log; a converted log holds the same."""

import io
import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from mcap.reader import make_reader
from rich.console import Console

from quadctl.errors import LogError
from quadctl.logs.columns import STATE_COLUMNS
from quadctl.logs.convert import convert
from quadctl.logs.findings import Kind, finding, of_kind
from quadctl.logs.flight_log import ATTITUDE, POSITION, RATES, VELOCITY, FlightLog, Floats
from quadctl.logs.quality import ChannelQuality, QualityReport, quality
from quadctl.logs.read import read_log
from tests.support.places import DATA

needs_raptor = pytest.mark.skipif(not (DATA / "raptor").is_dir(), reason="the public RAPTOR logs are not here")
needs_px4 = pytest.mark.skipif(not (DATA / "px4").is_dir(), reason="the logs of real PX4 are not here")
needs_ardupilot = pytest.mark.skipif(not (DATA / "ardupilot").is_dir(), reason="the ArduPilot logs are not here")


def flight(
    changed: Mapping[str, Floats | None] | None = None, clock_error: float = 0.0, speed_m_s: float = 2.0
) -> FlightLog:
    """60 s at 50 rows a second: 10 s on the ground, then to and fro; position at 10 Hz, rpm at 5 Hz, all held.

    `clock_error` is the share by which the log's clock is slow. A column `changed` to None is left out.
    """
    true = np.arange(0.0, 60.0, 0.02)
    flying = (true >= 10.0) & (true < 55.0)
    position_s, rpm_s = np.floor(10.0 * true + 1e-6) / 10.0, np.floor(5.0 * true + 1e-6) / 5.0
    columns: dict[str, Floats] = {"time_s": true / (1.0 + clock_error)}
    for name in POSITION:
        columns[name] = 3.0 * speed_m_s * np.sin(position_s / 3.0)
    for name in VELOCITY:
        columns[name] = speed_m_s * np.cos(position_s / 3.0)
    columns["z_m"] = np.where(flying, 1.0 + 0.01 * np.sin(position_s), 0.0)
    columns["vz_m_s"] = 0.01 * np.cos(position_s)
    columns |= {name: np.sin(true) for name in (*ATTITUDE, *RATES)}
    columns |= {f"motor{i}_rpm": np.where(flying, 5000.0 + np.sin(rpm_s), 0.0) for i in range(1, 5)}
    for name, values in (changed or {}).items():
        if values is None:
            del columns[name]
        else:
            columns[name] = values
    return FlightLog("made.csv", None, columns)


def channel(report: QualityReport, name: str) -> ChannelQuality:
    found = report.channel(name)
    assert found is not None
    return found


def printed(report: QualityReport) -> str:
    console = Console(width=200, file=io.StringIO())
    with console.capture() as captured:
        console.print(report)
    return captured.get()


class TestChannels:
    def test_rates_are_of_updates_and_not_of_rows(self) -> None:
        report = quality(flight())
        assert channel(report, "position").rate_hz == pytest.approx(10.0, rel=0.01)
        assert channel(report, "attitude").rate_hz == pytest.approx(50.0, rel=0.01)
        assert channel(report, "position").held_share == pytest.approx(0.8, abs=0.001)
        assert channel(report, "attitude").held_share == 0.0

    def test_a_gap_is_found_where_it_is(self) -> None:
        log = flight()
        silent = (log.time_s > 30.05) & (log.time_s < 32.0)
        for name in POSITION:
            log[name][silent] = log[name][np.argmax(silent)]
        position = channel(quality(log), "position")
        assert (position.longest_gap_s, position.longest_gap_at_s) == pytest.approx((2.0, 30.0), abs=0.021)
        assert position.n_gaps == 1

    def test_missing_values_are_counted(self) -> None:
        battery = np.full(3000, np.nan)
        battery[750:] = np.linspace(16.0, 15.0, 2250)
        report = quality(flight({"battery_v": battery}))
        assert channel(report, "battery").nan_share == 0.25
        assert channel(report, "battery").held_share == 0.0

    def test_empty_and_constant_channels_are_named(self) -> None:
        report = quality(flight({"battery_v": np.full(3000, np.nan), "throttle_cmd": np.full(3000, 0.5)}))
        assert "battery holds no values" in report.notes
        assert "constant in the whole log: throttle command" in report.notes

    def test_one_dead_motor_does_not_hide_the_others(self) -> None:
        report = quality(flight({"motor2_rpm": np.full(3000, np.nan)}))
        assert channel(report, "rpm").n_updates == channel(quality(flight()), "rpm").n_updates > 200


class TestClock:
    def test_measured_and_counted_rows(self) -> None:
        log = flight()
        assert quality(log).clock.is_counted
        shaken = log["time_s"] + np.random.default_rng(1).normal(0.0, 0.002, len(log))
        clock = quality(flight({"time_s": shaken})).clock
        assert not clock.is_counted
        assert clock.row_interval_s == pytest.approx(0.02, abs=0.001)
        assert clock.row_jitter_s == pytest.approx(0.002 * 2**0.5, rel=0.1)

    @pytest.mark.parametrize("error", [-0.03, 0.02, 0.05])
    def test_a_wrong_clock_shows_in_position_against_velocity(self, error: float) -> None:
        clock = quality(flight(clock_error=error)).clock
        assert clock.scale == pytest.approx(1.0 + error, abs=0.005)
        assert clock.runs_wrong

    def test_a_right_clock_raises_no_alarm(self) -> None:
        assert not quality(flight()).clock.runs_wrong

    def test_slow_flight_says_nothing_of_the_clock(self) -> None:
        clock = quality(flight(clock_error=0.05, speed_m_s=0.1)).clock
        assert np.isnan(clock.scale)
        assert not clock.runs_wrong


class TestVerdict:
    def test_a_good_log_can_be_analysed(self) -> None:
        report = quality(flight())
        assert report.can_be_analysed
        assert report.thrust_source == "rpm"
        assert report.flight_s == pytest.approx(45.0, abs=0.1)

    @pytest.mark.parametrize(
        ("changed", "said"),
        [
            (dict.fromkeys(POSITION), "it holds no position"),
            ({"roll_deg": None, "pitch_deg": None, "yaw_deg": None}, "it holds no attitude"),
            ({name: np.ones(3000) for name in VELOCITY}, "velocity: never changes"),
            ({f"motor{i}_rpm": None for i in range(1, 5)}, "thrust is unknown"),
            ({f"motor{i}_rpm": np.zeros(3000) for i in range(1, 5)}, "0 s of usable flight"),
        ],
    )
    def test_why_a_log_cannot_be_analysed_is_said(self, changed: dict[str, Floats | None], said: str) -> None:
        report = quality(flight(changed))
        assert not report.can_be_analysed
        assert any(said in obstacle for obstacle in report.obstacles)
        assert said in printed(report)

    @pytest.mark.parametrize("group", [POSITION, ATTITUDE])
    def test_a_frozen_state_is_no_flight(self, group: tuple[str, ...]) -> None:
        """In the air from 10 to 55 s; a recorder that goes on with the last state has seen 12 s of that."""
        log = flight()
        for name in group:
            log[name][log.time_s > 22.0] = log[name][log.time_s <= 22.0][-1]
        report = quality(log)
        assert report.flight_s == pytest.approx(12.0, abs=0.2)
        (gaps,) = of_kind(report.findings, Kind.GAPS)
        assert gaps.figures["seconds"] == pytest.approx(33.0, abs=0.5)
        assert gaps.times_s[-1][0] == pytest.approx(22.0, abs=0.1)
        for name in group:
            log[name][log.time_s > 12.0] = log[name][log.time_s <= 12.0][-1]
        assert not quality(log).can_be_analysed

    def test_thrust_comes_from_the_best_there_is(self) -> None:
        no_rpm: dict[str, Floats | None] = {f"motor{i}_rpm": None for i in range(1, 5)}
        throttle = np.where(flight()["motor1_rpm"] > 0.0, 0.5 + 0.01 * flight()["roll_deg"], 0.0)
        assert quality(flight({**no_rpm, "throttle_cmd": throttle})).thrust_source == "throttle command"
        outputs: dict[str, Floats | None] = {f"motor{i}_output": throttle for i in range(1, 5)}
        report = quality(flight({**no_rpm, "throttle_cmd": throttle, **outputs}))
        assert report.thrust_source == "motor output"
        assert report.can_be_analysed

    @pytest.mark.parametrize("n", [0, 1, 2])
    def test_hardly_any_rows_are_no_flight(self, n: int) -> None:
        report = quality(flight().rows(slice(n)))
        assert not report.can_be_analysed
        assert "Cannot be analysed" in printed(report)

    def test_prints_and_goes_to_json(self) -> None:
        report = quality(flight({"battery_v": np.full(3000, np.nan)}))
        assert "position" in printed(report)
        json.dumps(report.to_dict(), allow_nan=False)


@needs_raptor
class TestRaptor:
    def test_hovering(self) -> None:
        report = quality(read_log(DATA / "raptor" / "HOVERING.csv"))
        assert channel(report, "position").rate_hz == pytest.approx(9.2, abs=0.1)
        assert channel(report, "rpm").rate_hz == pytest.approx(2.8, abs=0.15)
        assert report.clock.row_interval_s == pytest.approx(0.011)
        assert not report.clock.is_counted
        assert report.can_be_analysed
        assert report.flight_s == pytest.approx(148.0, abs=1.0)  # in the air from 13.1 to 161.4 s

    def test_the_clock_of_forward_speed_is_counted_and_slow(self) -> None:
        clock = quality(read_log(DATA / "raptor" / "FORWARD_SPEED.csv")).clock
        assert clock.is_counted
        assert clock.runs_wrong
        assert 1.015 < clock.scale < 1.05

    def test_step_responses_have_no_rotor_speeds(self) -> None:
        report = quality(read_log(DATA / "raptor" / "HIGH_ALTITUDE_02.csv"))
        assert report.thrust_source == "throttle command"
        assert report.can_be_analysed


@needs_px4
def test_px4s_log_has_its_topics_rates() -> None:
    report = quality(read_log(DATA / "px4" / "B_forward.ulg"))
    assert channel(report, "position").rate_hz == pytest.approx(50.0, rel=0.01)
    assert channel(report, "position").source == "vehicle_local_position at 50.0 Hz"
    assert channel(report, "attitude").rate_hz == pytest.approx(125.0, rel=0.01)
    assert (report.thrust_source, report.can_be_analysed) == ("motor output", True)
    assert not report.clock.runs_wrong


@needs_ardupilot
@pytest.mark.parametrize(("name", "source"), [("stair_eq0.bin", "motor output"), ("fwd_vib.tlog", "rpm")])
def test_ardupilots_logs_can_be_analysed(name: str, source: str) -> None:
    report = quality(read_log(DATA / "ardupilot" / name))
    assert (report.thrust_source, report.can_be_analysed) == (source, True)
    assert channel(report, "position").rate_hz == pytest.approx(25.0, rel=0.01)
    assert not report.clock.runs_wrong


class TestConvert:
    @pytest.fixture
    def log(self) -> FlightLog:
        made = flight({"battery_v": np.concatenate([np.full(1000, np.nan), np.linspace(16.0, 15.0, 2000)])})
        phase = np.where(made.time_s < 10.0, "wait", "fly")
        meta = {"vehicle": "made", "sources": {"POS": {"rate_hz": 10.0, "columns": list(POSITION)}}}
        return FlightLog("made.bin", None, made.columns, phase, meta, [finding(Kind.READ_BY_MAP, file="m.yaml")])

    def test_csv(self, log: FlightLog, tmp_path: Path) -> None:
        path = convert(log, "csv", tmp_path)
        assert path == tmp_path / "made.csv"
        again = read_log(path)
        for name in log.columns:
            np.testing.assert_array_equal(again[name], log[name])
        assert again.meta == log.meta

    def test_parquet(self, log: FlightLog, tmp_path: Path) -> None:
        path = convert(log, "parquet", tmp_path)
        table = pl.read_parquet(path)
        for name in log.columns:
            np.testing.assert_array_equal(table[name].fill_null(np.nan).to_numpy(), log[name])
        assert table["battery_v"].null_count() == 1000
        assert log.phase is not None
        assert table["phase"].to_list() == log.phase.tolist()
        about = pl.read_parquet_metadata(path)
        assert json.loads(about["quadctl.meta"]) == log.meta
        assert json.loads(about["quadctl.notes"]) == log.notes

    def test_mcap_holds_each_channel_at_its_own_updates(self, log: FlightLog, tmp_path: Path) -> None:
        path = convert(log, "mcap", tmp_path)
        found: dict[str, list[tuple[float, dict[str, object]]]] = {}
        with path.open("rb") as file:
            for schema, channel, message in make_reader(file).iter_messages():
                assert schema is not None
                assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
                content = json.loads(message.data)
                assert set(content) <= set(json.loads(schema.data)["properties"])
                found.setdefault(channel.topic, []).append((1e-9 * message.log_time, content))
        assert set(found) == {"/position", "/velocity", "/attitude", "/rates", "/rpm", "/battery", "/phase"}
        rows = log.updates(*POSITION)
        np.testing.assert_allclose([t for t, _ in found["/position"]], log.time_s[rows], atol=1e-9)
        for name in POSITION:
            assert [content[name] for _, content in found["/position"]] == log[name][rows].tolist()
        assert len(found["/battery"]) == 2000
        assert [content["phase"] for _, content in found["/phase"]] == ["wait", "fly"]

    def test_mcap_leaves_missing_parts_out(self, tmp_path: Path) -> None:
        log = flight({"motor2_rpm": np.full(3000, np.nan)})
        with convert(log, "mcap", tmp_path).open("rb") as file:
            messages = [json.loads(m.data) for _, _, m in make_reader(file).iter_messages(topics=["/rpm"])]
        assert len(messages) > 200
        assert all(set(message) == {"motor1_rpm", "motor3_rpm", "motor4_rpm"} for message in messages)

    def test_mcap_carries_notes_and_meta(self, log: FlightLog, tmp_path: Path) -> None:
        with convert(log, "mcap", tmp_path).open("rb") as file:
            about = {record.name: record.metadata for record in make_reader(file).iter_metadata()}
        assert about["notes"] == {"1": "read by the map m.yaml"}
        assert json.loads(about["quadctl"]["meta"]) == log.meta

    def test_nothing_is_overwritten(self, log: FlightLog, tmp_path: Path) -> None:
        path = convert(log, "csv", tmp_path)
        with pytest.raises(LogError, match=r"made\.csv: is there already"):
            convert(log, "csv", tmp_path)
        path.unlink()
        with pytest.raises(LogError, match=r"made\.meta\.yaml: is there already"):
            convert(log, "csv", tmp_path)

    def test_an_unknown_format_is_refused(self, log: FlightLog, tmp_path: Path) -> None:
        with pytest.raises(LogError, match="'xlsx' is no format to convert to, expected one of csv, parquet, mcap"):
            convert(log, "xlsx", tmp_path)
        assert list(tmp_path.iterdir()) == []

    @pytest.mark.parametrize("to", ["csv", "parquet", "mcap"])
    def test_a_place_that_cannot_be_written_is_one_sentence(self, log: FlightLog, tmp_path: Path, to: str) -> None:
        (tmp_path / "file").write_text("")
        with pytest.raises(LogError, match="cannot be made"):
            convert(log, to, tmp_path / "file" / "below")

    @needs_px4
    def test_real_log_to_csv_and_back(self, tmp_path: Path) -> None:
        log = read_log(DATA / "px4" / "B_forward.ulg")
        again = read_log(convert(log, "csv", tmp_path))
        for name in (*STATE_COLUMNS, "motor1_output", "imu_z_m_s2", "throttle_cmd"):
            np.testing.assert_array_equal(again[name], log[name])
