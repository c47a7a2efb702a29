"""Time scale of a mission: a factor that is given, or the smallest with which it is within the vehicle's limits."""

import math

from quadctl.errors import SettingsError
from quadctl.flight.preflight.check import check_demands
from quadctl.flight.preflight.findings import Finding, Verdict
from quadctl.flight.preflight.plan import FlightPlan

FIT = "fit"
LEAST, MOST = 0.1, 20.0
STEP = 0.01
"""Step of a factor that is found."""


def with_time_scale(plan: FlightPlan, wanted: str | None) -> FlightPlan:
    """The same flight in `wanted` times its time; `fit`: in the least time that is within the limits; None: as it is.

    Raises
    ------
    SettingsError
        `wanted` is neither a factor nor `fit`, no factor helps, or the mission then lasts too long.
    """
    if wanted is None:
        return plan
    slowed = _slowed(plan, _least(plan) if wanted == FIT else _factor(wanted))
    longest_s = slowed.mission.limits.max_duration_s
    if slowed.mission.duration_s > longest_s:
        raise SettingsError(
            f"--time-scale {slowed.mission.time_scale:g}: '{plan.mission.name}' then lasts "
            f"{slowed.mission.duration_s:.0f} s, expected at most limits.max_duration_s = {longest_s:g}"
        )
    return slowed


def _factor(wanted: str) -> float:
    try:
        factor = float(wanted)
    except ValueError:
        factor = math.nan
    if not LEAST <= factor <= MOST:
        raise SettingsError(f"--time-scale is '{wanted}', expected a factor from {LEAST:g} to {MOST:g}, or {FIT}")
    return factor


def _least(plan: FlightPlan) -> float:
    """The smallest factor from 1 on with which nothing is objected to, in hundredths, by bisection.

    What a slower reference asks for is less in speed, tilt, rate and thrust alike.
    """
    low, high = 100, round(MOST / STEP)
    if not _objections(plan):
        return 1.0
    if still := _objections(_slowed(plan, MOST)):
        raise SettingsError(f"--time-scale {FIT}: a slower '{plan.mission.name}' does not help: {still[0]}")
    while high - low > 1:
        middle = (low + high) // 2
        if _objections(_slowed(plan, STEP * middle)):
            low = middle
        else:
            high = middle
    return high / 100


def _objections(plan: FlightPlan) -> list[Finding]:
    return [finding for finding in check_demands(plan) if finding.verdict is not Verdict.OK]


def _slowed(plan: FlightPlan, factor: float) -> FlightPlan:
    return plan._replace(mission=plan.mission.slowed(factor))
