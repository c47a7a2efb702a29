"""Steps that can be seen in a log without mission phases: in its reference, else in its position."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from quadctl.errors import LogError
from quadctl.logs.columns import rpm_columns
from quadctl.logs.flight_log import FlightLog, Floats

LEAST_JUMP_M, LEAST_STEP_M = 0.05, 0.2
"""Smallest step that is looked for in a reference, and in a position, which also drifts."""
LISTED = 3
"""So many steps are listed where there are too many."""
SAME_REFERENCE_M = 1e-5
"""A reference that changes by less is constant, but for the digits of a file."""
QUIET = 0.1
"""Largest movement before a step, relative to the step."""
DEPARTED = 0.05
"""The vehicle has begun its step when it has gone this share of it."""
LEFT_M = 0.1
"""A vehicle this far from where it settled has left: it lands, or steps again."""
BEFORE_S, AFTER_S, LEVEL_S = 1.0, 3.0, 5.0
"""Time that the vehicle is quiet before a step, time to arrive, and time over which its new level is a median."""
GRID_S = 0.05
"""Positions are looked at on a grid of this."""
SPINNING = 0.5
"""Rotors that turn faster than this share of their median speed carry the vehicle."""
ON_GROUND_M = 0.06
"""A level this close to where the vehicle stands is the ground: take-off and landing are no steps."""


@dataclass(frozen=True)
class Step:
    """One step along an axis; times in the log's own."""

    start_s: float
    end_s: float
    """Time at which the new level was left, or the log ends."""
    from_m: float
    to_m: float

    def __str__(self) -> str:
        return f"from {self.from_m:.2f} to {self.to_m:.2f} m at {self.start_s:.2f} s"


def source_of_steps(log: FlightLog, axis: str) -> str:
    """`reference` where the log has one along `axis`, else `position`."""
    return "reference" if log.has(f"{axis}_ref_m") else "position"


def only_step(log: FlightLog, axis: str = "z") -> Step:
    """The one step along `axis` that a log holds.

    Raises
    ------
    LogError
        It holds none, or several.
    """
    source = source_of_steps(log, axis)
    found = steps_in_reference(log, axis) if source == "reference" else steps_in_position(log, axis)
    if len(found) == 1:
        return found[0]
    what = f"{len(found)} steps were" if found else "no step was"
    listed = f" ({', '.join(map(str, found[:LISTED]))}{', ...' if len(found) > LISTED else ''})" if found else ""
    raise LogError(
        f"{log.name}: has no phases, and {what} found in the {source} along {axis}{listed}, "
        "expected one, or a time window (--from, --to) to measure it in"
    )


def steps_in_reference(log: FlightLog, axis: str = "z") -> list[Step]:
    """Jumps of the reference between two stretches in which it is constant."""
    time, reference = log.time_s, log[f"{axis}_ref_m"]
    change = np.diff(reference)  # change[i] leads to row i + 1
    constant = np.abs(change) <= SAME_REFERENCE_M
    found = []
    for i in np.flatnonzero(np.abs(change) >= LEAST_JUMP_M).tolist():
        if 0 < i < len(change) - 1 and constant[i - 1] and constant[i + 1]:
            left = np.flatnonzero(~constant[i + 1 :])
            last = i + 1 + (int(left[0]) if len(left) else len(constant) - i - 1)
            found.append(Step(float(time[i + 1]), float(time[last]), float(reference[i]), float(reference[i + 1])))
    return found


def steps_in_position(log: FlightLog, axis: str = "z") -> list[Step]:
    """Changes of the position between two levels in the air; each begins when the vehicle departs, not when it is told.

    Where rotor speeds tell when the vehicle stands, take-off and landing are left out.
    """
    position = log[f"{axis}_m"]
    known, flying = np.isfinite(position), _flying(log)
    airborne = np.flatnonzero(known & flying)
    if len(airborne) < 2:
        return []
    standing = position[known & ~flying]
    ground = float(np.median(standing)) if axis == "z" and len(standing) else -np.inf
    time = np.arange(log.time_s[airborne[0]], log.time_s[airborne[-1]], GRID_S)
    level = np.interp(time, log.time_s[airborne], position[airborne])
    before, after = round(BEFORE_S / GRID_S), round(AFTER_S / GRID_S)
    found: list[Step] = []
    i = before
    while i + after < len(level):
        past = level[i - before : i]
        old = float(np.median(past))
        arrived = float(np.median(level[i + after : i + after + before]))
        size = abs(arrived - old)
        departs = abs(level[i] - old) > DEPARTED * size
        in_the_air = min(old, arrived) > ground + ON_GROUND_M
        if not (size >= LEAST_STEP_M and departs and np.ptp(past) <= QUIET * size and in_the_air):
            i += 1
            continue
        new = float(np.median(level[i + after : i + after + round(LEVEL_S / GRID_S)]))
        end = _leaves(level, i + after, new)
        found.append(Step(float(time[i - 1]), float(time[end]), old, new))
        i = max(end, i + after)
    return found


def _flying(log: FlightLog) -> NDArray[np.bool_]:
    """True in rows in which the rotors carry the vehicle, shape (n,); in all rows of a log without rotor speeds."""
    names = rpm_columns(log.n_rotors)
    if not names:
        return np.ones(len(log), dtype=bool)
    speed = np.nan_to_num(np.mean([log[name] for name in names], axis=0))
    turning = speed[speed > 0.0]
    return np.asarray(speed > SPINNING * np.median(turning)) if len(turning) else np.ones(len(log), dtype=bool)


def _leaves(level: Floats, begin: int, new: float) -> int:
    """Index at which `level` departs from `new` for good, looked for from `begin` on; the last one where it stays."""
    far = np.flatnonzero(np.abs(level[begin:] - new) > LEFT_M)
    if not len(far):
        return len(level) - 1
    near = np.flatnonzero(np.abs(level[begin : begin + far[0] + 1] - new) <= DEPARTED * LEFT_M / QUIET)
    return begin + (int(near[-1]) if len(near) else int(far[0]))
