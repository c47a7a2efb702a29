"""The port to an autopilot: the operations that a flight needs, for a real autopilot and for a simulated one."""

from collections.abc import Iterable, Sequence
from typing import Protocol

from quadctl.flight.autopilot.firmware import Firmware, Requirement
from quadctl.state import AttitudeTarget, Vec3, VehicleState
from quadctl.thrust_chain.chain import Addition


class Autopilot(Protocol):
    """An autopilot that flies attitude and throttle targets in its offboard mode.

    Requests return when the autopilot has accepted them and raise `FlightError` with its reason when it has not.
    """

    warnings: list[str]
    """One sentence for each thing that the autopilot does not provide and the flight can do without."""

    @property
    def description(self) -> str:
        """Kind and address of the autopilot, for the log."""
        ...

    @property
    def firmware(self) -> Firmware:
        """Description of its firmware; raises `LinkError` before it is connected."""
        ...

    @property
    def requirements(self) -> Sequence[Requirement]:
        """Parameters that must have certain values before a flight."""
        ...

    def thrust_additions(self, hover: float) -> list[Addition]:
        """Table of what the firmware adds to thrust, for a vehicle that hovers at the throttle `hover`."""
        ...

    async def connect(self) -> None:
        """Open the link and wait for the first heartbeat; raises `LinkError` with one sentence when none comes."""
        ...

    async def identity(self) -> str:
        """Name of the vehicle, by which it is told from others at the next contact; raises `LinkError` without one."""
        ...

    async def request_telemetry(self) -> None:
        """Ask for the message rates that control needs."""
        ...

    def state(self) -> VehicleState:
        """The latest state, at once; parts that never arrived are nan."""
        ...

    def tell(self, name: str, vector: Vec3) -> None:
        """Show a vector to ground stations, once; one that cannot be sent is lost."""
        ...

    def send(self, target: AttitudeTarget) -> None:
        """Put one target on the wire, at once, once: nothing may repeat it."""
        ...

    async def run_checks(self) -> None:
        """Run its own checks before arming, and say as texts which of them fail."""
        ...

    async def arm(self) -> None:
        """Arm the motors; nothing may repeat the request, as somebody may have disarmed them meanwhile."""
        ...

    async def start_offboard(self) -> None:
        """Enter the mode that follows our targets; where the targets lift off, a stream of them must be running."""
        ...

    async def leave_offboard(self) -> None:
        """Enter the mode that it was in before `start_offboard`, on the ground and disarmed."""
        ...

    async def take_off(self, height_m: float) -> None:
        """Begin to climb to `height_m` above the ground it stands on; nothing may repeat the request."""
        ...

    async def land(self) -> None:
        """Enter the autopilot's own land mode; nothing may repeat the request, as with `send`."""
        ...

    async def hold(self) -> None:
        """Hand over: enter the autopilot's own hold mode."""
        ...

    async def parameters(self, names: Iterable[str]) -> dict[str, float]:
        """Values of the autopilot's parameters by name; those that it does not have are left out."""
        ...

    async def set_parameter(self, name: str, value: float) -> None: ...

    async def close(self) -> None: ...
