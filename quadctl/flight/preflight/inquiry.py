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
from quadctl.flight.preflight.findings import Finding, Verdict, judged
from quadctl.flight.preflight.lateral import ask_about_lateral_force
from quadctl.flight.preflight.plan import FlightPlan
from quadctl.flight.preflight.rate import ask_about_rate
from quadctl.flight.realtime import run
from quadctl.state import VehicleState
from quadctl.thrust_chain.chain import TABLE_TILT_DEG, Addition
from quadctl.vehicle import Vehicle

CHECKS_OFF = "its own checks before arming are off (ARMING_CHECK is 0): it arms whatever it would object to"
NO_REMOTE = "the autopilot receives no remote control: nobody can take the vehicle with one"
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
    of_others = [
        judged(
            "parameters", f"{kept.path} keeps old values for another vehicle too ({name}): connect it to restore them"
        )
        for name in kept.others
    ]
    if not restore_parameters:
        named = [Finding(Verdict.WARNING, "parameters", left_behind(name, change)) for name, change in left.items()]
        return named + of_others
    said: list[str] = []
    await restore(autopilot, left, kept, said.append)
    unrestored = kept.read()
    restored = [
        Finding(Verdict.WARNING if name in unrestored else Verdict.OK, "parameters", sentence)
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
        return [Finding(Verdict.REFUSED, "messages", str(error))]
    await _ready(autopilot, plan.settings.guards)
    with suppress(FlightError):  # an autopilot that does not answer this is refused for what it lacks
        await autopilot.run_checks()
    counted = await _listen(autopilot, seconds)
    state = autopilot.state()
    return [
        judged("autopilot", autopilot.description),
        *(Finding(Verdict.WARNING, "messages", warning) for warning in autopilot.warnings),
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
    return [judged("thrust chain", text) for text in (heading, *rows)]


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
            refused = "none came"
        elif oldest_s > allowed_s:
            refused = f"the guard hands over at max_state_age_s = {allowed_s:g}"
        elif rate < wanted_hz:
            warning = f"control runs at {wanted_hz:g} Hz"
        text = f"{part} at {rate:.0f} Hz, up to {1e3 * oldest_s:.0f} ms old"
        yield judged("messages", text, refused=refused, warning=warning)
    rpm_hz = counted.rate_hz("rpm")
    text, lacking = f"rotor speeds at {rpm_hz:.0f} Hz", None
    if rpm_hz == 0.0:
        lacking = "the lab will have to take thrust from the throttle"
    elif state.rotor_rpm and not any(rpm > 0.0 for rpm in state.rotor_rpm):
        lacking = "all are zero, so it will show when the motors turn if they are measured"
    yield judged("messages", text, warning=lacking)


def _estimator(state: VehicleState, plan: FlightPlan) -> Finding:
    known = [f"{std_m:.2f} m" for std_m in (state.horizontal_std_m, state.vertical_std_m) if math.isfinite(std_m)]
    stated = f", standard deviation {' and '.join(known)}" if known else ""
    text = f"attitude, velocity and position{stated}"
    found = defect(state, plan.settings.guards)
    return judged("estimator", text, refused=str(found.reason) if found else None)


def _standing(state: VehicleState, plan: FlightPlan) -> Finding:
    unseen = None if state.landed else "the autopilot does not think that it has landed"
    expected = not_standing(state, plan.settings.height_datum)
    return judged("standing", str(posture(state)), refused=str(expected) if expected else None, warning=unseen)


def _texts(state: VehicleState) -> Iterator[Finding]:
    """Texts of the autopilot, each once."""
    for text in dict.fromkeys(text._replace(received_s=0.0) for text in state.texts):
        yield Finding(Verdict.WARNING if text.grave else Verdict.OK, "autopilot", str(text))


def _mode(state: VehicleState) -> Finding:
    armed = "armed" if state.armed else "disarmed"
    refused = "expected a vehicle that is disarmed" if state.armed else None
    if refused is None and not state.ready_to_arm:
        reasons = f" ({'; '.join(state.why_not_ready)})" if state.why_not_ready else ""
        refused = f"its own checks do not pass{reasons}: it would not arm"
    unknown = None if state.tells_readiness else "in this mode it does not say if it would arm: choose another mode"
    if state.checks_off:
        unknown = CHECKS_OFF
    return judged("mode", f"{state.mode or 'unknown'}, {armed}", refused=refused, warning=unknown)


def _battery(state: VehicleState, plan: FlightPlan) -> Finding:
    limit_v = plan.settings.guards.min_battery_v
    if math.isnan(state.battery_v):
        guarded = "guards.min_battery_v needs it" if limit_v else None
        return judged("battery", "voltage unknown", refused=guarded, warning="the autopilot does not tell it")
    low = f"expected {limit_v:g} V or more" if state.battery_v < limit_v else None
    known = f", {100.0 * state.battery_remaining:.0f} % left" if math.isfinite(state.battery_remaining) else ""
    return judged("battery", f"{state.battery_v:.2f} V{known}", refused=low or state.why_battery_empty)


def _remote(state: VehicleState) -> Iterator[Finding]:
    """Warning of a vehicle that nobody can take with a remote control."""
    if state.remote is False:
        yield Finding(Verdict.WARNING, "remote", NO_REMOTE)


async def _parameters(autopilot: Autopilot, vehicle: Vehicle, without_failsafe: bool) -> list[Finding]:
    values = await autopilot.parameters(need.parameter for need in autopilot.requirements)
    required = [_required(need, values, without_failsafe) for need in autopilot.requirements]
    return [*required, *await advisable_parameters(autopilot, vehicle)]


async def advisable_parameters(autopilot: Autopilot, vehicle: Vehicle) -> list[Finding]:
    """Findings about the parameters that a flight does not require."""
    names = [check.parameter for check in autopilot.firmware.checks]
    values = await autopilot.parameters(names)
    if names and not values:
        return [judged("parameters", ", ".join(names), warning="the autopilot tells none of them")]
    found = [(check, values[check.parameter]) for check in autopilot.firmware.checks if check.parameter in values]
    return [_advised(check, value, vehicle) for check, value in found]


def _advised(check: Check, value: float, vehicle: Vehicle) -> Finding:
    objection = check.objected(value, vehicle)
    return judged(
        "parameters",
        check.said(value, vehicle),
        refused=objection if check.refuses else None,
        warning=objection,
    )


def _required(need: Requirement, values: Mapping[str, float], without_failsafe: bool) -> Finding:
    """Finding about a parameter that `quadctl fly` refuses to fly without, or sets with --set-params."""
    lenient = need.advice or (need.failsafe and without_failsafe)
    if need.parameter not in values:
        unknown = "the autopilot does not tell it"
        return judged("parameters", need.parameter, refused=None if lenient else unknown, warning=unknown)
    value = values[need.parameter]
    problem = None if need.met(value) else f"expected {need.to_meet(value):.7g} (--set-params does it): {need.because}"
    return judged("parameters", need.said(value), refused=None if lenient else problem, warning=problem)
