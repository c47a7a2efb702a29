"""One flight in real time: connect to the autopilot, meet its requirements, fly the plan, record, report."""

import math
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

from rich.console import Console

from quadctl.errors import FlightError
from quadctl.flight.autopilot.mavsdk_autopilot import MavsdkAutopilot
from quadctl.flight.autopilot.port import Autopilot
from quadctl.flight.loop import fly, landing_on_signals
from quadctl.flight.pilot.outcome import Outcome, Tally
from quadctl.flight.pilot.tick import Tick
from quadctl.flight.preflight.changed_parameters import ChangedParameters, left_behind, restore, still_changed
from quadctl.flight.preflight.facts import Kind
from quadctl.flight.preflight.findings import Verdict, of_verdict
from quadctl.flight.preflight.inquiry import advisable_parameters
from quadctl.flight.preflight.lateral import ask_about_lateral_force
from quadctl.flight.preflight.plan import FlightPlan
from quadctl.flight.preflight.requirements import requirements_met
from quadctl.flight.realtime import privileges, run
from quadctl.flight.record.display import Display
from quadctl.flight.record.view_link import ViewEnd, ViewLink
from quadctl.flight.watchdog import Watchdog
from quadctl.words import Fact

RESIDUAL_EVERY_S = 0.5
RESIDUAL = "residual"
"""Name of the DEBUG_VECT, of at most ten characters: forward, right, down, m/s^2."""


class Allowed(NamedTuple):
    """Permissions that the user gives for one flight, about the parameters of the autopilot."""

    set_parameters: bool = False
    """True: set what it must have, and restore it afterwards."""
    without_failsafe: bool = False
    """True: fly though nobody would land the vehicle if this program died."""
    restore_parameters: bool = False
    """True: restore first what an earlier flight left behind."""
    keep_in: Path | None = None
    """Folder of the file for the old values; None: they need not outlive this program."""


def fly_real_time(
    plan: FlightPlan,
    url: str,
    log_dir: Path,
    console: Console,
    allowed: Allowed | None = None,
    view: ViewEnd | None = None,
) -> Outcome:
    """Fly on the autopilot at `url`, with a display on `console`, and a viewer at the other end of `view`.

    Raises
    ------
    LinkError
        No autopilot answers at `url`.
    FlightError
        The log cannot be written, the autopilot refuses what a flight needs, or Ctrl-C came before the flight.
    """
    link = plan.settings.link
    autopilot = MavsdkAutopilot(url, plan.body.vehicle.n_rotors, link.timeout_s, link.system_id)
    try:
        with privileges() as real_time:
            return run(_fly(_Session(plan, autopilot, log_dir, console, allowed or Allowed(), view, real_time)))
    except KeyboardInterrupt:  # in flight, Ctrl-C is a wish to land
        raise FlightError("interrupted while the link was being opened or closed") from None


class _Session(NamedTuple):
    """Parts that one flight is given."""

    plan: FlightPlan
    autopilot: Autopilot
    log_dir: Path
    console: Console
    allowed: Allowed
    view: ViewEnd | None
    real_time: Sequence[str]


async def _fly(session: _Session) -> Outcome:
    plan, autopilot, _, console, allowed, *_ = session

    def warn(sentence: str) -> None:
        console.print(f"warning: {sentence}", style="yellow", soft_wrap=True, markup=False, highlight=False)

    try:
        with console.status("waiting for the autopilot"):
            await autopilot.connect()
            await autopilot.request_telemetry()
            advice = await advisable_parameters(autopilot, plan.body.vehicle)
            lateral = await ask_about_lateral_force(plan, autopilot)
        if refused := of_verdict([*advice, *lateral], Verdict.REFUSED):
            raise FlightError(f"{refused[0]}.")
        for warning in [*autopilot.warnings, *of_verdict(advice, Verdict.WARNING)]:
            warn(str(warning))
        if autopilot.state().checks_off:
            warn(f"{Fact(Kind.CHECKS_OFF)}.")
        if autopilot.state().remote is False:
            warn(f"{Fact(Kind.NO_REMOTE)}.")
        kept = None
        if allowed.keep_in is not None:
            kept = ChangedParameters(allowed.keep_in, await autopilot.identity())
        await _look_for_left_parameters(autopilot, allowed, kept, warn)
        async with requirements_met(autopilot, allowed.set_parameters, warn, allowed.without_failsafe, kept):
            return await _fly_prepared(session)
    finally:
        await autopilot.close()


async def _look_for_left_parameters(
    autopilot: Autopilot, allowed: Allowed, kept: ChangedParameters | None, warn: Callable[[str], None]
) -> None:
    """Restore what an earlier flight left behind, or name it; a flight that sets parameters restores it at its end."""
    if kept is None:
        return
    left = await still_changed(autopilot, kept)
    if allowed.restore_parameters:
        await restore(autopilot, left, kept, warn)
    elif not allowed.set_parameters:
        for name, change in left.items():
            warn(str(left_behind(name, change)))


async def _fly_prepared(session: _Session) -> Outcome:
    plan, autopilot, log_dir, console, allowed, view, real_time = session
    rate_hz, firmware = plan.settings.controller.rate_hz, autopilot.firmware
    pilot = plan.pilot(firmware.takes_off_itself, firmware.stays_up and not allowed.without_failsafe)
    recorder = plan.recorder(log_dir, autopilot.description, real_time)
    tally = Tally(1.0 / rate_hz)
    with ExitStack() as stack:
        stack.callback(lambda: recorder.close(pilot.ended or "broken off"))
        stack.enter_context(landing_on_signals(pilot))
        display = stack.enter_context(Display(pilot, console, real_time))
        viewer = [] if view is None else [ViewLink(view, pilot)]
        watchdog = stack.enter_context(Watchdog())
        await fly(autopilot, pilot, rate_hz, [recorder, tally, display, *viewer, ModelLink(autopilot), watchdog])
    return tally.outcome(pilot, recorder.path, recorder.problem)


class ModelLink:
    """Listener of the loop that tells ground stations the residual of the model, twice a second."""

    def __init__(self, autopilot: Autopilot) -> None:
        self._autopilot = autopilot
        self._due_s = -math.inf

    def __call__(self, tick: Tick) -> None:
        residual = tick.model_error.body_m_s2
        if tick.time_s >= self._due_s and all(map(math.isfinite, residual)):
            self._due_s = tick.time_s + RESIDUAL_EVERY_S
            self._autopilot.tell(RESIDUAL, residual)
