"""A simulated autopilot behind the port, in the process of the loop that flies it."""

import asyncio
from collections.abc import Callable, Iterable

from quadctl.errors import FlightError
from quadctl.flight.autopilot.firmware import Requirement
from quadctl.flight.autopilot.px4 import PX4
from quadctl.flight.pilot.guards import GuardLimits
from quadctl.flight.pilot.tick import Stage, Tick
from quadctl.flight.preflight.plan import FlightPlan
from quadctl.flight.preflight.preparation import prepare_flight
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.state import AttitudeTarget, Vec3, VehicleState
from tests.support.places import ROOT

TICK_S = 0.02
HURRY_HZ = 400.0
"""The simulated time of a tick passes at once, so the loop need not wait for it."""


class InProcess:
    """The port to a simulated autopilot whose time passes by one tick with every look at its state."""

    def __init__(self) -> None:
        self.px = SimulatedAutopilot(plan().body.vehicle)
        self.warnings: list[str] = []
        self.firmware = PX4
        self.requirements: list[Requirement] = []
        self.asked: list[str] = []
        self.sent: list[AttitudeTarget] = []
        self.told: list[tuple[str, Vec3]] = []
        self.before_send: Callable[[], None] = lambda: None
        self.land_hangs = False

    @property
    def description(self) -> str:
        return "a simulated PX4 in this process"

    async def connect(self) -> None: ...

    async def request_telemetry(self) -> None: ...

    async def close(self) -> None: ...

    async def parameters(self, names: Iterable[str]) -> dict[str, float]:
        return {name: self.px.parameters[name] for name in names if name in self.px.parameters}

    async def set_parameter(self, name: str, value: float) -> None:
        self.px.parameters[name] = value

    def state(self) -> VehicleState:
        self.px.step(self.px.time_s + TICK_S)
        return self.px.estimate()

    def tell(self, name: str, vector: Vec3) -> None:
        self.told.append((name, vector))

    def send(self, target: AttitudeTarget) -> None:
        self.before_send()
        self.sent.append(target)
        self.px.set_attitude_target(target)

    async def run_checks(self) -> None:
        self._ask("CHECKS", self.px.request_checks())

    async def arm(self) -> None:
        self._ask("ARM", self.px.request_arm())

    async def start_offboard(self) -> None:
        self._ask("OFFBOARD", self.px.request_mode("OFFBOARD"))

    async def take_off(self, height_m: float) -> None:
        raise AssertionError("a PX4 lifts off by targets")

    async def land(self) -> None:
        if self.land_hangs:
            self.asked.append("LAND")
            await asyncio.Event().wait()
        self._ask("LAND", self.px.request_mode("LAND"))

    async def hold(self) -> None:
        self._ask("HOLD", self.px.request_mode("HOLD"))

    def _ask(self, what: str, refusal: str | None) -> None:
        self.asked.append(what)
        if refusal is not None:
            raise FlightError(f"it refused {what}: {refusal}")


def plan() -> FlightPlan:
    made = prepare_flight(ROOT / "tests" / "support" / "hop.yaml", ROOT / "config" / "flight.yaml", None, None)
    guards = GuardLimits(max_tick_late_s=1.0)  # a busy machine is not what is tested here
    return made._replace(settings=made.settings.model_copy(update={"guards": guards}))


def in_flight(pilots: list[Tick]) -> bool:
    return sum(t.stage is Stage.FLY for t in pilots) > 50
