"""Decisions of one tick of a flight: the types that pilot, loop and listeners share."""

import enum
from typing import NamedTuple

from quadctl.control import ControlOutput
from quadctl.flight.model_watch.watch import NO_ERROR, ModelError
from quadctl.state import AttitudeTarget, Setpoint, StatusText, VehicleState


class Stage(enum.Enum):
    """Stage of a flight."""

    WAIT = "waiting for telemetry"
    STREAM = "streaming idle setpoints"
    START = "offboard and arming"
    STAND_DOWN = "leaving offboard"
    SPOOL_UP = "spooling up"
    CLIMB = "taking off by the autopilot"
    FLY = "flying"
    LAND = "landing"
    RELEASED = "released"
    DONE = "done"


class Request(enum.Enum):
    """Request of the pilot to the autopilot; carried out beside the loop."""

    OFFBOARD = "enter offboard"
    LEAVE_OFFBOARD = "leave offboard"
    CHECKS = "run its checks"
    ARM = "arm"
    TAKE_OFF = "take off"
    LAND = "land"


class Event(NamedTuple):
    """Event for the log: a guard's answer, a wish to land, a refusal."""

    time_s: float
    what: str
    answer: str
    guard: str = ""
    """Name of the `Guard` whose limit was passed; empty where it was none of them."""
    kind: str = ""
    """Name of its `reasons.Kind`, in small letters."""


class Decision(NamedTuple):
    """Decision of one stage about one state."""

    target: AttitudeTarget | None = None
    """Target to be sent now; None: send nothing."""
    requests: tuple[Request, ...] = ()
    setpoint: Setpoint | None = None
    output: ControlOutput | None = None


class Tick(NamedTuple):
    """Decision of one tick, with what led to it."""

    time_s: float
    stage: Stage
    phase: str
    target: AttitudeTarget | None
    """Target to be sent now; None: send nothing."""
    requests: tuple[Request, ...]
    state: VehicleState
    setpoint: Setpoint | None
    output: ControlOutput | None
    ground_down_m: float
    late_s: float
    events: tuple[Event, ...] = ()
    texts: tuple[StatusText, ...] = ()
    """Texts of the autopilot that are new; each is an event too."""
    model_error: ModelError = NO_ERROR
    """Error of the model that flies."""
