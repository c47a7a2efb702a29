"""What differs from one autopilot to the next on the wire: modes, streams, parameters, refusals."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from quadctl.state import VehicleState
from sitl.messages import Builder


@dataclass
class Stream:
    """One kind of message on its way out at its own interval."""

    build: Builder
    default_rate_hz: float
    """0: only when it is asked for."""
    part: str
    """The part of the estimate it carries: sent only when that is new, as autopilots do."""
    interval_s: float = math.nan
    due_s: float = 0.0
    sample_s: float = -math.inf

    def __post_init__(self) -> None:
        self.interval_s = 1.0 / self.default_rate_hz if self.default_rate_hz > 0.0 else math.inf

    def set_interval(self, microseconds: float, now_s: float) -> None:
        """MAV_CMD_SET_MESSAGE_INTERVAL: 0 is the default rate, -1 is off."""
        if microseconds == 0.0:
            self.__post_init__()
        else:
            self.interval_s = math.inf if microseconds < 0.0 else 1e-6 * microseconds
        self.due_s = now_s

    def take(self, estimate: VehicleState) -> bool:
        """Whether to send it now; notes that it is sent."""
        now_s, sample_s = estimate.time_s, estimate.received_s[self.part]
        if math.isinf(self.interval_s) or now_s < self.due_s or sample_s <= self.sample_s:
            return False
        self.due_s = max(self.due_s + self.interval_s, now_s)
        self.sample_s = sample_s
        return True


@dataclass(frozen=True)
class Manners:
    """The ways of one autopilot; a new one for each mock, because the streams are at work in it."""

    mav_autopilot: int
    custom_modes: Mapping[str, int]
    """`custom_mode` of the heartbeat, by name of the mode."""
    sub_mode_shift: int
    """Where parameters 2 and 3 of DO_SET_MODE go in the custom mode: parameter 2 at this bit, 3 eight bits above."""
    streams: dict[int, Stream]
    """By message id; HEARTBEAT comes by itself."""
    unknown_interval: int
    """MAV_RESULT for the interval of a message that it does not send."""
    refusal: int
    """MAV_RESULT of a request that it refuses, with a text that says why."""
    takes_off_by_command: bool
    integer_parameters: frozenset[str] = field(default_factory=frozenset)
    bytewise_integers: bool = False
    """Whether an integer's bytes travel in the float field, or its value."""
    capabilities: int = mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2 | mavlink.MAV_PROTOCOL_CAPABILITY_SET_ATTITUDE_TARGET
    version: int = 0
