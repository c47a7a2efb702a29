"""A flight in simulated time: the real loop, pilot, link adapter and telemetry, on a clock that the simulation moves.

The event loop of asyncio waits for nothing: where it would, the world moves on. What crosses the line between autopilot
and flight are the messages of the simulated autopilot and of the adapter, with the line's troubles.
"""

import asyncio
import errno
import heapq
import inspect
import itertools
import math
import random
import selectors
import signal
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest import mock as patching

import yaml
from pymavlink.dialects.v20 import ardupilotmega as dialect

from quadctl.errors import FlightError, LinkError
from quadctl.flight import loop as flight_loop
from quadctl.flight.autopilot import mavlink, mavsdk_autopilot, round_trips
from quadctl.flight.autopilot.mavsdk_autopilot import MavsdkAutopilot
from quadctl.flight.autopilot.telemetry import Telemetry
from quadctl.flight.pilot.outcome import COMPLETED, Tally
from quadctl.flight.pilot.tick import Stage as FlightStage
from quadctl.flight.pilot.tick import Tick
from quadctl.flight.preflight.plan import FlightPlan
from quadctl.flight.watchdog import HANG_S
from quadctl.sitl.server import server
from quadctl.sitl.server.server import STEP_S, MavlinkMock
from quadctl.state import AttitudeTarget

from ..faults.line import Troubles
from ..faults.scene import PROFILES
from .draw import Sequence
from .evidence import Asked, Evidence, Noted, Sent, Told
from .kinds import KINDS
from .plan import plan_of
from .stage import Killed, Stage

BEGAN_S = 1000.0
"""Time on the flight's clock at which the autopilot has just booted."""
BOOTED_S = 1.0
WIRE_S = 0.0005
"""Delay of a line without troubles."""
HORIZON_S = 170.0
"""Longest time from the boot until all must be over: longer than any flight, its landing and its patience together."""
PATIENCE_S = 90.0
"""Longest time of the flight after which no vehicle may be in the air."""
COMMAND_TRIES, COMMAND_WAIT_S = 4, 0.5
"""MAVSDK's repetitions of a command that is not acknowledged."""
QUEUE = 600
"""Number of datagrams that wait for a process that is stopped; later ones are lost."""
LIFTED_M = 0.15


class World(Stage):
    """The world outside the flight's event loop, and the clock of both."""

    def __init__(self, sequence: Sequence, chance: random.Random) -> None:
        self._now_s = BEGAN_S
        self._events: list[tuple[float, int, Callable[[], object]]] = []
        self._numbers = itertools.count()
        self._profile = PROFILES[sequence.autopilot]
        self._step_due_s = BEGAN_S
        self.receive: Callable[[str, Mapping[str, Any], float], None] = lambda name, fields, sampled_s: None
        """Takes in a message of the autopilot with the time at which it was sent."""
        self._stalled_until_s = -math.inf
        self._stopped_until_s = -math.inf
        self._queue: list[Callable[[], object]] = []
        self.woken: Callable[[], bool] = lambda: False
        self.signals: dict[int, Callable[[], object]] = {}
        self.closed = False
        """True: the flight's process has ended by itself."""
        self.log_file: Any = None
        super().__init__(
            mock=None,  # type: ignore[arg-type]  # set by whoever makes it, as it needs this clock
            profile=self._profile,
            down=Troubles(chance=random.Random(chance.random())),
            up=Troubles(chance=random.Random(chance.random())),
        )

    # --- clock -------------------------------------------------------------------------------------------------

    @property
    def now_s(self) -> float:
        return self._now_s

    def monotonic(self) -> float:
        return self._now_s

    def later(self, after_s: float, action: Callable[[], object]) -> None:
        heapq.heappush(self._events, (self._now_s + max(after_s, 0.0), next(self._numbers), action))

    def advance(self, until_s: float, wakes: bool = True) -> None:
        """Move on to `until_s`, or to what wakes the flight's loop."""
        while True:
            due_s = min(self._events[0][0] if self._events else math.inf, self._step_due_s)
            if due_s > until_s:
                self._now_s = max(self._now_s, until_s)
                return
            self._now_s = max(self._now_s, due_s)
            if self._events and self._events[0][0] <= self._step_due_s:
                heapq.heappop(self._events)[2]()
            else:
                self._step_due_s += STEP_S
                self.live(self._now_s - BEGAN_S + BOOTED_S)
            if wakes and self.woken():
                return

    def wait(self, timeout_s: float | None) -> None:
        """Let the flight's loop wait, and hold it up where it is stalled."""
        self.advance(self._now_s + (STEP_S if timeout_s is None else timeout_s))
        self.be_stalled()

    def be_stalled(self) -> None:
        """Hold the flight's thread up for as long as it is stalled."""
        while self._now_s < self._stalled_until_s:
            self.advance(self._stalled_until_s, wakes=False)
            if self.killed:
                break
        if self.killed and not self.closed:
            self.closed = True
            raise Killed

    def live(self, until_s: float) -> None:
        """A step of the autopilot, to `until_s` on its own clock."""
        self.mock.autopilot.step(until_s)
        self.mock._send_streams()
        while self.mock.autopilot.said:
            self.mock._say(*self.mock.autopilot.said.popleft())

    # --- line --------------------------------------------------------------------------------------------------

    def carry_down(self, message: Any) -> None:
        """A message of the autopilot, on its way to the flight."""
        name, sent_s = message.get_type(), self._now_s
        if self.closed or self.killed:
            return
        fields = message.to_dict()
        for arrives_s in self.down.arrivals_s(sent_s):
            self.later(arrives_s + WIRE_S - sent_s, lambda: self._arrive(lambda: self.receive(name, fields, sent_s)))

    def carry_up(self, name: str, fields: Mapping[str, Any]) -> None:
        """A message of the flight, on its way to the autopilot."""
        if self.closed or self.killed:
            return
        for arrives_s in self.up.arrivals_s(self._now_s):
            self.later(arrives_s + WIRE_S - self._now_s, lambda: self._hear(name, fields))

    def _arrive(self, deliver: Callable[[], object]) -> None:
        if self._now_s >= self._stopped_until_s:
            deliver()
        elif len(self._queue) < QUEUE:
            self._queue.append(deliver)

    def _hear(self, name: str, fields: Mapping[str, Any]) -> None:
        handler = self.mock._on_message.get(name)
        if handler is not None and not self.mock.faults.deaf:
            handler(_Message(**fields))

    @property
    def stopped(self) -> bool:
        """True: no thread of the flight runs."""
        return self._now_s < self._stopped_until_s or self.killed or self.closed

    # --- faults ------------------------------------------------------------------------------------------------

    def stall(self, seconds: float, how: str) -> None:
        until_s = self._now_s + seconds
        if how == "loop" and seconds > HANG_S - 1.0:  # the watchdog ends it
            self.later(HANG_S - 1.0, self.kill)
        self._stalled_until_s = max(self._stalled_until_s, until_s)
        if how != "loop":
            self._stopped_until_s = max(self._stopped_until_s, until_s)
            self.later(seconds, self._go_on)

    def _go_on(self) -> None:
        if self._now_s < self._stopped_until_s:
            return
        waiting, self._queue = self._queue, []
        for deliver in waiting:
            deliver()

    def interrupt(self, name: str) -> None:
        handler = self.signals.get(signal.Signals[name])
        if handler is not None:
            handler()

    def kill(self) -> None:
        if not self.closed:
            self.killed = True
            self._stalled_until_s = self._now_s  # noticed where the loop waits next

    def fill_disk(self) -> None:
        self.disk_full = True


class _Message(SimpleNamespace):
    """A message of the flight as the autopilot's handlers read it."""

    def get_srcSystem(self) -> int:  # noqa: N802 - pymavlink's name
        return mavlink.OWN_SYSTEM_ID

    def get_header(self) -> Any:
        return SimpleNamespace(srcSystem=mavlink.OWN_SYSTEM_ID, srcComponent=dialect.MAV_COMP_ID_ONBOARD_COMPUTER)


def _in_world(kind: type[MavlinkMock], world: World) -> type[MavlinkMock]:
    """The autopilot on the wire of `world`, without thread and socket."""

    class InWorld(kind):  # type: ignore[misc,valid-type]
        def _send(self, message: Any) -> None:
            if self.faults.lets_out(message.get_type()):
                world.carry_down(message)

    return InWorld


class _Selector(selectors.SelectSelector):
    """Lets the world move on where the loop would wait."""

    def __init__(self, world: World) -> None:
        super().__init__()
        self._world = world

    def select(self, timeout: float | None = None) -> list[Any]:
        if timeout is None or timeout > 0.0:
            self._world.wait(timeout)
        else:
            self._world.be_stalled()
        return []


class _Loop(asyncio.SelectorEventLoop):
    """asyncio's loop on the clock of the world."""

    def __init__(self, world: World) -> None:
        super().__init__(_Selector(world))
        self._world = world
        world.woken = lambda: bool(self._ready)  # type: ignore[attr-defined]

    def time(self) -> float:
        return self._world.now_s

    def add_signal_handler(self, sig: int, callback: Callable[..., object], *args: Any) -> None:  # type: ignore[override]
        self._world.signals[sig] = lambda: self.call_soon(callback, *args)

    def remove_signal_handler(self, sig: int) -> bool:
        return self._world.signals.pop(sig, None) is not None


class _Link:
    """MAVSDK's link to the autopilot in the world: commands are repeated until they are acknowledged."""

    def __init__(self, world: World, evidence: Evidence) -> None:
        self.url = "simulated"
        self.own_system_id, self.system_id = mavlink.OWN_SYSTEM_ID, 1
        self.warnings: list[str] = []
        self.other_autopilots: list[int] = []
        self.on_reopened: Callable[[], None] = lambda: None
        self._world = world
        self._evidence = evidence
        self._answers: dict[int, list[asyncio.Future[int]]] = {}
        self._last: dict[str, tuple[float, Mapping[str, Any]]] = {}
        """Latest position and attitude, with the time at which they were sent."""

    async def open(self, messages: object, timeout_s: float) -> None: ...

    async def close(self) -> None: ...

    async def run(self, call: Callable[[], Any]) -> Any:
        result = call()
        return await result if inspect.isawaitable(result) else result

    def send(self, name: str, fields: Mapping[str, Any]) -> None:
        if name == "SET_ATTITUDE_TARGET":
            self._note(fields)
        self._world.carry_up(name, fields)

    async def command_once(self, number: int, *parameters: float, what: str) -> int:
        return await self.command(number, *parameters, what=what, tries=1)

    async def command(self, number: int, *parameters: float, what: str, tries: int = COMMAND_TRIES) -> int:
        fields = {f"param{i}": float(value) for i, value in enumerate((*parameters, *[0.0] * 7)[:7], start=1)}
        answer: asyncio.Future[int] = asyncio.get_running_loop().create_future()
        self._answers.setdefault(number, []).append(answer)
        try:
            for _ in range(tries):
                if what.startswith(("enter ", "arm", "take off")):
                    self._evidence.asked.append(Asked(self._world.now_s, what.removeprefix("enter ")))
                self._world.carry_up("COMMAND_LONG", {"command": number, **fields})
                done, _ = await asyncio.wait([answer], timeout=COMMAND_WAIT_S)
                if done:
                    return answer.result()
            raise LinkError(f"The autopilot was asked to {what}: no answer; check the link.")
        finally:
            self._answers[number].remove(answer)

    def read_parameter(self, name: str) -> float | int | None:
        value = self._world.mock.autopilot.parameters.get(name)
        return int(value) if value is not None and name in self._world.mock.manners.integer_parameters else value

    def write_parameter(self, name: str, value: float) -> None:
        self._world.mock.autopilot.parameters[name] = value

    def take_in(self, name: str, fields: Mapping[str, Any], sent_s: float) -> None:
        """Take in what the evidence and the commands need of a message that has arrived."""
        if name == "COMMAND_ACK":
            for answer in self._answers.get(fields["command"], []):
                if not answer.done():
                    answer.set_result(fields["result"])
        elif name in ("LOCAL_POSITION_NED", "ATTITUDE_QUATERNION"):
            self._last[name] = sent_s, fields

    def _note(self, fields: Mapping[str, Any]) -> None:
        """Note a setpoint, with the state that the flight has by now."""
        now_s = self._world.now_s
        nothing: tuple[float, Mapping[str, Any]] = (-math.inf, {})
        position_s, position = self._last.get("LOCAL_POSITION_NED", nothing)
        attitude_s, attitude = self._last.get("ATTITUDE_QUATERNION", nothing)
        values = {**{n: position.get(n) for n in ("x", "y", "z", "vx", "vy", "vz")}}
        values |= {n: attitude.get(n) for n in ("q1", "q2", "q3", "q4")}
        spoiled = [name for name, value in values.items() if value is None or not math.isfinite(value)]
        lateral = None
        if fields["type_mask"] & mavlink.ATTITUDE_TARGET_THRUST_BODY_SET:
            lateral = (fields["thrust_body"][0], fields["thrust_body"][1])
        target = AttitudeTarget(tuple(fields["q"]), fields["thrust"], lateral)
        self._evidence.sent.append(Sent(now_s, target, now_s - position_s, now_s - attitude_s, ", ".join(spoiled)))


class _Telemetry(Telemetry):
    """Telemetry whose waits are those of the flight's loop."""

    def wait_for(self, condition: Callable[[], bool], timeout_s: float) -> Any:  # awaited by `_Link.run`
        return self._poll(condition, timeout_s)

    async def _poll(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        running = asyncio.get_running_loop()
        end_s = running.time() + timeout_s
        while not condition():
            if running.time() >= end_s:
                return False
            await asyncio.sleep(0.01)
        return True


class _FullDisk:
    """File of a log on a disk that may fill up."""

    def __init__(self, file: Any, world: World) -> None:
        self._file, self._world = file, world

    def write(self, text: str) -> int:
        if self._world.disk_full:
            raise OSError(errno.ENOSPC, "No space left on device")
        return int(self._file.write(text))

    def __enter__(self) -> "_FullDisk":
        return self

    def __exit__(self, *error: object) -> None:
        self._file.close()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)


class _AutopilotInWorld(MavsdkAutopilot):
    """The product's adapter on the link of the world; a stall may hold it up before or after it looks at the state."""

    def __init__(self, world: World, link: _Link, telemetry: _Telemetry) -> None:
        super().__init__("udpin://127.0.0.1:14540", 1)
        self._link, self._telemetry = link, telemetry  # type: ignore[assignment]
        self._asker = SimpleNamespace(start=lambda: None, ident=None)  # type: ignore[assignment]
        self._world = world

    def keep_talking(self) -> None:
        """Talk as the adapter's thread and MAVSDK do, until the process ends."""
        world = self._world
        if world.killed or world.closed:
            return
        if not world.stopped:
            self._talk(world.now_s)
        world.later(round_trips.EVERY_S, self.keep_talking)

    def keep_alive(self) -> None:
        """Send a heartbeat every second, as MAVSDK's threads do."""
        world = self._world
        if world.killed or world.closed:
            return
        if not world.stopped:
            world.carry_up("HEARTBEAT", {"type": dialect.MAV_TYPE_ONBOARD_CONTROLLER})
        world.later(1.0, self.keep_alive)


def fly(sequence: Sequence, log_dir: Path) -> Evidence:
    """Fly a sequence, and watch until all is over."""
    plan = plan_of(sequence, log_dir)
    chance = random.Random(sequence.seed)
    world = World(sequence, chance)
    profile = world.profile
    with _on_the_clock_of(world):
        plain = profile.make(plan.body.vehicle, 1)
        plain.autopilot.parameters.update(sequence.parameters)
        world.mock = _in_world(type(plain), world)(plain.autopilot, 1)
        world.mock.autopilot.step(BOOTED_S)
        evidence = Evidence(profile.offboard, taken=world.taken, guards=plan.settings.guards)
        evidence.max_throttle = plan.settings.controller.max_throttle
        _fly(plan, sequence, world, evidence, log_dir, chance)
        _watch_the_rest(world, evidence)
    evidence.killed, evidence.disk_full = world.killed, world.disk_full
    _read_log(evidence, log_dir)
    return evidence


def _fly(
    plan: FlightPlan, sequence: Sequence, world: World, evidence: Evidence, log_dir: Path, chance: random.Random
) -> None:
    telemetry = _Telemetry(plan.body.vehicle.n_rotors)
    link = _Link(world, evidence)
    autopilot = _AutopilotInWorld(world, link, telemetry)
    known = frozenset(telemetry.messages)

    def receive(name: str, fields: Mapping[str, Any], sent_s: float) -> None:
        link.take_in(name, fields, sent_s)
        if name in known:
            telemetry.receive(name, fields, world.now_s)
        if name in ("HEARTBEAT", "CURRENT_MODE"):
            armed = bool(fields["base_mode"] & mavlink.MAV_MODE_FLAG_SAFETY_ARMED) if name == "HEARTBEAT" else None
            evidence.told.append(Told(world.now_s, telemetry.mode, armed))

    world.receive = receive
    world.advance(world.now_s + chance.uniform(0.0, 1.0))  # the flight's clock is not the autopilot's
    world.later(0.0, autopilot.keep_alive)
    asyncio_loop = _Loop(world)
    try:
        asyncio_loop.run_until_complete(_flight(plan, sequence, world, evidence, autopilot, log_dir))
    except Killed:
        pass
    except (FlightError, TimeoutError) as error:
        evidence.outcome = evidence.ended = str(error)
        evidence.has_begun = evidence.ticks > 0
    except Exception as error:
        evidence.failure = f"the process ended by {error!r}"
    finally:
        world.closed = True
        _bury(asyncio_loop)


async def _flight(
    plan: FlightPlan,
    sequence: Sequence,
    world: World,
    evidence: Evidence,
    autopilot: _AutopilotInWorld,
    log_dir: Path,
) -> None:
    await autopilot.connect()
    world.later(round_trips.EVERY_S, autopilot.keep_talking)
    await autopilot.request_telemetry()
    rate_hz = plan.settings.controller.rate_hz
    pilot = plan.pilot(autopilot.firmware.takes_off_itself, autopilot.firmware.stays_up)
    recorder = plan.recorder(log_dir, autopilot.description)
    recorder._file = _FullDisk(recorder._file, world)  # type: ignore[assignment]
    tally = Tally(1.0 / rate_hz)
    _plan_faults(sequence, world, evidence)
    began_s = world.now_s

    def watch(tick: Tick) -> None:
        evidence.ticks += 1
        evidence.noted += [Noted(world.now_s, event.what, event.answer) for event in tick.events]
        evidence.mission_flown = pilot.flight_s >= plan.mission.duration_s - 0.1
        if world.now_s > began_s + PATIENCE_S and tick.stage is FlightStage.RELEASED:
            world.interrupt("SIGTERM")  # whoever flies it now does not need the recording any more
        if world.now_s > began_s + HORIZON_S:
            raise RuntimeError(f"the flight goes on after {HORIZON_S:g} s, in {tick.stage.name}")

    try:
        with flight_loop.landing_on_signals(pilot):
            await flight_loop.fly(autopilot, pilot, rate_hz, [recorder, tally, watch])
    finally:
        if not world.killed:
            recorder.close(pilot.ended or "broken off")
    outcome = tally.outcome(pilot, recorder.path, recorder.problem)
    evidence.outcome = outcome.ended if not outcome.completed else COMPLETED


def _plan_faults(sequence: Sequence, world: World, evidence: Evidence) -> None:
    """Let the faults come at their times, those of the air after lift-off."""
    for fault in sequence.faults:
        if fault.early:
            world.later(fault.at_s, partial(KINDS[fault.kind].act, world, fault.size, fault.lasts_s))

    def look() -> None:
        if -world.mock.autopilot.body.position[2] < LIFTED_M:
            world.later(STEP_S, look)
            return
        evidence.lifted_s = world.now_s
        for fault in sequence.faults:
            if not fault.early:
                world.later(fault.at_s, partial(KINDS[fault.kind].act, world, fault.size, fault.lasts_s))

    look()


def _watch_the_rest(world: World, evidence: Evidence) -> None:
    """Watch until the vehicle stands disarmed, after the flight has ended."""
    autopilot, end_s = world.mock.autopilot, world.now_s + PATIENCE_S
    while world.now_s < end_s and (autopilot.armed or not autopilot.landed):
        world.advance(world.now_s + 0.1, wakes=False)
    world.advance(world.now_s + 0.5, wakes=False)
    evidence.at_rest = not autopilot.armed and autopilot.landed
    evidence.last_mode, evidence.armed_at_end = autopilot.mode, autopilot.armed


def _read_log(evidence: Evidence, log_dir: Path) -> None:
    logs = sorted(log_dir.glob("*.csv"))
    if not logs and evidence.has_begun:
        evidence.failure = evidence.failure or ("" if evidence.outcome else "there is no log")
    if not logs:
        return
    try:
        meta = yaml.safe_load(logs[0].with_suffix(".meta.yaml").read_text())
        evidence.ended = meta["ended"]
        evidence.rows = sum(1 for _ in logs[0].open()) - 1
    except (OSError, KeyError, TypeError, yaml.YAMLError) as error:
        evidence.failure = evidence.failure or f"the log cannot be read ({error!r})"


@contextmanager
def _on_the_clock_of(world: World) -> Iterator[None]:
    with ExitStack() as stack:
        for module in (flight_loop, mavsdk_autopilot, server):
            stack.enter_context(patching.patch.object(module, "time", world))
        yield


def _bury(loop: asyncio.AbstractEventLoop) -> None:
    """Let go of the tasks of a process that is gone: nothing of them leaves it any more."""
    tasks = asyncio.all_tasks(loop)

    async def cancelled() -> None:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    loop.run_until_complete(cancelled())
    loop.close()
