"""The description of a simulated autopilot on the wire: modes, streams, parameters, refusals."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from quadctl.sitl.server.messages import Builder
from quadctl.state import VehicleState
from quadctl.vehicle import Vehicle


@dataclass
class Stream:
    """One kind of message, sent at its own interval."""

    build: Builder
    default_rate_hz: float
    """Rate without a request, Hz; 0: only when it is asked for."""
    part: str
    """Part of the estimate that it carries; it is sent only when that is new, as autopilots do."""
    interval_s: float = math.nan
    due_s: float = 0.0
    sample_s: float = -math.inf

    def __post_init__(self) -> None:
        self.interval_s = 1.0 / self.default_rate_hz if self.default_rate_hz > 0.0 else math.inf

    def set_interval(self, microseconds: float, now_s: float) -> None:
        """Set the interval as MAV_CMD_SET_MESSAGE_INTERVAL does: 0 is the default rate, -1 is off."""
        if microseconds == 0.0:
            self.__post_init__()
        else:
            self.interval_s = math.inf if microseconds < 0.0 else 1e-6 * microseconds
        self.due_s = now_s

    def take(self, estimate: VehicleState) -> bool:
        """True when it is due; the message then counts as sent."""
        now_s, sample_s = estimate.time_s, estimate.received_s[self.part]
        if now_s < self.due_s or sample_s <= self.sample_s or math.isinf(self.interval_s):
            return False
        self.due_s = max(self.due_s + self.interval_s, now_s)
        self.sample_s = sample_s
        return True


@dataclass
class ModeStream(Stream):
    """CURRENT_MODE as PX4 sends it: at its own interval, whatever is asked for, and soon after a change."""

    change_s: float = 0.06
    """Time after a change of mode within which it is sent."""
    mode: str = ""

    def set_interval(self, microseconds: float, now_s: float) -> None:
        """Keep the interval; the request is accepted all the same."""

    def take(self, estimate: VehicleState) -> bool:
        if estimate.mode != self.mode:
            self.mode = estimate.mode
            self.due_s = min(self.due_s, estimate.time_s + self.change_s)
        return super().take(estimate)


@dataclass(frozen=True)
class Manners:
    """Description of one autopilot on the wire; each mock needs a new one, as the streams hold their state."""

    mav_autopilot: int
    custom_modes: Mapping[str, int]
    """`custom_mode` of the heartbeat, by name of the mode."""
    sub_mode_shift: int
    """First bit of parameter 2 of DO_SET_MODE in the custom mode; parameter 3 begins eight bits above."""
    streams: dict[int, Stream]
    """Streams by message id, without HEARTBEAT, which every autopilot sends."""
    unknown_interval: int
    """MAV_RESULT for the interval of a message that it does not send."""
    refusal: int
    """MAV_RESULT of a request that it refuses, with a text that says why."""
    takes_off_by_command: bool
    motor_test_output: Callable[[float], float]
    """Function from the share that a motor test asks for to the motor output of `SimulatedAutopilot`."""
    tests_motors_clockwise: bool
    """True: a motor test counts the motors clockwise from the front."""
    integer_parameters: frozenset[str] = field(default_factory=frozenset)
    texts_for_stations: bool = False
    """True: texts go only to links on which a ground station's heartbeat was heard."""
    announces_unknown: bool = False
    """True: a text says that a message which was asked for is unknown."""
    sends_current_mode: bool = False
    """True: CURRENT_MODE comes every half second, and after a change."""
    acknowledges_modes_twice: bool = False
    """True: a request for a mode is acknowledged twice, one for a pilot's mode that is refused first as accepted."""
    fixed_heartbeats: bool = False
    """True: another interval of the heartbeats is refused."""
    bytewise_integers: bool = False
    """True: the bytes of an integer parameter travel in the float field; False: its value."""
    takes_body_thrust: bool = False
    """True: the thrust of a target may have three dimensions (thrust_body); False: its thrust is a number."""
    capabilities: int = mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2 | mavlink.MAV_PROTOCOL_CAPABILITY_SET_ATTITUDE_TARGET
    version: int = 0

    def tested_rotor(self, number: int, vehicle: Vehicle) -> int:
        """Index of the rotor that a motor test calls `number`; -1 where there is none."""
        places = [rotor.position_m for rotor in vehicle.rotors]
        rotors = list(range(len(places)))
        if self.tests_motors_clockwise:
            rotors.sort(key=lambda i: math.atan2(places[i][1], places[i][0]) % math.tau)
        return rotors[number - 1] if 0 < number <= len(rotors) else -1
