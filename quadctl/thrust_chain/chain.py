"""The description of a thrust chain, and the curve that both firmwares share."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from quadctl.numeric import Number, clip, sqrt
from quadctl.thrust_chain.atmosphere import Atmosphere

Parameters = Mapping[str, float]
"""Values of the firmware's parameters by name; those that are not known are missing."""

NAN = math.nan


class Ambient(NamedTuple):
    """Battery and air, which firmware compensates for; nan where they are not known: nothing is undone for them."""

    battery_v: Number = NAN
    density_ratio: Number = NAN
    """Density of the air over that of the standard atmosphere at sea level."""
    battery_scale: Number = NAN
    """Factor by which PX4 compensates the battery, as it says itself."""
    atmosphere: Atmosphere | None = None
    """Formula of the density ratio, where it is ArduPilot's."""


class Addition(NamedTuple):
    """One line of the table `what your autopilot adds`: change of the thrust by a parameter, as shares of it."""

    parameters: str
    """Names and values."""
    at_hover: float
    at_tilt: float
    """Change when the vehicle holds its height at TABLE_TILT_DEG."""
    remark: str
    """Name of the change, and the answer of quadctl to it."""


TABLE_TILT_DEG = 15.0


@dataclass(frozen=True)
class ThrustChain:
    """Functions of one firmware between the thrust of an attitude target and the motor outputs.

    A thrust is a share, 0..1, of the greatest one; an output is a share, 0..1, of the range of pulses.
    """

    parameters: Sequence[str]
    """Parameters that the functions read; a function leaves the thrust as it is where it lacks one."""
    defaults: Parameters
    """Values for the curve of the motors where the firmware does not tell them."""
    boost: Callable[[Number, Parameters], Number]
    """Factor by which the firmware multiplies the thrust at a cosine of the tilt."""
    thrust_of_output: Callable[[Number, Parameters, Ambient], Number]
    output_of_thrust: Callable[[Number, Parameters, Ambient], Number]
    """Inverse of `thrust_of_output`."""
    additions: Callable[[float, Parameters, Ambient], list[Addition]]
    """The table, for a vehicle that hovers at a thrust."""


PLAIN = ThrustChain(
    parameters=(),
    defaults={},
    boost=lambda upright, parameters: 1.0,
    thrust_of_output=lambda output, parameters, ambient: output,
    output_of_thrust=lambda thrust, parameters, ambient: thrust,
    additions=lambda hover, parameters, ambient: [],
)
"""Chain of a firmware that leaves the thrust as it is."""


def bent(output: Number, bend: float) -> Number:
    """Thrust of a motor whose thrust is part linear, part quadratic in its output: (1 - bend) u + bend u^2."""
    return (1.0 - bend) * output + bend * output * output


def unbent(thrust: Number, bend: float) -> Number:
    """Inverse of `bent`, for 0 <= thrust."""
    if abs(bend) < 1e-6:
        return thrust
    linear = 1.0 - bend
    return (sqrt(linear * linear + 4.0 * bend * thrust) - linear) / (2.0 * bend)


def said(parameters: Parameters, *names: str) -> str:
    """Names and values of parameters; `not told` for those that are missing."""
    return ", ".join(f"{name} {parameters[name]:.4g}" if name in parameters else f"{name} not told" for name in names)


def share(value: Number) -> Number:
    return clip(value, 0.0, 1.0)
