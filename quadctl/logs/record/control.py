"""Moment at which a vehicle gets out of control: what comes after it tells of the accident, not of the physics."""

import re
from collections.abc import Iterator

import numpy as np

from quadctl.logs.columns import motor_of
from quadctl.logs.events import events_of
from quadctl.logs.findings import Finding, Kind, Span, finding
from quadctl.logs.flight_log import ATTITUDE, FlightLog, Floats
from quadctl.logs.merge import intervals
from quadctl.logs.record.flight_time import Mask, within

UPSIDE_DOWN_DEG, UPSIDE_DOWN_S = 90.0, 0.2
"""Tilt beyond which the thrust no longer holds the vehicle, and the time for which it is no glitch of the angles."""
DISOBEYED_DEG, DISOBEYED_S = 25.0, 1.0
"""Error of roll or pitch against the command, and its duration, that no attitude controller leaves in control."""
LIMITS, AT_LIMIT_S = (0.01, 0.99), 2.0
"""Shares of the range of a motor output at which it cannot give less or more, and the time there that is long. A weak
battery holds a motor there in a climb, too: it is out of control where the vehicle turns, leans or sinks meanwhile."""
TURNS_RAD_S, LEANS_DEG, SINKS_M_S, ERROR_DEG = 2.0, 45.0, 2.0, 10.0
"""Yaw rate, tilt, rate of descent, and error of the attitude beside a motor at its limit that tell of lost control."""
FAILURES = re.compile(
    r"crash[: ]|attitude failure|failure detected|motor \d* ?failure|failure.*motor|terminat(ion|ed|ing)|parachute|"
    r"potential thrust loss",
    re.IGNORECASE,
)
"""Messages by which an autopilot says itself that the vehicle fails."""
NO_FAILURES = re.compile(r"crash (dump|report|log)|disabled|params?", re.IGNORECASE)


def out_of_control(log: FlightLog, flights: tuple[Span, ...]) -> list[Finding]:
    """Findings on flights that get out of control, each from the moment on to the end of the flight."""
    found = []
    for flight in flights:
        signs = [(time_s, why, figures) for time_s, why, figures in _signs(log, flight)]
        if signs:
            time_s, why, figures = min(signs, key=lambda sign: sign[0])
            found.append(finding(Kind.OUT_OF_CONTROL, [(time_s, flight[1])], why=why, **figures))
    return found


def _signs(log: FlightLog, flight: Span) -> Iterator[tuple[float, str, dict[str, object]]]:
    time_s, inside = log.time_s, within(log.time_s, [flight])
    if all(log.has(name) for name in ATTITUDE[:2]):
        roll, pitch = (np.radians(np.nan_to_num(log[name])) for name in ATTITUDE[:2])
        tilt = np.degrees(np.arccos(np.clip(np.cos(roll) * np.cos(pitch), -1.0, 1.0)))
        if (at := _first(time_s, inside & (tilt > UPSIDE_DOWN_DEG), UPSIDE_DOWN_S)) is not None:
            yield at, "upside down", {"tilt_deg": float(tilt[inside].max())}
        for name in ATTITUDE[:2]:
            command = name.replace("_deg", "_cmd_deg")
            if not (log.has(name) and log.has(command)):
                continue
            error = np.abs(np.nan_to_num(log[name] - log[command]))
            if (at := _first(time_s, inside & (error > DISOBEYED_DEG), DISOBEYED_S)) is not None:
                largest = float(error[inside & (time_s >= at)].max())
                yield at, "attitude not as commanded", {"angle": name.removesuffix("_deg"), "error_deg": largest}
    helpless = _helpless(log)
    for name in log.columns:
        if motor_of(name) is None or not name.endswith("_output"):
            continue
        output = log[name]
        for side, limit in zip((output <= LIMITS[0], output >= LIMITS[1]), ("least", "most"), strict=True):
            for at, until in _lasting(time_s, inside & side, AT_LIMIT_S):
                if helpless[(time_s >= at) & (time_s <= until)].any():
                    yield at, "motor at its limit", {"motor": motor_of(name), "limit": limit}
    for event in events_of(log.meta):
        if (
            flight[0] <= event.time_s <= flight[1]
            and FAILURES.search(event.what)
            and not NO_FAILURES.search(event.what)
        ):
            yield event.time_s, "said by the autopilot", {"message": event.what}


def _helpless(log: FlightLog) -> Mask:
    """Rows in which the vehicle turns, leans, sinks or disobeys as it does where a motor has no more to give."""
    found = np.zeros(len(log), dtype=bool)
    if log.has("yaw_rate_rad_s"):
        found |= np.abs(np.nan_to_num(log["yaw_rate_rad_s"])) > TURNS_RAD_S
    if log.has("vz_m_s"):
        found |= np.nan_to_num(log["vz_m_s"]) < -SINKS_M_S
    for name in (name for name in ATTITUDE[:2] if log.has(name)):
        found |= np.abs(np.nan_to_num(log[name])) > LEANS_DEG
        command = name.replace("_deg", "_cmd_deg")
        if log.has(command):
            found |= np.abs(np.nan_to_num(log[name] - log[command])) > ERROR_DEG
    return found


def _first(time_s: Floats, on: Mask, least_s: float) -> float | None:
    """Begin of the first stretch of a flag that lasts; None without any."""
    return next((begin for begin, _ in _lasting(time_s, on, least_s)), None)


def _lasting(time_s: Floats, on: Mask, least_s: float) -> list[Span]:
    """Stretches of a flag that last."""
    return [(begin_s, end_s) for begin_s, end_s in intervals(time_s, on) if end_s - begin_s >= least_s]
