"""Time in flight: from the take-off to the landing, without what stands on the ground in between.

The ground has a height at a time, not one height: the barometer drifts, a slope or a roof is higher. So each stretch
between two rests, in which the rotors work, is a flight, whatever its heights; the ground before it ends where the
vehicle leaves the height of that rest, and the ground after it begins where it reaches the height of the next.
"""

import itertools
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from quadctl.frames import GRAVITY_M_S2, quaternion_from_euler, rotate
from quadctl.logs.columns import MOTOR_QUANTITIES, motor_of
from quadctl.logs.findings import Span
from quadctl.logs.flight_log import ATTITUDE, VELOCITY, FlightLog, Floats
from quadctl.logs.merge import runs

Mask = NDArray[np.bool_]

THRUST_SOURCES = ("rpm", "motor output", "throttle command", "thrust command")
"""Channels from which thrust can be known, the best first."""
GROUND_PHASES = ("wait", "stream", "start", "spool_up", "land", "released", "done")
"""Phases of quadctl's own logs in which no mission is flown."""

FLOWN_S = 5.0
"""Time for which the rotors give more than the drive that counts as high: a flight is longer, a spike is not."""
WORKING_SHARE = 0.4
"""Share of the drive in flight above which rotors work; idling ones give less."""
LONGEST_HOLD_S = 1.0
"""Time for which a drive without new values is taken to go on."""
IDLE_S = 1.0
"""Rotors may idle in the air for an instant, at the top of a quick climb; a rest is longer."""
REST_RANGE_M, STILL_M_S = 0.3, 0.5
"""Range of height, and speed, within which a vehicle stands still."""
CLEARANCE_M = 0.05
"""Distance from the height of a rest at which the vehicle has left the ground, unless its height scatters more."""
LONGEST_ROW_GAP_S = 10.0
"""Largest time between rows of one flight; after a longer gap the clock has jumped, or another flight begins."""
TRIM_START_S, TRIM_END_S = 2.0, 1.5
"""Times cut off at the beginning and end of each flight, for the take-off transient and the touchdown."""

STEP_S, SMOOTHED_S = 0.1, 0.5
"""Step of the clock on which forces are compared, and the time over which they are averaged."""
HELD_M_S2, PUSHED_M_S2, CARRIED_M_S2 = 1.0, 2.0, 4.0
"""Force of the ground over mass: the least that counts beside a vehicle that does not obey, along and across gravity,
and the least that counts by itself. No effect of the air near the ground carries 40 % of a vehicle that hovers."""
DISOBEYED_DEG, DISOBEYED_M_S = 5.0, 0.5
"""Difference of the attitude from its command, and of the velocity from its reference, that a vehicle in the air
does not keep."""
CONTACT_S = 1.0
"""Least duration of a contact, and the time around it that is left out with it."""


@dataclass(frozen=True)
class FlightTime:
    """Times in flight, s on the log's clock."""

    flights: tuple[Span, ...]
    """Stretches from take-off to landing."""
    on_ground: tuple[Span, ...]
    """Stretches within them in which the vehicle stands on the ground, rotors working."""
    rests_up_m: tuple[tuple[float, float], ...]
    """Time and height of each rest before or after a flight."""
    upside_down: bool = False
    """True where the height falls at the take-off, and the vehicle flies below the ground."""


def flight_time(log: FlightLog, thrust_source: str | None) -> FlightTime:
    """Find the flights of a log whose rotors are driven as `thrust_source`, one of THRUST_SOURCES, says."""
    nothing = FlightTime((), (), ())
    if len(log) < 2 or not log.has("z_m"):
        return nothing
    time_s = log.time_s
    logged = thrust_drive(log, thrust_source)
    lost = np.zeros(len(log), dtype=bool) if logged is None else np.isnan(logged)
    drive = None if logged is None else np.nan_to_num(logged)
    level = flown_drive(time_s, drive)
    working = np.ones(len(log), dtype=bool) if drive is None else _mostly(time_s, drive > WORKING_SHARE * level)
    working = _as_before(working, lost)
    ground = _on_ground(log, drive, level, working & ~lost)
    flights: list[Span] = []
    rests: list[tuple[float, float]] = []
    upside_down = False
    for first, last in _runs(working, time_s):
        before, after = _rest(log, working | lost, first, -1), _rest(log, working | lost, last, 1)
        begin, end = _airborne(log, first, last, before, after, ground)
        if end > begin:
            flights.append((float(time_s[begin]), float(time_s[end])))
            rests += [(float(time_s[row]), rest.height_m) for row, rest in ((first, before), (last, after)) if rest]
            upside_down |= _below_ground(log, begin, end, before, after)
    if log.phase is not None:
        flights = list(without(flights, _spans(time_s, np.isin(log.phase, GROUND_PHASES))))
    inside = [span for span in _spans(time_s, ground) if span[1] - span[0] >= CONTACT_S]
    inside = [(a, b) for a, b in inside if any(begin < a and b < end for begin, end in flights)]
    return FlightTime(tuple(flights), tuple(inside), tuple(rests), upside_down)


def driven(log: FlightLog, thrust_source: str) -> tuple[Span, ...]:
    """Stretches in which the rotors work: the flights, as far as a log without a height tells them."""
    drive = np.nan_to_num(np.asarray(thrust_drive(log, thrust_source)))
    working = _mostly(log.time_s, drive > WORKING_SHARE * flown_drive(log.time_s, drive))
    return tuple((float(log.time_s[first]), float(log.time_s[last])) for first, last in _runs(working, log.time_s))


def usable(flights: Iterable[Span], left_out: Iterable[Span]) -> tuple[Span, ...]:
    """Flights without their ends, and without what is left out."""
    trimmed = [(begin + TRIM_START_S, end - TRIM_END_S) for begin, end in flights]
    return without([(begin, end) for begin, end in trimmed if end > begin], left_out)


def without(spans: Iterable[Span], left_out: Iterable[Span]) -> tuple[Span, ...]:
    """Stretches of time without those that are left out."""
    kept = list(spans)
    for begin, end in left_out:
        pieces = [piece for a, b in kept for piece in ((a, min(b, begin)), (max(a, end), b))]
        kept = [(a, b) for a, b in pieces if b > a]
    return tuple(kept)


def total(spans: Iterable[Span]) -> float:
    """Time of all stretches, s."""
    return sum(end - begin for begin, end in spans)


def within(time_s: Floats, spans: Iterable[Span]) -> Mask:
    """Mask of the times that lie in one of the stretches."""
    inside = np.zeros(len(time_s), dtype=bool)
    for begin, end in spans:
        inside[np.searchsorted(time_s, begin) : np.searchsorted(time_s, end, side="right")] = True
    return inside


# --- drive ------------------------------------------------------------------------------------------------------------


def thrust_drive(log: FlightLog, thrust_source: str | None) -> Floats | None:
    """Signal that grows with the thrust of all rotors, about in proportion, shape (n,), NaN where it brings nothing
    new for LONGEST_HOLD_S; None where none is logged."""
    if thrust_source in ("throttle command", "thrust command"):
        name = {"throttle command": "throttle_cmd", "thrust command": "thrust_cmd_n"}[thrust_source]
        return _held(log.time_s, log[name])
    quantity = {"rpm": "rpm", "motor output": "output"}.get(thrust_source or "")
    if quantity is None:
        return None
    assert quantity in MOTOR_QUANTITIES
    motors = [name for name in log.columns if motor_of(name) is not None and name.endswith(f"_{quantity}")]
    each = np.array([_held(log.time_s, log[name]) for name in motors if log.has(name)])
    return np.asarray(np.mean(each**2 if quantity == "rpm" else each, axis=0))


def _held(time_s: Floats, values: Floats) -> Floats:
    """Values held over rows without one for up to LONGEST_HOLD_S; NaN where there is none for longer."""
    known = np.flatnonzero(np.isfinite(values))
    if not len(known):
        return np.full(len(values), np.nan)
    last = known[np.maximum(np.searchsorted(known, np.arange(len(values)), side="right") - 1, 0)]
    fresh = (time_s - time_s[last] <= LONGEST_HOLD_S) & (last <= np.arange(len(values)))
    return np.where(fresh, values[last], np.nan)


def flown_drive(time_s: Floats, drive: Floats | None) -> float:
    """Middle of the drive while the rotors carry the vehicle; however long the log stands on the ground."""
    if drive is None or not len(drive):
        return 0.0
    lasts_s = np.minimum(np.diff(time_s, append=time_s[-1]), 1.0)
    order = np.argsort(drive)[::-1]
    high = drive[order[np.searchsorted(np.cumsum(lasts_s[order]), min(FLOWN_S, 0.5 * float(lasts_s.sum())))]]
    above = drive > 0.5 * high
    return float(np.median(drive[above])) if above.any() else 0.0


def _as_before(on: Mask, unknown: Mask) -> Mask:
    """A flag that keeps its value over rows in which it is not known."""
    known = np.flatnonzero(~unknown)
    if not len(known):
        return np.zeros(len(on), dtype=bool)
    kept: Mask = on[known[np.maximum(np.searchsorted(known, np.arange(len(on)), side="right") - 1, 0)]]
    return kept


def _mostly(time_s: Floats, on: Mask) -> Mask:
    """Rows around which a flag is set for a quarter of the time within IDLE_S."""
    begin, end = np.searchsorted(time_s, time_s - IDLE_S), np.searchsorted(time_s, time_s + IDLE_S, side="right")
    count = np.concatenate([[0], np.cumsum(on)])
    found: Mask = count[end] - count[begin] > 0.25 * (end - begin)
    return found


def _runs(on: Mask, time_s: Floats) -> list[tuple[int, int]]:
    """First and last row of each stretch in which a flag is set, not across long gaps between rows."""
    apart = np.diff(time_s) >= LONGEST_ROW_GAP_S
    steps = np.flatnonzero(np.diff(on.astype(np.int8)) != 0) + 1
    edges = np.unique(np.concatenate([[0], steps, np.flatnonzero(apart) + 1, [len(on)]]))
    return [(int(a), int(b) - 1) for a, b in itertools.pairwise(edges) if on[a]]


def _spans(time_s: Floats, on: Mask) -> list[Span]:
    return [(float(time_s[first]), float(time_s[last])) for first, last in _runs(on, time_s)]


# --- ground -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Rest:
    height_m: float
    clearance_m: float


def _rest(log: FlightLog, working: Mask, row: int, side: int) -> _Rest | None:
    """Rest beside a stretch with working rotors, before its first row (side -1) or after its last (1).

    Rows in which nobody knows whether the rotors work count as `working`, too.
    """
    time_s = log.time_s
    edge = row + side
    if not 0 <= edge < len(log) or working[edge] or abs(time_s[edge] - time_s[row]) >= LONGEST_ROW_GAP_S:
        return None
    if side > 0 and not _is_fresh(log, edge):
        return None
    rows = np.arange(edge, -1, -1) if side < 0 else np.arange(edge, len(log))
    rows = rows[np.abs(time_s[rows] - time_s[edge]) <= 2.0 * IDLE_S]
    stop = np.flatnonzero(working[rows])
    rows = rows[: stop[0]] if len(stop) else rows
    z = log["z_m"][rows]
    z = z[np.isfinite(z)]
    if len(z) < 2 or abs(time_s[rows[-1]] - time_s[edge]) < 0.5 * IDLE_S or np.ptp(z) > REST_RANGE_M:
        return None
    return _Rest(float(np.median(z)), max(CLEARANCE_M, 4.0 * float(np.std(z))))


def _is_fresh(log: FlightLog, edge: int) -> bool:
    """Tell whether the height has changed since shortly before a landing: a recorder may go on with the last state."""
    rows = log.updates("z_m")
    late = rows[log.time_s[rows] > log.time_s[edge] - 2.0 * IDLE_S]
    return len(late) > 0


def _airborne(
    log: FlightLog, first: int, last: int, before: _Rest | None, after: _Rest | None, ground: Mask
) -> tuple[int, int]:
    """First and last row in the air of a stretch with working rotors."""
    z = log["z_m"][first : last + 1]
    stands = ground[first : last + 1]

    def lifted(rest: _Rest | None) -> Mask:
        clear = np.ones(len(z), dtype=bool) if rest is None else np.abs(z - rest.height_m) > rest.clearance_m
        return clear & np.isfinite(z) & ~stands

    up, down = np.flatnonzero(lifted(before)), np.flatnonzero(lifted(after))
    return (first + int(up[0]), first + int(down[-1])) if len(up) and len(down) else (last, first)


def _below_ground(log: FlightLog, begin: int, end: int, before: _Rest | None, after: _Rest | None) -> bool:
    """Tell whether the height falls at a take-off from a rest and stays below the ground until the landing."""
    if before is None:
        return False
    z, time_s = log["z_m"][begin : end + 1], log.time_s[begin : end + 1]
    ground_m = min(rest.height_m for rest in (before, after) if rest)
    low = float(np.nanmedian(z)) < ground_m - REST_RANGE_M
    first = z[time_s < time_s[0] + TRIM_START_S]
    return low and float(np.nanmedian(first)) < before.height_m - before.clearance_m


def _on_ground(log: FlightLog, drive: Floats | None, level: float, working: Mask) -> Mask:
    """Rows in which the vehicle stands on the ground although its rotors work: something else carries or holds it.

    The force that neither the rotors nor gravity explain is compared with that of the whole flight, so that a steady
    wind, a drag or a wrong attitude count for nothing.
    """
    names = (*VELOCITY, *ATTITUDE)
    if drive is None or level <= 0.0 or not working.any() or not all(log.has(name) for name in names):
        return np.zeros(len(log), dtype=bool)
    grid = clock_of(log.time_s)
    if len(grid) < 2 * round(CONTACT_S / STEP_S):
        return np.zeros(len(log), dtype=bool)
    velocity = np.array([on_clock(grid, log, name) for name in VELOCITY])
    roll, pitch, yaw = (np.radians(on_clock(grid, log, name, unwrap=True)) for name in ATTITUDE)
    flown = np.interp(grid, log.time_s, working.astype(float)) > 0.5
    north, east, down = rotate(quaternion_from_euler(roll, pitch, yaw), (0.0, 0.0, -1.0))
    axis = np.array([north, east, -np.asarray(down)])
    steps = round(0.5 * SMOOTHED_S / STEP_S)
    acceleration = averaged(np.gradient(velocity, grid, axis=1), steps)
    acceleration[2] += GRAVITY_M_S2
    push = averaged(axis * np.interp(grid, log.time_s, drive), steps)
    still = np.max(np.abs(velocity), axis=0) < STILL_M_S
    carried = flown & (push[2] > 0.0)
    if not carried.any():
        return np.zeros(len(log), dtype=bool)
    other = acceleration - push * float(np.median(acceleration[2, carried] / push[2, carried]))
    other -= np.median(other[:, carried], axis=1, keepdims=True)
    across = np.hypot(other[0], other[1])
    disobeys = _disobeys(log, grid, velocity, steps)
    held = (other[2] > CARRIED_M_S2) | (disobeys & ((other[2] > HELD_M_S2) | (across > PUSHED_M_S2)))
    contact = _lasting(held & still & flown, round(CONTACT_S / STEP_S))
    # What is in contact stays so until it moves, or until nothing but the air carries it.
    may = still & flown & ((other[2] > HELD_M_S2) | (across > PUSHED_M_S2))
    contact = _grown(contact, may)
    carried_by_ground = may & (other[2] > HELD_M_S2)
    contact |= _grown(_beside(flown) & (carried_by_ground | ~flown), carried_by_ground)
    return _at_rows(contact, grid, log.time_s)


def _disobeys(log: FlightLog, grid: Floats, velocity: Floats, steps: int) -> Mask:
    """Times in which the attitude is not the commanded one, or the velocity not the reference."""
    found = np.zeros(len(grid), dtype=bool)
    for name in ATTITUDE[:2]:
        command = name.replace("_deg", "_cmd_deg")
        if log.has(name) and log.has(command):
            error = averaged(on_clock(grid, log, name) - on_clock(grid, log, command), steps)
            found |= np.abs(error) > DISOBEYED_DEG
    for own, name in zip(velocity, VELOCITY, strict=True):
        reference = name.replace("_m_s", "_ref_m_s")
        if log.has(reference):
            found |= np.abs(own - on_clock(grid, log, reference)) > DISOBEYED_M_S
    return found


def clock_of(time_s: Floats) -> Floats:
    """Even clock over the rows, in steps of STEP_S, without the times of long gaps."""
    return np.asarray(STEP_S * np.unique(np.floor(time_s / STEP_S)))


def on_clock(grid: Floats, log: FlightLog, name: str, unwrap: bool = False) -> Floats:
    return np.interp(grid, *updated(log, name, unwrap))


def updated(log: FlightLog, name: str, unwrap: bool = False) -> tuple[Floats, Floats]:
    """Times of a channel's updates, s, and its values there; angles in degrees may be made continuous."""
    rows = log.updates(name)
    values = log[name][rows]
    return log.time_s[rows], np.unwrap(values, period=360.0) if unwrap else values


def averaged(values: Floats, steps: int) -> Floats:
    """Running mean over `steps` values on each side, along the last axis."""
    padded = np.concatenate(
        [np.repeat(values[..., :1], steps, -1), values, np.repeat(values[..., -1:], steps, -1)], axis=-1
    )
    sums = np.cumsum(np.concatenate([np.zeros((*values.shape[:-1], 1)), padded], axis=-1), axis=-1)
    width = 2 * steps + 1
    return np.asarray((sums[..., width:] - sums[..., :-width]) / width)


def _lasting(on: Mask, least: int) -> Mask:
    """The stretches of a flag that last for at least so many steps."""
    kept = np.zeros(len(on), dtype=bool)
    for begin, end in runs(on):
        kept[begin:end] = end - begin >= least
    return kept


def _grown(seed: Mask, may: Mask) -> Mask:
    """The seed with the stretches of `may` that touch it."""
    grown = np.zeros(len(seed), dtype=bool)
    for begin, end in runs(seed | may):
        grown[begin:end] = seed[begin:end].any()
    return grown


def _beside(on: Mask) -> Mask:
    """The last step before a flag is set, the first after, and the ends of a log that begins or ends with it: what
    grows from there touches a rest, or may."""
    off = ~on
    edge = np.zeros(len(on), dtype=bool)
    edge[[0, -1]] = on[[0, -1]]
    edge[:-1] |= off[:-1] & on[1:]
    edge[1:] |= off[1:] & on[:-1]
    return edge


def _at_rows(on: Mask, grid: Floats, time_s: Floats) -> Mask:
    found: Mask = np.interp(time_s, grid, on.astype(float)) > 0.5
    return found
