"""Lag of the attitude before a flight: the one configured, beside what a log shows and what has changed since."""

import math
from collections.abc import Mapping
from typing import NamedTuple

from quadctl.control.lags import turn_lag_s
from quadctl.flight.autopilot.port import Autopilot
from quadctl.flight.preflight.facts import Kind
from quadctl.flight.preflight.findings import Finding, Verdict, judged
from quadctl.flight.preflight.plan import FlightPlan
from quadctl.vehicle import AttitudeResponse
from quadctl.words import Fact, fact

TOPIC, EARLIER = "attitude", "last log"
FLOAT32 = 1e-6
"""Relative difference of the same number as autopilots and their logs hold it."""


class LastFlight(NamedTuple):
    """Attitude in the log of an earlier flight."""

    log: str
    response: AttitudeResponse | None
    """Answer of the attitude; None: the log does not show it."""
    parameters: Mapping[str, float] = {}
    """Parameters of the autopilot, as far as the log holds them."""


def check_look_ahead(plan: FlightPlan) -> Finding:
    """Finding about how far ahead the reference is looked at."""
    controller, vehicle = plan.settings.controller, plan.body.vehicle
    if not controller.look_ahead:
        return judged(TOPIC, Fact(Kind.NOT_AHEAD))
    lag_s = turn_lag_s(plan.compensator, controller)
    if lag_s is not None:
        return judged(TOPIC, fact(Kind.AHEAD, lag_s=lag_s))
    if vehicle.attitude_response is None:
        return judged(TOPIC, fact(Kind.NO_RESPONSE, vehicle=vehicle.name))
    return judged(TOPIC, fact(Kind.NO_DRAG, lag_s=vehicle.attitude_response.lag_s))


def compare_with_log(plan: FlightPlan, last: LastFlight) -> Finding:
    """Finding about the lag that the vehicle file has and the one that the log shows.

    They disagree where their intervals are apart, by more than a tick: that long a setpoint is held anyway.
    """
    found, configured = last.response, plan.body.vehicle.attitude_response
    if found is None:
        return judged(EARLIER, fact(Kind.LAG_NOT_SHOWN, log=last.log), warning=Fact(Kind.TOO_CALM))
    apart = configured is not None and _apart(found, configured, 1.0 / plan.settings.controller.rate_hz)
    return judged(
        EARLIER,
        fact(
            Kind.LAG_SHOWN,
            log=last.log,
            lag_s=found.lag_s,
            interval_s=found.lag_interval_s,
            configured_s=None if configured is None else configured.lag_s,
        ),
        warning=Fact(Kind.LAG_DIFFERS) if apart else None,
    )


async def ask_about_attitude(last: LastFlight, autopilot: Autopilot) -> list[Finding]:
    """Findings about the parameters on which the lag depends, and whose value is not that of the log."""
    names = [name for name in autopilot.firmware.attitude_parameters if name in last.parameters]
    if not names:
        return [judged(EARLIER, fact(Kind.NO_PARAMETERS_IN_LOG, log=last.log))]
    now = await autopilot.parameters(names)
    changed = [
        Finding(
            Verdict.WARNING,
            EARLIER,
            fact(Kind.PARAMETER_CHANGED, name=name, was=last.parameters[name], log=last.log, now=now[name]),
        )
        for name in names
        if name in now and not math.isclose(now[name], last.parameters[name], rel_tol=FLOAT32, abs_tol=1e-9)
    ]
    return changed or [judged(EARLIER, fact(Kind.PARAMETERS_KEPT, parameters=len(now), log=last.log))]


def _apart(a: AttitudeResponse, b: AttitudeResponse, tick_s: float) -> bool:
    """True where two lags differ by more than a tick, and their intervals do not touch."""
    (low, high), (lower, higher) = (r.lag_interval_s or (r.lag_s, r.lag_s) for r in (a, b))
    return abs(a.lag_s - b.lag_s) > tick_s and (low > higher or high < lower)
