"""Answer of the attitude to its setpoint, found in a log: a delay and a second order about each axis.

The setpoint of the log, held between its updates, is sent through the answer and compared with the attitude that was
measured. Each stretch of the flight gives a lag of its own: their scatter gives the interval of their mean. What all
have in common does not scatter: when within a row the setpoint left and the attitude was true, and what the second
order is not. So the interval is never narrower than a row is long.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import lfilter
from scipy.stats import t as student

from quadctl.logs.flight_log import FlightLog, Floats
from quadctl.model import Model
from quadctl.vehicle import AttitudeResponse, AxisResponse

STEP_S = 0.005
ROUNDING_S = 1e-6
"""Error of rounding of a time in a log."""
STRETCHES = 6
SETTLED_S = 1.0
"""Begin of each stretch that is not compared: the answer is still that to what was before."""
LEAST_S = 15.0
"""Least time in flight."""
WITHIN_ROW = 0.475
"""Half the interval, in rows, that holds 95 % of the times within one: a time that may lie anywhere in it."""
LEAST_DEG = 0.5
"""Least motion of the setpoint, RMS, that shows an answer."""
AIRBORNE_M = 0.3
START = (12.0, 1.0, 0.02)
LOW, HIGH = (2.0, 0.3, 0.0), (60.0, 3.0, 0.3)
"""Frequency, damping and delay: begin of the search, and its bounds."""


def attitude_response(logs: Sequence[FlightLog]) -> AttitudeResponse | None:
    """Answer of roll and pitch in these flights together; None where they do not show it.

    Setpoints of quadctl's own logs are those that it sent: their way to the autopilot is a part of the delay.
    """
    roll, pitch = _axis(logs, "roll"), _axis(logs, "pitch")
    return None if roll is None or pitch is None else AttitudeResponse(roll=roll, pitch=pitch)


def with_response(model: Model, response: AttitudeResponse) -> Model:
    """The model of a vehicle that answers like that; its file holds the vehicle itself."""
    vehicle = model.vehicle.model_copy(update={"attitude_response": response})
    return replace(model, vehicle=vehicle, vehicle_path=None)


def _axis(logs: Sequence[FlightLog], axis: str) -> AxisResponse | None:
    stretches = [stretch for log in logs for stretch in _stretches(log, axis)]
    if not stretches:
        return None
    frequency, damping, delay_s = _fitted(stretches, START)
    lags_s = np.array([_lag_s(_fitted([stretch], (frequency, damping, delay_s))) for stretch in stretches])
    lag_s, n = _lag_s((frequency, damping, delay_s)), len(lags_s)
    scatter_s = float(student.ppf(0.975, n - 1) * np.std(lags_s, ddof=1) / math.sqrt(n))
    half_s = math.hypot(scatter_s, WITHIN_ROW * max(float(np.median(np.diff(log.time_s))) for log in logs))
    return AxisResponse(
        frequency_rad_s=round(frequency, 3),
        damping=round(damping, 3),
        delay_s=round(delay_s, 4),
        lag_interval_s=(round(max(0.0, lag_s - half_s), 4), round(lag_s + half_s, 4)),
    )


def _stretches(log: FlightLog, axis: str) -> list[tuple[Floats, Floats]]:
    """Setpoint and attitude of the parts of a flight, deg, every STEP_S; none where there is too little to see."""
    names = (f"{axis}_cmd_deg", f"{axis}_deg")
    if not all(name in log.columns for name in names):
        return []
    told = np.flatnonzero(np.isfinite(log[names[0]]) & (log["z_m"] > np.nanmin(log["z_m"]) + AIRBORNE_M))
    seen = log.updates(names[1])
    if len(told) < 2 or len(seen) < 2:
        return []
    age_s = log["telemetry_age_s"] if "telemetry_age_s" in log.columns else np.zeros(len(log))
    grid = np.arange(log.time_s[told[0]], log.time_s[told[-1]], STEP_S)
    if grid[-1] - grid[0] < LEAST_S:
        return []
    held = np.searchsorted(log.time_s[told], grid + ROUNDING_S, side="right") - 1
    setpoint = log[names[0]][told][held]
    attitude = np.interp(grid, log.time_s[seen] - np.nan_to_num(age_s[seen]), log[names[1]][seen])
    if np.std(setpoint) < LEAST_DEG:
        return []
    return list(zip(np.array_split(setpoint, STRETCHES), np.array_split(attitude, STRETCHES), strict=True))


def _fitted(stretches: Sequence[tuple[Floats, Floats]], start: Sequence[float]) -> tuple[float, float, float]:
    """Frequency, damping and delay that leave the least error of the attitude."""

    def error(values: Floats) -> Floats:
        return np.concatenate([_error(stretch, values) for stretch in stretches])

    inside = np.clip(start, np.array(LOW) + 1e-3, np.array(HIGH) - 1e-3)
    found = least_squares(error, inside, bounds=(LOW, HIGH), x_scale=(10.0, 1.0, 0.05), diff_step=(1e-3, 1e-3, 1e-3))
    return float(found.x[0]), float(found.x[1]), float(found.x[2])


def _error(stretch: tuple[Floats, Floats], values: Floats) -> Floats:
    setpoint, attitude = stretch
    frequency, damping, delay_s = values
    # Bilinear, s = 2 (z - 1) / (z + 1) / STEP_S, of frequency^2 / (s^2 + 2 damping frequency s + frequency^2).
    turn = 0.5 * STEP_S * frequency
    a = np.array([1.0 + 2.0 * damping * turn + turn**2, 2.0 * (turn**2 - 1.0), 1.0 - 2.0 * damping * turn + turn**2])
    b = turn**2 * np.array([1.0, 2.0, 1.0])
    # A value holds from its sample on; the bilinear filter draws lines between samples, which is half a step earlier.
    index = np.arange(len(setpoint)) - delay_s / STEP_S - 0.5
    late = np.interp(index, np.arange(len(setpoint)), setpoint)
    answer = late[0] + lfilter(b, a, late - late[0])
    off: Floats = (answer - attitude)[round(SETTLED_S / STEP_S) :]
    off -= off.mean()  # a level that is off is no lag
    return off


def _lag_s(values: tuple[float, float, float]) -> float:
    frequency, damping, delay_s = values
    return delay_s + 2.0 * damping / frequency
