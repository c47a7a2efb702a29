"""Logs for the tests of their formats: real ones where they are, and small ones written byte for byte."""

import struct
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from quadctl.errors import LogError
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.read import read_log
from tests.support.places import DATA

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


@dataclass(frozen=True)
class Topic:
    """A ULog topic to be written: `fields` as in a ULog format, one tuple of values for each message."""

    name: str
    fields: str
    rows: Sequence[tuple[float, ...]]


ULOG_CODES = {"uint64_t": "Q", "float": "f", "uint8_t": "B", "bool": "?", "int32_t": "i", "uint32_t": "I"}
ULOG_NESTED = {"esc_report": "int32_t esc_rpm;float esc_voltage;uint8_t actuator_function"}


def ulog_codes(fields: str) -> str:
    """struct's codes of a ULog format."""
    codes = ""
    for field in fields.split(";"):
        kind, _, count = field.split(" ")[0].partition("[")
        code = ulog_codes(ULOG_NESTED[kind]) if kind in ULOG_NESTED else ULOG_CODES[kind]
        codes += code * int(count.rstrip("]") or 1)
    return codes


def ulog_bytes(*topics: Topic, parameters: Mapping[str, float] | None = None) -> bytes:
    def message(kind: bytes, body: bytes) -> bytes:
        return struct.pack("<H", len(body)) + kind + body

    out = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0), message(b"B", bytes(40))]
    formats = {topic.name: topic.fields for topic in topics} | ULOG_NESTED
    out += [message(b"F", f"{name}:{fields};".encode()) for name, fields in formats.items()]
    for name, value in (parameters or {}).items():
        kind = "int32_t" if isinstance(value, int) else "float"
        key = f"{kind} {name}".encode()
        out.append(message(b"P", bytes([len(key)]) + key + struct.pack("<" + ULOG_CODES[kind], value)))
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


DATAFLASH_CODES = {
    "Q": "Q",
    "B": "B",
    "f": "f",
    "c": "h",
    "C": "H",
    "H": "H",
    "e": "i",
    "N": "16s",
    "Z": "64s",
    "b": "b",
    "h": "h",
    "I": "I",
    "M": "B",
}
HUNDREDTHS = "cCeE"
"""Letters of integers that stand for hundredths."""


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


def dataflash_text(*messages: Message) -> bytes:
    """The same log as a ground station writes it as text."""
    lines = ["FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns"]
    for i, (name, letters, columns, _) in enumerate(messages):
        size = 3 + struct.calcsize("<" + "".join(DATAFLASH_CODES[letter] for letter in letters))
        lines.append(f"FMT, {10 + i}, {size}, {name}, {letters}, {columns}")
    for name, letters, _, rows in messages:
        for row in rows:
            cells = [
                value.decode()
                if isinstance(value, bytes)
                else f"{float(str(value)) / 100 if of in HUNDREDTHS else value}"
                for of, value in zip(letters, row, strict=True)
            ]
            lines.append(", ".join([name, *cells]))
    return ("\n".join(lines) + "\n").encode()


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


def small_ulog(
    *more: Topic, without: str = "", valid_from: int = 10, parameters: Mapping[str, float] | None = None
) -> bytes:
    us = [1_000_000 + 20_000 * i for i in range(100)]
    half = np.sqrt(0.5)
    topics = [
        Topic(
            "vehicle_local_position",
            "uint64_t timestamp;uint64_t timestamp_sample;float x;float y;float z;float vx;float vy;float vz;"
            "bool xy_valid;bool z_valid;uint8_t z_reset_counter",
            [(t, t - 8000, i, 2.0, -0.5 * i, 4.0, 5.0, -6.0, i >= valid_from, True, i // 60) for i, t in enumerate(us)],
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
    return ulog_bytes(*(topic for topic in topics if topic.name != without), *more, parameters=parameters)


def small_dataflash(
    *more: Message, without: str = "", status: int = 0b11_1111, written: Callable[..., bytes] = dataflash_bytes
) -> bytes:
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
        ("XKF4", "QBHb", "TimeUS,C,SS,PI", [(t, c, status * c, 1) for t in us for c in (0, 1)]),
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
    return written(*(message for message in messages if message[0] != without), *more)


def old_dataflash(version: str = "3.2.1", without: str = "", written: Callable[..., bytes] = dataflash_bytes) -> bytes:
    """Log of ArduCopter 3.2 (milliseconds, and messages without a time) or 3.3, armed at its end."""
    is_33 = version >= "3.3"
    clock, unit, output = ("QTimeUS", 20_000, "Ch") if is_33 else ("ITimeMS", 20, "Chan")
    stamps = [5000 // 20 * unit + unit * i for i in range(100)]

    def timed(name: str, letters: str, columns: str, row: tuple[object, ...]) -> Message:
        return name, clock[0] + letters, f"{clock[1:]},{columns}", [(t, *row) for t in stamps]

    state = (110, -210, 35_900, 1.0, 2.0, -3.0, 10.0, 5.0, -6.0)
    outputs = ",".join(f"{output}{i}" for i in range(1, 9))
    before: list[Message] = [
        ("PARM", "Nf", "Name,Value", [(b"RC3_MIN", 1100.0), (b"RC3_MAX", 1900.0), (b"FRAME", 1.0)]),
        ("MSG", "Z", "Message", [(f"ArduCopter V{version} (36b405fb)".encode(),), (b"Frame: QUAD, X",)]),
    ]
    after: list[Message] = [
        timed("EKF1", "ccCffffff", "Roll,Pitch,Yaw,VN,VE,VD,PN,PE,PD", state),
        timed("ATT", "ccccCC", "DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw", (100, 110, -200, -210, 35_000, 35_900)),
        timed("IMU", "ffffff", "GyrX,GyrY,GyrZ,AccX,AccY,AccZ", (0.1, 0.2, 0.3, 0.0, 0.0, -9.8)),
        timed("RCOU", "hhhhhhhh", outputs, (1500, 1300, 1700, 1100, 0, 0, 0, 0)),
        timed("CURR", "hIhhhf", "ThrOut,ThrInt,Volt,Curr,Vcc,CurrTot", (621, 0, 1644, 108, 5217, 5.9)),
        timed("CTUN", "hhh", "ThrIn,AngBst,ThrOut", (500, 0, 450)),
    ]
    if is_33:
        after.append(timed("RATE", "ffff", "R,P,Y,AOut", (18000.0, 9000.0, -9000.0, 350.0)))
    events: list[Message] = [("MODE", "Mh", "Mode,ThrCrs", [(5, 450)]), ("EV", "B", "Id", [(10,)])]
    messages = [message for message in (*before, *after) if message[0] != without]
    return written(*messages, *events)


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
