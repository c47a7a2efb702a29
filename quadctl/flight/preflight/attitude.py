"""Lag of the attitude before a flight: the one configured, beside what a log shows and what has changed since."""

import math
from collections.abc import Mapping
from typing import NamedTuple

from quadctl.control.lags import turn_lag_s
from quadctl.flight.autopilot.port import Autopilot
from quadctl.flight.preflight.findings import Finding, Verdict, judged
from quadctl.flight.preflight.plan import FlightPlan
from quadctl.vehicle import AttitudeResponse

TOPIC, EARLIER = "attitude", "last log"
FLOAT32 = 1e-6
"""Relative difference of the same number as autopilots and their logs hold it."""
AGAIN = "the lag may differ: fly excitation and run `quadctl fit` again"


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
        return judged(TOPIC, "look_ahead is false: the reference is fed forward at its own time")
    lag_s = turn_lag_s(plan.compensator, controller)
    if lag_s is not None:
        return judged(TOPIC, f"the force to the side follows {lag_s:.2f} s later, and the reference is looked at ahead")
    off = "look-ahead is off, and the vehicle lags behind its reference"
    if vehicle.attitude_response is None:
        return judged(
            TOPIC,
            f"'{vehicle.name}' has no attitude_response: {off}; `quadctl fit` finds it in a log of the mission "
            "`excitation`",
        )
    return judged(TOPIC, f"lag {vehicle.attitude_response.lag_s:.2f} s, but no drag in the model: {off}")


def compare_with_log(plan: FlightPlan, last: LastFlight) -> Finding:
    """Finding about the lag that the vehicle file has and the one that the log shows.

    They disagree where their intervals are apart, by more than a tick: that long a setpoint is held anyway.
    """
    found, configured = last.response, plan.body.vehicle.attitude_response
    if found is None:
        text = f"{last.log} does not show the lag"
        return judged(EARLIER, text, warning="expected 15 s in the air that lean both ways, as excitation does")
    text = f"attitude lag {_with_interval(found)} in {last.log}"
    if configured is None:
        return judged(
            EARLIER, f"{text}, configured none: look-ahead is off; `quadctl fit` writes it into the model file"
        )
    return judged(
        EARLIER,
        f"{text}, configured {configured.lag_s:.2f}",
        warning=AGAIN if _apart(found, configured, 1.0 / plan.settings.controller.rate_hz) else None,
    )


async def ask_about_attitude(last: LastFlight, autopilot: Autopilot) -> list[Finding]:
    """Findings about the parameters on which the lag depends, and whose value is not that of the log."""
    names = [name for name in autopilot.firmware.attitude_parameters if name in last.parameters]
    if not names:
        return [judged(EARLIER, f"{last.log} does not hold the parameters on which the lag depends")]
    now = await autopilot.parameters(names)
    changed = [
        Finding(
            Verdict.WARNING, EARLIER, f"{name} was {last.parameters[name]:g} in {last.log}, is {now[name]:g}: {AGAIN}"
        )
        for name in names
        if name in now and not math.isclose(now[name], last.parameters[name], rel_tol=FLOAT32, abs_tol=1e-9)
    ]
    return changed or [judged(EARLIER, f"{len(now)} parameters on which the lag depends are as in {last.log}")]


def _with_interval(response: AttitudeResponse) -> str:
    interval_s = response.lag_interval_s
    return f"{response.lag_s:.2f} s" + ("" if interval_s is None else f" [{interval_s[0]:.2f}, {interval_s[1]:.2f}]")


def _apart(a: AttitudeResponse, b: AttitudeResponse, tick_s: float) -> bool:
    """True where two lags differ by more than a tick, and their intervals do not touch."""
    (low, high), (lower, higher) = (r.lag_interval_s or (r.lag_s, r.lag_s) for r in (a, b))
    return abs(a.lag_s - b.lag_s) > tick_s and (low > higher or high < lower)
