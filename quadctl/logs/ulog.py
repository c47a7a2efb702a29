"""PX4's ULog (`.ulg`), read with pyulog.

State comes from PX4's estimator (`vehicle_local_position`, `vehicle_attitude`, `vehicle_angular_velocity`), each at the
time of the sensor sample it stands for; commands and motor outputs at the time they were published. A simulator's
`*_groundtruth` topics are not among TOPICS and never reach the table.
"""

import contextlib
import io
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from quadctl.errors import LogError
from quadctl.frames import euler_from_quaternion
from quadctl.logs.columns import LATERAL_THROTTLE, TORQUE, motor_columns
from quadctl.logs.estimator_health import lane_switches, lost_fixes, rejections
from quadctl.logs.events import PX4_MODES, Event, estimator_resets, mode_changes, parameter_changes, said
from quadctl.logs.findings import Finding, Kind, finding
from quadctl.logs.flight_log import ATTITUDE, POSITION, RATES, VELOCITY, FlightLog, Floats
from quadctl.logs.merge import ROW_TOLERANCE_S, Channel, Origin, finite, intervals, merge
from quadctl.logs.parameter_history import ParameterHistory, change_findings
from quadctl.logs.ulog_end import is_cut_short
from quadctl.thrust_chain.chain import Ambient, bent
from quadctl.thrust_chain.px4 import battery_scale, bend_of

TOPICS = (
    "vehicle_local_position",
    "vehicle_attitude",
    "vehicle_angular_velocity",
    "sensor_combined",
    "vehicle_acceleration",
    "actuator_motors",
    "actuator_outputs",
    "actuator_controls_0",
    "esc_status",
    "battery_status",
    "vehicle_attitude_setpoint",
    "vehicle_thrust_setpoint",
    "vehicle_torque_setpoint",
    "actuator_armed",
    "vehicle_status",
    "estimator_status",
    "estimator_selector_status",
    "vehicle_gps_position",
    "vehicle_air_data",
    "distance_sensor",
)
PARAMETERS = (
    "CA_ROTOR_COUNT",
    "EKF2_BARO_CTRL",
    "EKF2_HGT_MODE",
    "EKF2_HGT_REF",
    "MAV_TYPE",
    "MC_BAT_SCALE_EN",
    "MPC_THR_HOVER",
    "PWM_MAIN_MAX",
    "PWM_MAIN_MIN",
    "PWM_MAX",
    "PWM_MIN",
    "THR_MDL_FAC",
)
"""Parameters that an analysis of motor outputs or of heights may need, kept in the log's `meta`."""
PWM_LIMITS = (("PWM_MAIN_MIN", "PWM_MAIN_MAX"), ("PWM_MIN", "PWM_MAX"))
"""Parameters of the range of the outputs: those of PX4 1.12, and of the versions before."""
CHAIN_PARAMETERS = ("MC_BAT_SCALE_EN", "THR_MDL_FAC", *(name for pair in PWM_LIMITS for name in pair))
"""Parameters on which the thrust depends that an output or a command stands for."""
INFO = ord("6")
"""Level of messages above which they are for debugging, as the logger writes it."""
MAGIC = b"ULog\x01\x12\x35"
"""The first bytes of every ULog."""
NEEDED = "vehicle_local_position and vehicle_attitude"
STATE = (*POSITION, *VELOCITY, *ATTITUDE)

INTEGRATED_GYRO = "sensor_combined gyro"
"""Source of rates that PX4 integrates by trapezoids from one to the next (`Integrator::put`)."""
FIRST_MOTOR_FUNCTION = 101
"""PX4's output function of motor 1."""
MAX_MOTORS = 12
MAX_ESCS = 8
PWM_US = (1000.0, 2000.0)
"""Range of the motor outputs where PX4's parameters do not say."""
DOWN, FIX_3D = 25, 3
"""distance_sensor.orientation of a range finder that looks down, and the least fix_type with heights."""
PULSE_US = (800.0, 2200.0)
"""Values of actuator_outputs that can be pulse lengths."""
MOTORS_OF_TYPE = {2: 4, 13: 6, 14: 8, 15: 3}
"""Number of motors by MAV_TYPE: quadrotor, hexarotor, octorotor, tricopter."""
FLAGS = {
    "xy_valid": ("x_m", "y_m"),
    "z_valid": ("z_m",),
    "v_xy_valid": ("vx_m_s", "vy_m_s"),
    "v_z_valid": ("vz_m_s",),
}
"""Columns that PX4's estimator calls valid by each of its flags."""
RESET_COUNTERS = {
    "xy_reset_counter": "horizontal position",
    "z_reset_counter": "height",
    "vxy_reset_counter": "velocity",
    "vz_reset_counter": "velocity",
    "heading_reset_counter": "heading",
}
"""Counters of PX4's estimator that change at a reset, and the part of the state that is reset."""
TEST_RATIOS = {"pos_test_ratio": "position", "vel_test_ratio": "velocity", "hgt_test_ratio": "height"}
"""Fields of estimator_status with the test ratios, and what is measured."""
IMU = ("imu_x_m_s2", "imu_y_m_s2", "imu_z_m_s2")
ATTITUDE_COMMAND = ("roll_cmd_deg", "pitch_cmd_deg", "yaw_cmd_deg")

_Topic: TypeAlias = dict[str, Any]
"""Arrays of shape (n,) by the names of the fields."""


def is_ulog(head: bytes) -> bool:
    """True for a file that begins with `head` as a ULog does."""
    return head.startswith(MAGIC)


def read_ulog(path: Path, *, of_rotation: bool = False) -> FlightLog:
    """Read a PX4 ULog: of the whole state, or `of_rotation`, where body rates are enough.

    Of rotation, rates are those of the gyro before PX4's filters, where they come as fast, each at its own time, and
    the torque setpoint is read too.

    Raises
    ------
    LogError
        The file cannot be read, is no ULog, or holds no position, velocity or attitude; or no body rates.
    """
    log = _parsed(path)
    findings: list[Finding] = []
    if log.file_corruption:
        findings.append(finding(Kind.DAMAGED))
    if is_cut_short(path):
        findings.append(finding(Kind.CUT_SHORT))
    elif _has_no_end(log):
        findings.append(finding(Kind.CUT_SHORT, of="logger"))
    if log.dropouts:
        lost = sum(dropout.duration for dropout in log.dropouts) / 1000.0
        findings.append(finding(Kind.LOST_BY_LOGGER, times=len(log.dropouts), seconds=lost))
    instances = ((data.name, data.data) for data in log.data_list)
    history, release = _history(log), log.msg_info_dict.get("ver_sw_release")
    return log_of_instances(path, instances, history, release, findings, _said(log, history), of_rotation=of_rotation)


def log_of_instances(
    path: Path,
    instances: Iterable[tuple[str, _Topic]],
    history: ParameterHistory,
    release: object,
    findings: list[Finding],
    events: Sequence[Event],
    *,
    of_rotation: bool = False,
) -> FlightLog:
    """The flight log in PX4's topics, of which several instances may have the same name; the first is the primary.

    `history` holds the parameters, `release` is PX4's number of the version, if it is one; what is found is
    added to `findings`, and `events` are those that no topic says.

    Raises
    ------
    LogError
        They hold no position, velocity or attitude.
    """
    topics: dict[str, _Topic] = {}
    outputs: list[_Topic] = []
    for name, topic in instances:
        if len(topic.get("timestamp", ())):
            topics.setdefault(name, topic)
            if name == "actuator_outputs":
                outputs.append(topic)
    parameters = {name: value for name, value in history.last.items() if name in PARAMETERS}
    findings += change_findings(history, CHAIN_PARAMETERS)
    meta = {"autopilot": "PX4", "software": _version(release), "parameters": parameters}
    topics.pop("actuator_outputs", None)
    if "actuator_motors" not in topics and "CA_ROTOR_COUNT" not in parameters:  # PX4 1.12 and before
        topics |= _motors_from_outputs(outputs, history, findings)
    _remove_battery_scale(topics, history, findings)
    return log_of_topics(path, topics, meta, findings, events, of_rotation=of_rotation)


def parameters_in_ulog(path: Path) -> dict[str, float]:
    """Last value of each parameter in a PX4 ULog.

    Raises
    ------
    LogError
        The file cannot be read, or is no ULog.
    """
    return _history(_parsed(path)).last


def log_of_topics(
    path: Path,
    topics: dict[str, _Topic],
    meta: dict[str, Any],
    findings: list[Finding],
    events: Sequence[Event] = (),
    *,
    of_rotation: bool = False,
) -> FlightLog:
    """The flight log in PX4's topics, by their names in a ULog: arrays of shape (n,) by the names of their fields.

    `events` are those that no topic says.

    Raises
    ------
    LogError
        They hold no position, velocity or attitude.
    """
    armed = topics.get("actuator_armed")
    periods = [] if armed is None else intervals(_seconds(armed, "timestamp"), _values(armed, "armed") > 0)
    channels = list(_channels(topics, findings))
    required: tuple[str, ...] = RATES if of_rotation else STATE
    tolerance_s = 0.0 if of_rotation else ROW_TOLERANCE_S
    if of_rotation:
        channels = _of_rotation(topics, channels)
    position = topics.get("vehicle_local_position", {})
    invalid = _invalid(position, findings)
    resets = [
        event
        for counter, what in RESET_COUNTERS.items()
        if counter in position
        for event in estimator_resets(_sampled(position).tolist(), position[counter].tolist(), what)
    ]
    findings += _health(topics)
    status = topics.get("vehicle_status")
    if status is not None and "nav_state" in status:
        events = [*events, *mode_changes(_seconds(status, "timestamp"), status["nav_state"].tolist(), PX4_MODES)]
    origin = Origin(path, NEEDED, meta, findings, periods, invalid, [*events, *resets], required, tolerance_s)
    return merge(channels, origin)


def _history(log: Any) -> ParameterHistory:
    changed = [change for change in log.changed_parameters if change[0] > log.start_timestamp]
    before = {name: value for time, name, value in log.changed_parameters if time <= log.start_timestamp}
    return ParameterHistory(
        ((1e-6 * time, name, value) for time, name, value in changed), log.initial_parameters | before
    )


def _health(topics: dict[str, _Topic]) -> list[Finding]:
    """Findings of PX4's estimator."""
    found: list[Finding] = []
    if (status := topics.get("estimator_status")) is not None:
        ratios = {name: _values(status, field) for field, name in TEST_RATIOS.items() if field in status}
        found += rejections(_sampled(status), ratios)
    if (selector := topics.get("estimator_selector_status")) is not None and "primary_instance" in selector:
        found += lane_switches(_seconds(selector, "timestamp"), _values(selector, "primary_instance"))
    if (gps := topics.get("vehicle_gps_position")) is not None and "fix_type" in gps:
        found += lost_fixes(_seconds(gps, "timestamp"), _values(gps, "fix_type"))
    return found


def _said(log: Any, history: ParameterHistory) -> list[Event]:
    """Messages of a ULog, those for debugging left out, and changes of parameters after its begin."""
    told = [message for message in log.logged_messages if message.log_level <= INFO]
    texts = said([1e-6 * message.timestamp for message in told], [message.message for message in told])
    return [*texts, *parameter_changes(history)]


def _parsed(path: Path) -> Any:
    from pyulog import ULog

    try:
        # It prints what it finds damaged, and leaves a file open that it cannot read.
        with path.open("rb") as file, contextlib.redirect_stdout(io.StringIO()):
            recognised = is_ulog(file.read(len(MAGIC)))
            file.seek(0)
            log = ULog(file, list(TOPICS)) if recognised else None
    except OSError as error:
        raise LogError(f"{path}: cannot be read ({error.strerror})") from None
    except Exception as error:  # the parser stumbles over damage in any way that Python can
        raise LogError(f"{path}: cannot be parsed as a PX4 ULog ({type(error).__name__}: {error})") from None
    if log is None:
        raise LogError(f"{path}: does not begin as a PX4 ULog does, expected a {path.suffix} file of PX4")
    return log


def _has_no_end(log: Any) -> bool:
    """Tell whether PX4's logger, which stops at disarming, did not come to write what it writes last."""
    until_disarmed = not log.initial_parameters.get("SDLOG_MODE", 0)
    said = log.msg_info_multiple_dict
    return until_disarmed and "perf_counter_preflight" in said and "perf_counter_postflight" not in said


def _version(release: object) -> str:
    if not isinstance(release, int):
        return "PX4"
    return f"PX4 {release >> 24 & 0xFF}.{release >> 16 & 0xFF}.{release >> 8 & 0xFF}"


def _channels(topics: dict[str, _Topic], findings: list[Finding]) -> Iterator[Channel]:
    if (topic := topics.get("vehicle_local_position")) is not None:
        yield _local_position(topic)
    if (topic := topics.get("vehicle_attitude")) is not None:
        yield Channel("vehicle_attitude", _sampled(topic), _euler(topic, "q", ATTITUDE))
    yield from _rates_and_imu(topics)
    yield from _motors(topics, findings)
    if (topic := topics.get("battery_status")) is not None and "voltage_v" in topic:
        voltage = {"battery_v": _values(topic, "voltage_v")}
        yield Channel("battery_status", _seconds(topic, "timestamp"), voltage, makes_rows=False)
    yield from _commands(topics)
    yield from _heights(topics)


def _heights(topics: dict[str, _Topic]) -> Iterator[Channel]:
    """Sensors of the height: barometer, range finder that looks down, and GPS's climb rate."""
    if (air := topics.get("vehicle_air_data")) is not None:
        columns = {"baro_m": _values(air, "baro_alt_meter")}
        temperature = next((name for name in ("ambient_temperature", "baro_temp_celcius") if name in air), None)
        if temperature is not None:
            columns["baro_temperature_c"] = _values(air, temperature)
        yield Channel("vehicle_air_data", _sampled(air), columns, makes_rows=False, averaged=True)
    if (finder := topics.get("distance_sensor")) is not None:
        distance, good = _values(finder, "current_distance"), np.ones(len(finder["timestamp"]), dtype=bool)
        if "orientation" in finder:
            good &= finder["orientation"] == DOWN
        if "signal_quality" in finder:
            good &= finder["signal_quality"] != 0
        if "min_distance" in finder and "max_distance" in finder:
            good &= (distance > finder["min_distance"]) & (distance < finder["max_distance"])
        distances = {"range_m": np.where(good, distance, np.nan)}
        yield Channel("distance_sensor", _seconds(finder, "timestamp"), distances, makes_rows=False)
    if (gps := topics.get("vehicle_gps_position")) is not None and "vel_d_m_s" in gps:
        climb = np.where(_values(gps, "fix_type") >= FIX_3D, -_values(gps, "vel_d_m_s"), np.nan)
        yield Channel("vehicle_gps_position", _sampled(gps), {"gps_vz_m_s": climb}, makes_rows=False)


def _local_position(topic: _Topic) -> Channel:
    columns = {
        "x_m": _valid(topic, "x", "xy_valid"),
        "y_m": _valid(topic, "y", "xy_valid"),
        "z_m": -_valid(topic, "z", "z_valid"),
        "vx_m_s": _valid(topic, "vx", "v_xy_valid"),
        "vy_m_s": _valid(topic, "vy", "v_xy_valid"),
        "vz_m_s": -_valid(topic, "vz", "v_z_valid"),
    }
    if "az" in topic:
        columns |= {
            "ax_m_s2": _values(topic, "ax"),
            "ay_m_s2": _values(topic, "ay"),
            "az_m_s2": -_values(topic, "az"),
        }
    return Channel("vehicle_local_position", _sampled(topic), columns)


def _invalid(topic: _Topic, findings: list[Finding]) -> dict[str, str]:
    """Reasons, by column, of those that PX4's estimator never calls valid; a finding on those that it calls invalid for
    a part of the log."""
    reasons: dict[str, str] = {}
    for flag, columns in FLAGS.items():
        if flag not in topic:
            continue
        share = float(np.mean(np.asarray(topic[flag]) == 0))
        if share == 1.0:
            reason = f"PX4's estimator calls {' and '.join(columns)} invalid throughout: {flag} is false"
            reasons |= dict.fromkeys(columns, reason)
        elif share > 0.0:
            findings.append(finding(Kind.STATE_INVALID, columns=columns, share=share, flag=flag, left_out=True))
    return reasons


def _rates_and_imu(topics: dict[str, _Topic]) -> Iterator[Channel]:
    combined = topics.get("sensor_combined")
    if (topic := topics.get("vehicle_angular_velocity")) is not None:
        yield Channel("vehicle_angular_velocity", _sampled(topic), _xyz(topic, "xyz", RATES))
    elif combined is not None:
        gyro = _xyz(combined, "gyro_rad", RATES)
        yield Channel(INTEGRATED_GYRO, _seconds(combined, "timestamp"), gyro, makes_rows=False, averaged=True)
    if combined is not None:
        # Relative to the gyro's time stamp, and INT32_MAX where there is no accelerometer sample.
        field = "accelerometer_timestamp_relative"
        relative = _values(combined, field) if field in combined else np.zeros(len(combined["timestamp"]))
        known = np.abs(relative) < 1e6
        time = _seconds(combined, "timestamp")[known] + 1e-6 * relative[known]
        imu = {name: values[known] for name, values in _xyz(combined, "accelerometer_m_s2", IMU).items()}
        yield Channel("sensor_combined", time, imu, makes_rows=False, averaged=True)
    elif (topic := topics.get("vehicle_acceleration")) is not None:
        imu = _xyz(topic, "xyz", IMU)
        yield Channel("vehicle_acceleration", _sampled(topic), imu, makes_rows=False, averaged=True)


def _of_rotation(topics: dict[str, _Topic], channels: Sequence[Channel]) -> list[Channel]:
    """The channels with the gyro before PX4's filters in place of the rates after them, where it comes as fast, and
    with the torque setpoint; only gyro, motors and commands make rows."""
    filtered, combined = topics.get("vehicle_angular_velocity"), topics.get("sensor_combined")
    found = [replace(c, makes_rows=False) if c.columns.keys() & {*POSITION, *ATTITUDE} else c for c in channels]
    if combined is not None and (filtered is None or len(combined["timestamp"]) >= len(filtered["timestamp"])):
        found = [c for c in found if not c.columns.keys() & set(RATES)]
        rates = _xyz(combined, "gyro_rad", RATES)
        found.append(Channel(INTEGRATED_GYRO, _seconds(combined, "timestamp"), rates))
    controls = topics.get("actuator_controls_0")
    if (torque := topics.get("vehicle_torque_setpoint")) is not None:
        found.append(Channel("vehicle_torque_setpoint", _seconds(torque, "timestamp"), _xyz(torque, "xyz", TORQUE)))
    elif controls is not None:
        setpoint = _xyz(controls, "control", TORQUE)
        found.append(Channel("actuator_controls_0 torque", _seconds(controls, "timestamp"), setpoint))
    return found


def _motors(topics: dict[str, _Topic], findings: list[Finding]) -> Iterator[Channel]:
    rpm = None if (topic := topics.get("esc_status")) is None else _esc_status(topic, findings)
    if rpm is not None:
        yield rpm
    source = next((name for name in ("actuator_motors", "actuator_outputs") if name in topics), None)
    if source is None:
        if rpm is None:
            findings.append(finding(Kind.NO_MOTOR_SIGNAL))
        return
    topic = topics[source]
    controls = [_values(topic, f"control[{i}]") for i in range(MAX_MOTORS) if f"control[{i}]" in topic]
    n_motors = max((i for i, control in enumerate(controls, 1) if np.isfinite(control).any()), default=0)
    # NaN is PX4's word for a motor that is stopped.
    outputs = [np.nan_to_num(control, nan=0.0) for control in controls[:n_motors]]
    columns = dict(zip(motor_columns(n_motors, "output"), outputs, strict=True))
    yield Channel(source, _seconds(topic, "timestamp"), columns)


def _motors_from_outputs(
    instances: list[_Topic], history: ParameterHistory, findings: list[Finding]
) -> dict[str, _Topic]:
    """`actuator_motors` as PX4 1.13 and later log it, from the pulse lengths that earlier versions log.

    PX4 bends the share of the full thrust on its way to the output: thrust = f u^2 + (1 - f) u, where u is the share of
    the PWM range and f is THR_MDL_FAC. In PX4 1.12 `MultirotorMixer::mix` does so before `actuator_outputs` are logged,
    and it is undone here. Later versions do so after `actuator_motors` are logged (`FunctionMotors::updateValues`), so
    that nothing has to be undone there.
    """
    parameters = history.last
    for topic in instances:
        pulses = np.column_stack([_values(topic, f"output[{i}]") for i in range(MAX_MOTORS)])
        n_motors = MOTORS_OF_TYPE.get(int(parameters.get("MAV_TYPE", 0))) or _n_moving(pulses)
        pulses = pulses[:, :n_motors]
        if not n_motors or _n_moving(pulses) < n_motors:
            continue
        if not np.all((np.max(pulses, axis=0) > PULSE_US[0]) & (np.max(pulses, axis=0) < PULSE_US[1])):
            findings.append(finding(Kind.NOT_PULSES))
            continue
        time_s, thrust = _seconds(topic, "timestamp"), np.empty_like(pulses)
        for period in history.periods(CHAIN_PARAMETERS):
            rows = (time_s >= period.begin_s) & (time_s < period.end_s)
            low, high = _pulse_range(period.values)
            thrust[rows] = bent(np.clip((pulses[rows] - low) / (high - low), 0.0, 1.0), bend_of(period.values))
        findings.append(finding(Kind.OUTPUT_CHAIN, pulses_us=_pulse_range(parameters), bend=bend_of(parameters)))
        return {"actuator_outputs": {"timestamp": topic["timestamp"]} | _controls(thrust)}
    return {}


def _pulse_range(parameters: Mapping[str, float]) -> tuple[float, float]:
    """Pulse lengths of no and of full output, us."""
    given = ((parameters.get(low, 0.0), parameters.get(high, 0.0)) for low, high in PWM_LIMITS)
    return next(((low, high) for low, high in given if 0.0 < low < high), PWM_US)


def _remove_battery_scale(topics: dict[str, _Topic], history: ParameterHistory, findings: list[Finding]) -> None:
    """Divide motor outputs and thrust commands by the factor with which PX4 compensates the battery, where it does."""
    if not any(period.values.get("MC_BAT_SCALE_EN") for period in history.periods(["MC_BAT_SCALE_EN"])):
        return
    if (battery := topics.get("battery_status")) is None or "scale" not in battery:
        findings.append(finding(Kind.BATTERY_SCALE, removed=False))
        return
    logged_s, logged = _seconds(battery, "timestamp"), _values(battery, "scale")
    scaled = {
        "actuator_motors": [f"control[{i}]" for i in range(MAX_MOTORS)],
        "actuator_outputs": [f"control[{i}]" for i in range(MAX_MOTORS)],
        "vehicle_thrust_setpoint": ["xyz[0]", "xyz[1]", "xyz[2]"],
        "actuator_controls_0": ["control[3]"],
    }
    for name in scaled.keys() & topics.keys():
        topic = topics[name]
        time_s = _seconds(topic, "timestamp")
        factor = np.ones(len(time_s))
        for period in history.periods(["MC_BAT_SCALE_EN"]):
            rows = (time_s >= period.begin_s) & (time_s < period.end_s)
            scale = np.interp(time_s[rows], logged_s, logged)
            factor[rows] = battery_scale(Ambient(battery_scale=scale), period.values)
        topics[name] = topic | {field: topic[field] / factor for field in scaled[name] if field in topic}
    findings.append(finding(Kind.BATTERY_SCALE, removed=True))


def _controls(share: Floats) -> _Topic:
    return {f"control[{i}]": column for i, column in enumerate(share.T)}


def _n_moving(pulses: Floats) -> int:
    """Number of the outputs, from the first, that change without a fixed one between them."""
    moves = np.nanmax(pulses, axis=0, initial=-np.inf) > np.nanmin(pulses, axis=0, initial=np.inf)
    return int(np.argmin(np.append(moves, False)))


def _esc_status(topic: _Topic, findings: list[Finding]) -> Channel | None:
    """Speeds, voltages and currents of the motors; None when all stand still all the time."""
    columns: dict[str, Floats] = {}
    n_escs = min(int(np.nan_to_num(_values(topic, "esc_count")).max()), MAX_ESCS)
    if not any(np.any(topic.get(f"esc[{esc}].esc_rpm", 0)) for esc in range(n_escs)):
        findings.append(finding(Kind.SPEEDS_ZERO, source="esc_status", several=False))
        return None
    for esc in range(n_escs):
        function = int(np.max(topic.get(f"esc[{esc}].actuator_function", 0)))
        is_motor = FIRST_MOTOR_FUNCTION <= function < FIRST_MOTOR_FUNCTION + MAX_MOTORS
        motor = 1 + (function - FIRST_MOTOR_FUNCTION if is_motor else esc)
        columns[f"motor{motor}_rpm"] = np.abs(_values(topic, f"esc[{esc}].esc_rpm"))
        for quantity in ("voltage_v", "current_a"):
            field = f"esc[{esc}].esc_{quantity[:-2]}"
            if field in topic and np.any(topic[field]):
                columns[f"motor{motor}_{quantity}"] = _values(topic, field)
    return Channel("esc_status", _seconds(topic, "timestamp"), columns)


def _commands(topics: dict[str, _Topic]) -> Iterator[Channel]:
    attitude, thrust = topics.get("vehicle_attitude_setpoint"), topics.get("vehicle_thrust_setpoint")
    controls = topics.get("actuator_controls_0")  # PX4 1.12 and before: roll, pitch, yaw, thrust
    if attitude is not None:
        columns = _euler(attitude, "q_d", ATTITUDE_COMMAND)
        if thrust is None and controls is None and "thrust_body[2]" in attitude:
            columns["throttle_cmd"] = -_values(attitude, "thrust_body[2]")
        yield Channel("vehicle_attitude_setpoint", _seconds(attitude, "timestamp"), columns)
    if thrust is not None:
        throttle = {"throttle_cmd": -_values(thrust, "xyz[2]"), **_lateral(thrust)}
        yield Channel("vehicle_thrust_setpoint", _seconds(thrust, "timestamp"), throttle)
    elif controls is not None:
        throttle = {"throttle_cmd": _values(controls, "control[3]")}
        yield Channel("actuator_controls_0", _seconds(controls, "timestamp"), throttle)


def _lateral(thrust: _Topic) -> dict[str, Floats]:
    """Lateral throttle of a fully actuated vehicle; nothing of one that never has any."""
    columns = {name: _values(thrust, f"xyz[{axis}]") for axis, name in enumerate(LATERAL_THROTTLE)}
    return columns if any(np.any(np.nan_to_num(column)) for column in columns.values()) else {}


# --- fields -----------------------------------------------------------------------------------------------------------


def _values(topic: _Topic, field: str) -> Floats:
    """The field; NaN where it is not finite or firmware does not log it."""
    return finite(topic[field]) if field in topic else np.full(len(topic["timestamp"]), np.nan)


def _valid(topic: _Topic, field: str, flag: str) -> Floats:
    """The field, NaN where PX4 says that it is not valid."""
    values = _values(topic, field)
    return np.where(topic[flag].astype(bool), values, np.nan) if flag in topic else values


def _xyz(topic: _Topic, field: str, names: tuple[str, str, str]) -> dict[str, Floats]:
    return {name: _values(topic, f"{field}[{i}]") for i, name in enumerate(names)}


def _euler(topic: _Topic, field: str, names: tuple[str, str, str]) -> dict[str, Floats]:
    w, x, y, z = (_values(topic, f"{field}[{i}]") for i in range(4))
    angles = euler_from_quaternion((w, x, y, z))
    return {name: np.degrees(angle) for name, angle in zip(names, angles, strict=True)}


def _seconds(topic: _Topic, field: str) -> Floats:
    return 1e-6 * np.asarray(topic[field], dtype=np.float64)


def _sampled(topic: _Topic) -> Floats:
    """Time of the sensor sample; older firmware has none, or zero."""
    has_sample_time = "timestamp_sample" in topic and np.all(topic["timestamp_sample"] > 0)
    return _seconds(topic, "timestamp_sample" if has_sample_time else "timestamp")
