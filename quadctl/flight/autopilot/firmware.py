"""The description of an autopilot: everything that differs from one to the next is a `Firmware`, in a file of its own.

A new autopilot is a new file beside px4.py and ardupilot.py, and a line in firmwares.py.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeAlias

from quadctl.thrust_chain.atmosphere import Version
from quadctl.thrust_chain.chain import PLAIN, ThrustChain
from quadctl.vehicle import Vehicle
from quadctl.words import Facts, Template, When, Words

MAX_HOVER_DIFFERENCE = 0.15
"""Largest difference of the hover throttle in the autopilot's parameters from that of the vehicle file; beyond it one
of them is wrong."""
UNKNOWN = "it does something unknown"
Meaning: TypeAlias = Mapping[int, str] | Callable[[float], Any]
"""Meaning of the values of a parameter; one that a mapping lacks is `UNKNOWN`."""
_WORDS = Words()


@dataclass(frozen=True, slots=True)
class Stream:
    """A message that the autopilot is asked to send."""

    name: str
    message_id: int
    rate_hz: float
    required: bool = False
    """True: control cannot fly without it."""
    alternative: bool = False
    """True: one of several sources of the same quantity, whose refusal is not reported."""
    without: str = ""
    """Sentence about a flight without it, for the warning."""


@dataclass(frozen=True, slots=True)
class Requirement:
    """A parameter that must have a certain value, or certain bits, before a flight."""

    parameter: str
    to_meet: Callable[[float], float]
    """Function from its present value to the required one."""
    because: str
    """Consequence if it is not met: the end of the sentence `GUID_OPTIONS is 0, expected 8: ...`."""
    advice: bool = False
    """True: recommended only; a flight without it is warned, not refused."""
    failsafe: bool = False
    """True: without it nobody lands the vehicle after quadctl has died; refused unless the user accepts that."""
    finding: Template = ""
    """Template of its `value` and the `meaning` of that; empty: the value alone says it."""
    meaning: Meaning | None = None

    def met(self, value: float) -> bool:
        return self.to_meet(value) == value

    def said(self, value: float) -> str:
        """Parameter and value, in a sentence where there is one."""
        if not self.finding:
            return f"{self.parameter} = {value:.7g}"
        return f"{self.parameter}: {_WORDS.say(self.finding, {'value': value, 'meaning': _meant(self.meaning, value)})}"


class Renamed(NamedTuple):
    """The name of a parameter in newer versions."""

    name: str
    since: Version
    """Version that has it, and not the older one any more."""
    unit: float = 1.0
    """Its unit, in units of the older one: 100 where centimetres have become metres."""


@dataclass(frozen=True, slots=True)
class Check:
    """A parameter that is judged before a flight, which is warned of a poor value, or refused."""

    parameter: str
    finding: Template
    """Template of its `value`, the `meaning` of that, and the `vehicle`."""
    poor: Callable[[float, Vehicle], bool]
    """Function from value and vehicle: True where the value is poor for this vehicle."""
    objection: Template
    """Template of the same about a poor value."""
    meaning: Meaning | None = None
    refuses: bool = False
    """True: a flight is refused for it."""

    def said(self, value: float, vehicle: Vehicle) -> str:
        """Sentence about its value."""
        return f"{self.parameter}: {_WORDS.say(self.finding, self._facts(value, vehicle))}"

    def objected(self, value: float, vehicle: Vehicle) -> str | None:
        """Reason why the value is poor for this vehicle, or None."""
        return _WORDS.say(self.objection, self._facts(value, vehicle)) if self.poor(value, vehicle) else None

    def _facts(self, value: float, vehicle: Vehicle) -> Facts:
        return {"value": value, "meaning": _meant(self.meaning, value), "vehicle": vehicle}


@dataclass(frozen=True)
class Firmware:
    """Description of one autopilot on the MAVLink wire."""

    name: str
    mav_autopilot: int
    """MAV_AUTOPILOT of its heartbeat."""
    modes: Mapping[str, int]
    """`custom_mode` of its heartbeat, by the autopilot's own name of the mode."""
    unknown_mode: Callable[[int], str]
    """Name of a `custom_mode` that is not among `modes`."""
    set_mode_parameters: Callable[[int], tuple[float, float]]
    """Parameters 2 and 3 of DO_SET_MODE for a `custom_mode`."""
    offboard_mode: str
    """Name of the mode that follows attitude targets."""
    land_mode: str
    hold_mode: str
    takes_off_itself: bool
    """True: lift-off is a command of its own, before the first target; False: the targets lift it off."""
    stays_up: bool
    """True: without targets it stays in the air for as long as it hears our heartbeats; False: it lands or returns."""
    streams: Sequence[Stream]
    tells_readiness: Callable[[str], bool]
    """Function from its mode: True when the pre-arm bit of SYS_STATUS says in this mode if offboard could be armed."""
    lists_prearm: bool
    """True: SYS_STATUS lists the pre-arm check as present; False: only its health bit tells."""
    heartbeat_type: int
    """MAV_TYPE of our heartbeats: that of a ground station where texts go only to links on which one is heard."""
    disarming_text: str
    """Beginning of the text that says at once that it is disarmed; empty where heartbeats come soon enough."""
    tells_aids: bool
    """True: SYS_STATUS and GPS_RAW_INT tell if GPS or motion capture work; its estimator does not."""
    thrust_chain: ThrustChain = PLAIN
    """Functions between the throttle target and the motor outputs that it reports."""
    renamed: Mapping[str, Renamed] = field(default_factory=dict)
    """Newer names of parameters: an autopilot is asked for the name of its version first, and then for the other."""
    requirements: Callable[[int], Sequence[Requirement]] = lambda own_system_id: ()
    """Function from quadctl's own system id to the parameters that must have certain values before a flight."""
    checks: Sequence[Check] = ()
    """Parameters that are judged before a flight, besides the requirements."""
    serial_parameters: Sequence[str] = ()
    """Parameters that make it speak MAVLink on its serial port for a companion, and at which baud rate."""
    rotor_axis_parameters: Callable[[int], tuple[str, str, str]] | None = None
    """Function from the number of a rotor, from 0, to the parameters of its thrust axis, FRD, by which it mixes lateral
    force; None: it has no setpoint of lateral force."""
    attitude_parameters: Sequence[str] = ()
    """Parameters on which the answer of the attitude to its setpoint depends."""
    rate_limits: Sequence[str] = ()
    """Parameters that limit the rates about roll and pitch, deg/s; 0 is no limit."""
    tests_motors_clockwise: bool = False
    """True: a motor test counts the motors clockwise from the front, not by their numbers."""
    throttle_bent_by: str = ""
    """Parameter that bends the throttle target on its way to the motor output, but not a motor test; 0 is no bend."""

    def mode_name(self, custom_mode: int) -> str:
        """Name of a HEARTBEAT's `custom_mode`."""
        names = (name for name, number in self.modes.items() if number == custom_mode)
        return next(names, self.unknown_mode(custom_mode))


def _meant(meaning: Meaning | None, value: float) -> Any:
    if isinstance(meaning, Mapping):
        return meaning.get(round(value), UNKNOWN)
    return None if meaning is None else meaning(value)


def above_ceiling(unit_m: float) -> Callable[[float, Vehicle], bool]:
    """Function that tells whether a height, in units of `unit_m`, reaches the ceiling over a vehicle, if it has one."""
    return lambda height, vehicle: vehicle.ceiling_m is not None and unit_m * height >= vehicle.ceiling_m


def hover_throttle_check(parameter: str) -> Check:
    """Check of the `parameter` that holds the throttle of hover, 0..1, against the vehicle file."""
    return Check(
        parameter,
        "hovers at {value:.2f}, the vehicle file at {vehicle.hover_throttle:.2f}",
        lambda theirs, vehicle: abs(theirs - vehicle.hover_throttle) > MAX_HOVER_DIFFERENCE,
        "one of them is wrong",
    )


def rotor_count_check(parameter: str, count: Callable[[float], int | None]) -> Check:
    """Check of the `parameter` that says how many rotors the autopilot drives (None: it does not) against the vehicle
    file."""
    return Check(
        parameter,
        When("meaning", "{meaning} rotors ({value:g})", "{value:g}, of an unknown number of rotors"),
        lambda value, vehicle: count(value) not in (None, vehicle.n_rotors),
        "the vehicle file '{vehicle.name}' has {vehicle.n_rotors}",
        meaning=count,
        refuses=True,
    )


def share_of_pulse(value: float) -> float:
    """Share, 0..1, of the usual range of pulses, 1000 to 2000 us; a value that is a share already is only clipped."""
    return min(max((value - 1000.0) / 1000.0, 0.0), 1.0) if value > 1.0 else max(value, 0.0)
