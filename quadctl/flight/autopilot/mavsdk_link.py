"""A MAVLink connection through MAVSDK: UDP, TCP or serial. Messages out and in, commands, parameters.

A serial device that goes away (a pulled plug) is opened again as soon as it is back.
"""

import asyncio
import json
import logging
import re
import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

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
from quadctl.flight.autopilot import serial_line, udp_port
from quadctl.flight.autopilot.firmwares import FIRMWARES
from quadctl.flight.autopilot.mavlink import MAV_COMP_ID_AUTOPILOT, OWN_SYSTEM_ID

T = TypeVar("T")
Receiver = Callable[[str, Mapping[str, Any], float], None]
"""Callback with a message's name, its fields and its time of arrival (`time.monotonic`), on a thread of MAVSDK."""

SILENCE_S = 1.5
"""Silence after which a serial line is opened again: heartbeats alone come every second."""
REOPEN_EVERY_S = 0.5
LAST_PORT = 65535
ANSWER_WAIT_S = 0.5
"""Longest wait for the acknowledgement of a command that is sent once."""

_URL = re.compile(r"(?:(?:udpin|udpout|tcpin|tcpout)://[^\s/:]+:\d{1,5}|serial://[^\s:]+:\d+)")
_URL_EXPECTED = "udpin://0.0.0.0:14540, udpout://HOST:PORT, tcpout://HOST:PORT or serial:///dev/ttyAMA0:921600"

ADVICE = {
    "serial": "the device's name, its permissions and the baud rate ({ports})",
    "udpin": "that it sends MAVLink to this port (a simulator: 14540) and that no other program holds it",
    "": "the host, the port and that its MAVLink server is running",
}
"""Advice about a silent link, by the beginning of its URL."""


class MavsdkLink:
    """The connection to the first autopilot that is heard at `url`."""

    def __init__(self, url: str, receiver: Receiver, own_system_id: int = OWN_SYSTEM_ID) -> None:
        """Raises LinkError when `url` is not one that MAVSDK can open."""
        self.url = _checked(url)
        self.own_system_id = own_system_id
        self.system_id = 1
        self.warnings: list[str] = []
        """One sentence for each thing about the line that a flight can do without."""
        self.on_reopened: Callable[[], None] = lambda: None
        """Called on a thread of the link when a line that had gone silent speaks again."""
        self._receiver = receiver
        self._heard_s = -float("inf")
        self._mavsdk: Mavsdk | None = None
        self._handle: Any = None
        self._direct: MavlinkDirect | None = None
        self._param: Param | None = None
        # Of its own: whatever else occupies asyncio's default executor must not delay a landing.
        self._executor = ThreadPoolExecutor(max_workers=4, thread_name_prefix="mavsdk")
        self._answers: dict[int, int] = {}
        """MAV_RESULT of the last acknowledgement of each command."""
        self._answered = threading.Condition()
        self._closing = threading.Event()
        self._keeper = threading.Thread(target=self._keep_open, name="link", daemon=True)

    async def open(self, messages: Iterable[str], timeout_s: float) -> None:
        """Open the link, wait for an autopilot, and from then on hand over the `messages` that it sends.

        Raises LinkError when the link cannot be opened, another program holds its port, or nobody answers.
        """
        listens = self.url.startswith("udpin")
        if listens:
            udp_port.require_free(self.url)
        log_subscribe(_log)
        configuration = Configuration.create_with_component_type(ComponentType.COMPANION_COMPUTER)
        configuration.system_id = self.own_system_id
        mavsdk = self._mavsdk = Mavsdk(configuration)
        try:
            self._handle = await self.run(lambda: mavsdk.add_any_connection_with_handle(self.url))
        except MavsdkConnectionError as error:
            reason = str(error).rpartition(": ")[2]
            raise LinkError(f"The link {self.url} cannot be opened ({reason}): check {_advice(self.url)}.") from None
        if listens:
            udp_port.own(self.url)
        if self._device and not serial_line.let_reads_wait(self._device):
            self.warnings.append(
                f"{self._device} does not let reads wait for data (VMIN 1 cannot be set): "
                "listening takes a whole core of the processor."
            )
        system = await _first_autopilot(mavsdk, timeout_s)
        if system is None:
            raise LinkError(
                f"No autopilot answers at {self.url} within {timeout_s:g} s: "
                f"check that it is powered, and {_advice(self.url)}."
            )
        self.system_id = system.get_system_id()
        self._direct, self._param = MavlinkDirect(system), Param(system)
        for name in messages:
            self._direct.subscribe_message(name, self._receive)
        self._direct.subscribe_message("COMMAND_ACK", self._on_answer)
        self._heard_s = time.monotonic()
        if self._device:
            self._keeper.start()

    async def close(self) -> None:
        """Let go of the link. Waits for commands under way, which MAVSDK gives up by itself after some seconds."""
        with ThreadPoolExecutor(max_workers=1) as closer:
            await asyncio.get_running_loop().run_in_executor(closer, self._destroy)

    async def run(self, call: Callable[[], T]) -> T:
        """Wait for a blocking call on a thread of the link."""
        return await asyncio.get_running_loop().run_in_executor(self._executor, call)

    def send(self, name: str, fields: Mapping[str, Any]) -> None:
        """Put one message on the wire, at once, once. Raises LinkError."""
        try:
            self._opened(self._direct).send_message(self._message(name, fields))
        except MavlinkDirectError as error:
            raise LinkError(f"{name} could not be sent over {self.url}: {error.result.name}.") from None

    def command(self, number: int, *parameters: float, what: str) -> int:
        """Send a COMMAND_LONG and wait for its acknowledgement; its MAV_RESULT. Raises LinkError when none comes."""
        try:
            ack = self._opened(self._direct).send_command(self._message(*self._command(number, parameters)))
        except MavlinkDirectError as error:
            cause = "no answer" if error.result == MavlinkDirectResult.TIMEOUT else error.result.name
            raise self._unanswered(what, cause) from None
        return int(json.loads(ack.fields_json)["result"])

    def command_once(self, number: int, *parameters: float, what: str) -> int:
        """Send a COMMAND_LONG once, and wait for its acknowledgement; its MAV_RESULT. Raises LinkError when none comes.

        MAVSDK repeats the others three times in 1.5 s, and cannot be stopped when somebody takes the vehicle meanwhile.
        """
        with self._answered:
            self._answers.pop(number, None)
        self.send(*self._command(number, parameters))
        with self._answered:
            if not self._answered.wait_for(lambda: number in self._answers, ANSWER_WAIT_S):
                raise self._unanswered(what, "no answer")
            return self._answers[number]

    def read_parameter(self, name: str) -> float | int | None:
        """Value of a parameter, an int where the autopilot holds one; None when no answer comes.

        MAVSDK wants to know the type, and says when it was the other one.
        """
        param = self._opened(self._param)
        try:
            return int(param.get_param_int(name))
        except ParamError as error:
            if error.result is not ParamResult.WRONG_TYPE:
                return None
        try:
            return float(param.get_param_float(name))
        except ParamError:
            return None

    def write_parameter(self, name: str, value: float) -> None:
        """Set a parameter, as an integer where the autopilot holds one; raises FlightError when it is not confirmed."""
        tried_again(lambda: self._write_parameter(name, value))

    def _write_parameter(self, name: str, value: float) -> None:
        param = self._opened(self._param)
        known = self.read_parameter(name)
        if known is None:
            raise FlightError(f"The autopilot at {self.url} did not tell its {name}, so it was not set to {value:.7g}.")
        try:
            if isinstance(known, int):
                param.set_param_int(name, round(value))
            else:
                param.set_param_float(name, value)
        except ParamError as error:
            raise FlightError(
                f"The autopilot at {self.url} did not set {name} to {value:.7g}: {error.result.name}."
            ) from None

    @property
    def other_autopilots(self) -> list[int]:
        """System ids of further autopilots that are heard on this link."""
        systems = [] if self._mavsdk is None else self._mavsdk.get_systems()
        heard = {system.get_system_id() for system in systems if system.has_autopilot()}
        return sorted(heard - {self.system_id})

    # --- inside ------------------------------------------------------------------------------------------------

    @property
    def _device(self) -> str:
        """The serial device; empty for a link over the network."""
        kind, _, address = self.url.partition("://")
        return address.rpartition(":")[0] if kind == "serial" else ""

    def _opened(self, plugin: T | None) -> T:
        if plugin is None:
            raise LinkError(f"The link {self.url} is not open: connect first.")
        return plugin

    def _receive(self, message: MavlinkMessage, _: object) -> None:
        """Hand over a message that has arrived; runs on MAVSDK's thread."""
        if message.component_id == MAV_COMP_ID_AUTOPILOT:
            self._heard_s = time.monotonic()
            self._receiver(message.message_name, json.loads(message.fields_json), self._heard_s)

    def _on_answer(self, message: MavlinkMessage, _: object) -> None:
        """Take in an acknowledgement; runs on MAVSDK's thread."""
        if message.component_id == MAV_COMP_ID_AUTOPILOT:
            fields = json.loads(message.fields_json)
            with self._answered:
                self._answers[int(fields["command"])] = int(fields["result"])
                self._answered.notify_all()

    def _command(self, number: int, parameters: Sequence[float]) -> tuple[str, dict[str, Any]]:
        """Name and fields of the message of a command."""
        fields = {
            "target_system": self.system_id,
            "target_component": MAV_COMP_ID_AUTOPILOT,
            "command": number,
            "confirmation": 0,
            **{f"param{i}": float(value) for i, value in enumerate(parameters, start=1)},
        }
        return "COMMAND_LONG", fields

    def _unanswered(self, what: str, cause: str) -> LinkError:
        return LinkError(f"The autopilot at {self.url} was asked to {what}: {cause}; check the link.")

    def _message(self, name: str, fields: Mapping[str, Any]) -> MavlinkMessage:
        return MavlinkMessage(name, 0, 0, self.system_id, MAV_COMP_ID_AUTOPILOT, json.dumps(fields))

    def _keep_open(self) -> None:
        """Open the serial device again after a silence, which MAVSDK does not do by itself."""
        assert self._mavsdk is not None
        lost = False
        while not self._closing.wait(REOPEN_EVERY_S):
            if time.monotonic() - self._heard_s < SILENCE_S:
                if lost:
                    lost = False
                    self.on_reopened()
                continue
            lost = True
            if self._handle is not None:
                self._mavsdk.remove_connection(self._handle)
                self._handle = None
            try:
                self._handle = self._mavsdk.add_any_connection_with_handle(self.url)
            except MavsdkConnectionError:
                continue
            serial_line.let_reads_wait(self._device)
            self._closing.wait(SILENCE_S)  # for the first heartbeat

    def _destroy(self) -> None:
        self._closing.set()
        if self._keeper.ident is not None:
            self._keeper.join()
        self._executor.shutdown(wait=True, cancel_futures=True)
        self._direct = self._param = None
        if self._mavsdk is not None:
            self._mavsdk.destroy()
            self._mavsdk = None


async def _first_autopilot(mavsdk: Mavsdk, timeout_s: float) -> System | None:
    loop = asyncio.get_running_loop()
    found: asyncio.Future[System | None] = loop.create_future()

    def settle(system: System | None) -> None:
        if not found.done():
            found.set_result(system)

    waiting = mavsdk.first_autopilot_async(timeout_s, lambda system: loop.call_soon_threadsafe(settle, system))
    try:
        return await found
    finally:
        mavsdk.cancel_first_autopilot(waiting)


def tried_again(call: Callable[[], T]) -> T:
    """Result of a call that may be made twice, where the first has failed: of a link that loses a fifth each way, the
    four attempts of MAVSDK lose one call in sixty."""
    try:
        return call()
    except FlightError:
        return call()


def _log(level: LogLevel, text: str, *_: object) -> bool:
    """Take in a line of MAVSDK's own log, for debugging only: what users must know, quadctl says."""
    logging.getLogger("mavsdk").debug("%s: %s", level.name, text)
    return True


def _checked(url: str) -> str:
    if url.startswith("udp://"):
        port = url.rpartition(":")[2]
        raise LinkError(f"The link {url} uses the outdated udp://: say udpin://0.0.0.0:{port} to listen on that port.")
    if not _URL.fullmatch(url):
        raise LinkError(f"The link {url!r} is not one that can be opened: expected {_URL_EXPECTED}.")
    port = url.rpartition(":")[2]
    if not url.startswith("serial") and not 1 <= int(port) <= LAST_PORT:
        raise LinkError(f"The link {url} has the port {port}, expected one from 1 to {LAST_PORT}.")
    return url


def _advice(url: str) -> str:
    """Advice for a link of this kind that stays silent."""
    ports = "; ".join(f"{known.name}: {', '.join(known.serial_parameters)}" for known in FIRMWARES.values())
    return next(advice for scheme, advice in ADVICE.items() if url.startswith(scheme)).format(ports=ports)
