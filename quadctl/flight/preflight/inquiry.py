"""Inspection of an autopilot on the ground: its messages, its state, its parameters. Nothing moves."""

import asyncio
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from quadctl.errors import FlightError
from quadctl.flight.autopilot.firmware import Check, Requirement
from quadctl.flight.autopilot.mavsdk_autopilot import MavsdkAutopilot
from quadctl.flight.autopilot.port import Autopilot
from quadctl.flight.pilot.guards import GuardLimits, defect, patience_s
from quadctl.flight.pilot.standing import not_standing, posture
from quadctl.flight.preflight.attitude import LastFlight, ask_about_attitude
from quadctl.flight.preflight.changed_parameters import ChangedParameters, left_behind, restore, still_changed
from quadctl.flight.preflight.check import needed_rate_rad_s
from quadctl.flight.preflight.facts import Kind
from quadctl.flight.preflight.findings import Finding, Verdict, judged
from quadctl.flight.preflight.lateral import ask_about_lateral_force
from quadctl.flight.preflight.plan import FlightPlan
from quadctl.flight.preflight.rate import ask_about_rate
from quadctl.flight.realtime import run
from quadctl.state import VehicleState
from quadctl.thrust_chain.chain import TABLE_TILT_DEG, Addition
from quadctl.vehicle import Vehicle
from quadctl.words import Fact, fact

LOOK_EVERY_S = 0.002
"""Interval at which the state is read: shorter than that of the most frequent message, so that each is counted."""


@dataclass
class Counted:
    """Updates that arrived while listening."""

    seconds: float
    updates: dict[str, int] = field(default_factory=dict)
    oldest_s: dict[str, float] = field(default_factory=dict)
    """Largest age of each part."""

    def rate_hz(self, part: str) -> float:
        return self.updates.get(part, 0) / self.seconds


def ask_autopilot(
    plan: FlightPlan,
    url: str,
    seconds: float,
    logs: Path,
    without_failsafe: bool = False,
    restore_parameters: bool = False,
    last: LastFlight | None = None,
) -> list[Finding]:
    """Connect to the autopilot at `url`, listen for `seconds`, ask for parameters, let go.

    With `without_failsafe` a missing failsafe is a warning only. The folder `logs` tells what an earlier flight may
    have left behind; with `restore_parameters` that is restored. With a `last` flight its parameters are compared.

    Raises
    ------
    LinkError
        No autopilot answers.
    """
    link = plan.settings.link
    autopilot = MavsdkAutopilot(url, plan.body.vehicle.n_rotors, link.timeout_s, link.system_id)
    try:
        return run(_ask(plan, autopilot, seconds, logs, without_failsafe, restore_parameters, last))
    except KeyboardInterrupt:
        raise FlightError("interrupted while the autopilot was asked") from None


async def _ask(
    plan: FlightPlan,
    autopilot: Autopilot,
    seconds: float,
    logs: Path,
    without_failsafe: bool,
    restore_parameters: bool,
    last: LastFlight | None,
) -> list[Finding]:
    try:
        await autopilot.connect()
        kept = ChangedParameters(logs, await autopilot.identity())
        left = await _left_behind(autopilot, kept, restore_parameters)
        return left + await inspect_autopilot(plan, autopilot, seconds, without_failsafe, last)
    finally:
        await autopilot.close()


async def _left_behind(autopilot: Autopilot, kept: ChangedParameters, restore_parameters: bool) -> list[Finding]:
    """Findings about the parameters that an earlier flight has changed and did not restore."""
    left = await still_changed(autopilot, kept)
    of_others = [judged("parameters", fact(Kind.OF_ANOTHER, path=str(kept.path), vehicle=name)) for name in kept.others]
    if not restore_parameters:
        named = [Finding(Verdict.WARNING, "parameters", left_behind(name, change)) for name, change in left.items()]
        return named + of_others
    said: list[str] = []
    await restore(autopilot, left, kept, said.append)
    unrestored = kept.read()
    restored = [
        Finding(Verdict.WARNING if name in unrestored else Verdict.OK, "parameters", fact(Kind.TOLD, text=sentence))
        for name, sentence in zip(left, said, strict=True)
    ]
    return restored + of_others


async def inspect_autopilot(
    plan: FlightPlan,
    autopilot: Autopilot,
    seconds: float,
    without_failsafe: bool = False,
    last: LastFlight | None = None,
) -> list[Finding]:
    """All findings about an autopilot that is connected."""
    try:
        await autopilot.request_telemetry()
    except FlightError as error:
        return [Finding(Verdict.REFUSED, "messages", fact(Kind.TOLD, text=str(error)))]
    await _ready(autopilot, plan.settings.guards)
    with suppress(FlightError):  # an autopilot that does not answer this is refused for what it lacks
        await autopilot.run_checks()
    counted = await _listen(autopilot, seconds)
    state = autopilot.state()
    return [
        judged("autopilot", fact(Kind.TOLD, text=autopilot.description)),
        *(Finding(Verdict.WARNING, "messages", fact(Kind.TOLD, text=warning)) for warning in autopilot.warnings),
        *_messages(counted, state, plan),
        _estimator(state, plan),
        _standing(state, plan),
        *_texts(state),
        _mode(state),
        _battery(state, plan),
        *_remote(state),
        *await _parameters(autopilot, plan.body.vehicle, without_failsafe),
        *await ask_about_lateral_force(plan, autopilot),
        *await ask_about_rate(needed_rate_rad_s(plan), autopilot),
        *([] if last is None else await ask_about_attitude(last, autopilot)),
        *thrust_findings(autopilot.thrust_additions(plan.body.vehicle.hover_throttle)),
    ]


def thrust_findings(additions: Sequence[Addition]) -> list[Finding]:
    """Rows of the table of what the autopilot adds to the thrust, after a row that says what its columns are."""
    width = max((len(addition.parameters) for addition in additions), default=0)
    heading = f"{'your autopilot adds':{width}} at hover  at {TABLE_TILT_DEG:g} deg"
    rows = [f"{a.parameters:{width}} {a.at_hover:+8.1%} {a.at_tilt:+10.1%}  {a.remark}" for a in additions]
    return [judged("thrust chain", fact(Kind.TOLD, text=text)) for text in (heading, *rows)]


async def _ready(autopilot: Autopilot, guards: GuardLimits) -> None:
    """Wait as long as a flight does for a state that it may use, as the estimator needs some time after boot."""
    began_s = autopilot.state().time_s
    while True:
        state = autopilot.state()
        if state.armed or (state.ready_to_arm and defect(state, guards) is None):
            return
        if state.time_s - began_s > patience_s(state):
            return
        await asyncio.sleep(LOOK_EVERY_S)


async def _listen(autopilot: Autopilot, seconds: float) -> Counted:
    counted = Counted(seconds)
    last = autopilot.state()
    end_s = last.time_s + seconds
    while last.time_s < end_s:
        await asyncio.sleep(LOOK_EVERY_S)
        state = autopilot.state()
        for part, received_s in state.received_s.items():
            if received_s > last.received_s.get(part, -math.inf):
                counted.updates[part] = counted.updates.get(part, 0) + 1
            counted.oldest_s[part] = max(counted.oldest_s.get(part, 0.0), state.age_s(part))
        last = state
    return counted


def _messages(counted: Counted, state: VehicleState, plan: FlightPlan) -> Iterator[Finding]:
    """Findings about the messages that control needs, at the rates at which they arrive."""
    allowed_s, wanted_hz = plan.settings.guards.max_state_age_s, plan.settings.controller.rate_hz
    for part in ("position", "attitude"):
        rate, oldest_s = counted.rate_hz(part), counted.oldest_s.get(part, math.inf)
        refused = warning = None
        if rate == 0.0:
            refused = Fact(Kind.NONE_CAME)
        elif oldest_s > allowed_s:
            refused = fact(Kind.TOO_OLD, most_s=allowed_s)
        elif rate < wanted_hz:
            warning = fact(Kind.TOO_RARE, wanted_hz=wanted_hz)
        found = fact(Kind.MESSAGES, part=part, rate_hz=rate, oldest_ms=1e3 * oldest_s)
        yield judged("messages", found, refused=refused, warning=warning)
    rpm_hz = counted.rate_hz("rpm")
    lacking = None
    if rpm_hz == 0.0:
        lacking = Fact(Kind.NO_ROTOR_SPEEDS)
    elif state.rotor_rpm and not any(rpm > 0.0 for rpm in state.rotor_rpm):
        lacking = Fact(Kind.ALL_ZERO)
    yield judged("messages", fact(Kind.ROTOR_SPEEDS, rate_hz=rpm_hz), warning=lacking)


def _estimator(state: VehicleState, plan: FlightPlan) -> Finding:
    known = [std_m for std_m in (state.horizontal_std_m, state.vertical_std_m) if math.isfinite(std_m)]
    found = defect(state, plan.settings.guards)
    return judged("estimator", fact(Kind.ESTIMATOR, std_m=known), refused=found.reason if found else None)


def _standing(state: VehicleState, plan: FlightPlan) -> Finding:
    unseen = None if state.landed else Fact(Kind.NOT_LANDED)
    return judged("standing", posture(state), refused=not_standing(state, plan.settings.height_datum), warning=unseen)


def _texts(state: VehicleState) -> Iterator[Finding]:
    """Texts of the autopilot, each once."""
    for text in dict.fromkeys(text._replace(received_s=0.0) for text in state.texts):
        yield Finding(Verdict.WARNING if text.grave else Verdict.OK, "autopilot", fact(Kind.TOLD, text=str(text)))


def _mode(state: VehicleState) -> Finding:
    refused = Fact(Kind.ARMED) if state.armed else None
    if refused is None and not state.ready_to_arm:
        refused = fact(Kind.NOT_READY, reasons=state.why_not_ready)
    unknown = None if state.tells_readiness else Fact(Kind.READINESS_UNTOLD)
    if state.checks_off:
        unknown = Fact(Kind.CHECKS_OFF)
    return judged("mode", fact(Kind.MODE, mode=state.mode, armed=state.armed), refused=refused, warning=unknown)


def _battery(state: VehicleState, plan: FlightPlan) -> Finding:
    limit_v = plan.settings.guards.min_battery_v
    if math.isnan(state.battery_v):
        guarded = Fact(Kind.GUARD_NEEDS_IT) if limit_v else None
        return judged("battery", Fact(Kind.VOLTAGE_UNKNOWN), refused=guarded, warning=Fact(Kind.UNTOLD))
    low = fact(Kind.TOO_LOW, least_v=limit_v) if state.battery_v < limit_v else None
    if low is None and state.why_battery_empty is not None:
        low = fact(Kind.TOLD, text=state.why_battery_empty)
    left = 100.0 * state.battery_remaining if math.isfinite(state.battery_remaining) else None
    return judged("battery", fact(Kind.VOLTAGE, battery_v=state.battery_v, left_percent=left), refused=low)


def _remote(state: VehicleState) -> Iterator[Finding]:
    """Warning of a vehicle that nobody can take with a remote control."""
    if state.remote is False:
        yield Finding(Verdict.WARNING, "remote", Fact(Kind.NO_REMOTE))


async def _parameters(autopilot: Autopilot, vehicle: Vehicle, without_failsafe: bool) -> list[Finding]:
    values = await autopilot.parameters(need.parameter for need in autopilot.requirements)
    required = [_required(need, values, without_failsafe) for need in autopilot.requirements]
    return [*required, *await advisable_parameters(autopilot, vehicle)]


async def advisable_parameters(autopilot: Autopilot, vehicle: Vehicle) -> list[Finding]:
    """Findings about the parameters that a flight does not require."""
    names = [check.parameter for check in autopilot.firmware.checks]
    values = await autopilot.parameters(names)
    if names and not values:
        none = fact(Kind.PARAMETER, said=", ".join(names))
        return [judged("parameters", none, warning=Fact(Kind.NONE_TOLD))]
    found = [(check, values[check.parameter]) for check in autopilot.firmware.checks if check.parameter in values]
    return [_advised(check, value, vehicle) for check, value in found]


def _advised(check: Check, value: float, vehicle: Vehicle) -> Finding:
    objection = check.objected(value, vehicle)
    poor = None if objection is None else fact(Kind.TOLD, text=objection)
    return judged(
        "parameters",
        fact(Kind.PARAMETER, name=check.parameter, value=value, said=check.said(value, vehicle)),
        refused=poor if check.refuses else None,
        warning=poor,
    )


def _required(need: Requirement, values: Mapping[str, float], without_failsafe: bool) -> Finding:
    """Finding about a parameter that `quadctl fly` refuses to fly without, or sets with --set-params."""
    lenient = need.advice or (need.failsafe and without_failsafe)
    if need.parameter not in values:
        unknown, untold = Fact(Kind.UNTOLD), fact(Kind.PARAMETER, name=need.parameter, said=need.parameter)
        return judged("parameters", untold, refused=None if lenient else unknown, warning=unknown)
    value = values[need.parameter]
    problem = None if need.met(value) else fact(Kind.NOT_MET, expected=need.to_meet(value), because=need.because)
    found = fact(Kind.PARAMETER, name=need.parameter, value=value, said=need.said(value))
    return judged("parameters", found, refused=None if lenient else problem, warning=problem)
