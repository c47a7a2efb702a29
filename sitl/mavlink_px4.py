"""The simulated autopilot on the wire: a PX4 as MAVLink sees it, in real time, over UDP.

Only what PX4 itself does on its onboard link: heartbeats, streams at intervals that a companion may change, commands
with their acknowledgements, parameters. The rules of arming, modes and failsafes are the simulated autopilot's.
"""

import math
import select
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from types import TracebackType
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import common as mavlink

from quadctl.frames import euler_from_quaternion
from quadctl.state import AttitudeTarget, VehicleState
from sitl import dialect
from sitl.autopilot import SimulatedAutopilot
from sitl.faults import Faults

STEP_S = 0.004
"""Period of the loop: physics, streams."""
MAX_LAG_S = 0.05
"""A machine too busy to keep up delays the vehicle's time beyond this, so that it cannot miss setpoints by itself."""

CUSTOM_MODES = {
    "POSCTL": 3 << 16,
    "HOLD": 4 << 16 | 3 << 24,
    "RTL": 4 << 16 | 5 << 24,
    "LAND": 4 << 16 | 6 << 24,
    "OFFBOARD": 6 << 16,
}
"""PX4's custom modes: main mode in byte 2, sub mode in byte 3."""

INTEGER_PARAMETERS = frozenset({"COM_OBL_RC_ACT"})
"""Those that PX4 declares INT32; the others are floats."""

FORCE_MAGIC = 21196.0
PX4_VERSION = 0x010F00FF
"""1.15.0, a release."""

Message = Any
Builder = Callable[[VehicleState], Iterator[Message]]


class ReceivedSetpoint(NamedTuple):
    """A SET_ATTITUDE_TARGET as it arrived, with the time of `time.monotonic`."""

    received_s: float
    target: AttitudeTarget


@dataclass
class _Stream:
    """One kind of message on its way out at its own interval."""

    build: Builder
    default_rate_hz: float
    part: str
    """The part of the estimate it carries: sent only when that is new, as PX4 does."""
    interval_s: float = math.nan
    due_s: float = 0.0
    sample_s: float = -math.inf

    def __post_init__(self) -> None:
        self.interval_s = 1.0 / self.default_rate_hz if self.default_rate_hz > 0.0 else math.inf

    def set_interval(self, microseconds: float, now_s: float) -> None:
        """MAV_CMD_SET_MESSAGE_INTERVAL: 0 is the default rate, -1 is off."""
        if microseconds == 0.0:
            self.__post_init__()
        else:
            self.interval_s = math.inf if microseconds < 0.0 else 1e-6 * microseconds
        self.due_s = now_s

    def take(self, estimate: VehicleState) -> bool:
        """Whether to send it now; notes that it is sent."""
        now_s, sample_s = estimate.time_s, estimate.received_s[self.part]
        if math.isinf(self.interval_s) or now_s < self.due_s or sample_s <= self.sample_s:
            return False
        self.due_s = max(self.due_s + self.interval_s, now_s)
        self.sample_s = sample_s
        return True


class MavlinkPx4:
    """A PX4 on UDP: sends to `host:port`, obeys whoever answers. A context manager, or `start` and `stop`.

    The vehicle belongs to the thread of this object while it runs; others may read its plain attributes.
    """

    def __init__(
        self, autopilot: SimulatedAutopilot, port: int = 14540, host: str = "127.0.0.1", heartbeat_hz: float = 1.0
    ) -> None:
        dialect.register(mavlink)
        self.autopilot = autopilot
        self.faults = Faults()
        self.setpoints_received: list[ReceivedSetpoint] = []
        self.lag_s = 0.0
        """Real time that the vehicle's clock has given up because the machine was too busy."""
        self._booted_s = 0.0
        self._heartbeat_hz = heartbeat_hz
        self._address = (host, port)
        self._socket: socket.socket | None = None
        self._mav = mavlink.MAVLink(None, srcSystem=1, srcComponent=mavlink.MAV_COMP_ID_AUTOPILOT1)
        self._mav.robust_parsing = True
        self._streams = _px4_streams(heartbeat_hz)
        self._news = threading.Condition()
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None
        self._failure: BaseException | None = None
        self._on_message: dict[str, Callable[[Message], None]] = {
            "COMMAND_LONG": self._command,
            "COMMAND_INT": self._command,
            "SET_ATTITUDE_TARGET": self._setpoint,
            "PARAM_REQUEST_LIST": self._parameter_list,
            "PARAM_REQUEST_READ": self._parameter_read,
            "PARAM_SET": self._parameter_set,
        }
        self._on_command: dict[int, Callable[[Message], int]] = {
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM: self._arm_disarm,
            mavlink.MAV_CMD_DO_SET_MODE: self._set_mode,
            mavlink.MAV_CMD_NAV_LAND: lambda _: self._answer(self.autopilot.request_mode("LAND")),
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_message_interval,
            mavlink.MAV_CMD_REQUEST_MESSAGE: self._request_message,
        }

    def start(self) -> None:
        """Open the socket and let time run."""
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((self._address[0] if self._address[0].startswith("127.") else "", 0))
        self._socket.setblocking(False)
        self._stopping.clear()
        self._thread = threading.Thread(target=self._run, name="mavlink-px4", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Stop time and close the socket; raises what the thread died of, if it did."""
        self._stopping.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        if self._socket is not None:
            self._socket.close()
            self._socket = None
        if self._failure is not None:
            failure, self._failure = self._failure, None
            raise failure

    def restart(self) -> None:
        """As after a short loss of power: disarmed, its clock at 0, its messages at their default rates."""
        self.autopilot.power_cycle()
        self._booted_s = self.autopilot.time_s + self.lag_s
        self._streams = _px4_streams(self._heartbeat_hz)

    def __enter__(self) -> "MavlinkPx4":
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def wait_until(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        """Block until `condition` holds after one of the coming steps; False when the time is up."""
        with self._news:
            return self._news.wait_for(lambda: self._failure is not None or condition(), timeout_s) and condition()

    # --- time --------------------------------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            self._live()
        except BaseException as error:  # kept for the thread that stops this one
            self._failure = error
        finally:
            with self._news:
                self._news.notify_all()

    def _live(self) -> None:
        deadline_s = time.monotonic()
        until_s = self.autopilot.time_s
        while not self._stopping.is_set():
            deadline_s += STEP_S
            until_s += STEP_S
            lag_s = time.monotonic() - deadline_s
            if lag_s > MAX_LAG_S:
                deadline_s += lag_s
                self.lag_s += lag_s
            self._receive_until(deadline_s)
            self.autopilot.step(until_s)
            self._send_streams()
            with self._news:
                self._news.notify_all()

    def _receive_until(self, deadline_s: float) -> None:
        """Handle what arrives, as it arrives; at least what is there already."""
        assert self._socket is not None
        while True:
            wait_s = max(deadline_s - time.monotonic(), 0.0)
            if not select.select([self._socket], [], [], wait_s)[0]:
                return
            try:
                data = self._socket.recv(65536)
            except ConnectionError:  # nobody listens on the other side (yet)
                continue
            if not self.faults.deaf:
                self._handle(data)

    # --- out ---------------------------------------------------------------------------------------------------

    def _send(self, message: Message) -> None:
        assert self._socket is not None
        if self.faults.lets_out(message.get_type()):
            data = message.pack(self._mav)
            self._mav.seq = (self._mav.seq + 1) % 256
            try:
                self._socket.sendto(data, self._address)
            except (ConnectionError, BlockingIOError):  # UDP loses what nobody takes
                return

    def _send_streams(self) -> None:
        estimate = self.faults.distort(self.autopilot.estimate())
        for stream in self._streams.values():
            if stream.take(estimate):
                for message in stream.build(self._stamped(estimate)):
                    self._send(message)

    def _stamped(self, estimate: VehicleState) -> VehicleState:
        """With the time since boot on a clock that runs on while the vehicle's waits for a busy machine."""
        return replace(
            estimate,
            time_s=estimate.time_s + self.lag_s - self._booted_s,
            estimator_ratio=self.faults.estimator_ratio,
        )

    # --- in ----------------------------------------------------------------------------------------------------

    def _handle(self, data: bytes) -> None:
        for message in self._mav.parse_buffer(data) or ():
            handler = self._on_message.get(message.get_type())
            if handler is not None:
                handler(message)

    def _setpoint(self, message: Message) -> None:
        target = AttitudeTarget(tuple(message.q), message.thrust)
        self.setpoints_received.append(ReceivedSetpoint(time.monotonic(), target))
        flown = message.type_mask & 0b1100_0000 == 0  # neither thrust nor attitude is to be ignored
        if flown and all(map(math.isfinite, (*target.attitude, target.throttle))):
            self.autopilot.set_attitude_target(target)

    def _command(self, message: Message) -> None:
        handler = self._on_command.get(message.command)
        result = mavlink.MAV_RESULT_UNSUPPORTED if handler is None else handler(message)
        header = message.get_header()
        self._send(
            mavlink.MAVLink_command_ack_message(
                message.command, result, target_system=header.srcSystem, target_component=header.srcComponent
            )
        )

    def _answer(self, refusal: str | None) -> int:
        """The result of a request; a refusal is told in words too, as PX4 does."""
        if refusal is None:
            return int(mavlink.MAV_RESULT_ACCEPTED)
        self._send(mavlink.MAVLink_statustext_message(mavlink.MAV_SEVERITY_CRITICAL, refusal.encode()[:50]))
        return int(mavlink.MAV_RESULT_TEMPORARILY_REJECTED)

    def _arm_disarm(self, command: Message) -> int:
        if command.param1 == 1.0:
            return self._answer(self.faults.refuse_arming or self.autopilot.request_arm())
        return self._answer(self.autopilot.request_disarm())

    def _set_mode(self, command: Message) -> int:
        custom = int(command.param2) << 16 | int(command.param3) << 24
        for name, numbers in CUSTOM_MODES.items():
            if numbers == custom and int(command.param1) & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
                return self._answer(self.faults.refuse_modes or self.autopilot.request_mode(name))
        return int(mavlink.MAV_RESULT_DENIED)

    def _set_message_interval(self, command: Message) -> int:
        message_id = int(command.param1)
        stream = self._streams.get(message_id)
        if stream is None or not self.faults.lets_out(mavlink.mavlink_map[message_id].msgname):
            return int(mavlink.MAV_RESULT_FAILED)
        stream.set_interval(command.param2, self.autopilot.time_s)
        return int(mavlink.MAV_RESULT_ACCEPTED)

    def _request_message(self, command: Message) -> int:
        stream = self._streams.get(int(command.param1))
        if stream is None:
            return int(mavlink.MAV_RESULT_DENIED)
        for message in stream.build(self._stamped(self.faults.distort(self.autopilot.estimate()))):
            self._send(message)
        return int(mavlink.MAV_RESULT_ACCEPTED)

    # --- parameters --------------------------------------------------------------------------------------------

    def _parameter_list(self, _: Message) -> None:
        for name in self.autopilot.parameters:
            self._send_parameter(name)

    def _parameter_read(self, message: Message) -> None:
        names = list(self.autopilot.parameters)
        name = _parameter_name(message)
        if message.param_index >= 0:
            name = names[message.param_index] if message.param_index < len(names) else ""
        self._send_parameter(name)

    def _parameter_set(self, message: Message) -> None:
        name = _parameter_name(message)
        if name in self.autopilot.parameters and message.param_type == _parameter_type(name):
            self.autopilot.parameters[name] = _decode_parameter(name, message.param_value)
        self._send_parameter(name)

    def _send_parameter(self, name: str) -> None:
        """The value, or nothing for a parameter that does not exist, as PX4 does."""
        parameters = self.autopilot.parameters
        if name in parameters:
            self._send(
                mavlink.MAVLink_param_value_message(
                    name.encode(),
                    _encode_parameter(name, parameters[name]),
                    _parameter_type(name),
                    len(parameters),
                    list(parameters).index(name),
                )
            )


def _parameter_name(message: Message) -> str:
    name = message.param_id
    return name if isinstance(name, str) else name.decode(errors="replace").rstrip("\0")


def _parameter_type(name: str) -> int:
    return int(mavlink.MAV_PARAM_TYPE_INT32 if name in INTEGER_PARAMETERS else mavlink.MAV_PARAM_TYPE_REAL32)


def _encode_parameter(name: str, value: float) -> float:
    """PX4 puts the bytes of an integer into the float field."""
    if name not in INTEGER_PARAMETERS:
        return value
    encoded: float = struct.unpack("<f", struct.pack("<i", round(value)))[0]
    return encoded


def _decode_parameter(name: str, value: float) -> float:
    if name not in INTEGER_PARAMETERS:
        return value
    decoded: int = struct.unpack("<i", struct.pack("<f", value))[0]
    return float(decoded)


# --- messages: the estimate in MAVLink's words -------------------------------------------------------------------


def _boot_ms(estimate: VehicleState) -> int:
    return round(1000.0 * estimate.time_s)


def _millivolts(estimate: VehicleState) -> int:
    return round(1000.0 * estimate.battery_v) if math.isfinite(estimate.battery_v) else 65535


def _heartbeat(estimate: VehicleState) -> Iterator[Message]:
    armed = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if estimate.armed else 0
    yield mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_HEXAROTOR if len(estimate.rotor_rpm) == 6 else mavlink.MAV_TYPE_QUADROTOR,
        mavlink.MAV_AUTOPILOT_PX4,
        mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | armed,
        CUSTOM_MODES[estimate.mode],
        mavlink.MAV_STATE_ACTIVE if estimate.armed else mavlink.MAV_STATE_STANDBY,
        3,
    )


def _local_position(estimate: VehicleState) -> Iterator[Message]:
    yield mavlink.MAVLink_local_position_ned_message(
        _boot_ms(estimate), *estimate.position_ned_m, *estimate.velocity_ned_m_s
    )


def _attitude_quaternion(estimate: VehicleState) -> Iterator[Message]:
    yield mavlink.MAVLink_attitude_quaternion_message(_boot_ms(estimate), *estimate.attitude, *estimate.rates_rad_s)


def _attitude(estimate: VehicleState) -> Iterator[Message]:
    yield mavlink.MAVLink_attitude_message(
        _boot_ms(estimate), *euler_from_quaternion(estimate.attitude), *estimate.rates_rad_s
    )


def _esc_status(estimate: VehicleState) -> Iterator[Message]:
    """Four motors to a message."""
    unknown = [math.nan] * 4
    for first in range(0, len(estimate.rotor_rpm), 4):
        rpm = [round(v) for v in estimate.rotor_rpm[first : first + 4]]
        yield dialect.EscStatus(first, 1000 * _boot_ms(estimate), rpm + [0] * (4 - len(rpm)), unknown, unknown)


def _sys_status(estimate: VehicleState) -> Iterator[Message]:
    yield mavlink.MAVLink_sys_status_message(0, 0, 0, 0, _millivolts(estimate), -1, -1, 0, 0, 0, 0, 0, 0)


def _battery_status(estimate: VehicleState) -> Iterator[Message]:
    cells = [_millivolts(estimate)] + [65535] * 9
    yield mavlink.MAVLink_battery_status_message(0, 0, 0, 32767, cells, -1, -1, -1, -1)


def _estimator_status(estimate: VehicleState) -> Iterator[Message]:
    ratio = estimate.estimator_ratio
    yield mavlink.MAVLink_estimator_status_message(
        1000 * _boot_ms(estimate), 0x3F, 0.1, ratio, 0.1, 0.1, math.nan, math.nan, 0.1, 0.1
    )


def _extended_sys_state(estimate: VehicleState) -> Iterator[Message]:
    landed = mavlink.MAV_LANDED_STATE_ON_GROUND if estimate.landed else mavlink.MAV_LANDED_STATE_IN_AIR
    yield mavlink.MAVLink_extended_sys_state_message(mavlink.MAV_VTOL_STATE_UNDEFINED, landed)


def _autopilot_version(_: VehicleState) -> Iterator[Message]:
    capabilities = (
        mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
        | mavlink.MAV_PROTOCOL_CAPABILITY_SET_ATTITUDE_TARGET
        | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
    )
    none = [0] * 8
    yield mavlink.MAVLink_autopilot_version_message(capabilities, PX4_VERSION, 0, 0, 0, none, none, none, 0, 0, 1)


def _px4_streams(heartbeat_hz: float) -> dict[int, _Stream]:
    """By message id, with PX4's default rates on the onboard link."""
    return {
        mavlink.MAVLINK_MSG_ID_HEARTBEAT: _Stream(_heartbeat, heartbeat_hz, "heartbeat"),
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: _Stream(_local_position, 30.0, "position"),
        mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: _Stream(_attitude_quaternion, 50.0, "attitude"),
        mavlink.MAVLINK_MSG_ID_ATTITUDE: _Stream(_attitude, 100.0, "attitude"),
        dialect.ESC_STATUS_ID: _Stream(_esc_status, 10.0, "rpm"),
        mavlink.MAVLINK_MSG_ID_SYS_STATUS: _Stream(_sys_status, 5.0, "battery"),
        mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: _Stream(_battery_status, 0.5, "battery"),
        mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS: _Stream(_estimator_status, 0.5, "attitude"),
        mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: _Stream(_extended_sys_state, 5.0, "heartbeat"),
        mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: _Stream(_autopilot_version, 0.0, "heartbeat"),
    }
