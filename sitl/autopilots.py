"""The autopilots that can be simulated, by the name that `quadctl fly --sitl --autopilot` takes.

A new autopilot is a subclass of `MavlinkMock` in a file of `server/`, which names the rules that it obeys, and a line
here. The classes are named, not imported, because they load pymavlink, which flights in lockstep do without.
"""

import enum
import pkgutil
from typing import TYPE_CHECKING, Self

if TYPE_CHECKING:
    from quadctl.sitl.server.server import MavlinkMock


class Simulated(enum.StrEnum):
    """Name of a simulated autopilot, and the class that puts it on the wire, as `module:class`."""

    path: str

    def __new__(cls, name: str, path: str) -> Self:
        member = str.__new__(cls, name)
        member._value_, member.path = name, path
        return member

    PX4 = "px4", "quadctl.sitl.server.px4:MavlinkPx4"
    ARDUPILOT = "ardupilot", "quadctl.sitl.server.ardupilot:MavlinkArduPilot"

    @property
    def on_the_wire(self) -> "type[MavlinkMock]":
        """The class that puts it on the wire."""
        kind: type[MavlinkMock] = pkgutil.resolve_name(self.path)
        return kind
