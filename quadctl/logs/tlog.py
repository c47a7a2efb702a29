"""MAVLink telemetry logs (`.tlog`), as ground stations write them, decoded with pymavlink's dialect.

A record is the time of arrival and one MAVLink frame. State is put at the autopilot's own time since boot, which the
link cannot delay; a message without it (rotor speeds, battery) gets the boot time of the messages around it. Of several
vehicles the one with the most positions is read. Messages of a simulator's truth (SIMSTATE, SIM_STATE, HIL_STATE...)
are not among MESSAGES and never decoded.
"""

import itertools
import struct
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from quadctl.errors import LogError
from quadctl.files import reading
from quadctl.frames import GRAVITY_M_S2, euler_from_quaternion
from quadctl.logs.ardupilot import CHAIN_PARAMETERS, PARAMETERS, motor_of_servo, motor_outputs, output_finding
from quadctl.logs.events import Event, mode_changes, parameter_changes, said
from quadctl.logs.findings import Finding, Kind, finding
from quadctl.logs.flight_log import ATTITUDE, RATES, FlightLog, Floats
from quadctl.logs.merge import Channel, Origin, finite, intervals, merge
from quadctl.logs.parameter_history import ParameterHistory, change_findings
from quadctl.thrust_chain.ardupilot import BOOST, angle_boost
from quadctl.thrust_chain.atmosphere import (
    Air,
    Version,
    air_density_ratio,
    atmosphere_of,
    pressure_altitude_m,
    version_in,
    version_of_number,
)
from quadctl.thrust_chain.chain import Ambient

MESSAGES = {
    0: "HEARTBEAT",
    1: "SYS_STATUS",
    22: "PARAM_VALUE",
    26: "SCALED_IMU",
    27: "RAW_IMU",
    29: "SCALED_PRESSURE",
    30: "ATTITUDE",
    31: "ATTITUDE_QUATERNION",
    32: "LOCAL_POSITION_NED",
    33: "GLOBAL_POSITION_INT",
    36: "SERVO_OUTPUT_RAW",
    83: "ATTITUDE_TARGET",
    105: "HIGHRES_IMU",
    132: "DISTANCE_SENSOR",
    141: "ALTITUDE",
    147: "BATTERY_STATUS",
    148: "AUTOPILOT_VERSION",
    253: "STATUSTEXT",
    291: "ESC_STATUS",
    11030: "ESC_TELEMETRY_1_TO_4",
    11031: "ESC_TELEMETRY_5_TO_8",
    11032: "ESC_TELEMETRY_9_TO_12",
}
"""The messages that are decoded, by their numbers."""
NEEDED = "LOCAL_POSITION_NED and ATTITUDE (or ATTITUDE_QUATERNION)"

MAX_STAMP_ERROR_S = 2.0
"""A time stamp further from the time of arrival than this is on another clock."""
REBOOT_S = 1.0
"""Boot time going back by more than this is a new boot."""

MAX_RECORD = 8 + 12 + 255 + 13
"""Length of the longest record: time of arrival, head, payload, and what ends a frame."""
STEADY_BYTES = 3
"""Bytes of the time of arrival, the highest, that are the same for days."""
MAX_LEADING_DAMAGE = 100_000
"""Bytes before the first record. More of them, and the file is something else."""

_V1, _V2 = 0xFE, 0xFD
_STAMP = struct.Struct(">Q")
_PLAUSIBLE_US = (946_684_800_000_000, 4_102_444_800_000_000)
"""Times of arrival, microseconds since 1970: the years 2000 to 2100."""
_ESC_STATUS = struct.Struct("<Q4i4f4fB")
_ARDUPILOT, _NO_AUTOPILOT = 3, 8
_ARMED = 128
_DOWN = 25
"""MAV_SENSOR_ROTATION_PITCH_270."""
_MOTORS_OF_TYPE = {2: 4, 13: 6, 14: 8, 15: 3, 29: 12, 35: 10}
"""Number of motors by MAV_TYPE: quadrotor, hexarotor, octorotor, tricopter, dodecarotor, decarotor."""

_Sender: TypeAlias = tuple[int, int]
"""System and component."""


@dataclass(frozen=True)
class _Record:
    number: int
    """Number of the record in the file."""
    arrival_s: float
    kind: str
    fields: Any
    """pymavlink's message, or `_EscStatus`."""


@dataclass(frozen=True)
class _EscStatus:
    """ESC_STATUS, which pymavlink's bundled dialects do not know yet."""

    time_usec: int
    rpm: Sequence[int]
    voltage: Sequence[float]
    current: Sequence[float]
    index: int


def is_tlog(head: bytes) -> bool:
    """True where a file that begins with `head` (at least 9 bytes) can be a telemetry log."""
    return len(head) >= 9 and _is_record(head, 0)


def read_tlog(path: Path) -> FlightLog:
    """Read a MAVLink telemetry log.

    Raises
    ------
    LogError
        The file cannot be read, is no telemetry log, or holds no position, velocity or attitude.
    """
    with reading(path, LogError):
        data = path.read_bytes()
    findings: list[Finding] = []
    senders = _records(path, data, findings)
    sender = _vehicle(senders, findings)
    if sender is None:
        raise LogError(f"{path}: holds no vehicle's messages, expected {NEEDED}")
    records = _longest_boot(senders[sender], findings)
    telemetry = _Telemetry.of(records)
    history = telemetry.parameters()
    is_ardupilot = any(m.fields.autopilot == _ARDUPILOT for m in telemetry.records["HEARTBEAT"])
    meta = {
        "autopilot": "ArduPilot" if is_ardupilot else "PX4",
        "system": sender[0],
        "parameters": {name: value for name, value in history.last.items() if name in PARAMETERS},
    }
    if is_ardupilot:
        findings += change_findings(history, CHAIN_PARAMETERS)
    channels = list(_channels(telemetry, history, is_ardupilot, findings))
    return merge(channels, Origin(path, NEEDED, meta, findings, telemetry.armed(), events=_events(telemetry)))


# --- records ----------------------------------------------------------------------------------------------------------


def _records(path: Path, data: bytes, findings: list[Finding]) -> dict[_Sender, list[_Record]]:
    """The wanted messages in their order in the file, by sender."""
    from pymavlink.dialects.v20 import ardupilotmega

    decoder = ardupilotmega.MAVLink(None)
    found: dict[_Sender, list[_Record]] = defaultdict(list)
    at, number, damaged, last = 0, 0, 0, b""
    whole = 0  # end of the last whole record
    while at + 8 + 8 <= len(data):
        end = _end_of_record(data, at)
        if end is None or end > len(data):
            at, damaged = at + 1, damaged + 1
            if number == 0 and damaged > MAX_LEADING_DAMAGE:
                break
            continue
        frame = data[at + 8 : end]
        kind = MESSAGES.get(_message_number(frame))
        if kind is not None:
            try:
                fields = _esc_status(frame) if kind == "ESC_STATUS" else decoder.decode(bytearray(frame))
            except (ardupilotmega.MAVError, struct.error, ValueError):  # the checksum, as a rule
                at, damaged = at + 1, damaged + 1
                continue
            sender = (frame[5], frame[6]) if frame[0] == _V2 else (frame[3], frame[4])
            found[sender].append(_Record(number, 1e-6 * _STAMP.unpack_from(data, at)[0], kind, fields))
        last, at, number, whole = data[at : at + _STAMP.size], end, number + 1, end
    if _is_begin(data[whole:], last):
        damaged -= at - whole
        findings.append(finding(Kind.CUT_SHORT))
    if not found and damaged:
        raise LogError(f"{path}: holds no readable MAVLink message, expected a telemetry log")
    if damaged:
        findings.append(finding(Kind.DAMAGED_BYTES, bytes=damaged))
    return found


def _is_record(data: bytes, at: int) -> bool:
    low, high = _PLAUSIBLE_US
    return data[at + 8] in (_V1, _V2) and low <= _STAMP.unpack_from(data, at)[0] <= high


def _is_begin(rest: bytes, last_stamp: bytes) -> bool:
    """Tell whether the rest of a file is the begin of a record: it begins as the time of the last whole one did."""
    return 0 < len(rest) < MAX_RECORD and rest[:STEADY_BYTES] == last_stamp[: min(len(rest), STEADY_BYTES)]


def _end_of_record(data: bytes, at: int) -> int | None:
    """Position of the end of the record that begins at `at`; None where there is none."""
    if not _is_record(data, at):
        return None
    length = data[at + 9]
    if data[at + 8] == _V1:
        return at + 8 + 8 + length
    signature = 13 if data[at + 10] & 1 else 0
    return at + 8 + 12 + length + signature


def _message_number(frame: bytes) -> int:
    return int.from_bytes(frame[7:10], "little") if frame[0] == _V2 else frame[5]


def _esc_status(frame: bytes) -> _EscStatus:
    payload = frame[10 : 10 + frame[1]].ljust(_ESC_STATUS.size, b"\0")
    time, *rest, index = _ESC_STATUS.unpack_from(payload)
    return _EscStatus(time, rest[:4], rest[4:8], rest[8:12], index)


def _vehicle(senders: dict[_Sender, list[_Record]], findings: list[Finding]) -> _Sender | None:
    """The autopilot with the most positions."""
    positions = {
        sender: sum(record.kind == "LOCAL_POSITION_NED" for record in records)
        for sender, records in senders.items()
        if any(record.kind != "HEARTBEAT" or record.fields.autopilot != _NO_AUTOPILOT for record in records)
    }
    if not positions:
        return None
    best = max(positions, key=lambda sender: positions[sender])
    others = [sender for sender, n in positions.items() if n and sender != best]
    if others:
        listed = [f"{system}/{component}" for system, component in others]
        findings.append(finding(Kind.OTHER_SYSTEMS, system=best[0], others=listed))
    return best


def _longest_boot(records: list[_Record], findings: list[Finding]) -> list[_Record]:
    """The part of the log between two boots of the autopilot that holds the most messages."""
    stamped = [(i, stamp) for i, record in enumerate(records) if (stamp := _boot_s(record)) is not None]
    begins = [0, *(i for (_, a), (i, b) in itertools.pairwise(stamped) if b < a - REBOOT_S), len(records)]
    if len(begins) == 2:
        return records
    n, begin, end = max((b - a, a, b) for a, b in itertools.pairwise(begins))
    findings.append(finding(Kind.REBOOTED, times=len(begins) - 2, messages=n))
    return records[begin:end]


def _boot_s(record: _Record) -> float | None:
    boot_ms = getattr(record.fields, "time_boot_ms", None)
    return None if boot_ms is None else 1e-3 * boot_ms


@dataclass(frozen=True)
class _Telemetry:
    """The messages of one autopilot, and the relation of their times of arrival to its clock."""

    records: dict[str, list[_Record]]
    arrival_s: Floats
    boot_s: Floats
    """At `arrival_s`."""

    @classmethod
    def of(cls, records: Sequence[_Record]) -> "_Telemetry":
        by_kind: dict[str, list[_Record]] = defaultdict(list)
        for record in records:
            by_kind[record.kind].append(record)
        pairs = [(record.arrival_s, stamp) for record in records if (stamp := _boot_s(record)) is not None]
        arrival, boot = np.array(pairs, dtype=np.float64).reshape(-1, 2).T
        return cls(by_kind, np.maximum.accumulate(arrival), np.maximum.accumulate(boot))

    def times(self, records: Sequence[_Record]) -> Floats:
        """Times since boot: the message's stamp where it is on that clock, else that of messages around it."""
        arrival = np.array([record.arrival_s for record in records])
        around = np.interp(arrival, self.arrival_s, self.boot_s) if len(self.boot_s) else arrival
        stamp = np.array([_stamp_s(record) for record in records])
        # SERVO_OUTPUT_RAW counts microseconds in 32 bits, which overflow every 71 minutes.
        wrap = 2.0**32 * 1e-6
        stamp = np.where(stamp < wrap, stamp + wrap * np.round((around - stamp) / wrap), stamp)
        return np.where(np.abs(stamp - around) < MAX_STAMP_ERROR_S, stamp, around)

    def field(self, kind: str, name: str, scale: float = 1.0) -> Floats:
        return scale * finite([getattr(record.fields, name) for record in self.records[kind]])

    def parameters(self) -> ParameterHistory:
        told = self.records["PARAM_VALUE"]
        values = [(m.fields.param_id, float(m.fields.param_value)) for m in told]
        return ParameterHistory((time, *value) for time, value in zip(self.times(told).tolist(), values, strict=True))

    def armed(self) -> list[tuple[float, float]]:
        beats = self.records["HEARTBEAT"]
        return intervals(self.times(beats), np.array([bool(m.fields.base_mode & _ARMED) for m in beats], dtype=bool))


def _stamp_s(record: _Record) -> float:
    boot = _boot_s(record)
    return 1e-6 * getattr(record.fields, "time_usec", np.nan) if boot is None else boot


# --- messages ---------------------------------------------------------------------------------------------------------


def _channels(
    telemetry: _Telemetry, history: ParameterHistory, is_ardupilot: bool, findings: list[Finding]
) -> Iterator[Channel]:
    records = telemetry.records
    if records["LOCAL_POSITION_NED"]:
        fields = {"x_m": ("x", 1.0), "y_m": ("y", 1.0), "z_m": ("z", -1.0)}
        fields |= {"vx_m_s": ("vx", 1.0), "vy_m_s": ("vy", 1.0), "vz_m_s": ("vz", -1.0)}
        yield _channel(telemetry, "LOCAL_POSITION_NED", fields)
    if kind := _first(telemetry, "ATTITUDE", "ATTITUDE_QUATERNION"):
        rates = {
            column: (field, 1.0) for column, field in zip(RATES, ("rollspeed", "pitchspeed", "yawspeed"), strict=True)
        }
        yield _channel(telemetry, kind, rates, _attitude(telemetry, kind))
    if kind := _first(telemetry, "HIGHRES_IMU", "SCALED_IMU", *(["RAW_IMU"] if is_ardupilot else [])):
        # ArduPilot's RAW_IMU is not raw: it is SCALED_IMU, in thousandths of gravity.
        scale = 1.0 if kind == "HIGHRES_IMU" else 1e-3 * GRAVITY_M_S2
        fields = {f"imu_{axis}_m_s2": (f"{axis}acc", scale) for axis in "xyz"}
        yield _channel(telemetry, kind, fields, makes_rows=False, averaged=True)
    if records["ATTITUDE_TARGET"]:
        quaternion = np.array([record.fields.q for record in records["ATTITUDE_TARGET"]], dtype=np.float64).T
        names = ("roll_cmd_deg", "pitch_cmd_deg", "yaw_cmd_deg")
        throttle = {"throttle_cmd": _boosted(telemetry, history, is_ardupilot, findings)}
        yield _channel(telemetry, "ATTITUDE_TARGET", {}, throttle | _euler(quaternion, names))
    yield from _rotors(telemetry, history.last, findings)
    ambient = _ambient(telemetry)
    if records["SERVO_OUTPUT_RAW"] and (columns := _outputs(telemetry, history, ambient)):
        if is_ardupilot:
            findings.append(output_finding(history.last, ambient))
        yield _channel(telemetry, "SERVO_OUTPUT_RAW", {}, columns)
    yield from _battery(telemetry)
    yield from _heights(telemetry)


def _heights(telemetry: _Telemetry) -> Iterator[Channel]:
    """Barometer and range finder that looks down; the climb rate of GPS is in no message.

    PX4 tells the barometer's height in ALTITUDE, ArduPilot its pressure.
    """
    if kind := _first(telemetry, "ALTITUDE", "SCALED_PRESSURE"):
        if kind == "ALTITUDE":
            columns = {"baro_m": telemetry.field(kind, "altitude_monotonic")}
        else:
            columns = {"baro_m": np.asarray(pressure_altitude_m(telemetry.field(kind, "press_abs", 100.0)))}
            columns["baro_temperature_c"] = telemetry.field(kind, "temperature", 0.01)
        yield _channel(telemetry, kind, {}, columns, makes_rows=False, averaged=True)
    downward = [record for record in telemetry.records["DISTANCE_SENSOR"] if record.fields.orientation == _DOWN]
    of_one = [record for record in downward if record.fields.id == downward[0].fields.id]
    if of_one:
        names = ("current_distance", "min_distance", "max_distance")
        distance, least, most = 0.01 * np.array([[getattr(m.fields, name) for m in of_one] for name in names])
        good = (distance > least) & (distance < most)
        columns = {"range_m": np.where(good, distance, np.nan)}
        yield Channel("DISTANCE_SENSOR", telemetry.times(of_one), columns, makes_rows=False)


def _events(telemetry: _Telemetry) -> list[Event]:
    """Modes, messages, and changes of parameters."""
    from pymavlink.mavutil import mode_string_v10

    beats, texts = (telemetry.records[kind] for kind in ("HEARTBEAT", "STATUSTEXT"))
    return [
        *mode_changes(telemetry.times(beats).tolist(), [mode_string_v10(beat.fields) for beat in beats]),
        *said(telemetry.times(texts).tolist(), [record.fields.text for record in texts]),
        *parameter_changes(telemetry.parameters()),
    ]


def _channel(
    telemetry: _Telemetry,
    kind: str,
    fields: dict[str, tuple[str, float]],
    more: dict[str, Floats] | None = None,
    makes_rows: bool = True,
    averaged: bool = False,
) -> Channel:
    """A channel of scaled fields of one message, `{column: (field, scale)}`, and of columns made before."""
    columns = {column: telemetry.field(kind, name, scale) for column, (name, scale) in fields.items()}
    return Channel(kind, telemetry.times(telemetry.records[kind]), columns | (more or {}), makes_rows, averaged)


def _first(telemetry: _Telemetry, *kinds: str) -> str | None:
    return next((kind for kind in kinds if telemetry.records[kind]), None)


def _attitude(telemetry: _Telemetry, kind: str) -> dict[str, Floats]:
    if kind == "ATTITUDE":
        return {name: np.degrees(telemetry.field(kind, name.removesuffix("_deg"))) for name in ATTITUDE}
    return _euler(np.array([telemetry.field(kind, f"q{i}") for i in range(1, 5)]), ATTITUDE)


def _euler(quaternion: Floats, names: Sequence[str]) -> dict[str, Floats]:
    """`quaternion` of shape (4, n)."""
    w, x, y, z = quaternion
    return {name: np.degrees(angle) for name, angle in zip(names, euler_from_quaternion((w, x, y, z)), strict=True)}


def _rotors(telemetry: _Telemetry, parameters: dict[str, float], findings: list[Finding]) -> Iterator[Channel]:
    """Speeds, voltages and currents, four ESCs to a message; nothing when all stand still all the time."""
    groups: list[tuple[int, list[_Record], tuple[float, float]]] = [
        (first, telemetry.records[kind], (0.01, 0.01))
        for first, kind in ((0, "ESC_TELEMETRY_1_TO_4"), (4, "ESC_TELEMETRY_5_TO_8"), (8, "ESC_TELEMETRY_9_TO_12"))
    ]
    by_index: dict[int, list[_Record]] = defaultdict(list)
    for record in telemetry.records["ESC_STATUS"]:
        by_index[record.fields.index].append(record)
    groups += [(first, found, (1.0, 1.0)) for first, found in sorted(by_index.items())]
    any_found, any_turns = False, False
    for first, found, scales in groups:
        if not found:
            continue
        any_found = True
        columns = _escs(first, found, scales, parameters)
        if columns:
            any_turns = True
            yield Channel(f"{found[0].kind} from {first + 1}", telemetry.times(found), columns)
    if any_found and not any_turns:
        findings.append(finding(Kind.SPEEDS_ZERO, source="the ESC messages", several=True))


def _escs(
    first: int, records: list[_Record], scales: tuple[float, float], parameters: dict[str, float]
) -> dict[str, Floats]:
    columns: dict[str, Floats] = {}
    table = {
        "rpm": np.abs(np.array([record.fields.rpm for record in records], dtype=np.float64)),
        "voltage_v": scales[0] * np.array([record.fields.voltage for record in records], dtype=np.float64),
        "current_a": scales[1] * np.array([record.fields.current for record in records], dtype=np.float64),
    }
    for i in range(4):
        motor = motor_of_servo(first + i + 1, parameters)
        if motor is not None and table["rpm"][:, i].any():
            columns |= {f"motor{motor}_{quantity}": v[:, i] for quantity, v in table.items() if v[:, i].any()}
    return columns


def _boosted(telemetry: _Telemetry, history: ParameterHistory, is_ardupilot: bool, findings: list[Finding]) -> Floats:
    """Thrust of ATTITUDE_TARGET as it is flown: ArduPilot tells it before its angle boost."""
    thrust = telemetry.field("ATTITUDE_TARGET", "thrust")
    kind = _first(telemetry, "ATTITUDE", "ATTITUDE_QUATERNION")
    boost = history.last.get(BOOST)
    if not is_ardupilot or kind is None or not boost:
        return thrust
    attitude = _attitude(telemetry, kind)
    cos_tilt = np.cos(np.radians(attitude["roll_deg"])) * np.cos(np.radians(attitude["pitch_deg"]))
    at_s, known_s = telemetry.times(telemetry.records["ATTITUDE_TARGET"]), telemetry.times(telemetry.records[kind])
    findings.append(finding(Kind.ANGLE_BOOST, value=boost))
    return np.asarray(thrust * angle_boost(np.interp(at_s, known_s, cos_tilt), history.last))


def _ambient(telemetry: _Telemetry) -> Ambient:
    """Battery and air at the times of SERVO_OUTPUT_RAW; the first temperature counts as that of the ground.

    A board of version 4.6 or later counts as one that takes the standard atmosphere, as most do: telemetry does not
    tell.
    """
    at_s = telemetry.times(telemetry.records["SERVO_OUTPUT_RAW"])
    volts = ratio = np.full(len(at_s), np.nan)
    atmosphere = None
    if records := telemetry.records["SYS_STATUS"]:
        volts = np.interp(at_s, telemetry.times(records), telemetry.field("SYS_STATUS", "voltage_battery", 1e-3))
    if records := telemetry.records["SCALED_PRESSURE"]:
        told_s = telemetry.times(records)
        if positions := telemetry.records["GLOBAL_POSITION_INT"]:
            altitude_m = np.interp(
                told_s, telemetry.times(positions), telemetry.field("GLOBAL_POSITION_INT", "alt", 1e-3)
            )
        else:
            altitude_m = np.full(len(told_s), np.nan)
        pressure_pa = telemetry.field("SCALED_PRESSURE", "press_abs", 100.0)
        ground_c = telemetry.field("SCALED_PRESSURE", "temperature", 0.01)[0]
        atmosphere = atmosphere_of(_version(telemetry), is_standard=True)
        air = Air(pressure_pa, ground_c, 0.0, altitude_m)
        ratio = np.interp(at_s, told_s, air_density_ratio(air, atmosphere))
    return Ambient(volts, ratio, atmosphere=atmosphere)


def _version(telemetry: _Telemetry) -> Version | None:
    """Version by AUTOPILOT_VERSION, or by the text of the start; None where neither tells."""
    numbers = [version_of_number(record.fields.flight_sw_version) for record in telemetry.records["AUTOPILOT_VERSION"]]
    named = [version_in(record.fields.text) for record in telemetry.records["STATUSTEXT"]]
    return next((version for version in [*numbers, *named] if version is not None), None)


def _outputs(telemetry: _Telemetry, history: ParameterHistory, ambient: Ambient) -> dict[str, Floats]:
    """Motor outputs; where no parameter says which outputs are motors, as many as the vehicle's type has."""
    kinds = Counter(m.fields.type for m in telemetry.records["HEARTBEAT"])
    n_motors = _MOTORS_OF_TYPE.get(kinds.most_common(1)[0][0], 16) if kinds else 16
    n_outputs = 16 if any(name.startswith("SERVO") for name in history.last) else n_motors
    pulses = {i: telemetry.field("SERVO_OUTPUT_RAW", f"servo{i}_raw") for i in range(1, n_outputs + 1)}
    time_s = telemetry.times(telemetry.records["SERVO_OUTPUT_RAW"])
    return motor_outputs(time_s, pulses, history, ambient, n_motors)


def _battery(telemetry: _Telemetry) -> Iterator[Channel]:
    records = [record for record in telemetry.records["BATTERY_STATUS"] if record.fields.id == 0]
    if records:
        # Cells that are not measured hold 65535.
        cells = np.array([record.fields.voltages for record in records], dtype=np.float64)
        volts = 1e-3 * np.where(cells < 65535, cells, 0.0).sum(axis=1)
        if volts.any():
            yield Channel("BATTERY_STATUS", telemetry.times(records), {"battery_v": volts}, makes_rows=False)
            return
    if telemetry.records["SYS_STATUS"]:
        yield _channel(telemetry, "SYS_STATUS", {"battery_v": ("voltage_battery", 1e-3)}, makes_rows=False)
