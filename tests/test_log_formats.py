"""PX4, ArduPilot and telemetry logs become the same table, and a simulator's truth never gets into it."""

import struct
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np
import pytest
from pymavlink.DFReader import DFReader_binary
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pyulog import ULog

from quadctl.errors import LogError
from quadctl.logs import dataflash, tlog, ulog
from quadctl.logs.columns import STATE_COLUMNS
from quadctl.logs.csv_log import read_csv, write_csv
from quadctl.logs.flight_log import ATTITUDE, POSITION, RATES, FlightLog, Floats
from quadctl.logs.merge import ROW_TOLERANCE_S, Channel, Origin, averaged, held, merge, row_times
from quadctl.logs.read import read_log

DATA = Path(__file__).parents[2] / "shared" / "data"
PX4, ARDUPILOT = DATA / "px4", DATA / "ardupilot"
needs_px4 = pytest.mark.skipif(not PX4.is_dir(), reason="the logs of real PX4 are not here")
needs_ardupilot = pytest.mark.skipif(not ARDUPILOT.is_dir(), reason="the logs of real ArduPilot are not here")

G = 9.80665


def sentence_of(path: Path) -> str:
    with pytest.raises(LogError) as caught:
        read_log(path)
    message = str(caught.value)
    assert str(path) in message
    assert "\n" not in message
    return message


# --- the files, byte for byte -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Topic:
    """A ULog topic to be written: `fields` as in a ULog format, one tuple of values for each message."""

    name: str
    fields: str
    rows: Sequence[tuple[float, ...]]


ULOG_CODES = {"uint64_t": "Q", "float": "f", "uint8_t": "B", "bool": "?", "int32_t": "i"}
ULOG_NESTED = {"esc_report": "int32_t esc_rpm;float esc_voltage;uint8_t actuator_function"}


def ulog_codes(fields: str) -> str:
    """struct's codes of a ULog format."""
    codes = ""
    for field in fields.split(";"):
        kind, _, count = field.split(" ")[0].partition("[")
        code = ulog_codes(ULOG_NESTED[kind]) if kind in ULOG_NESTED else ULOG_CODES[kind]
        codes += code * int(count.rstrip("]") or 1)
    return codes


def ulog_bytes(*topics: Topic) -> bytes:
    def message(kind: bytes, body: bytes) -> bytes:
        return struct.pack("<H", len(body)) + kind + body

    out = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0), message(b"B", bytes(40))]
    formats = {topic.name: topic.fields for topic in topics} | ULOG_NESTED
    out += [message(b"F", f"{name}:{fields};".encode()) for name, fields in formats.items()]
    out += [message(b"A", struct.pack("<BH", 0, i) + topic.name.encode()) for i, topic in enumerate(topics)]
    for i, topic in enumerate(topics):
        body = struct.Struct("<H" + ulog_codes(topic.fields))
        out += [message(b"D", body.pack(i, *row)) for row in topic.rows]
    return b"".join(out)


def ulog_without(data: bytes, unwanted: Callable[[str], bool]) -> bytes:
    """A ULog without the topics with such names."""
    kept, dropped, at = [data[:16]], set(), 16
    while at + 3 <= len(data):
        length, kind = struct.unpack_from("<HB", data, at)
        record, at = data[at : at + 3 + length], at + 3 + length
        if kind == ord("A") and unwanted(record[6:].decode()):
            dropped.add(record[4:6])
        elif not (kind == ord("D") and record[3:5] in dropped):
            kept.append(record)
    assert dropped
    return b"".join(kept)


DATAFLASH_CODES = {"Q": "Q", "B": "B", "f": "f", "c": "h", "C": "H", "H": "H", "e": "i", "N": "16s", "b": "b"}


Message: TypeAlias = tuple[str, str, str, Sequence[tuple[object, ...]]]
"""Name, format, columns, rows of raw values."""


def dataflash_bytes(*messages: Message) -> bytes:
    formats, bodies = [], []
    for i, (name, letters, columns, rows) in enumerate(messages):
        body = struct.Struct("<" + "".join(DATAFLASH_CODES[letter] for letter in letters))
        header = struct.pack("<BB4s16s64s", 10 + i, 3 + body.size, name.encode(), letters.encode(), columns.encode())
        formats.append(b"\xa3\x95\x80" + header)
        bodies += [b"\xa3\x95" + bytes([10 + i]) + body.pack(*row) for row in rows]
    return b"".join(formats + bodies)


def dataflash_without(data: bytes, unwanted: Callable[[str], bool]) -> bytes:
    """A DataFlash log without the messages with such names, found by pymavlink's own index."""
    kept, at = [], 0
    lengths, names = {0x80: 89}, {0x80: "FMT"}
    while at + 3 <= len(data):
        kind = data[at + 2]
        record, at = data[at : at + lengths[kind]], at + lengths[kind]
        if kind == 0x80 and len(record) == 89:
            lengths[record[3]], names[record[3]] = record[4], record[5:9].rstrip(b"\0").decode()
        if not unwanted(names[kind]):
            kept.append(record)
    return b"".join(kept)


def tlog_bytes(records: Iterable[tuple[float, mavlink.MAVLink_message]], system: int = 1) -> bytes:
    """`records`: seconds since some start, message."""
    link = mavlink.MAVLink(None, srcSystem=system, srcComponent=1)
    out = []
    for seconds, message in records:
        out.append(struct.pack(">Q", 1_700_000_000_000_000 + round(1e6 * seconds)) + message.pack(link))
    return b"".join(out)


def tlog_without(data: bytes, unwanted: Callable[[int], bool]) -> bytes:
    kept, at = [], 0
    while at + 18 <= len(data):
        assert data[at + 8] == 0xFD
        end = at + 8 + 12 + data[at + 9]
        if not unwanted(int.from_bytes(data[at + 15 : at + 18], "little")):
            kept.append(data[at:end])
        at = end
    return b"".join(kept)


def assert_same(a: FlightLog, b: FlightLog) -> None:
    assert a.columns.keys() == b.columns.keys()
    for name in a.columns:
        np.testing.assert_array_equal(a[name], b[name], err_msg=name)
    assert (a.notes, a.meta) == (b.notes, b.meta)


# --- merging ----------------------------------------------------------------------------------------------------------


class TestMerge:
    nan = np.nan

    def test_a_value_is_held_until_the_next_and_missing_before_the_first(self) -> None:
        rows = held(np.arange(6.0), np.array([1.0, 3.5]), np.array([7.0, 8.0]))
        np.testing.assert_array_equal(rows, [self.nan, 7.0, 7.0, 7.0, 8.0, 8.0])

    def test_an_update_a_moment_after_a_row_belongs_to_it(self) -> None:
        late = 0.5 * ROW_TOLERANCE_S
        assert held(np.array([1.0, 2.0]), np.array([1.0 + late]), np.array([5.0])).tolist() == [5.0, 5.0]

    def test_of_several_updates_in_a_row_the_last_counts(self) -> None:
        assert held(np.array([1.0, 2.0]), np.array([0.5, 1.2, 1.8]), np.array([1.0, 2.0, 3.0])).tolist() == [1.0, 3.0]

    def test_an_average_counts_every_sample_once(self) -> None:
        samples = np.array([9.0, 1.0, 2.0, 3.0, 4.0, self.nan, 6.0])
        rows = averaged(np.array([0.1, 1.0, 2.0, 3.0]), np.array([0.0, 0.1, 0.4, 0.8, 1.5, 1.6, 2.5]), samples)
        assert rows.tolist() == [1.0, 2.5, 4.0, 6.0]

    def test_an_average_is_held_where_no_sample_came(self) -> None:
        rows = averaged(np.arange(4.0), np.array([1.0, 3.0]), np.array([5.0, 6.0]))
        np.testing.assert_array_equal(rows, [self.nan, 5.0, 5.0, 6.0])

    def test_rows_are_all_updates_and_near_ones_share_a_row(self) -> None:
        assert row_times(np.array([0.02, 0.0, 0.0201, 0.01, 0.0005])).tolist() == [0.0, 0.01, 0.02]

    def test_updates_of_the_table_are_the_updates_of_the_channels(self) -> None:
        slow, fast = np.arange(0.0, 2.0, 0.1), np.arange(0.003, 2.0, 0.02)
        names = [name for name in STATE_COLUMNS[1:] if name not in ATTITUDE]
        channels = [
            Channel("slow", slow, {name: np.sin(slow) for name in names}),
            Channel("fast", fast, {name: np.cos(fast) for name in ATTITUDE}),
        ]
        log = merge(channels, Origin(Path("a.x"), "", {}, [], []))
        np.testing.assert_allclose(log.time_s[log.updates(*POSITION)], slow, atol=ROW_TOLERANCE_S)
        np.testing.assert_allclose(log.time_s[log.updates(*ATTITUDE)], fast, atol=ROW_TOLERANCE_S)
        assert log.notes == []

    def test_messages_whose_time_goes_back_are_left_out_and_said(self) -> None:
        time = np.array([0.0, 1.0, 0.5, 2.0])
        channels = [Channel("odd", time, {name: np.arange(4.0) for name in STATE_COLUMNS[1:]})]
        log = merge(channels, Origin(Path("a.x"), "", {}, [], []))
        assert len(log) == 3
        assert log.notes == ["1 of 4 odd messages left out: their time does not increase"]

    def test_what_is_missing_is_named_with_what_was_expected(self) -> None:
        channels = [Channel("odd", np.arange(3.0), {name: np.ones(3) for name in (*POSITION, *ATTITUDE)})]
        with pytest.raises(LogError, match=r"a\.x: holds no values of vx_m_s, vy_m_s, vz_m_s, expected messages A and"):
            merge(channels, Origin(Path("a.x"), "A and B", {}, [], []))


# --- PX4 --------------------------------------------------------------------------------------------------------------


def small_ulog(*more: Topic, without: str = "") -> bytes:
    us = [1_000_000 + 20_000 * i for i in range(100)]
    half = np.sqrt(0.5)
    topics = [
        Topic(
            "vehicle_local_position",
            "uint64_t timestamp;uint64_t timestamp_sample;float x;float y;float z;float vx;float vy;float vz;"
            "bool xy_valid;bool z_valid;uint8_t z_reset_counter",
            [(t, t - 8000, i, 2.0, -0.5 * i, 4.0, 5.0, -6.0, i > 9, True, i // 60) for i, t in enumerate(us)],
        ),
        # nose 90 degrees to the right
        Topic("vehicle_attitude", "uint64_t timestamp;float[4] q", [(t, half, 0.0, 0.0, half) for t in us]),
        Topic("vehicle_angular_velocity", "uint64_t timestamp;float[3] xyz", [(t, 0.1, 0.2, 0.3) for t in us]),
        Topic(
            "sensor_combined",
            "uint64_t timestamp;float[3] gyro_rad;int32_t accelerometer_timestamp_relative;float[3] accelerometer_m_s2",
            [(t, 0, 0, 0, 2**31 - 1 if i == 5 else 0, 0.0, 0.0, -G) for i, t in enumerate(us)],
        ),
        Topic("battery_status", "uint64_t timestamp;float voltage_v", [(us[0], 16.25), (us[50], 16.0)]),
        Topic("vehicle_attitude_groundtruth", "uint64_t timestamp;float[4] q", [(t, 0, 1, 0, 0) for t in us]),
    ]
    return ulog_bytes(*(topic for topic in topics if topic.name != without), *more)


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
        assert "PX4's estimator reset its height 1 times: it jumps there" in log.notes

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


def tilt_correlation(log: FlightLog, velocity: str, angle: str, sign: float) -> float:
    """Correlation of tilt with the acceleration along it, over half seconds in flight; heading is north."""
    clock = np.arange(12.0, log.time_s[-1] - 10.0, 0.5)
    known = np.isfinite(log[velocity]) & np.isfinite(log[angle])
    speed = np.interp(clock, log.time_s[known], log[velocity][known])
    steps = np.concatenate([[0.0], np.cumsum(log[angle][known][1:] * np.diff(log.time_s[known]))])
    mean_angle = np.diff(np.interp(clock, log.time_s[known], steps)) / 0.5
    # drag makes part of the tilt go with speed
    tilt = sign * np.radians(mean_angle) * G
    middle = 0.5 * (speed[1:] + speed[:-1])
    drag = float(np.sum(middle * (tilt - np.diff(speed) / 0.5)) / np.sum(middle**2))
    return float(np.corrcoef(np.diff(speed) / 0.5, tilt - drag * middle)[0, 1])


# --- ArduPilot DataFlash ----------------------------------------------------------------------------------------------


def small_dataflash(*more: Message, without: str = "") -> bytes:
    us = [5_000_000 + 20_000 * i for i in range(100)]
    messages: list[Message] = [
        (
            "PARM",
            "QNf",
            "TimeUS,Name,Value",
            [
                (us[0], b"MOT_PWM_MIN", 1100.0),
                (us[0], b"MOT_PWM_MAX", 1900.0),
                (us[0], b"SERVO1_FUNCTION", 34.0),
                (us[0], b"SERVO2_FUNCTION", 33.0),
                (us[0], b"SERVO3_FUNCTION", 0.0),
            ],
        ),
        ("XKF4", "QBb", "TimeUS,C,PI", [(t, c, 1) for t in us for c in (0, 1)]),
        (
            "XKF1",
            "QBffffff",
            "TimeUS,C,VN,VE,VD,PN,PE,PD",
            [(t, c, 1.0, 2.0, -3.0, 10.0 * c + 0.001 * i, 5.0, -6.0) for i, t in enumerate(us) for c in (0, 1)],
        ),
        (
            "ATT",
            "QccccCC",
            "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw",
            [(t, 100, 110, -200, -210, 35_000, 35_900) for t in us],
        ),
        ("RATE", "Qffff", "TimeUS,R,P,Y,AOut", [(t, 180.0, 90.0, -90.0, 0.35) for t in us]),
        ("IMU", "QBfff", "TimeUS,I,AccX,AccY,AccZ", [(t, i, 0.0, 0.0, -9.8 - i) for t in us for i in (0, 1)]),
        ("RCOU", "QHHH", "TimeUS,C1,C2,C3", [(t, 1500, 1300, 1700) for t in us]),
        ("SIM2", "Qfff", "TimeUS,PN,PE,PD", [(t, 77.0, 77.0, 77.0) for t in us]),
    ]
    return dataflash_bytes(*(message for message in messages if message[0] != without), *more)


class TestDataFlash:
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

    def test_missing_position_is_one_sentence(self, tmp_path: Path) -> None:
        path = tmp_path / "a.bin"
        path.write_bytes(small_dataflash(without="XKF1"))
        assert "holds no values of x_m, y_m, z_m, vx_m_s, vy_m_s, vz_m_s, expected messages XKF1" in sentence_of(path)

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
        assert np.median(flash_stairs["motor1_output"][flying]) == pytest.approx(0.587, abs=0.005)
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


# --- telemetry --------------------------------------------------------------------------------------------------------

BOOT_S = 4000.0


def telemetry(n: int = 100, boot_s: float = BOOT_S, link_delay_s: float = 0.3) -> list[tuple[float, object]]:
    """(arrival, message): state with its stamps, arriving late and unevenly; rotor speeds without a stamp."""
    out: list[tuple[float, object]] = []
    for i in range(n):
        t = 0.04 * i
        ms = round(1000.0 * (boot_s + t))
        arrival = t + link_delay_s + 0.015 * (i % 3)
        out.append((arrival, mavlink.MAVLink_attitude_message(ms, 0.1, -0.2, 0.01 * i, 0.4, 0.5, 0.6)))
        out.append((arrival, mavlink.MAVLink_local_position_ned_message(ms, 0.1 * i, 2.0, -3.0, 4.0, 5.0, -6.0)))
        out.append((arrival, mavlink.MAVLink_simstate_message(9.0, 9.0, 9.0, 9.0, 9.0, 9.0, 9.0, 9.0, 9.0, 90, 90)))
        if i % 5 == 0:
            rpm = [4000 + i, 4100, 4200, 4300]
            fields = ([30] * 4, [1650] * 4, [210] * 4, [0] * 4, rpm, [i] * 4)
            out.append((arrival, mavlink.MAVLink_esc_telemetry_1_to_4_message(*fields)))
            micros = round(1e6 * (boot_s + t)) % 2**32
            out.append((arrival, mavlink.MAVLink_servo_output_raw_message(micros, 0, *[1400 + i] * 4, *[0] * 4)))
    out.append((0.0, mavlink.MAVLink_heartbeat_message(2, 3, 81 | 128, 0, 4, 3)))
    out.sort(key=lambda record: record[0])
    return out


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


# --- any of them ------------------------------------------------------------------------------------------------------

SMALL: dict[str, Callable[[], bytes]] = {
    ".ulg": small_ulog,
    ".bin": small_dataflash,
    ".tlog": lambda: tlog_bytes(telemetry()),
}


class TestAnyFormat:
    @pytest.mark.parametrize("suffix", SMALL)
    def test_is_told_by_its_content(self, tmp_path: Path, suffix: str) -> None:
        named, renamed = tmp_path / f"a{suffix}", tmp_path / "a.log"
        for path in (named, renamed):
            path.write_bytes(SMALL[suffix]())
        assert read_log(renamed).columns.keys() == read_log(named).columns.keys()

    @pytest.mark.parametrize("suffix", SMALL)
    @pytest.mark.parametrize("content", [b"", b"x", b"time_s,x_m\n0,1\n" * 9, bytes(4000), bytes(range(256)) * 20])
    def test_something_else_under_its_name_is_one_sentence(self, tmp_path: Path, suffix: str, content: bytes) -> None:
        path = tmp_path / f"a{suffix}"
        path.write_bytes(content)
        assert "expected" in sentence_of(path)

    @pytest.mark.parametrize("suffix", SMALL)
    def test_damage_gives_a_log_or_one_sentence(self, tmp_path: Path, suffix: str) -> None:
        random = np.random.default_rng(7)
        whole = SMALL[suffix]()
        path = tmp_path / f"a{suffix}"
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

    @pytest.mark.parametrize("suffix", SMALL)
    def test_comes_back_from_csv(self, tmp_path: Path, suffix: str) -> None:
        path = tmp_path / f"a{suffix}"
        path.write_bytes(SMALL[suffix]())
        log = read_log(path)
        write_csv(log, tmp_path / "b.csv")
        again = read_csv(tmp_path / "b.csv")
        known = np.isfinite(log["x_m"])
        for name in log.columns:
            np.testing.assert_array_equal(again[name], log[name][np.argmax(known) :])
        assert again.meta == log.meta

    def test_missing_file_is_missing(self, tmp_path: Path) -> None:
        assert sentence_of(tmp_path / "a.ulg").endswith("there is no such file")
