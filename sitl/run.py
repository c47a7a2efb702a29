"""The one entrance to the simulator: a flight in lockstep, or a simulated autopilot on the wire."""

import multiprocessing
import signal
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from pathlib import Path

from quadctl.errors import FlightError
from quadctl.flight.pilot.outcome import Outcome, Tally
from quadctl.flight.pilot.pilot import Pilot
from quadctl.flight.pilot.tick import Request, Tick
from quadctl.flight.preflight.plan import FlightPlan
from quadctl.sitl.autopilots import Simulated
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.sitl.vehicle.hidden import HiddenTruth, load_hidden, true_model
from quadctl.vehicle import Vehicle

START_TIMEOUT_S = 20.0


def simulate(plan: FlightPlan, log_dir: Path, hidden: Path | None, seed: int) -> Outcome:
    """Fly a plan in lockstep in a world that hides what the file `hidden` says.

    Raises
    ------
    SettingsError
        The file `hidden` cannot be used.
    FlightError
        The log cannot be written.
    """
    autopilot = SimulatedAutopilot(plan.body.vehicle, load_hidden(hidden), seed, str(hidden or "hidden truth"))
    pilot = plan.pilot()
    rate_hz = plan.settings.controller.rate_hz
    told = f"simulated {autopilot.name} in lockstep, seed {seed}"
    recorder = plan.recorder(log_dir, told, heights=autopilot.estimator.height_sensors is not None)
    tally = Tally(1.0 / rate_hz)
    try:
        fly_lockstep(autopilot, pilot, rate_hz, [recorder, tally])
    finally:
        recorder.close(pilot.ended or "broken off")
    return tally.outcome(pilot, recorder.path, recorder.problem)


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
        pilot.reflect()
        ticks += 1
        autopilot.step(ticks / rate_hz)


def _carry_out(request: Request, autopilot: SimulatedAutopilot, pilot: Pilot) -> None:
    if request is Request.CHECKS:
        refusal = autopilot.request_checks()
    elif request is Request.ARM:
        refusal = autopilot.request_arm()
    elif request is Request.TAKE_OFF:
        refusal = autopilot.request_take_off(pilot.take_off_m)
    else:
        refusal = autopilot.request_mode(_mode_of(request, autopilot))
    if refusal is not None:
        pilot.request_failed(request, f"the simulated autopilot refused to {request.value}: {refusal}")


def _mode_of(request: Request, autopilot: SimulatedAutopilot) -> str:
    modes = {Request.OFFBOARD: autopilot.offboard_mode, Request.LEAVE_OFFBOARD: autopilot.first_mode}
    return modes.get(request, request.name)


@contextmanager
def mock_process(vehicle: Vehicle, hidden: Path | None, seed: int, kind: Simulated = Simulated.PX4) -> Iterator[str]:
    """A simulated autopilot on the wire, in real time; gives the URL at which it is found.

    The autopilot has a process of its own, as a real one has a computer of its own: the flight's loop must not share
    an interpreter with the physics.

    Raises
    ------
    SettingsError
        The file `hidden` cannot be used.
    FlightError
        The process did not start.
    """
    truth = load_hidden(hidden)
    true_model(vehicle, truth, str(hidden))  # raise here what would be lost in the child
    port = _free_port()
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(target=_serve, args=(vehicle, truth, seed, kind, port, there), daemon=True)
    process.start()
    there.close()
    try:
        if not _says_ready(here):
            raise FlightError("the simulated autopilot did not start")
        yield f"udpin://127.0.0.1:{port}"
    finally:
        here.close()
        process.join(timeout=5.0)
        process.terminate()


def _says_ready(child: Connection) -> bool:
    try:
        return child.poll(START_TIMEOUT_S) and child.recv() == "ready"
    except EOFError:  # it died
        return False


def _serve(vehicle: Vehicle, truth: HiddenTruth, seed: int, kind: Simulated, port: int, parent: Connection) -> None:
    """Fly in the child until the parent closes its end of the pipe. Ctrl-C is left to the parent, which lands first."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with kind.on_the_wire(kind.on_the_wire.rules(vehicle, truth, seed), port):
        parent.send("ready")
        try:
            parent.recv()
        except EOFError:
            return


def _free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port
