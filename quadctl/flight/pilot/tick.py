"""What one tick of a flight decides: the words that pilot, loop and listeners share."""

import enum
from typing import NamedTuple

from quadctl.control import ControlOutput
from quadctl.state import AttitudeTarget, Setpoint, VehicleState


class Stage(enum.Enum):
    """Where the flight is."""

    WAIT = "waiting for telemetry"
    STREAM = "streaming idle setpoints"
    START = "offboard and arming"
    SPOOL_UP = "spooling up"
    CLIMB = "taking off by the autopilot"
    FLY = "flying"
    LAND = "landing"
    RELEASED = "released"
    DONE = "done"


class Request(enum.Enum):
    """What the pilot wants the autopilot to do; carried out beside the loop."""

    OFFBOARD = "enter offboard"
    ARM = "arm"
    TAKE_OFF = "take off"
    LAND = "land"


class Event(NamedTuple):
    """Something that a log must explain: a guard's answer, a wish, a refusal."""

    time_s: float
    what: str
    answer: str


class Decision(NamedTuple):
    """What one stage makes of one state."""

    target: AttitudeTarget | None = None
    """To be sent now; None: silence."""
    requests: tuple[Request, ...] = ()
    setpoint: Setpoint | None = None
    output: ControlOutput | None = None


class Tick(NamedTuple):
    """What one tick decided."""

    time_s: float
    stage: Stage
    phase: str
    target: AttitudeTarget | None
    """To be sent now; None: silence."""
    requests: tuple[Request, ...]
    state: VehicleState
    setpoint: Setpoint | None
    output: ControlOutput | None
    ground_down_m: float
    late_s: float
    events: tuple[Event, ...] = ()
