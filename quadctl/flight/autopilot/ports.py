"""Search for an autopilot: the serial ports with the devices behind them, and the links at which MAVLink is heard."""

import errno
import socket
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path
from threading import Event

import serial
from pymavlink.dialects.v20 import common as dialect
from rich.console import Console
from serial.tools import list_ports

from quadctl.errors import LinkError
from quadctl.flight.autopilot.firmwares import FIRMWARES
from quadctl.flight.autopilot.mavlink import MAV_COMP_ID_AUTOPILOT

AUTO = "auto"
UDP_PORT = 14540
"""Port to which autopilots are usually configured to send, and PX4's simulator sends by default."""
BAUD_RATES = (921600, 115200, 57600, 500000)
"""Baud rates in the order in which they are tried: telemetry to a companion, USB, telemetry radios."""
LISTEN_S = 1.6
"""Listening time at one baud rate: heartbeats come every second."""

USB_AUTOPILOTS = {
    0x26AC: "3D Robotics autopilot",
    0x1209: "ArduPilot autopilot",
    0x2DAE: "CubePilot autopilot",
    0x3162: "Holybro autopilot",
    0x1FC9: "NXP autopilot",
    0x0483: "autopilot with an STM32",
}
"""Names by USB vendor of a flight controller's own USB port."""
USB_ADAPTERS = {0x0403: "FTDI", 0x10C4: "Silicon Labs CP210x", 0x1A86: "WCH CH34x", 0x067B: "Prolific"}
DEV = Path("/dev")
PINS = "serial0"
"""Link, on a Raspberry Pi, to the UART on its pins: to ttyS0 where Bluetooth has the better one, else to ttyAMA0."""
UARTS = {
    "ttyAMA": "UART of a Raspberry Pi",
    "ttyTHS": "UART of a Jetson",
    PINS: f"UART on the pins of a Raspberry Pi ({PINS})",
}
"""Names by the beginning of the device's name; a UART does not tell which device is wired to its pins."""


@dataclass(frozen=True)
class Port:
    """A serial port of this computer."""

    device: str
    what: str
    """Description of the device behind it, as far as known."""
    likely: bool
    """True: an autopilot may be behind it."""


def serial_ports() -> list[Port]:
    """All serial ports, the likely ones first."""
    found = {
        info.device: _described(info.device, info.vid, info.product or info.description)
        for info in list_ports.comports()
    }
    for device, what in _uarts():
        found[device] = Port(device, what, likely=True)
    return sorted(found.values(), key=lambda port: (not port.likely, port.device))


def resolve(url: str, console: Console) -> str:
    """URL of the link: `url` itself, or for `auto` the one at which an autopilot is heard.

    Raises
    ------
    LinkError
        No autopilot is heard anywhere.
    """
    if url != AUTO:
        return url
    with console.status("looking for an autopilot"):
        found = find_autopilot([port.device for port in serial_ports() if port.likely])
    console.print(f"found an autopilot at {found}", soft_wrap=True, markup=False, highlight=False)
    return found


def find_autopilot(devices: Iterable[str], udp_port: int = UDP_PORT) -> str:
    """URL of the first link at which the heartbeat of PX4 or ArduPilot comes, all of them listened to at once.

    Raises
    ------
    LinkError
        None comes.
    """
    tried = [f"udpin://0.0.0.0:{udp_port}", *(f"serial://{device}" for device in devices)]
    stop = Event()
    with ThreadPoolExecutor(max_workers=len(tried), thread_name_prefix="ports") as pool:
        waiting = {pool.submit(_listen_on_udp, udp_port, stop)}
        waiting |= {pool.submit(_listen_on_serial, url.removeprefix("serial://"), stop) for url in tried[1:]}
        try:
            while waiting:
                done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
                for url in (future.result() for future in done):
                    if url is not None:
                        return url
        finally:
            stop.set()
    raise LinkError(
        f"No autopilot is heard at {', '.join(tried)}: check that it is powered, wired and sends MAVLink, "
        "or name the link with --link."
    )


def _uarts() -> Iterator[tuple[str, str]]:
    """UARTs that pyserial does not list, or whose names do not tell what they are; each by its own name."""
    for device in sorted(DEV.glob("ttyTHS*")):
        yield str(device), UARTS["ttyTHS"]
    if (DEV / PINS).exists():
        yield str((DEV / PINS).resolve()), UARTS[PINS]


def _described(device: str, vendor: int | None, says: str) -> Port:
    says = "" if says == "n/a" else says
    if vendor in USB_AUTOPILOTS:
        return Port(device, _joined(USB_AUTOPILOTS[vendor], says), likely=True)
    if vendor in USB_ADAPTERS:
        return Port(device, _joined(f"{USB_ADAPTERS[vendor]} adapter", says), likely=True)
    name = device.rpartition("/")[2]
    for beginning, what in UARTS.items():
        if name.startswith(beginning):
            return Port(device, what, likely=True)
    return Port(device, says or "unknown", likely=vendor is not None)


def _joined(what: str, says: str) -> str:
    return f"{what} ({says})" if says else what


def _listen_on_serial(device: str, stop: Event) -> str | None:
    for baud in BAUD_RATES:
        try:
            with serial.Serial(device, baud, timeout=0.1, write_timeout=0.2, exclusive=True) as port:
                ears = _Ears()
                port.write(ears.greeting)  # on its USB port, PX4 speaks when it is spoken to
                end_s = time.monotonic() + LISTEN_S
                while time.monotonic() < end_s and not stop.is_set():
                    if ears.hear(port.read(max(port.in_waiting, 1))):
                        return f"serial://{device}:{baud}"
        except (OSError, ValueError):  # taken by another program, gone, or a baud rate that it cannot do
            continue
    return None


def _listen_on_udp(udp_port: int, stop: Event) -> str | None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ear:
        try:
            ear.bind(("0.0.0.0", udp_port))
        except OSError as error:
            if error.errno == errno.EADDRINUSE:
                return None
            raise
        ear.settimeout(0.1)
        ears = _Ears()
        end_s = time.monotonic() + len(BAUD_RATES) * LISTEN_S
        while time.monotonic() < end_s and not stop.is_set():
            try:
                if ears.hear(ear.recv(65536)):
                    return f"udpin://0.0.0.0:{udp_port}"
            except TimeoutError:
                continue
    return None


class _Ears:
    """Detector of an autopilot's heartbeat in a stream of bytes."""

    def __init__(self) -> None:
        self._parser = dialect.MAVLink(None)
        self._parser.robust_parsing = True

    @property
    def greeting(self) -> bytes:
        """A companion's heartbeat."""
        sender = dialect.MAVLink(None, srcSystem=1, srcComponent=dialect.MAV_COMP_ID_ONBOARD_COMPUTER)
        kind, none = dialect.MAV_TYPE_ONBOARD_CONTROLLER, dialect.MAV_AUTOPILOT_INVALID
        heartbeat: bytes = sender.heartbeat_encode(kind, none, 0, 0, dialect.MAV_STATE_ACTIVE).pack(sender)
        return heartbeat

    def hear(self, data: bytes) -> bool:
        return any(
            message.get_type() == "HEARTBEAT"
            and message.get_srcComponent() == MAV_COMP_ID_AUTOPILOT
            and message.autopilot in FIRMWARES
            for message in self._parser.parse_buffer(data) or ()
        )
