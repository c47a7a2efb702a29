"""The one entrance to the simulator: a flight in lockstep, or a mock autopilot on the wire."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from quadctl.flight.pilot import Pilot, Request, Tick
from quadctl.vehicle import Vehicle
from sitl.autopilot import SimulatedAutopilot
from sitl.hidden import load_hidden
from sitl.mavlink_px4 import MavlinkPx4


def simulated_autopilot(vehicle: Vehicle, hidden: Path | None, seed: int) -> SimulatedAutopilot:
    """An autopilot on a simulated vehicle whose world hides what the file `hidden` says."""
    return SimulatedAutopilot(vehicle, load_hidden(hidden), seed, str(hidden or "no hidden truth"))


def fly_lockstep(
    autopilot: SimulatedAutopilot, pilot: Pilot, rate_hz: float, listeners: list[Callable[[Tick], None]]
) -> None:
    """Fly the pilot's mission as fast as the machine can; the same seed gives the same flight to the last bit."""
    ticks = 0
    while not pilot.done:
        tick = pilot.tick(autopilot.estimate(), 0.0)
        if tick.target is not None:
            autopilot.set_attitude_target(tick.target)
        for request in tick.requests:
            _carry_out(request, autopilot, pilot)
        for listener in listeners:
            listener(tick)
        ticks += 1
        autopilot.step(ticks / rate_hz)


def _carry_out(request: Request, autopilot: SimulatedAutopilot, pilot: Pilot) -> None:
    refusal = autopilot.request_arm() if request is Request.ARM else autopilot.request_mode(request.name)
    if refusal is not None:
        pilot.request_failed(request, refusal)


@contextmanager
def mock_px4(autopilot: SimulatedAutopilot, port: int) -> Iterator[str]:
    """The simulated autopilot on the wire in real time; gives the URL at which it is found."""
    with MavlinkPx4(autopilot, port=port):
        yield f"udpin://127.0.0.1:{port}"
