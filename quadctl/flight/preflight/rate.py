"""Rate with which a mission turns the thrust axis, beside what the attitude and the autopilot's limits follow."""

import math
from collections.abc import Sequence
from typing import Any

from quadctl.control import ControllerSettings
from quadctl.control.lags import GAIN_TIMES_LAG
from quadctl.flight.autopilot.port import Autopilot
from quadctl.flight.preflight.facts import Kind
from quadctl.flight.preflight.findings import Finding, judged
from quadctl.flight.preflight.plan import FlightPlan
from quadctl.frames import GRAVITY_M_S2
from quadctl.missions import Mission
from quadctl.state import Vec3
from quadctl.vehicle import AttitudeResponse
from quadctl.words import Fact, fact

TOPIC = "rate"
USUAL_LAG_S = GAIN_TIMES_LAG / ControllerSettings().velocity_horizontal.p
"""Lag of an attitude that is not known: that for which the default gains are made."""


Axes = Sequence[tuple[float, Vec3]]
"""Directions of the thrust axis, NED, by time, s."""


def check_rate(axes: Axes, plan: FlightPlan) -> Finding:
    """Finding about the rate of the thrust axis.

    The answer of second order, looked at ahead of its lag, leaves (2 zeta^2 - 1) / omega^2 of the second derivative of
    the tilt: so far, in m, the vehicle is off where a reference of that acceleration changes quickly.
    """
    response = plan.body.vehicle.attitude_response
    rate, time_s = needed_rate(axes, plan)
    turns = {"rate_deg_s": math.degrees(rate), **place(plan.mission, time_s)}
    if response is None:
        return judged(TOPIC, fact(Kind.RATE, **turns))
    off_m = left_by(response) * GRAVITY_M_S2 * max(math.tan(_tilt_rad(axis)) for _, axis in axes)
    allowed_m = plan.mission.limits.tolerance_m
    return judged(
        TOPIC,
        fact(Kind.RATE, **turns, left_m=off_m),
        warning=fact(Kind.BEYOND_TOLERANCE, most_m=allowed_m) if off_m > allowed_m else None,
    )


def needed_rate(axes: Axes, plan: FlightPlan) -> tuple[float, float]:
    """Largest rate of the thrust axis within the attitude's lag, rad/s, and the time when it begins, s."""
    response = plan.body.vehicle.attitude_response
    return fastest_turn(axes, USUAL_LAG_S if response is None else response.lag_s)


def fastest_turn(axes: Axes, window_s: float) -> tuple[float, float]:
    """Largest mean rate of an axis over `window_s`, rad/s, and the time when it begins, s.

    An axis that jumps, as with the acceleration of a trapezoid, turns within the attitude's lag, not at once.
    """
    fastest, at_s, j = 0.0, axes[0][0], 0
    for time_s, axis in axes:
        while j < len(axes) - 1 and axes[j][0] < time_s + window_s - 1e-9:
            j += 1
        rate = _angle_rad(axis, axes[j][1]) / window_s
        if rate > fastest:
            fastest, at_s = rate, time_s
    return fastest, at_s


def left_by(response: AttitudeResponse) -> float:
    """Part of the second derivative that the slower axis leaves, s^2, after its lag is looked ahead of."""
    return max(abs(2.0 * axis.damping**2 - 1.0) / axis.frequency_rad_s**2 for axis in (response.roll, response.pitch))


def place(mission: Mission, time_s: float) -> dict[str, Any]:
    """Facts of a place in a mission: time and phase."""
    return {"time_s": time_s, "phase": mission.phase_at(time_s).name}


async def ask_about_rate(needed_rad_s: float, autopilot: Autopilot) -> list[Finding]:
    """Findings about the autopilot's own limits of the rates, beside the rate that the mission needs."""
    values = await autopilot.parameters(autopilot.firmware.rate_limits)
    return [_within(name, most, math.degrees(needed_rad_s)) for name, most in values.items() if most > 0.0]


def _within(name: str, most: float, needed: float) -> Finding:
    limit = fact(Kind.RATE_LIMIT, name=name, most_deg_s=most, needed_deg_s=needed)
    return judged(TOPIC, limit, warning=Fact(Kind.TURNS_SLOWER) if needed > most else None)


def _tilt_rad(axis: Vec3) -> float:
    return math.atan2(math.hypot(axis[0], axis[1]), -axis[2])


def _angle_rad(a: Vec3, b: Vec3) -> float:
    """Angle between two directions; atan2 of cross and dot product is exact for small ones."""
    cross = (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
    return math.atan2(math.hypot(*cross), sum(x * y for x, y in zip(a, b, strict=True)))
