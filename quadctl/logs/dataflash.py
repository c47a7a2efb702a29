"""ArduPilot's DataFlash logs (`.bin`, or as text `.log`), since ArduCopter 3.2.

State comes from the primary EKF core (XKF1; NKF1 or EKF1 of older firmware), ATT and RATE. A simulator's SIM and SIM2
messages are not among MESSAGES: they are stepped over and never decoded.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from quadctl.errors import LogError
from quadctl.logs.ardupilot import (
    CHAIN_PARAMETERS,
    PARAMETERS,
    motor_of_servo,
    motor_outputs,
    motors_of_frame,
    output_finding,
    with_frame,
)
from quadctl.logs.columns import TORQUE
from quadctl.logs.dataflash_records import Message, Records, read_records
from quadctl.logs.estimator_health import lane_switches, lost_fixes, rejections
from quadctl.logs.events import Event, mode_changes, parameter_changes, said
from quadctl.logs.findings import Finding, Kind, finding
from quadctl.logs.flight_log import ATTITUDE, POSITION, RATES, FlightLog, Floats, doubt_of_copy
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
from quadctl.words import count

MESSAGES: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(("VER", "XKF1", "XKF4", "NKF1", "NKF4", "EKF1", "EKF4", "ATT", "RATE", "IMU", "RCOU", "CTUN"), ()),
    **dict.fromkeys(("BAT", "CURR", "MOTB", "BARO", "ORGN", "EV", "GPS", "RFND"), ()),
    "PARM": ("Name",),
    "ESC": ("Instance", "RPM"),
    "ARM": ("ArmState",),
    "MODE": ("Mode",),
    "MSG": ("Message",),
}
"""The messages that are read, with the fields without which one says nothing; any other may be missing."""
ESTIMATES = {"XKF1": "XKF4", "NKF1": "NKF4", "EKF1": "EKF4"}
"""Messages with position and velocity, of ArduPilot's third, second and first EKF, and of what it says of itself."""
NEEDED = "XKF1 (NKF1 or EKF1 of older versions) and ATT"

THROTTLE, VOLTS = (2.0, 1000.0), (100.0, 100.0)
"""Values that none exceeds in its own unit, and the parts in which older firmware logs it."""
_INSTANCE_FIELDS = ("I", "C", "Inst", "Instance")
_MAX_OUTPUTS = 14
_OUTPUTS = ("C", "Ch", "Chan")
"""Begins of the names of the outputs in RCOU, the later the older."""
_ARMED_EVENTS = {10: True, 11: False}
"""Numbers of EV at which the vehicle is armed and disarmed, where ARM is not logged."""
_HORIZONTAL_POSITION, _HEIGHT, _CONSTANT_POSITION = 0b1_1000, 0b10_0000, 0b1000_0000
"""Bits of SS in XKF4, ArduPilot's `nav_filter_status`: horizontal position relative or absolute, height, and position
held constant for want of an aid."""

_RANGE_GOOD, _DOWN, _FIX_3D = 4, 25, 3
"""RFND.Stat of a good distance, RFND.Orient of one that looks down, and the least GPS.Status with heights."""
_TEST_RATIOS = {"SP": "position", "SV": "velocity", "SH": "height"}
"""Fields of XKF4 with the test ratios, and what is measured."""
_RESET_EVENTS = {60: "height", 62: "heading"}
"""Numbers of EV at which the estimator resets a part of its state."""
_YAW_RESET = re.compile(r"yaw re-?aligned|yaw alignment complete|yaw reset|yaw aligned", re.IGNORECASE)
"""Messages of a reset of the heading."""


def read_dataflash(path: Path, *, of_rotation: bool = False) -> FlightLog:
    """Read an ArduPilot DataFlash log; `of_rotation` with the gyro, where it comes faster than RATE, and with the
    controller's outputs in roll, pitch and yaw, each at its own time.

    Raises
    ------
    LogError
        The file cannot be read, is no DataFlash log, or holds no position, velocity or attitude.
    """
    records = _flight(path)
    messages, findings = records.messages, records.findings
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
    origin = Origin(path, NEEDED, meta, findings, armed_s, events=_events(messages, history))
    if not of_rotation:
        return merge(channels, origin)
    return merge(_of_rotation(messages, channels), replace(origin, row_tolerance_s=0.0))


def parameters_in_dataflash(path: Path) -> dict[str, float]:
    """Last value of each parameter in an ArduPilot DataFlash log; {} where it holds none.

    The frame that an older one tells in its messages is among them, as FRAME_CLASS and FRAME_TYPE.

    Raises
    ------
    LogError
        The file cannot be read, or is no DataFlash log.
    """
    messages = _described(path).messages
    values = _parameters(messages).last
    return with_frame(values, _texts(messages)) if values else {}


def _described(path: Path) -> Records:
    """Content of a log that describes its messages."""
    records = read_records(path, MESSAGES)
    if not records.n_formats:
        raise LogError(
            f"{path}: describes no message that is needed, expected an ArduPilot DataFlash log with {NEEDED}"
        )
    return records


def _flight(path: Path) -> Records:
    """Content of a log that holds a flight."""
    records = _described(path)
    if not records.counts:
        ends = f"ends after {count(records.n_formats, 'format')} and holds no data"
        raise LogError(f"{path}: {ends}, expected an ArduPilot DataFlash log with {NEEDED}")
    estimate = [] if any(name in records.messages for name in ESTIMATES) else [" or ".join(ESTIMATES)]
    lacking = estimate + ([] if "ATT" in records.messages else ["ATT"])
    if lacking:
        version = _version(records.messages)
        raise LogError(
            f"{path}: holds {', '.join(records.counts)} of {version}, but no {' and no '.join(lacking)}: expected "
            f"{NEEDED}, as ArduCopter logs them since 3.2{doubt_of_copy(records.findings)}"
        )
    return records


# --- messages ---------------------------------------------------------------------------------------------------------


def _channels(messages: dict[str, Message], history: ParameterHistory, findings: list[Finding]) -> Iterator[Channel]:
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
    yield from _rates(messages)
    if (imu := _instance(messages.get("IMU"), 0)) is not None:
        names = {"imu_x_m_s2": "AccX", "imu_y_m_s2": "AccY", "imu_z_m_s2": "AccZ"}
        force = {column: _values(imu, field) for column, field in names.items()}
        yield Channel("IMU", _seconds(imu), force, makes_rows=False, averaged=True)
    yield from _motors(messages, history, findings)
    if (battery := _battery(messages)) is not None:
        source, voltage = battery
        yield Channel(source, _seconds(voltage), {"battery_v": _values(voltage, "Volt")}, makes_rows=False)
    yield from _heights(messages, int(history.last.get("BARO_PRIMARY", 0.0)))


def _heights(messages: dict[str, Message], primary: int) -> Iterator[Channel]:
    """Sensors of the height: the primary barometer, the first range finder that looks down, and GPS's climb rate."""
    if (baro := _instance(messages.get("BARO"), primary)) is not None:
        columns = {"baro_m": _values(baro, "Alt")}
        if "Temp" in baro:
            columns["baro_temperature_c"] = _values(baro, "Temp")
        yield Channel("BARO", _seconds(baro), columns, makes_rows=False, averaged=True)
    if (finder := _instance(messages.get("RFND"), 0)) is not None and "Dist" in finder:
        known = np.ones(len(finder["Dist"]), dtype=bool)
        for field, wanted in (("Stat", _RANGE_GOOD), ("Orient", _DOWN)):
            known &= finder[field] == wanted if field in finder else True
        distance = np.where(known, _values(finder, "Dist"), np.nan)
        yield Channel("RFND", _seconds(finder), {"range_m": distance}, makes_rows=False)
    if (gps := _instance(messages.get("GPS"), 0)) is not None and "VZ" in gps:
        climb = np.where(_values(gps, "Status") >= _FIX_3D, -_values(gps, "VZ"), np.nan)
        yield Channel("GPS", _seconds(gps), {"gps_vz_m_s": climb}, makes_rows=False)


def _rates(messages: dict[str, Message]) -> Iterator[Channel]:
    """Body rates and throttle: of the controller where it logs them, else of the gyro and of the height controller."""
    throttle: dict[str, Floats] = {}
    if (rate := messages.get("RATE")) is not None:
        per_degree = 100.0 if _is_before(messages, (3, 4)) else 1.0
        rates = {
            column: np.radians(_values(rate, field)) / per_degree for column, field in zip(RATES, "RPY", strict=True)
        }
        throttle = {"throttle_cmd": _in_units(_values(rate, "AOut"), *THROTTLE)} if "AOut" in rate else {}
        yield Channel("RATE", _seconds(rate), rates | throttle)
    elif (imu := _instance(messages.get("IMU"), 0)) is not None and "GyrX" in imu:
        rates = {column: _values(imu, f"Gyr{axis}") for column, axis in zip(RATES, "XYZ", strict=True)}
        yield Channel("IMU gyro", _seconds(imu), rates, makes_rows=False, averaged=True)
    if not throttle and (height := messages.get("CTUN")) is not None:
        share = _in_units(_values(height, "ThO" if "ThO" in height else "ThrOut"), *THROTTLE)
        yield Channel("CTUN", _seconds(height), {"throttle_cmd": share})


def _of_rotation(messages: dict[str, Message], channels: Sequence[Channel]) -> list[Channel]:
    """The channels with the gyro in place of the controller's rates, where it comes faster, and with the outputs of the
    controller in roll, pitch and yaw; only gyro, motors and controller make rows."""
    found = [replace(c, makes_rows=False) if c.columns.keys() & {*POSITION, *ATTITUDE} else c for c in channels]
    rate, imu = messages.get("RATE"), _instance(messages.get("IMU"), 0)
    if imu is not None and "GyrX" in imu and (rate is None or len(imu["TimeUS"]) > len(rate["TimeUS"])):
        found = [replace(c, columns={n: v for n, v in c.columns.items() if n not in RATES}) for c in found]
        rates = {column: _values(imu, f"Gyr{axis}") for column, axis in zip(RATES, "XYZ", strict=True)}
        found.append(Channel("IMU gyro", _seconds(imu), rates))
    if rate is not None and "ROut" in rate:
        outputs = {column: _values(rate, f"{axis}Out") for column, axis in zip(TORQUE, "RPY", strict=True)}
        found.append(Channel("RATE outputs", _seconds(rate), outputs))
    return found


def _battery(messages: dict[str, Message]) -> tuple[str, Message] | None:
    """Message of the first battery and its name."""
    if (battery := _instance(messages.get("BAT"), 0)) is not None:
        return "BAT", battery
    if (battery := _instance(messages.get("CURR"), 0)) is None or "Volt" not in battery:
        return None
    return "CURR", battery | {"Volt": _in_units(_values(battery, "Volt"), *VOLTS)}


def _position(messages: dict[str, Message]) -> Iterator[Channel]:
    """Position and velocity of the EKF core that flies."""
    for state, status in ESTIMATES.items():
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


def _doubts(messages: dict[str, Message], armed_s: list[tuple[float, float]]) -> list[Finding]:
    """Findings on the time, armed where the log says so, in which the EKF itself did not claim to know the position."""
    name = next((status for status in ESTIMATES.values() if status in messages), None)
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


def _health(messages: dict[str, Message]) -> list[Finding]:
    """Findings of ArduPilot's estimator: rejected sensors, lost fixes, and resets."""
    found: list[Finding] = []
    name = next((status for status in ESTIMATES.values() if status in messages), None)
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


def _primary_over_time(status: Message) -> tuple[Floats, Floats]:
    """Times, and the number of the core that flew."""
    if "PI" not in status:
        return np.zeros(0), np.zeros(0)
    return _seconds(status), _values(status, "PI")


def _flown(cores: Message, status: Message | None) -> Message | None:
    """The messages of the core that flew at each time; one that the firmware does not number is the one that flew."""
    if status is None or "C" not in cores or "PI" not in status:
        return _instance(cores, 0)
    at, primary = _primary_over_time(status)
    last = np.maximum(np.searchsorted(at, _seconds(cores), side="right") - 1, 0)
    rows = cores["C"] == primary[last]
    return {name: values[rows] for name, values in cores.items()} if rows.any() else _instance(cores, 0)


def _primary_core(status: Message | None) -> int:
    """The core that was primary for most of the time."""
    if status is None or "PI" not in status:
        return 0
    return int(np.argmax(np.bincount(np.maximum(status["PI"], 0))))


def _motors(messages: dict[str, Message], history: ParameterHistory, findings: list[Finding]) -> Iterator[Channel]:
    if (esc := messages.get("ESC")) is not None and "Instance" in esc:
        if np.any(esc["RPM"]):
            n_motors = motors_of_frame(history.last, _texts(messages))
            found = (_esc(esc, int(i), history.last, n_motors) for i in np.unique(esc["Instance"]))
            yield from (channel for channel in found if channel is not None)
        else:
            findings.append(finding(Kind.SPEEDS_ZERO, source="ESC", several=False))
    if (rcou := messages.get("RCOU")) is not None:
        named = {
            i: next((name for of in _OUTPUTS if (name := f"{of}{i}") in rcou), None) for i in range(1, _MAX_OUTPUTS + 1)
        }
        pulses = {i: _values(rcou, name) for i, name in named.items() if name is not None}
        ambient = _ambient(messages, history, _seconds(rcou))
        n_motors = motors_of_frame(history.last, _texts(messages))
        if columns := motor_outputs(_seconds(rcou), pulses, history, ambient, n_motors):
            findings.append(output_finding(history.last, ambient))
            yield Channel("RCOU", _seconds(rcou), columns)


def _ambient(messages: dict[str, Message], history: ParameterHistory, time_s: Floats) -> Ambient:
    """Battery and air at these times, as the firmware's compensations saw them."""
    volts = ratio = np.full(len(time_s), np.nan)
    atmosphere = None
    if (motors := messages.get("MOTB")) is not None and "BatVolt" in motors:  # filtered, over MOT_BAT_VOLT_MAX
        filtered = history.last.get("MOT_BAT_VOLT_MAX", np.nan) * _values(motors, "BatVolt")
        volts = np.interp(time_s, _seconds(motors), filtered)
    elif (known := _battery(messages)) is not None:
        battery = known[1]
        resting = _values(battery, "VoltR" if "VoltR" in battery else "Volt")  # without the sag of the load
        volts = np.interp(time_s, _seconds(battery), resting)
    if (baro := _instance(messages.get("BARO"), 0)) is not None:
        height_m = _values(baro, "Alt")
        air = Air(_values(baro, "Press"), _values(baro, "GndTemp"), height_m, _altitude_m(messages, baro))
        atmosphere = atmosphere_of(_version_numbers(messages), takes_standard(air))
        ratio = np.interp(time_s, _seconds(baro), air_density_ratio(air, atmosphere))
    return Ambient(volts, ratio, atmosphere=atmosphere)


def _altitude_m(messages: dict[str, Message], baro: Message) -> Floats:
    """Altitude above the sea at each message of the barometer: its own, else that of the EKF's origin and its height;
    nan where neither is told."""
    origin = messages.get("ORGN")
    if "AltAMSL" in baro or origin is None:
        return _values(baro, "AltAMSL")
    ekf = origin["Type"] == 0 if "Type" in origin else np.ones(len(origin["TimeUS"]), dtype=bool)
    ground_m = _values(origin, "Alt")[ekf]
    return _values(baro, "Alt") + (ground_m[-1] if len(ground_m) else np.nan)


def _esc(messages: Message, instance: int, parameters: dict[str, float], n_motors: int | None) -> Channel | None:
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


def _armed(messages: dict[str, Message]) -> list[tuple[float, float]]:
    """A log can begin armed: before the first message of it the state was the other one."""
    att = messages["ATT"]
    if (arm := messages.get("ARM")) is not None:
        time, state = _seconds(arm), arm["ArmState"] != 0
    elif (event := messages.get("EV")) is not None and "Id" in event:
        known = np.isin(event["Id"], list(_ARMED_EVENTS))
        time, state = (
            _seconds(event)[known],
            np.array([_ARMED_EVENTS[int(number)] for number in event["Id"][known]], bool),
        )
    else:
        return []
    time = np.concatenate([_seconds(att)[:1], time, _seconds(att)[-1:]])
    return intervals(time, np.concatenate([~state[:1], state, state[-1:]])) if len(state) else []


def _parameters(messages: dict[str, Message]) -> ParameterHistory:
    if (parm := messages.get("PARM")) is None:
        return ParameterHistory()
    names = [name.decode("ascii", "replace") for name in parm["Name"].tolist()]
    return ParameterHistory(zip(_seconds(parm).tolist(), names, _values(parm, "Value").tolist(), strict=True))


def _texts(messages: dict[str, Message]) -> list[str]:
    """Texts of the autopilot's messages."""
    msg = messages.get("MSG")
    return [] if msg is None else [text.decode("ascii", "replace") for text in msg["Message"].tolist()]


def _events(messages: dict[str, Message], history: ParameterHistory) -> list[Event]:
    """Modes, messages, and changes of parameters."""
    from pymavlink.mavutil import mode_mapping_acm

    found: list[Event] = []
    if (mode := messages.get("MODE")) is not None:
        modes, names = mode["Mode"].tolist(), mode_mapping_acm
        if mode["Mode"].dtype.kind == "S":  # a text has the names themselves
            modes, names = [name.decode("ascii", "replace").upper() for name in modes], None
        found += mode_changes(_seconds(mode), modes, names)
    if (msg := messages.get("MSG")) is not None:
        found += said(_seconds(msg), _texts(messages))
    return [*found, *parameter_changes(history)]


def _version(messages: dict[str, Message]) -> str:
    """Name of the firmware and its version, by VER, or by the message of the start."""
    if (ver := messages.get("VER")) is not None and "FWS" in ver:
        return str(ver["FWS"][0].decode("ascii", "replace"))
    return next((text.strip() for text in _texts(messages) if version_in(text) is not None), "ArduPilot")


def _version_numbers(messages: dict[str, Message]) -> Version | None:
    """Version by VER, or by the message of the start; None where neither tells."""
    if (ver := messages.get("VER")) is not None and {"Maj", "Min"} <= ver.keys():
        return int(ver["Maj"][0]), int(ver["Min"][0])
    found = (version_in(text) for text in _texts(messages))
    return next((version for version in found if version is not None), None)


def _is_before(messages: dict[str, Message], version: Version) -> bool:
    """Tell whether the firmware is older; one that does not tell is where the first EKF is the only one."""
    known = _version_numbers(messages)
    return known < version if known is not None else not messages.keys() & {"XKF1", "NKF1"}


# --- fields -----------------------------------------------------------------------------------------------------------


def _instance(message: Message | None, wanted: int) -> Message | None:
    """The messages of one sensor or core; all of them where firmware does not number them."""
    if message is None:
        return None
    field = next((name for name in _INSTANCE_FIELDS if name in message), None)
    if field is None:
        return message
    rows = message[field] == wanted
    return {name: values[rows] for name, values in message.items()} if rows.any() else None


def _values(message: Message, field: str) -> Floats:
    """The field; NaN where it is not finite or firmware does not log it."""
    if field not in message:
        return np.full(len(message["TimeUS"]), np.nan)
    return finite(message[field])


def _in_units(values: Floats, most: float, parts: float) -> Floats:
    """Shares of the throttle, or volts: up to 3.3 so many parts of them are logged, as values above the `most` show."""
    return values / parts if np.nanmax(values, initial=0.0) > most else values


def _seconds(message: Message) -> Floats:
    return 1e-6 * message["TimeUS"].astype(np.float64)


def _within_180(degrees: Floats) -> Floats:
    """Yaw from ArduPilot's 0..360 to the table's -180..180."""
    return np.where(degrees > 180.0, degrees - 360.0, degrees)
