"""The simulated autopilot on the wire, in real time, over UDP.

Only what autopilots do: heartbeats, streams at intervals that a companion may change, commands with their
acknowledgements, parameters. The rules of arming, modes and failsafes are the simulated autopilot's; what differs on
the wire is its `Manners`.
"""

import contextlib
import math
import os
import select
import socket
import struct
import threading
import time
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from types import TracebackType
from typing import ClassVar, NamedTuple, Self

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.sitl.server import dialect, messages
from quadctl.sitl.server.faults import Faults
from quadctl.sitl.server.manners import Manners, ModeStream, Stream
from quadctl.sitl.server.messages import Message
from quadctl.state import AttitudeTarget, VehicleState

STEP_S = 0.004
"""Period of the loop: physics, streams."""
MAX_LAG_S = 0.05
"""Largest lag of the vehicle's time. On a machine too busy to keep up, the vehicle's clock waits, so that the machine
alone cannot make it miss setpoints."""

CURRENT_MODE_HZ = 1.0 / 0.51
"""Rate of CURRENT_MODE, whatever is asked for."""
PILOTED = ("POSCTL",)
"""Modes that a pilot flies, whose refusal is acknowledged as accepted first."""
STATION_S = 2.5
"""Time after its last heartbeat for which a ground station counts as there."""
PRIORITY = 10
"""Priority under SCHED_FIFO: above all ordinary processes, below the flight's."""


def put_first() -> None:
    """Put this thread before all ordinary ones, where it is permitted: a real autopilot, and its cable, share no
    computer with the flight."""
    if hasattr(os, "sched_setscheduler"):
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))


class ReceivedSetpoint(NamedTuple):
    """A SET_ATTITUDE_TARGET as it arrived, with the time of `time.monotonic`."""

    received_s: float
    target: AttitudeTarget


class MavlinkMock(ABC):
    """A simulated autopilot on UDP: sends to `host:port`, obeys any sender. A context manager, or `start` and `stop`.

    The vehicle belongs to the thread of this object while it runs; others may read its plain attributes.
    """

    rules: ClassVar[type[SimulatedAutopilot]]
    """The rules of arming, modes and failsafes that it obeys."""

    def __init__(
        self, autopilot: SimulatedAutopilot, port: int = 14540, host: str = "127.0.0.1", heartbeat_hz: float = 1.0
    ) -> None:
        dialect.register(mavlink)
        self.autopilot = autopilot
        self.manners = self.new_manners()
        self.faults = Faults()
        self.setpoints_received: list[ReceivedSetpoint] = []
        self.hardware = 1
        """Number of its hardware (AUTOPILOT_VERSION.uid); 0: it tells none."""
        self.heartbeats_sent = 0
        self.parameters_asked_for: list[str] = []
        """Names of the parameters that were asked for one by one."""
        self.motor_tests_received = 0
        self.vision_poses_received: list[Message] = []
        self.vectors_received: list[Message] = []
        """VISION_POSITION_ESTIMATE messages as they arrived; the estimator does not use them."""
        self.heartbeats_heard: Counter[tuple[int, int]] = Counter()
        """Number of the heartbeats that arrived, by system and MAV_TYPE."""
        self.origin: tuple[int, int, int] | None = None
        """Latitude and longitude, 1e-7 deg, and altitude, mm, of the origin that it was given."""
        self._station_heard_s = -math.inf
        self._texts_sent = 0
        self.lag_s = 0.0
        """Real time by which the vehicle's clock is behind because the machine was too busy, s."""
        self._booted_s = 0.0
        self._addresses = [(host, port)]
        self._socket: socket.socket | None = None
        self._mav = mavlink.MAVLink(None, srcSystem=1, srcComponent=mavlink.MAV_COMP_ID_AUTOPILOT1)
        self._mav.robust_parsing = True
        self._streams = {
            **self.manners.streams,
            mavlink.MAVLINK_MSG_ID_HEARTBEAT: Stream(self._heartbeat, heartbeat_hz, "heartbeat"),
            mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: Stream(self._version, 0.0, "heartbeat"),
        }
        if self.manners.sends_current_mode:
            self._streams[dialect.CURRENT_MODE_ID] = ModeStream(self._current_mode, CURRENT_MODE_HZ, "heartbeat")
        self._news = threading.Condition()
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None
        self._failure: BaseException | None = None
        self._on_message: dict[str, Callable[[Message], None]] = {
            "COMMAND_LONG": self._command,
            "COMMAND_INT": self._command,
            "HEARTBEAT": self._hear_heartbeat,
            "SET_ATTITUDE_TARGET": self._setpoint,
            "TIMESYNC": self._timesync,
            "VISION_POSITION_ESTIMATE": self.vision_poses_received.append,
            "DEBUG_VECT": self.vectors_received.append,
            "SET_GPS_GLOBAL_ORIGIN": self._take_origin,
            "PARAM_REQUEST_LIST": self._parameter_list,
            "PARAM_REQUEST_READ": self._parameter_read,
            "PARAM_SET": self._parameter_set,
        }
        self._on_command: dict[int, Callable[[Message], int]] = {
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM: self._arm_disarm,
            mavlink.MAV_CMD_DO_SET_MODE: self._set_mode,
            mavlink.MAV_CMD_RUN_PREARM_CHECKS: self._run_checks,
            mavlink.MAV_CMD_NAV_TAKEOFF: self._take_off,
            mavlink.MAV_CMD_NAV_LAND: lambda _: self._answer(self.autopilot.request_mode("LAND")),
            mavlink.MAV_CMD_DO_MOTOR_TEST: self._test_motor,
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_message_interval,
            mavlink.MAV_CMD_REQUEST_MESSAGE: self._request_message,
        }

    @abstractmethod
    def new_manners(self) -> Manners:
        """Description of this autopilot on the wire."""

    @property
    def address(self) -> tuple[str, int]:
        """Host and port to which it sends."""
        return self._addresses[0]

    def also_send_to(self, port: int) -> None:
        """Send to another port of the same host too, from where commands are taken as well, as behind a router."""
        self._addresses.append((self._addresses[0][0], port))

    def start(self) -> None:
        """Open the socket and start the vehicle's time."""
        host = self._addresses[0][0]
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((host if host.startswith("127.") else "", 0))
        self._socket.setblocking(False)
        self._stopping.clear()
        self._thread = threading.Thread(target=self._run, name="mavlink-mock", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Stop the vehicle's time and close the socket; raises the error of the thread, if it failed."""
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
        """Restart as after a short loss of power: disarmed, clock at 0, messages at their default rates."""
        self.autopilot.power_cycle()
        self._booted_s = self.autopilot.time_s + self.lag_s
        self._station_heard_s = -math.inf
        for stream in self._streams.values():
            stream.set_interval(0.0, self.autopilot.time_s)

    def __enter__(self) -> Self:
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
        put_first()
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
            while self.autopilot.said:
                self._say(*self.autopilot.said.popleft())
            with self._news:
                self._news.notify_all()

    def _receive_until(self, deadline_s: float) -> None:
        """Handle messages as they arrive, until `deadline_s`; those that wait already in any case."""
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
            for address in self._addresses:
                with suppress(ConnectionError, BlockingIOError):  # UDP loses what nobody takes
                    self._socket.sendto(data, address)

    def _say(self, severity: int, text: str) -> None:
        """Send a text, to nobody where no ground station is heard and it is told to nobody else."""
        heard = self.autopilot.time_s - self._station_heard_s < STATION_S
        if heard or not self.manners.texts_for_stations:
            self._texts_sent += 1
            for message in messages.statustext(severity, text, self._texts_sent):
                self._send(message)

    def _send_streams(self) -> None:
        estimate = self.faults.distort(self.autopilot.estimate())
        due = [stream for stream in self._streams.values() if stream.take(estimate)]
        stamped = self._stamped(estimate) if due else estimate
        for stream in due:
            for message in stream.build(stamped):
                self._send(message)

    @property
    def _clock_s(self) -> float:
        """Time since boot, s, on a clock that runs on while the vehicle's waits for a busy machine."""
        return self.autopilot.time_s + self.lag_s - self._booted_s

    def _stamped(self, estimate: VehicleState) -> VehicleState:
        """Estimate with the time since boot."""
        ready = estimate.ready_to_arm and (estimate.armed or not self.faults.refuse_arming)
        ratio = self.faults.estimator_ratio
        return replace(estimate, time_s=self._clock_s, estimator_ratio=ratio, ready_to_arm=ready)

    # --- in ----------------------------------------------------------------------------------------------------

    def _handle(self, data: bytes) -> None:
        for message in self._mav.parse_buffer(data) or ():
            handler = self._on_message.get(message.get_type())
            if handler is not None:
                handler(message)

    def _hear_heartbeat(self, message: Message) -> None:
        self.heartbeats_heard[message.get_srcSystem(), message.type] += 1
        if message.type == mavlink.MAV_TYPE_GCS:
            self._station_heard_s = self.autopilot.time_s
        self.autopilot.hear_heartbeat(message.get_srcSystem())

    def _setpoint(self, message: Message) -> None:
        target = AttitudeTarget(tuple(message.q), message.thrust)
        if self.manners.takes_body_thrust and message.type_mask & dialect.THRUST_BODY_SET:
            forward, right, down = message.thrust_body
            target = AttitudeTarget(target.attitude, -down, (forward, right))
        self.setpoints_received.append(ReceivedSetpoint(time.monotonic(), target))
        flown = message.type_mask & 0b1100_0000 == 0  # neither thrust nor attitude is to be ignored
        if flown and all(map(math.isfinite, (*target.attitude, target.throttle, *(target.lateral or ())))):
            self.autopilot.set_attitude_target(target)

    def _timesync(self, message: Message) -> None:
        """Answer a question about the clock, with the nanoseconds since boot."""
        if message.tc1 == 0:
            self._send(mavlink.MAVLink_timesync_message(round(1e9 * self._clock_s), message.ts1))

    def _command(self, message: Message) -> None:
        handler = self._on_command.get(message.command)
        result = int(mavlink.MAV_RESULT_UNSUPPORTED) if handler is None else handler(message)
        header = message.get_header()
        for acknowledged in self._acknowledgements(message, result):
            self._send(
                mavlink.MAVLink_command_ack_message(
                    message.command, acknowledged, target_system=header.srcSystem, target_component=header.srcComponent
                )
            )

    def _acknowledgements(self, command: Message, result: int) -> tuple[int, ...]:
        """Results that are sent for one command, in their order."""
        if command.command != mavlink.MAV_CMD_DO_SET_MODE or not self.manners.acknowledges_modes_twice:
            return (result,)
        first = int(mavlink.MAV_RESULT_ACCEPTED) if self._mode_asked_for(command) in PILOTED else result
        return first, result

    def _answer(self, refusal: str | None) -> int:
        """MAV_RESULT of a request; a refusal is also sent as a text, as PX4 does."""
        if refusal is None:
            return int(mavlink.MAV_RESULT_ACCEPTED)
        self._say(mavlink.MAV_SEVERITY_CRITICAL, refusal)
        return self.manners.refusal

    def _run_checks(self, _: Message) -> int:
        if self.faults.refuse_arming:
            self._say(mavlink.MAV_SEVERITY_CRITICAL, self.faults.refuse_arming)
        return self._answer(self.autopilot.request_checks())

    def _arm_disarm(self, command: Message) -> int:
        if command.param1 == 1.0:
            return self._answer(self.faults.refuse_arming or self.autopilot.request_arm())
        return self._answer(self.autopilot.request_disarm())

    def _set_mode(self, command: Message) -> int:
        mode = self._mode_asked_for(command)
        if not mode:
            return int(mavlink.MAV_RESULT_DENIED)
        return self._answer(self.faults.refuse_modes or self.autopilot.request_mode(mode))

    def _mode_asked_for(self, command: Message) -> str:
        """Name of the mode that DO_SET_MODE asks for; empty where there is none."""
        shift = self.manners.sub_mode_shift
        custom = int(command.param2) << shift | int(command.param3) << shift + 8
        if not int(command.param1) & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
            return ""
        return next((name for name, number in self.manners.custom_modes.items() if number == custom), "")

    def _take_off(self, command: Message) -> int:
        if not self.manners.takes_off_by_command:
            return int(mavlink.MAV_RESULT_UNSUPPORTED)
        return self._answer(self.autopilot.request_take_off(command.param7))

    def _test_motor(self, command: Message) -> int:
        """Test one motor by whole percent, as ArduPilot does."""
        number, kind, percent, seconds = round(command.param1), command.param2, int(command.param3), command.param4
        if kind != mavlink.MOTOR_TEST_THROTTLE_PERCENT or not 0 <= percent <= 100:
            return int(mavlink.MAV_RESULT_UNSUPPORTED)
        self.motor_tests_received += 1
        rotor = self.manners.tested_rotor(number, self.autopilot.vehicle)
        output = self.manners.motor_test_output(0.01 * percent)
        return self._answer(self.autopilot.request_motor_test(rotor, output, seconds))

    def _set_message_interval(self, command: Message) -> int:
        message_id = int(command.param1)
        stream = self._streams.get(message_id)
        if stream is None and self.manners.announces_unknown:
            self._say(mavlink.MAV_SEVERITY_INFO, f"No ap_message for mavlink id ({message_id})")
        if stream is None or not self.faults.lets_out(mavlink.mavlink_map[message_id].msgname):
            return self.manners.unknown_interval
        if message_id == mavlink.MAVLINK_MSG_ID_HEARTBEAT and self.manners.fixed_heartbeats:
            return int(mavlink.MAV_RESULT_FAILED)
        stream.set_interval(command.param2, self.autopilot.time_s)
        return int(mavlink.MAV_RESULT_ACCEPTED)

    def _take_origin(self, message: Message) -> None:
        self.origin = self.origin or (message.latitude, message.longitude, message.altitude)

    def _request_message(self, command: Message) -> int:
        if int(command.param1) == mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN and self.origin is not None:
            self._send(mavlink.MAVLink_gps_global_origin_message(*self.origin))
            return int(mavlink.MAV_RESULT_ACCEPTED)
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
        self.parameters_asked_for.append(name)
        if message.param_index >= 0:
            name = names[message.param_index] if message.param_index < len(names) else ""
        self._send_parameter(name)

    def _parameter_set(self, message: Message) -> None:
        name = _parameter_name(message)
        if name in self.autopilot.parameters and message.param_type == self._parameter_type(name):
            self.autopilot.parameters[name] = self._decoded(name, message.param_value)
        self._send_parameter(name)

    def _send_parameter(self, name: str) -> None:
        """Send the value of a parameter, or nothing where it does not exist."""
        parameters = self.autopilot.parameters
        if name in parameters:
            value, kind = self._encoded(name, parameters[name]), self._parameter_type(name)
            index = list(parameters).index(name)
            self._send(mavlink.MAVLink_param_value_message(name.encode(), value, kind, len(parameters), index))

    def _parameter_type(self, name: str) -> int:
        integer = name in self.manners.integer_parameters
        return int(mavlink.MAV_PARAM_TYPE_INT32 if integer else mavlink.MAV_PARAM_TYPE_REAL32)

    def _encoded(self, name: str, value: float) -> float:
        if name not in self.manners.integer_parameters or not self.manners.bytewise_integers:
            return value
        encoded: float = struct.unpack("<f", struct.pack("<i", round(value)))[0]
        return encoded

    def _decoded(self, name: str, value: float) -> float:
        if name not in self.manners.integer_parameters or not self.manners.bytewise_integers:
            return value
        decoded: int = struct.unpack("<i", struct.pack("<f", value))[0]
        return float(decoded)

    # --- who it is ---------------------------------------------------------------------------------------------

    def _heartbeat(self, estimate: VehicleState) -> Iterator[Message]:
        self.heartbeats_sent += 1
        armed = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if estimate.armed else 0
        yield mavlink.MAVLink_heartbeat_message(
            mavlink.MAV_TYPE_HEXAROTOR if len(estimate.rotor_rpm) == 6 else mavlink.MAV_TYPE_QUADROTOR,
            self.manners.mav_autopilot,
            mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | armed,
            self.manners.custom_modes[estimate.mode],
            mavlink.MAV_STATE_ACTIVE if estimate.armed else mavlink.MAV_STATE_STANDBY,
            3,
        )

    def _current_mode(self, estimate: VehicleState) -> Iterator[Message]:
        custom_mode = self.manners.custom_modes[estimate.mode]
        yield dialect.CurrentMode(0, custom_mode, custom_mode)

    def _version(self, _: VehicleState) -> Iterator[Message]:
        none = [0] * 8
        yield mavlink.MAVLink_autopilot_version_message(
            self.manners.capabilities, self.manners.version, 0, 0, 0, none, none, none, 0, 0, self.hardware
        )


def _parameter_name(message: Message) -> str:
    name = message.param_id
    return name if isinstance(name, str) else name.decode(errors="replace").rstrip("\0")
