"""Evidence of a flight: what left the flight, what reached it, and how its log ended; times on one clock."""

from dataclasses import dataclass, field
from typing import Any, NamedTuple

from quadctl.state import AttitudeTarget

from .stage import Taken


class Sent(NamedTuple):
    """A setpoint that left the flight, with what the flight had been told by then."""

    at_s: float
    target: AttitudeTarget
    position_age_s: float = 0.0
    """True age of the position that it was made from, s."""
    attitude_age_s: float = 0.0
    spoiled: str = ""
    """Part of the last position or attitude that was no number; empty: none."""


class Asked(NamedTuple):
    """A command that left the flight."""

    at_s: float
    what: str
    """`arm`, `take off`, or the name of a mode."""


class Told(NamedTuple):
    """News of the mode that reached the flight."""

    at_s: float
    mode: str | None
    """Mode; None where the message is not about it."""
    armed: bool | None


class Noted(NamedTuple):
    """An event of the flight's log."""

    at_s: float
    what: str
    answer: str


@dataclass
class Evidence:
    """Evidence of one flight."""

    offboard: str
    """Mode that follows targets."""
    has_begun: bool = True
    """False: it was refused, or ended by a fault, while the link was being opened."""
    lifted_s: float | None = None
    """Time at which the vehicle left the ground."""
    sent: list[Sent] = field(default_factory=list)
    asked: list[Asked] = field(default_factory=list)
    told: list[Told] = field(default_factory=list)
    noted: list[Noted] = field(default_factory=list)
    taken: list[Taken] = field(default_factory=list)
    """Modes that a person chose."""
    killed: bool = False
    disk_full: bool = False
    ended: str = ""
    """End of the flight in its sidecar."""
    outcome: str | None = None
    """End of the flight as its process says it; None: it did not end."""
    failure: str = ""
    """Error that ended the process, or a log that cannot be read."""
    rows: int = 0
    ticks: int = 0
    mission_flown: bool = False
    """True: the mission was flown to its end."""
    at_rest: bool = False
    """True: the vehicle stands disarmed in the end."""
    last_mode: str = ""
    armed_at_end: bool = False
    guards: Any = None
    """Limits of the flight's guards."""
    max_throttle: float = 0.9
    slack_s: float = 0.0
    """Time by which the machine may hold up what is seen here."""
