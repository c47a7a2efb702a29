"""Autopilots on the wire for the tests: a mock, an adapter connected to it, and the lines between them."""

import asyncio
import socket
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager, suppress

from quadctl.flight.autopilot.ardupilot import ARDUPILOT
from quadctl.flight.autopilot.mavlink import OWN_SYSTEM_ID
from quadctl.flight.autopilot.mavsdk_autopilot import MavsdkAutopilot
from quadctl.flight.autopilot.port import Autopilot
from quadctl.sitl.rules.copter import SimulatedCopter
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.sitl.server.ardupilot import MavlinkArduPilot
from quadctl.sitl.server.px4 import MavlinkPx4
from quadctl.sitl.server.server import MavlinkMock
from quadctl.state import AttitudeTarget, VehicleState
from tests.support.places import ROOT

RAPTOR = ROOT / "config" / "vehicles" / "raptor.yaml"
LEVEL = (1.0, 0.0, 0.0, 0.0)
IDLE = AttitudeTarget(LEVEL, 0.0)
TIMEOUT_S = 15.0


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def meet_requirements(copter: SimulatedCopter) -> None:
    """Set the parameters as quadctl requires and recommends."""
    for need in ARDUPILOT.requirements(OWN_SYSTEM_ID):
        own = need.parameter in copter.parameters
        name = need.parameter if own else ARDUPILOT.renamed[need.parameter].name
        copter.parameters[name] = need.to_meet(copter.parameters[name])


class Link:
    """One vehicle and one connected adapter."""

    def __init__(self, px: MavlinkMock, adapter: MavsdkAutopilot) -> None:
        self.px = px
        self.adapter = adapter

    def wait(self, condition: Callable[[], bool]) -> None:
        assert self.px.wait_until(condition, TIMEOUT_S), f"still {self.adapter.state()}"

    async def until(self, condition: Callable[[VehicleState], bool]) -> VehicleState:
        """Wait until the adapter's state is such; the loop runs on."""
        await asyncio.to_thread(self.wait, lambda: condition(self.adapter.state()))
        return self.adapter.state()

    async def arm(self) -> None:
        """Arm, on a PX4 when it has checked the mode that it has entered."""
        px = self.px
        await asyncio.to_thread(self.wait, lambda: not (isinstance(px, MavlinkPx4) and px.unchecked))
        await self.adapter.arm()

    async def pass_time(self, seconds: float) -> None:
        """Let the vehicle's clock run."""
        end_s = self.px.autopilot.time_s + seconds
        await asyncio.to_thread(self.wait, lambda: self.px.autopilot.time_s >= end_s)


def mock(autopilot: SimulatedAutopilot, port: int) -> MavlinkMock:
    """On the wire, with more heartbeats than the usual 1 Hz, which would only make the tests wait."""
    if isinstance(autopilot, SimulatedCopter):
        return MavlinkArduPilot(autopilot, port, heartbeat_hz=10.0)
    return MavlinkPx4(autopilot, port, heartbeat_hz=10.0)


@contextmanager
def connected(
    autopilot: SimulatedAutopilot, n_rotors: int = 4, own_system_id: int = OWN_SYSTEM_ID, hardware: int = 1
) -> Iterator[Link]:
    port = free_port()
    adapter = MavsdkAutopilot(f"udpin://127.0.0.1:{port}", n_rotors, own_system_id=own_system_id)
    px = mock(autopilot, port)
    px.hardware = hardware
    try:
        with px:
            asyncio.run(adapter.connect())
            yield Link(px, adapter)
    finally:
        asyncio.run(adapter.close())


class Stick:
    """Sends its target at 50 Hz."""

    def __init__(self, adapter: Autopilot) -> None:
        self._adapter = adapter
        self.target = IDLE
        self.sent = 0

    async def run(self) -> None:
        while True:
            self._adapter.send(self.target)
            self.sent += 1
            await asyncio.sleep(0.02)


@asynccontextmanager
async def streaming(link: Link) -> AsyncIterator[Stick]:
    """A stick whose targets have begun to arrive, released at the end."""
    stick = Stick(link.adapter)
    before = len(link.px.setpoints_received)
    task = asyncio.create_task(stick.run())
    try:
        await asyncio.to_thread(link.wait, lambda: len(link.px.setpoints_received) > before + 3)
        yield stick
    finally:
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task
