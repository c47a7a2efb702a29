"""Parameters written to an autopilot over a link: shown, asked for, read back, and undone where that is wanted."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from quadctl.errors import FlightError
from quadctl.export.autopilot import Dialect, Present, Row
from quadctl.flight.autopilot.mavsdk_autopilot import MavsdkAutopilot
from quadctl.flight.preflight.changed_parameters import FILE_NAME, Change, ChangedParameters, restore
from quadctl.flight.realtime import run

Say = Callable[[str], None]


def present_parameters(url: str, dialect: Dialect, asked: Sequence[str] | None = None) -> Present:
    """Values, on the vehicle at `url`, of the parameters that an export is about: `asked`, or those of a model.

    Raises
    ------
    LinkError
        No autopilot answers.
    FlightError
        It is another kind of autopilot.
    """

    async def ask() -> Present:
        autopilot = await _connected(url, dialect)
        try:
            return Present(await autopilot.parameters(dialect.asked if asked is None else asked), url, is_whole=True)
        finally:
            await autopilot.close()

    return run(ask())


def write_parameters(url: str, dialect: Dialect, rows: Sequence[Row], kept: Path, say: Say) -> None:
    """Set what the rows tell; the old values are written to the folder `kept` before anything is changed.

    Raises
    ------
    LinkError
        No autopilot answers.
    FlightError
        It is another kind of autopilot, it is armed, or it does not confirm a parameter.
    """

    async def write() -> None:
        autopilot = await _connected(url, dialect)
        try:
            present = await autopilot.parameters([row.name for row in rows])
            _require_disarmed(autopilot)
            changed = ChangedParameters(kept, await autopilot.identity())
            await _set(autopilot, _wanted(rows), present, changed, say)
        finally:
            await autopilot.close()

    run(write())


def undo(url: str, dialect: Dialect, kept: Path, say: Say) -> None:
    """Restore the values of before `write_parameters`.

    Raises
    ------
    LinkError
        No autopilot answers.
    FlightError
        It is another kind of autopilot, or nothing is kept in that folder for this vehicle.
    """
    path = kept / FILE_NAME
    if not path.is_file():
        raise FlightError(f"{path}: there is no such file of old values, so there is nothing to undo")

    async def put_back() -> None:
        autopilot = await _connected(url, dialect)
        try:
            file = ChangedParameters(kept, await autopilot.identity())
            changes = file.read()
            if not changes:
                others = ", ".join(f"'{name}'" for name in file.others)
                raise FlightError(f"{path}: holds old values of {others}, expected some of '{file.vehicle}'")
            await restore(autopilot, changes, file, say)
        finally:
            await autopilot.close()

    run(put_back())


async def _connected(url: str, dialect: Dialect) -> MavsdkAutopilot:
    autopilot = MavsdkAutopilot(url, n_rotors=4)
    await autopilot.connect()
    if not autopilot.description.startswith(dialect.name):
        await autopilot.close()
        raise FlightError(f"{autopilot.description} is there, expected {dialect.name}, whose parameters these are")
    return autopilot


def _require_disarmed(autopilot: MavsdkAutopilot) -> None:
    if autopilot.state().armed:
        raise FlightError(f"{autopilot.description} is armed: parameters are written to a vehicle that is disarmed")


def _wanted(rows: Sequence[Row]) -> dict[str, float]:
    return {row.name: row.to_write for row in rows if row.to_write is not None}


async def _set(
    autopilot: MavsdkAutopilot,
    wanted: Mapping[str, float],
    present: Mapping[str, float],
    kept: ChangedParameters,
    say: Say,
) -> None:
    before = kept.read()
    for name, value in wanted.items():
        if name not in present:
            say(f"{name} is not set: {autopilot.description} does not tell it.")
            continue
        # After two exports without an undo, the value to go back to is the oldest.
        kept.note(name, Change(was=before[name].was if name in before else present[name], set_to=value))
        await autopilot.set_parameter(name, value)
        found = (await autopilot.parameters([name])).get(name)
        if found is None or abs(found - value) > 1e-4 * max(abs(value), 1.0):
            raise FlightError(f"{name} was set to {value:.6g} and reads {found}: see {kept.path} for what it was")
        say(f"{name} is {value:.6g} (was {present[name]:.6g}).")
