"""Parameters that the autopilot must have before anything flies: refused, or set for one flight and restored."""

from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager

from quadctl.errors import FlightError
from quadctl.flight.autopilot.firmware import Requirement
from quadctl.flight.autopilot.port import Autopilot
from quadctl.flight.preflight.changed_parameters import Change, ChangedParameters, restore, still_changed

NOBODY_LANDS = "; --without-failsafe flies all the same, with somebody at the switch"


@asynccontextmanager
async def requirements_met(
    autopilot: Autopilot,
    set_parameters: bool,
    warn: Callable[[str], None],
    without_failsafe: bool = False,
    kept: ChangedParameters | None = None,
) -> AsyncIterator[None]:
    """Context in which the autopilot's requirements are met; parameters set for that are restored at its end.

    With `without_failsafe` a missing failsafe is a warning only. `kept` keeps the old values until they are restored,
    however this program ends; those of an earlier flight, which was killed, are restored at the end of this one.

    Raises
    ------
    FlightError
        A requirement is not met and `set_parameters` is false, or it cannot be met.
    """
    unmet = await _unmet(autopilot, warn if without_failsafe else None)
    if not set_parameters:
        for need, value in unmet:
            sentence = (
                f"{need.parameter} is {value:.7g} on {autopilot.description}, expected {need.to_meet(value):.7g}: "
                f"{need.because}. Set it there, or fly with --set-params, which restores it afterwards"
                f"{NOBODY_LANDS if need.failsafe and not without_failsafe else ''}."
            )
            if not (need.advice or (need.failsafe and without_failsafe)):
                raise FlightError(sentence)
            warn(sentence)
        unmet = []
    changes = {} if kept is None or not set_parameters else await still_changed(autopilot, kept)
    try:
        for need, value in unmet:
            change = Change(was=value, set_to=need.to_meet(value))
            if kept is not None:
                kept.note(need.parameter, change)
            changes.setdefault(need.parameter, change)
            await autopilot.set_parameter(need.parameter, need.to_meet(value))
            warn(f"{need.parameter} is set from {value:.7g} to {need.to_meet(value):.7g} for this flight.")
        yield
    finally:
        await restore(autopilot, changes, kept, warn)


async def _unmet(
    autopilot: Autopilot, warn_of_failsafe: Callable[[str], None] | None
) -> list[tuple[Requirement, float]]:
    """Requirements that are not met, each with the present value of its parameter."""
    values = await autopilot.parameters(need.parameter for need in autopilot.requirements)
    for need in autopilot.requirements:
        if need.parameter in values:
            continue
        unknown = f"{autopilot.description} does not tell its {need.parameter}"
        if need.failsafe and warn_of_failsafe is not None:
            warn_of_failsafe(f"{unknown}.")
        elif need.advice:
            continue
        else:
            way_out = NOBODY_LANDS if need.failsafe else ""
            raise FlightError(f"{unknown}, which must be known: {need.because}{way_out}.")
    known = [(need, values[need.parameter]) for need in autopilot.requirements if need.parameter in values]
    return [(need, value) for need, value in known if not need.met(value)]
