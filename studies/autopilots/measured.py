"""The files of measured behaviour, one for each autopilot, beside the scripts that start the real simulators."""

from quadctl.settings import Settings, load
from quadctl.sitl.rules.copter import SimulatedCopter
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.sitl.server.ardupilot import MavlinkArduPilot
from quadctl.sitl.server.px4 import MavlinkPx4
from quadctl.sitl.server.server import MavlinkMock
from quadctl.sitl.vehicle.hidden import HiddenTruth, load_hidden
from quadctl.vehicle import load_vehicle
from studies.page import ROOT

NAMES = ("px4", "ardupilot")
_RULES = {"px4": SimulatedAutopilot, "ardupilot": SimulatedCopter}
_WIRE = {"px4": MavlinkPx4, "ardupilot": MavlinkArduPilot}


class Fact(Settings):
    """One measured value of a real autopilot."""

    what: str
    value: str | float
    unit: str = ""
    source: str
    probe: str = ""
    """Name of the probe that measures the same on the mock; empty: the mock does not simulate it."""
    low: float | None = None
    high: float | None = None
    """Bounds of the mock's value; where there are none, it is the same word."""

    def is_met(self, found: str | float) -> bool:
        if self.low is None or self.high is None:
            return found == self.value
        return self.low <= float(found) <= self.high


class Measured(Settings):
    """Content of `measured.yaml`."""

    version: str
    mock: str
    """File of the hidden truth that the mock obeys, in the same folder."""
    facts: list[Fact]
    unknown: list[str]


def load_measured(name: str) -> Measured:
    return load(ROOT / "sitl" / name / "measured.yaml", Measured)


def mock(
    name: str,
    seed: int = 1,
    vehicle: str = "vehicle.yaml",
    truth: HiddenTruth | None = None,
    rules: type[SimulatedAutopilot] | None = None,
) -> SimulatedAutopilot:
    """Simulated autopilot that behaves as measured, with a vehicle and the parameters of the real simulator.

    `truth` takes the place of what it hides as measured, and `rules` of those of the version that was measured most.
    """
    folder = ROOT / "sitl" / name
    source = folder / load_measured(name).mock
    simulated = (rules or _RULES[name])(load_vehicle(folder / vehicle), truth or load_hidden(source), seed, str(source))
    if isinstance(simulated, SimulatedCopter):
        for line in (folder / "quadctl.parm").read_text().splitlines():
            key, _, value = line.partition(" ")
            if key in simulated.parameters:
                simulated.parameters[key] = float(value)
    return simulated


def on_the_wire(simulated: SimulatedAutopilot, name: str) -> MavlinkMock:
    """The same with its manners on the wire, not started."""
    return _WIRE[name](simulated)
