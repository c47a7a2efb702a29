"""One program on a UDP port: a second one is refused, before or while a flight holds the port."""

import asyncio
import os
import socket
from pathlib import Path

import pytest

from quadctl.errors import LinkError
from quadctl.flight.autopilot import udp_port
from quadctl.flight.autopilot.mavsdk_autopilot import MavsdkAutopilot
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.vehicle import load_vehicle
from tests.support.links import RAPTOR, connected, free_port

pytestmark = pytest.mark.realtime


def reusing(port: int, host: str) -> socket.socket:
    """A socket as ground stations open it."""
    taken = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    for option in (socket.SO_REUSEADDR, socket.SO_REUSEPORT):
        taken.setsockopt(socket.SOL_SOCKET, option, 1)
    taken.bind((host, port))
    return taken


@pytest.mark.parametrize("host", ["0.0.0.0", "127.0.0.1"])
def test_a_port_that_somebody_holds_is_refused_with_his_name_and_nothing_is_sent(host: str) -> None:
    port = free_port()
    with reusing(port, host) as held:
        adapter = MavsdkAutopilot(f"udpin://127.0.0.1:{port}", 4)
        with pytest.raises(LinkError) as error:
            asyncio.run(adapter.connect())
        asyncio.run(adapter.close())
        held.setblocking(False)
        with pytest.raises(BlockingIOError):
            held.recv(1)
    assert f"UDP port {port} is held by process {os.getpid()} (" in str(error.value)


def test_owning_a_port_leaves_no_file_open() -> None:
    port = free_port()
    with reusing(port, "127.0.0.1"):
        before = len(list(Path("/proc/self/fd").iterdir()))
        udp_port.own(f"udpin://127.0.0.1:{port}")
        assert len(list(Path("/proc/self/fd").iterdir())) == before
        with pytest.raises(OSError, match="Address already in use"):
            reusing(port, "127.0.0.1")


@pytest.mark.parametrize("host", ["0.0.0.0", "127.0.0.1"])
def test_a_program_that_starts_in_flight_does_not_get_the_port(host: str) -> None:
    with connected(SimulatedAutopilot(load_vehicle(RAPTOR))) as link:
        port = int(link.adapter._link.url.rpartition(":")[2])
        with pytest.raises(OSError, match="Address already in use"):
            reusing(port, host)
        heard_s = link.adapter.state().received_s["heartbeat"]
        link.wait(lambda: link.adapter.state().received_s["heartbeat"] > heard_s)
