"""PX4 over MAVSDK: UDP, TCP or serial.

Targets leave as single SET_ATTITUDE_TARGET messages. MAVSDK's own offboard plugin is not used: it goes on re-sending
the last target by itself, so that the autopilot would not notice a companion that hangs.
"""

import asyncio
import json
import logging
import math
import re
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import TypeVar

from mavsdk.component_type import ComponentType
from mavsdk.exceptions import ConnectionError as MavsdkConnectionError
from mavsdk.logging import LogLevel, log_subscribe
from mavsdk.mavsdk import Configuration, Mavsdk
from mavsdk.plugins.mavlink_direct import (
    MavlinkDirect,
    MavlinkDirectError,
    MavlinkDirectResult,
    MavlinkMessage,
)
from mavsdk.plugins.param import Param, ParamError, ParamResult
from mavsdk.system import System

from quadctl.errors import FlightError, LinkError
from quadctl.flight import px4
from quadctl.flight.telemetry import Telemetry
from quadctl.state import AttitudeTarget, VehicleState

T = TypeVar("T")

HEARTBEAT_WAIT_S = 3.0
"""For the next heartbeat of an autopilot that has been found, and for one that shows what was accepted."""
REASON_WAIT_S = 0.3
"""For the text that explains a refusal: it comes just before or just after the acknowledgement."""
UNIT_TOLERANCE = 1e-3

_URL = re.compile(r"(?:(?:udpin|udpout|tcpin|tcpout)://[^\s/:]+:\d{1,5}|serial://[^\s:]+:\d+)")
_URL_EXPECTED = "udpin://0.0.0.0:14540, udpout://HOST:PORT, tcpout://HOST:PORT or serial:///dev/ttyAMA0:921600"


class MavsdkAutopilot:
    """A PX4 at the other end of `url`; implements the port `Autopilot`."""

    def __init__(self, url: str, n_rotors: int, connect_timeout_s: float = 10.0) -> None:
        """Raises LinkError when `url` is not one that MAVSDK can open."""
        self._url = _checked(url)
        self._connect_timeout_s = connect_timeout_s
        self._telemetry = Telemetry(n_rotors)
        self._mavsdk: Mavsdk | None = None
        self._system_id = 1
        self._direct: MavlinkDirect | None = None
        self._param: Param | None = None
        # Of its own: whatever else occupies asyncio's default executor must not delay a landing.
        self._executor = ThreadPoolExecutor(max_workers=4, thread_name_prefix="mavsdk")
        self._start_s = time.monotonic()
        self.warnings: list[str] = []
        """What the autopilot cannot give and the flight can do without, one sentence each."""

    @property
    def description(self) -> str:
        """For the log: what it is and where."""
        return f"PX4 (system {self._system_id}) at {self._url}"

    async def connect(self) -> None:
        """Open the link and wait for a heartbeat; raises LinkError when none comes."""
        log_subscribe(_log)
        configuration = Configuration.create_with_component_type(ComponentType.COMPANION_COMPUTER)
        mavsdk = self._mavsdk = Mavsdk(configuration)
        try:
            await self._run(lambda: mavsdk.add_any_connection_with_handle(self._url))
        except MavsdkConnectionError as error:
            reason = str(error).rpartition(": ")[2]
            raise LinkError(f"The link {self._url} cannot be opened ({reason}): check {_advice(self._url)}.") from None
        system = await self._first_autopilot(mavsdk)
        if system is None:
            raise LinkError(
                f"No autopilot answers at {self._url} within {self._connect_timeout_s:g} s: "
                f"check that it is powered, and {_advice(self._url)}."
            )
        self._system_id = system.get_system_id()
        self._direct = MavlinkDirect(system)
        self._param = Param(system)
        for name in self._telemetry.messages:
            self._direct.subscribe_message(name, self._receive)
        if not await self._await(lambda: self._telemetry.autopilot != 0, HEARTBEAT_WAIT_S):
            raise LinkError(f"The autopilot at {self._url} went silent after its first heartbeat: check the link.")
        kind = self._telemetry.autopilot
        if kind != px4.MAV_AUTOPILOT_PX4:
            raise LinkError(
                f"The autopilot at {self._url} is not PX4: its heartbeat says MAV_AUTOPILOT {kind}, "
                f"expected {px4.MAV_AUTOPILOT_PX4}."
            )

    async def request_telemetry(self) -> None:
        """Ask for the message rates that control needs.

        Raises FlightError when a message that control stands on is refused; others are noted in `warnings`.
        """
        for stream in px4.STREAMS:
            interval_us = 1e6 / stream.rate_hz
            result = await self._command(
                px4.CMD_SET_MESSAGE_INTERVAL, stream.message_id, interval_us, what=f"send {stream.name}"
            )
            if result != px4.ACCEPTED:
                sentence = (
                    f"{self.description} refused to send {stream.name} at {stream.rate_hz:g} Hz: "
                    f"{px4.result_name(result)}."
                )
                if stream.required:
                    raise FlightError(sentence)
                self.warnings.append(sentence)

    def state(self) -> VehicleState:
        """The latest state, at once; parts that never arrived are nan."""
        return self._telemetry.state(time.monotonic())

    def send(self, target: AttitudeTarget) -> None:
        """Put one target on the wire, at once, once.

        Raises FlightError, and sends nothing, when the target is not a unit quaternion and a throttle in 0..1.
        """
        fields = {
            "time_boot_ms": int(1000.0 * (time.monotonic() - self._start_s)) & 0xFFFFFFFF,
            "target_system": self._system_id,
            "target_component": px4.MAV_COMP_ID_AUTOPILOT,
            "type_mask": px4.ATTITUDE_TARGET_IGNORE_RATES,
            "q": _checked_attitude(target),
            "body_roll_rate": 0.0,
            "body_pitch_rate": 0.0,
            "body_yaw_rate": 0.0,
            "thrust": _checked_throttle(target),
            "thrust_body": (0.0, 0.0, 0.0),
        }
        try:
            self._link.send_message(self._message("SET_ATTITUDE_TARGET", json.dumps(fields)))
        except MavlinkDirectError as error:
            raise LinkError(f"A target could not be sent to {self.description}: {error.result.name}.") from None

    async def arm(self) -> None:
        """Arm the motors; returns when the heartbeat shows it."""
        await self._request("arm", px4.CMD_COMPONENT_ARM_DISARM, 1.0, until=lambda: self._telemetry.armed)

    async def start_offboard(self) -> None:
        """Enter OFFBOARD, the mode that follows our targets; a stream of them must be running."""
        await self._enter("OFFBOARD")

    async def land(self) -> None:
        """Enter the autopilot's own land mode."""
        await self._enter("LAND")

    async def hold(self) -> None:
        """Hand over: enter the autopilot's own hold mode."""
        await self._enter("HOLD")

    async def parameters(self, names: Iterable[str]) -> dict[str, float]:
        """Values of the parameters by name, integers too as floats; those for which no answer comes are left out."""
        found = {}
        for name in names:
            value = await self._run(partial(self._read_parameter, name))
            if value is not None:
                found[name] = value
        return found

    async def set_parameter(self, name: str, value: float) -> None:
        """Set a parameter, as an integer where the autopilot holds one.

        Raises FlightError when the autopilot does not confirm it.
        """
        try:
            await self._run(lambda: self._write_parameter(name, value))
        except ParamError as error:
            raise FlightError(f"{self.description} did not set {name} to {value:g}: {error.result.name}.") from None

    async def close(self) -> None:
        """Let go of the link. Waits for commands under way, which MAVSDK gives up by itself after some seconds."""
        with ThreadPoolExecutor(max_workers=1) as closer:
            await asyncio.get_running_loop().run_in_executor(closer, self._destroy)

    # --- inside ------------------------------------------------------------------------------------------------

    @property
    def _link(self) -> MavlinkDirect:
        if self._direct is None:
            raise LinkError(f"The link {self._url} is not open: connect first.")
        return self._direct

    def _receive(self, message: MavlinkMessage, _: object) -> None:
        """A message has arrived; on MAVSDK's thread."""
        now_s = time.monotonic()
        if message.component_id == px4.MAV_COMP_ID_AUTOPILOT:
            self._telemetry.receive(message.message_name, json.loads(message.fields_json), now_s)

    async def _first_autopilot(self, mavsdk: Mavsdk) -> System | None:
        loop = asyncio.get_running_loop()
        found: asyncio.Future[System | None] = loop.create_future()

        def settle(system: System | None) -> None:
            if not found.done():
                found.set_result(system)

        waiting = mavsdk.first_autopilot_async(
            self._connect_timeout_s, lambda system: loop.call_soon_threadsafe(settle, system)
        )
        try:
            return await found
        finally:
            mavsdk.cancel_first_autopilot(waiting)

    async def _enter(self, mode: str) -> None:
        main, sub = px4.MODES[mode]
        await self._request(
            f"enter {mode}",
            px4.CMD_DO_SET_MODE,
            px4.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED,
            main,
            sub,
            until=lambda: self._telemetry.mode == mode,
        )

    async def _request(self, what: str, command: int, *parameters: float, until: Callable[[], bool]) -> None:
        """Command it and return when a heartbeat shows it: until then the state would contradict the answer."""
        asked_s = time.monotonic()
        result = await self._command(command, *parameters, what=what)
        if result != px4.ACCEPTED:
            await self._await(lambda: bool(self._telemetry.warnings_since(asked_s)), REASON_WAIT_S)
            reasons = "; ".join([px4.result_name(result), *self._telemetry.warnings_since(asked_s)])
            raise FlightError(f"{self.description} refused to {what}: {reasons}.")
        if not await self._await(until, HEARTBEAT_WAIT_S):
            raise FlightError(
                f"{self.description} accepted to {what}, but no heartbeat shows it within {HEARTBEAT_WAIT_S:g} s."
            )

    async def _command(self, command: int, *parameters: float, what: str) -> int:
        """Send a COMMAND_LONG; the MAV_RESULT of its acknowledgement."""
        fields = {
            "target_system": self._system_id,
            "target_component": px4.MAV_COMP_ID_AUTOPILOT,
            "command": command,
            "confirmation": 0,
            **{f"param{i}": float(value) for i, value in enumerate(parameters, start=1)},
        }
        link, message = self._link, self._message("COMMAND_LONG", json.dumps(fields))
        try:
            ack = await self._run(lambda: link.send_command(message))
        except MavlinkDirectError as error:
            cause = "no answer" if error.result == MavlinkDirectResult.TIMEOUT else error.result.name
            raise LinkError(f"{self.description} was asked to {what}: {cause}; check the link.") from None
        return int(json.loads(ack.fields_json)["result"])

    def _message(self, name: str, fields_json: str) -> MavlinkMessage:
        return MavlinkMessage(name, 0, 0, self._system_id, px4.MAV_COMP_ID_AUTOPILOT, fields_json)

    @property
    def _parameter_protocol(self) -> Param:
        if self._param is None:
            raise LinkError(f"The link {self._url} is not open: connect first.")
        return self._param

    def _read_parameter(self, name: str) -> float | None:
        """MAVSDK wants to know the type, and says when it was the other one."""
        protocol = self._parameter_protocol
        try:
            return float(protocol.get_param_int(name))
        except ParamError as error:
            if error.result is not ParamResult.WRONG_TYPE:
                return None
        try:
            return float(protocol.get_param_float(name))
        except ParamError:
            return None

    def _write_parameter(self, name: str, value: float) -> None:
        protocol = self._parameter_protocol
        try:
            protocol.set_param_float(name, value)
        except ParamError as error:
            if error.result is not ParamResult.WRONG_TYPE:
                raise
            protocol.set_param_int(name, round(value))

    async def _await(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        return await self._run(lambda: self._telemetry.wait_for(condition, timeout_s))

    async def _run(self, call: Callable[[], T]) -> T:
        return await asyncio.get_running_loop().run_in_executor(self._executor, call)

    def _destroy(self) -> None:
        self._executor.shutdown(wait=True, cancel_futures=True)
        self._direct = self._param = None
        if self._mavsdk is not None:
            self._mavsdk.destroy()
            self._mavsdk = None


def _log(level: LogLevel, text: str, *_: object) -> bool:
    """MAVSDK's own log goes to `logging`: written to the terminal by C++ it would tear the display apart."""
    severity = {LogLevel.WARN: logging.WARNING, LogLevel.ERROR: logging.ERROR}.get(level, logging.DEBUG)
    logging.getLogger("mavsdk").log(severity, text)
    return True


def _checked(url: str) -> str:
    if url.startswith("udp://"):
        port = url.rpartition(":")[2]
        raise LinkError(f"The link {url} uses the outdated udp://: say udpin://0.0.0.0:{port} to listen on that port.")
    if not _URL.fullmatch(url):
        raise LinkError(f"The link {url!r} is not one that can be opened: expected {_URL_EXPECTED}.")
    return url


def _checked_attitude(target: AttitudeTarget) -> tuple[float, float, float, float]:
    q = target.attitude
    norm = math.sqrt(sum(c * c for c in q))
    if not abs(norm - 1.0) <= UNIT_TOLERANCE:  # a nan is refused too
        raise FlightError(f"The attitude target {q} was not sent: expected a unit quaternion, its norm is {norm:g}.")
    return q


def _checked_throttle(target: AttitudeTarget) -> float:
    if not 0.0 <= target.throttle <= 1.0:  # a nan is refused too
        raise FlightError(f"The throttle target {target.throttle} was not sent: expected a number from 0 to 1.")
    return target.throttle


def _advice(url: str) -> str:
    """What to look at when this kind of link stays silent."""
    if url.startswith("serial"):
        return "the device's name, its permissions and the baud rate (PX4: MAV_1_CONFIG, SER_TEL2_BAUD)"
    if url.startswith("udpin"):
        return "that it sends MAVLink to this port (PX4's simulator: 14540) and that no other program holds it"
    return "the host, the port and that its MAVLink server is running"
