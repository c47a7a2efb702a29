"""Parameters that quadctl has changed on an autopilot, with their old values, in a file beside the logs.

The file is written before a parameter is changed and goes away when it is restored. So it outlives a flight that was
killed, and the next contact with that vehicle can tell, and restore. Each vehicle has an entry of its own: values of
one are never offered to another.
"""

import math
import os
from collections.abc import Callable
from pathlib import Path

import yaml

from quadctl.errors import FlightError
from quadctl.flight.autopilot.port import Autopilot
from quadctl.flight.preflight.facts import Kind
from quadctl.settings import Settings, load
from quadctl.words import Fact, fact

FILE_NAME = "changed_parameters.yaml"


class Change(Settings):
    """Old and new value of one parameter."""

    was: float
    set_to: float


class _Content(Settings):
    vehicles: dict[str, dict[str, Change]]


class ChangedParameters:
    """The entry of one vehicle in the file of one folder."""

    def __init__(self, folder: Path, vehicle: str) -> None:
        """`vehicle` is its name, as `Autopilot.identity` gives it."""
        self.path = folder / FILE_NAME
        self.vehicle = vehicle

    @property
    def others(self) -> list[str]:
        """Other vehicles with changes that were not undone."""
        return sorted(self._all().keys() - {self.vehicle})

    def read(self) -> dict[str, Change]:
        """Changes that were not undone, by parameter; raises SettingsError for a file that is not one of these."""
        return dict(self._all().get(self.vehicle, {}))

    def note(self, name: str, change: Change) -> None:
        """Write down a change that is about to be made; raises FlightError when that is not possible."""
        self._write(self.read() | {name: change})

    def forget(self, name: str) -> None:
        """Remove a parameter that is restored."""
        self._write({other: change for other, change in self.read().items() if other != name})

    def _all(self) -> dict[str, dict[str, Change]]:
        return dict(load(self.path, _Content).vehicles) if self.path.is_file() else {}

    def _write(self, changes: dict[str, Change]) -> None:
        vehicles = {name: entry for name, entry in (self._all() | {self.vehicle: changes}).items() if entry}
        try:
            if not vehicles:
                self.path.unlink(missing_ok=True)
                return
            self.path.parent.mkdir(parents=True, exist_ok=True)
            new = self.path.with_suffix(".new")
            with new.open("w") as file:
                file.write("# Parameters that quadctl has changed, by vehicle; --restore-params restores them.\n")
                yaml.safe_dump(_Content(vehicles=vehicles).model_dump(), file)
                file.flush()
                os.fsync(file.fileno())
            new.replace(self.path)
        except OSError as error:
            raise FlightError(f"{self.path}: cannot be written for the old parameters ({error.strerror})") from None


def left_behind(name: str, change: Change) -> Fact:
    """Fact about a change that an earlier flight did not undo."""
    return fact(Kind.LEFT_BEHIND, name=name, set_to=change.set_to, was=change.was)


async def still_changed(autopilot: Autopilot, kept: ChangedParameters) -> dict[str, Change]:
    """Parameters that have the value that an earlier flight gave them and did not undo.

    The file forgets those that somebody has restored since; the others were set anew.
    """
    changes = kept.read()
    values = await autopilot.parameters(changes)
    for name in values:
        if _alike(values[name], changes[name].was):
            kept.forget(name)
    return {name: changes[name] for name in values if _alike(values[name], changes[name].set_to)}


def _alike(one: float, other: float) -> bool:
    """True for the same value, after its way through 32 bits."""
    return math.isclose(one, other, rel_tol=1e-6)


async def restore(
    autopilot: Autopilot, changes: dict[str, Change], kept: ChangedParameters | None, say: Callable[[str], None]
) -> None:
    """Restore parameters, but not while the vehicle is armed: they must not change under whoever flies now."""
    for name, change in changes.items():
        by_hand = f"{name} could not be restored; set it to {change.was:.7g} by hand"
        if kept is not None:
            by_hand += ", or let --restore-params do it"
        if autopilot.state().armed:
            say(f"{by_hand}: the vehicle is still armed.")
            continue
        try:
            await autopilot.set_parameter(name, change.was)
        except FlightError as error:
            say(f"{by_hand}: {error}")
        else:
            say(f"{name} is {change.was:.7g} again.")
            if kept is not None:
                kept.forget(name)
