"""ArduPilot's DataFlash logs (`.bin`), decoded by pymavlink's table of formats, each kind of message at once.

State comes from the primary EKF core (XKF1, or NKF1 of older firmware), ATT and RATE. A simulator's SIM and SIM2
messages are not among MESSAGES: their bytes are stepped over and never decoded.
"""

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from quadctl.errors import LogError
from quadctl.logs.ardupilot import (
    CHAIN_PARAMETERS,
    PARAMETERS,
    motor_of_servo,
    motor_outputs,
    motors_of_frame,
    output_finding,
)
from quadctl.logs.estimator_health import lane_switches, lost_fixes, rejections
from quadctl.logs.events import Event, mode_changes, parameter_changes, said
from quadctl.logs.findings import Finding, Kind, finding
from quadctl.logs.flight_log import FlightLog, Floats
from quadctl.logs.merge import Channel, Origin, finite, intervals, merge
from quadctl.logs.parameter_history import ParameterHistory, change_findings
from quadctl.thrust_chain.atmosphere import (
    Air,
    Version,
    air_density_ratio,
    atmosphere_of,
    takes_standard,
    version_in,
)
from quadctl.thrust_chain.chain import Ambient

MESSAGES = (
    "PARM",
    "VER",
    "XKF1",
    "XKF4",
    "NKF1",
    "NKF4",
    "ATT",
    "RATE",
    "IMU",
    "RCOU",
    "ESC",
    "BAT",
    "ARM",
    "MOTB",
    "BARO",
    "MODE",
    "MSG",
    "ORGN",
    "EV",
    "GPS",
)
NEEDED = "XKF1 (or NKF1) and ATT"

_HEAD = b"\xa3\x95"
_FMT = 0x80
_FMT_BODY = struct.Struct("<BB4s16s64s")
_TEXT_FIELDS = ("Name", "FWS", "Message")
"""Fields of the MESSAGES that are no numbers."""
_NEEDED_FIELDS = {
    "PARM": ("Name",),
    "ESC": ("Instance", "RPM"),
    "ARM": ("ArmState",),
    "MODE": ("Mode",),
    "MSG": ("Message",),
}
"""Fields, beside the time, without which a message says nothing; any other may be missing."""
_INSTANCE_FIELDS = ("I", "C", "Inst", "Instance")
_MAX_OUTPUTS = 14
_HORIZONTAL_POSITION, _HEIGHT, _CONSTANT_POSITION = 0b1_1000, 0b10_0000, 0b1000_0000
"""Bits of SS in XKF4, ArduPilot's `nav_filter_status`: horizontal position relative or absolute, height, and position
held constant for want of an aid."""

_TEST_RATIOS = {"SP": "position", "SV": "velocity", "SH": "height"}
"""Fields of XKF4 with the test ratios, and what is measured."""
_RESET_EVENTS = {60: "height", 62: "heading"}
"""Numbers of EV at which the estimator resets a part of its state."""
_YAW_RESET = re.compile(r"yaw re-?aligned|yaw alignment complete|yaw reset|yaw aligned", re.IGNORECASE)
"""Messages of a reset of the heading."""

_Message: TypeAlias = dict[str, NDArray[Any]]
"""Arrays of shape (n,) by the names of the fields, in the units of ArduPilot's documentation."""


def is_dataflash(head: bytes) -> bool:
    """True for a file that begins with `head` as a DataFlash log does."""
    return head.startswith(_HEAD)


def read_dataflash(path: Path) -> FlightLog:
    """Read an ArduPilot DataFlash log.

    Raises
    ------
    LogError
        The file cannot be read, is no DataFlash log, or holds no position, velocity or attitude.
    """
    data, index = _indexed(path)
    findings = [finding(Kind.CUT_SHORT)] if index.is_cut_short else []
    if index.n_damaged_bytes:
        findings.append(finding(Kind.DAMAGED_BYTES, bytes=index.n_damaged_bytes, first=index.first_damage))
    messages = {name: _decoded(data, form) for name, form in index.formats.items() if form.offsets}
    history = _parameters(messages)
    meta = {
        "autopilot": "ArduPilot",
        "software": _version(messages),
        "parameters": {name: value for name, value in history.last.items() if name in PARAMETERS},
    }
    findings += change_findings(history, CHAIN_PARAMETERS)
    channels = list(_channels(messages, history, findings))
    armed_s = _armed(messages)
    findings += [*_doubts(messages, armed_s), *_health(messages)]
    return merge(channels, Origin(path, NEEDED, meta, findings, armed_s, events=_events(messages, history)))


def parameters_in_dataflash(path: Path) -> dict[str, float]:
    """Last value of each parameter in an ArduPilot DataFlash log.

    Raises
    ------
    LogError
        The file cannot be read, or is no DataFlash log.
    """
    data, index = _indexed(path)
    form = index.formats.get("PARM")
    return _parameters({"PARM": _decoded(data, form)} if form is not None and form.offsets else {}).last


def texts_in_dataflash(path: Path) -> list[str]:
    """Texts of the messages in an ArduPilot DataFlash log.

    Raises
    ------
    LogError
        The file cannot be read, or is no DataFlash log.
    """
    data, index = _indexed(path)
    form = index.formats.get("MSG")
    texts = _decoded(data, form)["Message"].tolist() if form is not None and form.offsets else []
    return [text.decode("ascii", "replace") for text in texts]


# --- bytes ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Format:
    """One of the MESSAGES, as this file describes it."""

    body: np.dtype[Any]
    scale: dict[str, float]
    """By the names of the fields that are logged as scaled integers."""
    offsets: list[int]
    """Positions in the file at which the bodies begin."""


@dataclass(frozen=True)
class _Index:
    formats: dict[str, _Format]
    """By the names of the MESSAGES."""
    is_cut_short: bool
    """True where the file ends within a message."""
    n_damaged_bytes: int
    first_damage: int | None


def _indexed(path: Path) -> tuple[bytes, _Index]:
    """Content of a log, and where its messages are."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise LogError(f"{path}: cannot be read ({error.strerror})") from None
    index = _index(data)
    if not index.formats:
        raise LogError(
            f"{path}: describes no message that is needed, expected an ArduPilot DataFlash log with {NEEDED}"
        )
    return data, index


def _index(data: bytes) -> _Index:
    """Find the messages. Damage is stepped over, to the next header of a message that the file describes."""
    lengths = {_FMT: 3 + _FMT_BODY.size}
    formats: dict[str, _Format] = {}
    wanted: dict[int, list[int]] = {}
    damaged, first_damage = 0, None
    at, end, is_cut_short = 0, len(data), False
    while at + 3 <= end:
        kind = data[at + 2]
        length = lengths.get(kind, 0) if data.startswith(_HEAD, at) else 0
        if length and at + length > end:
            is_cut_short = True
            break
        if not length:
            if end - at < 512 and not data[at:].strip(b"\0\xff"):
                break  # what the last page of a flash memory is filled up with
            first_damage = at if first_damage is None else first_damage
            after = data.find(_HEAD, at + 1)
            after = end if after < 0 else after
            damaged += after - at
            at = after
            continue
        if kind in wanted:
            wanted[kind].append(at + 3)
        elif kind == _FMT:
            of, size, *text = _FMT_BODY.unpack_from(data, at + 3)
            name, letters, fields = (part.rstrip(b"\0").decode("ascii", "replace") for part in text)
            lengths.setdefault(of, size)  # the same description may come again
            if name in MESSAGES and of not in wanted and (made := _format(name, letters, fields.split(","), size)):
                formats[name] = made
                wanted[of] = made.offsets
        at += length
    return _Index(formats, is_cut_short, damaged, first_damage)


def _format(name: str, letters: str, fields: list[str], length: int) -> _Format | None:
    """Layout of a message, None where its description is damaged."""
    from pymavlink.DFReader import FORMAT_TO_STRUCT

    try:
        codes = [FORMAT_TO_STRUCT[letter][0] for letter in letters]
        kinds = [f"S{code[:-1]}" if code.endswith("s") else f"<{code}" for code in codes]
        body = np.dtype(list(zip(fields, kinds, strict=True)))
    except (KeyError, ValueError):
        return None
    scale = {field: FORMAT_TO_STRUCT[letter][1] for field, letter in zip(fields, letters, strict=True)}
    if body.itemsize != length - 3 or not {"TimeUS", *_NEEDED_FIELDS.get(name, ())} <= set(fields):
        return None
    if body.names != tuple(fields) or any((body[field].kind == "S") != (field in _TEXT_FIELDS) for field in fields):
        return None
    return _Format(body, {field: by for field, by in scale.items() if by is not None}, [])


def _decoded(data: bytes, form: _Format) -> _Message:
    where = np.array(form.offsets)[:, None] + np.arange(form.body.itemsize)
    table = np.frombuffer(data, dtype=np.uint8)[where].view(form.body)[:, 0]
    fields = form.body.names or ()
    return {field: table[field] * form.scale[field] if field in form.scale else table[field] for field in fields}


# --- messages ---------------------------------------------------------------------------------------------------------


def _channels(messages: dict[str, _Message], history: ParameterHistory, findings: list[Finding]) -> Iterator[Channel]:
    yield from _position(messages)
    if (att := messages.get("ATT")) is not None:
        attitude = {
            "roll_deg": _values(att, "Roll"),
            "pitch_deg": _values(att, "Pitch"),
            "yaw_deg": _within_180(_values(att, "Yaw")),
        }
        wanted = {
            "roll_cmd_deg": _values(att, "DesRoll"),
            "pitch_cmd_deg": _values(att, "DesPitch"),
            "yaw_cmd_deg": _within_180(_values(att, "DesYaw")),
        }
        yield Channel("ATT", _seconds(att), attitude | wanted)
    if (rate := messages.get("RATE")) is not None:
        names = {"roll_rate_rad_s": "R", "pitch_rate_rad_s": "P", "yaw_rate_rad_s": "Y"}
        rates = {column: np.radians(_values(rate, field)) for column, field in names.items()}
        yield Channel("RATE", _seconds(rate), rates | {"throttle_cmd": _values(rate, "AOut")})
    if (imu := _instance(messages.get("IMU"), 0)) is not None:
        names = {"imu_x_m_s2": "AccX", "imu_y_m_s2": "AccY", "imu_z_m_s2": "AccZ"}
        force = {column: _values(imu, field) for column, field in names.items()}
        yield Channel("IMU", _seconds(imu), force, makes_rows=False, averaged=True)
    yield from _motors(messages, history, findings)
    if (battery := _instance(messages.get("BAT"), 0)) is not None:
        yield Channel("BAT", _seconds(battery), {"battery_v": _values(battery, "Volt")}, makes_rows=False)


def _position(messages: dict[str, _Message]) -> Iterator[Channel]:
    """Position and velocity of the EKF core that flies."""
    for state, status in (("XKF1", "XKF4"), ("NKF1", "NKF4")):
        if (all_cores := messages.get(state)) is None:
            continue
        primary = _primary_core(messages.get(status))
        if (core := _flown(all_cores, messages.get(status))) is None:
            continue
        signs = {"x_m": ("PN", 1.0), "y_m": ("PE", 1.0), "z_m": ("PD", -1.0)}
        signs |= {"vx_m_s": ("VN", 1.0), "vy_m_s": ("VE", 1.0), "vz_m_s": ("VD", -1.0)}
        columns = {column: sign * _values(core, field) for column, (field, sign) in signs.items()}
        yield Channel(f"{state} of core {primary}", _seconds(core), columns)
        return


def _doubts(messages: dict[str, _Message], armed_s: list[tuple[float, float]]) -> list[Finding]:
    """Findings on the time, armed where the log says so, in which the EKF itself did not claim to know the position."""
    name = next((status for status in ("XKF4", "NKF4") if status in messages), None)
    core = None if name is None else _instance(messages[name], _primary_core(messages[name]))
    if core is None or "SS" not in core:
        return []
    time, status = _seconds(core), core["SS"].astype(np.int64)
    if armed_s:
        status = status[np.logical_or.reduce([(time >= begin) & (time <= end) for begin, end in armed_s])]
    unknown = {
        ("x_m", "y_m"): ((status & _HORIZONTAL_POSITION) == 0) | ((status & _CONSTANT_POSITION) != 0),
        ("z_m",): (status & _HEIGHT) == 0,
    }
    return [
        finding(
            Kind.STATE_INVALID,
            columns=columns,
            share=float(np.mean(where)),
            flag=f"{name}.SS",
            left_out=False,
            while_armed=bool(armed_s),
        )
        for columns, where in unknown.items()
        if where.any()
    ]


def _health(messages: dict[str, _Message]) -> list[Finding]:
    """What ArduPilot's estimator says of itself: rejected sensors, lost fixes, and resets."""
    found: list[Finding] = []
    name = next((status for status in ("XKF4", "NKF4") if status in messages), None)
    if name is not None:
        if (core := _instance(messages[name], _primary_core(messages[name]))) is not None:
            ratios = {of: _values(core, field) for field, of in _TEST_RATIOS.items() if field in core}
            found += rejections(_seconds(core), ratios)
        found += lane_switches(*_primary_over_time(messages[name]))
    if (gps := _instance(messages.get("GPS"), 0)) is not None and "Status" in gps:
        found += lost_fixes(_seconds(gps), _values(gps, "Status"))
    times: dict[str, list[float]] = {}
    if (event := messages.get("EV")) is not None and "Id" in event:
        for at, number in zip(_seconds(event).tolist(), event["Id"].tolist(), strict=True):
            if number in _RESET_EVENTS:
                times.setdefault(_RESET_EVENTS[number], []).append(at)
    if (msg := messages.get("MSG")) is not None:
        for at, text in zip(_seconds(msg).tolist(), _texts(messages), strict=True):
            if _YAW_RESET.search(text):
                times.setdefault("heading", []).append(at)
    return [*found, *(finding(Kind.RESET, [(at, at) for at in own], of=of) for of, own in times.items())]


def _primary_over_time(status: _Message) -> tuple[Floats, Floats]:
    """Times, and the number of the core that flew."""
    if "PI" not in status:
        return np.zeros(0), np.zeros(0)
    return _seconds(status), _values(status, "PI")


def _flown(cores: _Message, status: _Message | None) -> _Message | None:
    """The messages of the core that flew at each time; one that the firmware does not number is the one that flew."""
    if status is None or "C" not in cores or "PI" not in status:
        return _instance(cores, 0)
    at, primary = _primary_over_time(status)
    last = np.maximum(np.searchsorted(at, _seconds(cores), side="right") - 1, 0)
    rows = cores["C"] == primary[last]
    return {name: values[rows] for name, values in cores.items()} if rows.any() else _instance(cores, 0)


def _primary_core(status: _Message | None) -> int:
    """The core that was primary for most of the time."""
    if status is None or "PI" not in status:
        return 0
    return int(np.argmax(np.bincount(np.maximum(status["PI"], 0))))


def _motors(messages: dict[str, _Message], history: ParameterHistory, findings: list[Finding]) -> Iterator[Channel]:
    if (esc := messages.get("ESC")) is not None and "Instance" in esc:
        if np.any(esc["RPM"]):
            n_motors = motors_of_frame(history.last, _texts(messages))
            found = (_esc(esc, int(i), history.last, n_motors) for i in np.unique(esc["Instance"]))
            yield from (channel for channel in found if channel is not None)
        else:
            findings.append(finding(Kind.SPEEDS_ZERO, source="ESC", several=False))
    if (rcou := messages.get("RCOU")) is not None:
        pulses = {i: _values(rcou, f"C{i}") for i in range(1, _MAX_OUTPUTS + 1) if f"C{i}" in rcou}
        ambient = _ambient(messages, history, _seconds(rcou))
        n_motors = motors_of_frame(history.last, _texts(messages))
        if columns := motor_outputs(_seconds(rcou), pulses, history, ambient, n_motors):
            findings.append(output_finding(history.last, ambient))
            yield Channel("RCOU", _seconds(rcou), columns)


def _ambient(messages: dict[str, _Message], history: ParameterHistory, time_s: Floats) -> Ambient:
    """Battery and air at these times, as the firmware's compensations saw them."""
    volts = ratio = np.full(len(time_s), np.nan)
    atmosphere = None
    if (motors := messages.get("MOTB")) is not None and "BatVolt" in motors:  # filtered, over MOT_BAT_VOLT_MAX
        filtered = history.last.get("MOT_BAT_VOLT_MAX", np.nan) * _values(motors, "BatVolt")
        volts = np.interp(time_s, _seconds(motors), filtered)
    elif (battery := _instance(messages.get("BAT"), 0)) is not None:
        resting = _values(battery, "VoltR" if "VoltR" in battery else "Volt")  # without the sag of the load
        volts = np.interp(time_s, _seconds(battery), resting)
    if (baro := _instance(messages.get("BARO"), 0)) is not None:
        height_m = _values(baro, "Alt")
        air = Air(_values(baro, "Press"), _values(baro, "GndTemp"), height_m, _altitude_m(messages, baro))
        atmosphere = atmosphere_of(_version_numbers(messages), takes_standard(air))
        ratio = np.interp(time_s, _seconds(baro), air_density_ratio(air, atmosphere))
    return Ambient(volts, ratio, atmosphere=atmosphere)


def _altitude_m(messages: dict[str, _Message], baro: _Message) -> Floats:
    """Altitude above the sea at each message of the barometer: its own, else that of the EKF's origin and its height;
    nan where neither is told."""
    origin = messages.get("ORGN")
    if "AltAMSL" in baro or origin is None:
        return _values(baro, "AltAMSL")
    ekf = origin["Type"] == 0 if "Type" in origin else np.ones(len(origin["TimeUS"]), dtype=bool)
    ground_m = _values(origin, "Alt")[ekf]
    return _values(baro, "Alt") + (ground_m[-1] if len(ground_m) else np.nan)


def _esc(messages: _Message, instance: int, parameters: dict[str, float], n_motors: int | None) -> Channel | None:
    """Speed, voltage and current of one motor; None when it is no motor."""
    esc = _instance(messages, instance)
    motor = motor_of_servo(instance + 1, parameters, n_motors)
    if esc is None or motor is None:
        return None
    columns = {f"motor{motor}_rpm": np.abs(_values(esc, "RPM"))}
    for quantity, field in (("voltage_v", "Volt"), ("current_a", "Curr")):
        if np.any(values := _values(esc, field)):
            columns[f"motor{motor}_{quantity}"] = values
    return Channel(f"ESC {instance}", _seconds(esc), columns)


def _armed(messages: dict[str, _Message]) -> list[tuple[float, float]]:
    """A log can begin armed: before the first ARM message the state was the other one."""
    if (arm := messages.get("ARM")) is None or (att := messages.get("ATT")) is None:
        return []
    state = arm["ArmState"] != 0
    time = np.concatenate([_seconds(att)[:1], _seconds(arm), _seconds(att)[-1:]])
    return intervals(time, np.concatenate([~state[:1], state, state[-1:]]))


def _parameters(messages: dict[str, _Message]) -> ParameterHistory:
    if (parm := messages.get("PARM")) is None:
        return ParameterHistory()
    names = [name.decode("ascii", "replace") for name in parm["Name"].tolist()]
    return ParameterHistory(zip(_seconds(parm).tolist(), names, _values(parm, "Value").tolist(), strict=True))


def _texts(messages: dict[str, _Message]) -> list[str]:
    """Texts of the autopilot's messages."""
    msg = messages.get("MSG")
    return [] if msg is None else [text.decode("ascii", "replace") for text in msg["Message"].tolist()]


def _events(messages: dict[str, _Message], history: ParameterHistory) -> list[Event]:
    """Modes, messages, and changes of parameters."""
    from pymavlink.mavutil import mode_mapping_acm

    found: list[Event] = []
    if (mode := messages.get("MODE")) is not None:
        found += mode_changes(_seconds(mode), mode["Mode"].tolist(), mode_mapping_acm)
    if (msg := messages.get("MSG")) is not None:
        found += said(_seconds(msg), _texts(messages))
    return [*found, *parameter_changes(history)]


def _version(messages: dict[str, _Message]) -> str:
    if (ver := messages.get("VER")) is None or "FWS" not in ver:
        return "ArduPilot"
    return str(ver["FWS"][0].decode("ascii", "replace"))


def _version_numbers(messages: dict[str, _Message]) -> Version | None:
    """Version by VER, or by the message of the start; None where neither tells."""
    if (ver := messages.get("VER")) is not None and {"Maj", "Min"} <= ver.keys():
        return int(ver["Maj"][0]), int(ver["Min"][0])
    texts = messages["MSG"]["Message"].tolist() if "MSG" in messages else []
    found = (version_in(text.decode("ascii", "replace")) for text in texts)
    return next((version for version in found if version is not None), None)


# --- fields -----------------------------------------------------------------------------------------------------------


def _instance(message: _Message | None, wanted: int) -> _Message | None:
    """The messages of one sensor or core; all of them where firmware does not number them."""
    if message is None:
        return None
    field = next((name for name in _INSTANCE_FIELDS if name in message), None)
    if field is None:
        return message
    rows = message[field] == wanted
    return {name: values[rows] for name, values in message.items()} if rows.any() else None


def _values(message: _Message, field: str) -> Floats:
    """The field; NaN where it is not finite or firmware does not log it."""
    if field not in message:
        return np.full(len(message["TimeUS"]), np.nan)
    return finite(message[field])


def _seconds(message: _Message) -> Floats:
    return 1e-6 * message["TimeUS"].astype(np.float64)


def _within_180(degrees: Floats) -> Floats:
    """Yaw from ArduPilot's 0..360 to the table's -180..180."""
    return np.where(degrees > 180.0, degrees - 360.0, degrees)
