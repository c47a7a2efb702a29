"""Parameters that the autopilot must have before anything flies: refused, or set for one flight and restored."""

from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager

from quadctl.errors import FlightError
from quadctl.flight.autopilot.firmware import Requirement
from quadctl.flight.autopilot.port import Autopilot


@asynccontextmanager
async def requirements_met(
    autopilot: Autopilot, set_parameters: bool, warn: Callable[[str], None]
) -> AsyncIterator[None]:
    """Context in which the autopilot's requirements are met; parameters set for that are restored at its end.

    Raises
    ------
    FlightError
        A requirement is not met and `set_parameters` is false, or it cannot be met.
    """
    unmet = await _unmet(autopilot)
    if not set_parameters:
        for need, value in unmet:
            sentence = (
                f"{need.parameter} is {value:g} on {autopilot.description}, expected {need.to_meet(value):g}: "
                f"{need.because}. Set it there, or fly with --set-params, which restores it afterwards."
            )
            if not need.advice:
                raise FlightError(sentence)
            warn(sentence)
        unmet = []
    try:
        for need, value in unmet:
            await autopilot.set_parameter(need.parameter, need.to_meet(value))
            warn(f"{need.parameter} is set from {value:g} to {need.to_meet(value):g} for this flight.")
        yield
    finally:
        await _restore(autopilot, {need.parameter: value for need, value in unmet}, warn)


async def _unmet(autopilot: Autopilot) -> list[tuple[Requirement, float]]:
    """Requirements that are not met, each with the present value of its parameter."""
    values = await autopilot.parameters(need.parameter for need in autopilot.requirements)
    for need in autopilot.requirements:
        if need.parameter not in values:
            raise FlightError(
                f"{autopilot.description} does not tell its {need.parameter}, which must be known: {need.because}."
            )
    return [(n, values[n.parameter]) for n in autopilot.requirements if not n.met(values[n.parameter])]


async def _restore(autopilot: Autopilot, before: Mapping[str, float], warn: Callable[[str], None]) -> None:
    """Restore parameters, but not while the vehicle is armed: they must not change under whoever flies now."""
    for name, value in before.items():
        by_hand = f"{name} could not be restored; set it to {value:g} by hand"
        if autopilot.state().armed:
            warn(f"{by_hand}: the vehicle is still armed.")
            continue
        try:
            await autopilot.set_parameter(name, value)
        except FlightError as error:
            warn(f"{by_hand}: {error}")
        else:
            warn(f"{name} is {value:g} again.")
