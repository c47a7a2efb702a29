"""Channels that live: what cannot be a measurement is left out before anything is made of it."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from quadctl.logs.columns import motor_of
from quadctl.logs.findings import Finding, Kind, Span, finding
from quadctl.logs.flight_log import IMU, RATES, FlightLog, Floats
from quadctl.logs.record.flight_time import Mask, total, within

LIMITS = {"rad_s": 75.0, "imu": 400.0, "output": 1.02, "throttle": 1.02, "battery": 500.0}
"""Largest body rate, rad/s (gyros reach 4000 deg/s), specific force, m/s^2 (accelerometers reach 32 g, of shocks 40),
share of an output or a throttle, and voltage."""
LEAST_BATTERY_V = 2.0
"""Least voltage of a battery that carries a multirotor: an empty lithium cell."""
SILENT_SHARE = 0.1
"""Share of the middle rotor's speed below which a rotor's speed is not measured: it would not be carried."""
FROZEN_S, FROZEN_HOLDS, FROZEN_CHANGES = 5.0, 20.0, 20
"""A motor's signal is frozen where it stays the same for longer than this time, and for that many times as long as it
usually holds a value, while each of the others changes at least so many times."""
MOSTLY = 0.5
"""Share of the flight for which a signal is frozen from which on it is not read at all."""


def possible(log: FlightLog) -> tuple[FlightLog, list[Finding]]:
    """The log without values that no sensor gives and no motor is told."""
    columns, findings = dict(log.columns), []
    limits: list[tuple[str, float, Callable[[Floats], Floats]]] = [
        *((name, LIMITS["rad_s"], np.abs) for name in RATES),
        *((name, LIMITS["imu"], np.abs) for name in IMU),
        *((name, LIMITS["output"], np.abs) for name in log.columns if name.endswith("_output")),
        ("throttle_cmd", LIMITS["throttle"], np.abs),
        ("battery_v", LIMITS["battery"], np.abs),
    ]
    for name, limit, size in limits:
        if name not in columns:
            continue
        with np.errstate(invalid="ignore"):
            beyond = size(columns[name]) > limit
        if beyond.any():
            findings.append(finding(Kind.IMPOSSIBLE_VALUES, column=name, values=int(beyond.sum()), limit=limit))
            columns[name] = np.where(beyond, np.nan, columns[name])
    return replace(log, columns=columns), findings


def living(log: FlightLog, flights: Sequence[Span]) -> tuple[FlightLog, list[Finding]]:
    """The log without channels that do not measure in flight what they are named for, and findings on these.

    A finding with times leaves out these times; one without left a channel out.
    """
    inside = within(log.time_s, flights)
    if not inside.any():
        return log, []
    findings: list[Finding] = []
    log = _battery(log, inside, findings)
    log = _speeds(log, inside, flights, findings)
    return log, findings


def _battery(log: FlightLog, inside: Mask, findings: list[Finding]) -> FlightLog:
    if not log.has("battery_v") or not np.isfinite(log["battery_v"][inside]).any():
        return log
    volts = float(np.nanmedian(log["battery_v"][inside]))
    if volts > LEAST_BATTERY_V:
        return log
    findings.append(finding(Kind.DEAD_CHANNEL, channel="battery_v", why="no battery", value=volts))
    return _without(log, ["battery_v"])


def _speeds(log: FlightLog, inside: Mask, flights: Sequence[Span], findings: list[Finding]) -> FlightLog:
    """The log without rotor speeds where one of them is not measured and another signal tells the thrust."""
    names = [f"motor{i}_rpm" for i in range(1, log.n_rotors + 1)]
    if len(names) < 2:
        return log
    medians = {name: _median(np.abs(log[name][inside])) for name in names}
    others = [name for name in ("motor1_output", "throttle_cmd", "thrust_cmd_n") if log.has(name)]
    if others and not np.isfinite(list(medians.values())).any():
        findings.append(
            finding(Kind.DEAD_CHANNEL, channel=f"{names[0]} to {names[-1]}", why="not measured", value=None)
        )
        return _without(log, [name for name in log.columns if name.endswith("_rpm")])
    middle = float(np.nanmedian(list(medians.values())))
    silent = [name for name in names if not medians[name] > SILENT_SHARE * middle and not _is_off(log, name, inside)]
    frozen = _frozen(log, names, inside)
    lost = {name: total(_overlap(flights, frozen.get(name, []))) for name in names}
    stuck = [name for name in names if name not in silent and lost[name] > MOSTLY * total(flights)]
    if others and not silent and not stuck:
        stuck = _standing(log, names, others[0], inside)
    if (silent or stuck) and others:
        why = {**dict.fromkeys(silent, "stands"), **dict.fromkeys(stuck, "frozen")}
        for name, how in why.items():
            value = medians[name] if np.isfinite(medians[name]) else None
            cause = how if value is not None else "not measured"
            findings.append(finding(Kind.DEAD_CHANNEL, channel=name, why=cause, value=value))
        return _without(log, [name for name in log.columns if name.endswith("_rpm")])
    findings += [finding(Kind.FROZEN_ROTOR, frozen[name], rotor=motor_of(name)) for name in names if name in frozen]
    return log


def _standing(log: FlightLog, names: Sequence[str], other: str, inside: Mask) -> list[str]:
    """Speeds of rotors that never change in flight, or are hardly ever known together, while another signal changes."""
    known = inside & np.all([np.isfinite(log[name]) for name in names], axis=0)
    rows = log.updates(*names)
    changes = np.count_nonzero(inside[rows])
    of_other = np.count_nonzero(inside[log.updates(other)])
    if of_other < FROZEN_CHANGES or (changes >= FROZEN_CHANGES and np.mean(known[inside]) > 1.0 - MOSTLY):
        return []
    return list(names)


def _is_off(log: FlightLog, name: str, inside: Mask) -> bool:
    """Tell whether the output to a motor says that it stands, as one that has failed may."""
    outputs = {own: _median(log[own][inside]) for own in log.columns if own.endswith("_output") and log.has(own)}
    own = outputs.get(name.replace("_rpm", "_output"), float("inf"))
    return bool(outputs) and own < SILENT_SHARE * float(np.nanmedian(list(outputs.values())))


def _frozen(log: FlightLog, names: Sequence[str], inside: Mask) -> dict[str, list[Span]]:
    """Times in which one signal stays the same while the others change, by its name: a wire that is off.

    A rotor that holds its speed still shows the noise of the sensor, and one that is rounded holds values again and
    again.
    """
    rows = np.flatnonzero(inside & np.all([np.isfinite(log[name]) for name in names], axis=0))
    if len(rows) < 2:
        return {}
    time_s = log.time_s[rows]
    changed = {name: np.flatnonzero(np.diff(log[name][rows])) + 1 for name in names}
    usual_s = float(np.median([np.percentile(_holds(time_s, own), 90.0) for own in changed.values()]))
    longest_s = max(FROZEN_S, FROZEN_HOLDS * usual_s)
    found: dict[str, list[Span]] = {}
    for name, own in changed.items():
        ends = np.concatenate([[0], own, [len(time_s) - 1]])
        long = _holds(time_s, own) > longest_s
        for first, last in zip(ends[:-1][long], ends[1:][long], strict=True):
            others = [np.count_nonzero((c > first) & (c <= last)) for other, c in changed.items() if other != name]
            if min(others, default=0) >= FROZEN_CHANGES:
                found.setdefault(name, []).append((float(time_s[first]), float(time_s[last])))
    return found


def _holds(time_s: Floats, changed: NDArray[np.intp]) -> Floats:
    """Times for which a signal holds each of its values."""
    return np.diff(time_s[np.concatenate([[0], changed, [len(time_s) - 1]]).astype(np.intp)])


def _overlap(flights: Sequence[Span], spans: Sequence[Span]) -> list[Span]:
    pieces = [(max(a, begin), min(b, end)) for a, b in flights for begin, end in spans]
    return [(a, b) for a, b in pieces if b > a]


def _median(values: Floats) -> float:
    return float(np.nanmedian(values)) if np.isfinite(values).any() else float("nan")


def _without(log: FlightLog, names: Sequence[str]) -> FlightLog:
    return replace(log, columns={name: values for name, values in log.columns.items() if name not in names})
