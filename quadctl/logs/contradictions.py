"""Values of a log that cannot all be true: an analysis of them would be nonsense without a word of doubt.

A log says most things twice: how a position changes, and the velocity; how an attitude changes, and the body rates;
where the vehicle leans, and where it accelerates to. Each pair is compared over short stretches of the flight, the
liveliest ones above all. What goes together as it should but by another factor is in another unit, by a negative one
upside down.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from quadctl.frames import GRAVITY_M_S2
from quadctl.logs.columns import LATERAL_COLUMNS
from quadctl.logs.findings import Finding, Kind, finding
from quadctl.logs.flight_log import ATTITUDE, IMU, POSITION, RATES, VELOCITY, FlightLog, Floats
from quadctl.logs.kinematics import MOTION, PUSH, SPEED_UP, TURN, Identity, integral

MAX_FACTOR = 2.0
"""Things that should be equal and differ by more are not in the units that they are said to be in."""
MIN_CORRELATION, MAX_SPREAD = 0.8, 0.35
"""Least correlation of two changes, and largest relative spread of their quotients, for a factor to be clear."""
STRANGER_CORRELATION, TWIN_CORRELATION = 0.5, 0.9
"""Changes that go together less do not belong together; those that do more are the same thing."""
MIN_STRETCHES = 8
LIVELY_SHARE = 0.125
"""Share of all stretches that is looked at: those with the largest changes."""
MIN_MOVE_M, MIN_TURN_RAD, MIN_SPEED_UP_M_S = 0.02, 0.005, 0.15
"""Median change over the lively stretches from which on sensor noise is no matter."""
SLOWEST_UPDATE_S = 5.0
"""Updates further apart are no slow log but another unit of time: stretches are then so many updates long."""
UPDATES_OF_A_STRETCH = 25
MIN_ROWS = 100
"""A shorter log may hold a constant by chance."""
SILENT_ROTOR_SHARE = 0.1
"""Share of the middle rotor's speed: a rotor slower than this for most of a log has a dead sensor."""
SPECIFIC_FORCE_RANGE = (0.5, 2.0)
"""Median of the accelerometer's reading over g: hover is 1."""

MOST_LEAN_DEG = 60.0
"""Lean at which thrust is twice the weight: no flight has a larger one for half of its time."""

_DEGREES = 180.0 / np.pi
_MOTION_UNITS = {
    1e-3: "time in ms",
    1e-6: "time in us",
    1e-9: "time in ns",
    1000.0: "position in mm",
    100.0: "position in cm",
    3.2808: "position in ft",
    0.3048: "velocity in ft/s",
    0.5144: "velocity in knots",
    0.2778: "velocity in km/h",
    0.01: "velocity in cm/s",
}
_SPEED_UP_UNITS = {
    _DEGREES: "angles in radians",
    3.2808: "motion in ft",
    100.0: "motion in cm",
    1000.0: "motion in mm",
}
_ACCELERATION_UNITS = {GRAVITY_M_S2: "acceleration in g"}
"""Likely causes of a factor between two channels, by the factor."""


def contradictions(log: FlightLog, side_force: bool = False) -> list[Finding]:
    """Contradictions in a log; [] without any. Nothing is raised.

    With `side_force` the vehicle can speed up without leaning, as one does that is commanded to (`LATERAL_COLUMNS`):
    then where it leans tells nothing.

    Of the comparisons only the first that fails is told: the others may fail because of it.
    """
    side_force = side_force or any(log.has(name) for name in LATERAL_COLUMNS)
    comparisons = (
        _dead_channels,
        _lying_on_its_side,
        _position_against_velocity,
        *(() if side_force else (_velocity_against_tilt,)),
        _attitude_against_rates,
        _acceleration_against_velocity,
    )
    with np.errstate(over="ignore", invalid="ignore"):  # of numbers that are no measurements
        return next((found for compare in comparisons if (found := list(compare(log)))), [])


# --- one quantity against another -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Agreement:
    """Agreement of changes with those that they should equal, over the stretches with the largest changes."""

    factor: float
    """Median quotient."""
    spread: float
    """Median deviation of the quotients from it, relative."""
    correlation: float
    """Correlation of ranks over those stretches, or of the changes over all, whichever is weaker."""
    size: float
    """The larger of the two median changes."""

    def is_wrong(self, min_size: float) -> bool:
        """True where the factor is clear, and far from one."""
        clear = abs(self.correlation) > MIN_CORRELATION and self.spread < MAX_SPREAD and self.size > min_size
        return clear and not 1.0 / MAX_FACTOR < self.factor < MAX_FACTOR


_UNKNOWN = _Agreement(float("nan"), float("nan"), 0.0, 0.0)


def _agreement(change: Floats, expected: Floats) -> _Agreement:
    if len(change) < 2 * MIN_STRETCHES:
        return _UNKNOWN
    change, expected = change - np.median(change), expected - np.median(expected)
    if not np.any(change) or not np.any(expected):
        return _UNKNOWN
    liveliness = np.abs(change) / np.std(change) + np.abs(expected) / np.std(expected)
    lively = np.argsort(liveliness)[-max(MIN_STRETCHES, round(LIVELY_SHARE * len(change))) :]
    lively = lively[expected[lively] != 0.0]
    if len(lively) < MIN_STRETCHES:
        return _UNKNOWN
    quotients = change[lively] / expected[lively]
    factor = float(np.median(quotients))
    spread = float(np.median(np.abs(quotients - factor))) / max(abs(factor), 1e-30)
    among_lively = float(np.corrcoef(_ranks(change[lively]), _ranks(expected[lively]))[0, 1])
    sizes = [float(np.median(np.abs(values[lively]))) for values in (change, expected)]
    # A few lively stretches may go together by chance; a few jumps of an estimator may hide what all others tell.
    bounded = [np.clip(v, -3.0 * size, 3.0 * size) for v, size in zip((change, expected), sizes, strict=True)]
    among_all = float(np.corrcoef(bounded[0], bounded[1])[0, 1]) if min(sizes) > 0.0 else 0.0
    return _Agreement(factor, spread, min(among_lively, among_all, key=abs), max(sizes))


def _ranks(values: Floats) -> Floats:
    return np.argsort(np.argsort(values)).astype(np.float64)


def _stretches(time_s: Floats, values: Sequence[Floats], length_s: float) -> NDArray[np.intp]:
    """Rows between stretches of about `length_s`, each one in which `values` were updated; empty where too few are."""
    steps = np.logical_or.reduce([np.diff(v) != 0.0 for v in values])
    rows = np.flatnonzero(np.concatenate([[True], steps]))
    if len(rows) < 2 * MIN_STRETCHES:
        return np.empty(0, dtype=np.intp)
    interval_s = float(time_s[rows[-1]] - time_s[rows[0]]) / (len(rows) - 1)
    length = UPDATES_OF_A_STRETCH if interval_s > SLOWEST_UPDATE_S else max(1, round(length_s / interval_s))
    return rows[::length]


def _changes(time_s: Floats, level: Floats, slope: Floats, length_s: float) -> tuple[Floats, Floats]:
    """Changes of `level` over stretches, and of the integral of `slope`, which they should equal."""
    ends = _stretches(time_s, [level], length_s)
    return np.diff(level[ends]), np.diff(integral(time_s, slope)[ends])


def _known(log: FlightLog, names: Sequence[str]) -> list[Floats] | None:
    """Time and the columns, without the rows in which one of them is missing; None without such columns."""
    if not all(log.has(name) for name in names):
        return None
    values = [log.time_s, *(log[name] for name in names)]
    known = np.logical_and.reduce([np.isfinite(v) for v in values])
    return [v[known] for v in values] if np.count_nonzero(known) > MIN_STRETCHES else None


def _likely(factor: float, units: dict[float, str], otherwise: str) -> str:
    """Likely cause of a positive factor, by the known one that is nearest."""
    nearest = min(units, key=lambda known: abs(np.log(factor / known)))
    return units[nearest] if 0.8 < factor / nearest < 1.25 else otherwise


# --- what is compared -------------------------------------------------------------------------------------------------


def _lying_on_its_side(log: FlightLog) -> Iterator[Finding]:
    """A multirotor that leans most of the time by more than it can carry itself."""
    known = _known(log, ATTITUDE[:2])
    if known is None:
        return
    roll, pitch = (np.radians(angle) for angle in known[1:])
    lean_deg = float(np.degrees(np.nanmedian(np.arccos(np.clip(np.cos(roll) * np.cos(pitch), -1.0, 1.0)))))
    if lean_deg > MOST_LEAN_DEG:
        yield finding(Kind.LEANS, lean_deg=lean_deg, most_deg=MOST_LEAN_DEG)


def _wrong_factors(log: FlightLog, identity: Identity, min_size: float) -> Iterator[tuple[str, str, float]]:
    """Level, slope and factor of each axis, by itself, whose factor is wrong."""
    for level, slope in zip(identity.levels, identity.needed, strict=True):
        if found := _known(log, (level, slope)):
            agreement = _agreement(*_changes(found[0], found[1], found[2], identity.stretch_s))
            if agreement.is_wrong(min_size):
                yield level, slope, agreement.factor


def _position_against_velocity(log: FlightLog) -> Iterator[Finding]:
    wrong = list(_wrong_factors(log, MOTION, MIN_MOVE_M))
    for position, velocity, factor in wrong:
        sign = "one points down" if position == "z_m" else "one points the other way"
        likely = sign if factor < 0.0 else _likely(factor, _MOTION_UNITS, "not in metres and seconds")
        yield finding(Kind.ANOTHER_FACTOR, of=position, by=velocity, factor=factor, likely=likely)
    if not wrong and (swapped := _swapped(log)):
        yield swapped


def _swapped(log: FlightLog) -> Finding | None:
    found = _known(log, (*POSITION[:2], *VELOCITY[:2]))
    if found is None:
        return None
    time_s, x, y, vx, vy = found
    if _are_swapped(
        [_changes(time_s, x, v, MOTION.stretch_s) for v in (vx, vy)],
        [_changes(time_s, y, v, MOTION.stretch_s) for v in (vy, vx)],
        MIN_MOVE_M,
    ):
        return finding(Kind.SWAPPED, of="position")
    return None


def _are_swapped(
    first: Sequence[tuple[Floats, Floats]], second: Sequence[tuple[Floats, Floats]], min_size: float
) -> bool:
    """True where both changes ignore their own cause and follow the other's; each is a list of (own, other's)."""
    for own, other in (first, second):
        mine, others = _agreement(*own), _agreement(*other)
        if (
            abs(others.correlation) > TWIN_CORRELATION
            and others.spread < MAX_SPREAD
            and others.size > min_size
            and 1.0 / MAX_FACTOR < abs(others.factor) < MAX_FACTOR
            and not abs(mine.correlation) > STRANGER_CORRELATION
        ):
            return True
    return False


def _velocity_against_tilt(log: FlightLog) -> Iterator[Finding]:
    """A vehicle speeds up to where its thrust leans: g tan(tilt), less drag and wind (which never turn the sign)."""
    found = _known(log, PUSH.columns)
    if found is None:
        return
    time_s, *values = found
    columns = dict(zip(PUSH.columns, values, strict=True))
    (north, east), pushes = PUSH.of(columns)
    roll, pitch, yaw = (np.radians(columns[name]) for name in ATTITUDE)
    ends = _stretches(time_s, [north, east], PUSH.stretch_s)
    if len(ends) < 2 * MIN_STRETCHES or np.any(np.abs(np.cos(roll) * np.cos(pitch)) < 0.1):
        return
    heading = yaw[ends[:-1]]
    push_north, push_east = pushes
    by_pitch, by_roll = (np.diff(integral(time_s, push)[ends]) for push in _ahead_and_right(push_north, push_east, yaw))
    forward, right = _ahead_and_right(np.diff(north[ends]), np.diff(east[ends]), heading)
    # A vehicle that turns within a stretch is pushed to the side of its first heading by its pitch, too.
    pushed_north, pushed_east = (np.diff(integral(time_s, push)[ends]) for push in pushes)
    pushed_forward, pushed_right = _ahead_and_right(pushed_north, pushed_east, heading)
    for name, change, expected, where in (
        ("pitch_deg", forward, pushed_forward, "forward"),
        ("roll_deg", right, pushed_right, "to the right"),
    ):
        agreement = _agreement(change, expected)
        if agreement.is_wrong(MIN_SPEED_UP_M_S) and not 0.0 < agreement.factor < 1.0:
            likely = "not in m/s and degrees"
            likely = "wrong sign" if agreement.factor < 0.0 else _likely(agreement.factor, _SPEED_UP_UNITS, likely)
            yield finding(Kind.ANOTHER_FACTOR, of=f"speed {where}", by=name, factor=agreement.factor, likely=likely)
            return
    if _are_swapped([(forward, by_pitch), (forward, by_roll)], [(right, by_roll), (right, by_pitch)], MIN_SPEED_UP_M_S):
        yield finding(Kind.SWAPPED, of="attitude")


def _ahead_and_right(north: Floats, east: Floats, heading: Floats) -> tuple[Floats, Floats]:
    return north * np.cos(heading) + east * np.sin(heading), east * np.cos(heading) - north * np.sin(heading)


def _attitude_against_rates(log: FlightLog) -> Iterator[Finding]:
    found = _known(log, TURN.columns)
    if found is None:
        return
    time_s, *values = found
    levels, slopes = TURN.of(dict(zip(TURN.columns, values, strict=True)))
    if np.any(np.abs(np.cos(levels[1])) < 0.1):
        return
    for name, rate, level, slope in zip(ATTITUDE, RATES, levels, slopes, strict=True):
        agreement = _agreement(*_changes(time_s, level, slope, TURN.stretch_s))
        if agreement.is_wrong(MIN_TURN_RAD):
            likely = "wrong sign of one"
            if agreement.factor > 0.0:
                likely = _likely(agreement.factor, {1.0 / _DEGREES: "rates in degrees"}, "not in their units")
            yield finding(Kind.ANOTHER_FACTOR, of=name, by=rate, factor=agreement.factor, likely=likely)
            return


def _acceleration_against_velocity(log: FlightLog) -> Iterator[Finding]:
    for velocity, own, factor in _wrong_factors(log, SPEED_UP, MIN_SPEED_UP_M_S):
        likely = "one points the other way"
        if factor > 0.0:
            likely = _likely(factor, _ACCELERATION_UNITS, "acceleration not in m/s^2")
        yield finding(Kind.ANOTHER_FACTOR, of=velocity, by=own, factor=factor, likely=likely)
    if found := _known(log, IMU):
        size = float(np.median(np.linalg.norm(found[1:], axis=0)))
        if not SPECIFIC_FORCE_RANGE[0] < size / GRAVITY_M_S2 < SPECIFIC_FORCE_RANGE[1]:
            likely = _likely(GRAVITY_M_S2 / max(size, 1e-9), _ACCELERATION_UNITS, "accelerations not in m/s^2")
            yield finding(Kind.NOT_GRAVITY, size_m_s2=size, likely=likely)
        elif float(np.median(found[3])) > SPECIFIC_FORCE_RANGE[0] * GRAVITY_M_S2:
            yield finding(Kind.NOT_GRAVITY, size_m_s2=float(np.median(found[3])), likely="not FRD")


def _dead_channels(log: FlightLog) -> Iterator[Finding]:
    """Channels without values or changes, where others say that there should be some."""
    for pair in (*zip(POSITION, VELOCITY, strict=True), *zip(ATTITUDE, RATES, strict=True)):
        for dead, alive in (pair, pair[::-1]):
            if not (_is_constant(log, dead) and _varies(log, alive)):
                continue
            value = log[dead][np.isfinite(log[dead])][0]
            if value == 0.0 or dead in (*POSITION, *ATTITUDE):  # steady motion at a constant speed or rate may be
                yield finding(Kind.STANDS_STILL, channel=dead, value=float(value), while_changes=alive)
    rpm = [f"motor{i + 1}_rpm" for i in range(log.n_rotors)]
    holding = [name for name in rpm if log.has(name)]
    medians = {name: float(np.nanmedian(np.abs(log[name]))) for name in holding}
    for name in rpm:
        if name not in holding and holding:
            yield finding(Kind.ROTOR_UNKNOWN, rotor=name, why="no values", known=holding[0])
        elif name in holding and medians[name] < SILENT_ROTOR_SHARE * float(np.median(list(medians.values()))):
            yield finding(Kind.ROTOR_UNKNOWN, rotor=name, why="silent", rpm=medians[name])
        elif _is_constant(log, name) and any(_varies(log, other) for other in holding):
            yield finding(Kind.ROTOR_UNKNOWN, rotor=name, why="stands", rpm=medians[name])


def _is_constant(log: FlightLog, name: str) -> bool:
    return len(log) >= MIN_ROWS and log.has(name) and len(log.updates(name)) == 1


def _varies(log: FlightLog, name: str) -> bool:
    return log.has(name) and len(log.updates(name)) >= MIN_ROWS // 5
