"""The stage on which faults act: a simulated autopilot on the wire, the line, the flight, and a person.

The faults of link and estimate that are there at a time add up; `Stage.refresh` puts their sum into effect.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from quadctl.sitl.server.faults import Distortion
from quadctl.sitl.server.server import MavlinkMock
from quadctl.state import VehicleState

from ..faults.line import Troubles
from ..faults.scene import Profile


class Way(NamedTuple):
    """Troubles of one direction of the line."""

    delay_s: float = 0.0
    jitter_s: float = 0.0
    loss: float = 0.0
    duplicates: float = 0.0


NO_TROUBLE = Way()


@dataclass(frozen=True)
class Trouble:
    """A fault of link or estimate that lasts for a time."""

    distort: Distortion | None = None
    withheld: frozenset[str] = frozenset()
    silent: bool = False
    deaf: bool = False
    refuse_modes: str = ""
    refuse_arming: str = ""
    estimator_ratio: float = 0.1
    down: Way = NO_TROUBLE
    up: Way = NO_TROUBLE


class Taken(NamedTuple):
    """A mode that a person chose."""

    at_s: float
    mode: str


class Killed(BaseException):
    """The flight's process was killed."""


@dataclass
class Stage(ABC):
    """World that the faults act on; times are seconds on the clock of `now_s`."""

    mock: MavlinkMock
    profile: Profile
    down: Troubles
    up: Troubles
    troubles: list[Trouble] = field(default_factory=list)
    taken: list[Taken] = field(default_factory=list)
    """Modes that the person chose, in order."""
    killed: bool = False
    ended_by_person: bool = False
    """True: someone asked the flight to land, or ended its process."""
    disk_full: bool = False

    @property
    @abstractmethod
    def now_s(self) -> float: ...

    @abstractmethod
    def later(self, after_s: float, action: Callable[[], object]) -> None:
        """Do `action` after so many seconds from now."""

    @abstractmethod
    def stall(self, seconds: float, how: str) -> None:
        """Stall the flight: its `loop`, its `interpreter` or the whole `process`."""

    @abstractmethod
    def interrupt(self, name: str) -> None:
        """Send the signal of that name to the flight."""

    @abstractmethod
    def kill(self) -> None: ...

    @abstractmethod
    def fill_disk(self) -> None:
        """Let the log take no more from now on."""

    def begin(self, trouble: Trouble, lasts_s: float) -> None:
        """Let a trouble begin, and end after `lasts_s`."""
        self.troubles.append(trouble)
        self.refresh()
        if math.isfinite(lasts_s):
            self.later(lasts_s, lambda: self.end(trouble))

    def end(self, trouble: Trouble) -> None:
        self.troubles.remove(trouble)
        self.refresh()

    def refresh(self) -> None:
        """Put the sum of all troubles into effect."""
        there, faults = self.troubles, self.mock.faults
        faults.distort = _one_after_the_other([t.distort for t in there if t.distort is not None])
        faults.withheld = frozenset().union(*(t.withheld for t in there))
        faults.silent = any(t.silent for t in there)
        faults.deaf = any(t.deaf for t in there)
        faults.refuse_modes = next((t.refuse_modes for t in there if t.refuse_modes), "")
        faults.refuse_arming = next((t.refuse_arming for t in there if t.refuse_arming), "")
        faults.estimator_ratio = max((t.estimator_ratio for t in there), default=0.1)
        for way, of in ((self.down, [t.down for t in there]), (self.up, [t.up for t in there])):
            way.delay_s = sum(w.delay_s for w in of)
            way.jitter_s = max((w.jitter_s for w in of), default=0.0)
            way.loss = 1.0 - math.prod(1.0 - w.loss for w in of)
            way.duplicates = max((w.duplicates for w in of), default=0.0)

    def take_mode(self, mode: str) -> None:
        """The person with the switch chooses a mode; one that flies by targets is refused where none come."""
        if self.mock.autopilot.armed and self.mock.autopilot.request_mode(mode) is None:
            self.taken.append(Taken(self.now_s, mode))


def _one_after_the_other(distortions: Sequence[Distortion]) -> Distortion:
    def distort(estimate: VehicleState) -> VehicleState:
        for distortion in distortions:
            estimate = distortion(estimate)
        return estimate

    return distort
