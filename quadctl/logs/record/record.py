"""The one judgement of a record: what of it can be used, which seconds are flight, and why it cannot be analysed.

Every command and the page ask `examine`. It reads what the log says of itself in the order in which each step needs the
ones before: rows that were drawn, values that cannot be, jumps, the time in flight, channels that do not live, the
moment at which control is lost, clocks, and the witnesses of the acceleration against each other.
"""

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from quadctl.logs.channel_groups import GROUPS, channel_groups, come_in_turn, updates_of_any
from quadctl.logs.contradictions import contradictions
from quadctl.logs.events import MODE, events_of
from quadctl.logs.findings import Finding, Kind, Span, finding, of_kind
from quadctl.logs.flight_log import IMU, FlightLog, Floats
from quadctl.logs.record import (
    attitude_reading,
    channels,
    delays,
    flight_time,
    interpolation,
    jumps,
    level,
    lever_arm,
    witnesses,
)
from quadctl.logs.record.control import out_of_control
from quadctl.logs.record.flight_time import THRUST_SOURCES, FlightTime, total, usable, within, without
from quadctl.logs.record.heading import corrected_heading, heading_error, is_of_heading, with_one_heading
from quadctl.logs.record.height_error import without_height_error

MIN_RATE_HZ = 2.4
"""Least update rate of the slowest channel; below it, motion between the updates would look like an unexplained
force."""
MIN_FLIGHT_S = 10.0
MAX_HELD_S, GAP_UPDATES = 1.0, 8.0
"""Longest time, also in usual updates of the slowest channel, for which a channel may bring nothing new in flight."""
NEEDED = ("position", "velocity", "attitude")
MEASURED = (*NEEDED, "rates", "imu", "rpm", "motor output")
"""Channels in which noise shows which rows were measured."""
LEFT_OUT_S = {
    Kind.RESET: 0.5,
    Kind.LANE_SWITCH: 0.5,
    Kind.CLOCK_JUMP: 0.5,
    Kind.REJECTED: 0.5,
    Kind.GPS_LOST: 0.0,
    Kind.STATE_INVALID: 0.0,
    Kind.ON_GROUND: 0.5,
    Kind.OUT_OF_CONTROL: 1.0,
    Kind.GAPS: 0.0,
    Kind.FROZEN_ROTOR: 0.0,
}
"""Findings whose times are not used, and the time before and after that goes with them: a filter sees so far."""
CLOCK_STEPS = 5.0
"""Time between two rows, in usual ones, from which on a jump of the position there is one of the clock."""
SAME_RESET_S = 0.5
"""Time within which what is said and what is seen of a reset are the same one."""
GROUND_MOVED_M = 0.3
"""Least difference of the heights of the ground before and after a flight that is told."""
BELOW_REST_M, LOWEST_PERCENT = 0.04, 0.5
"""Least depth below the height at rest that is told, and the share of the flight that may be as low."""
ENDS_S = 0.5
"""A flight that ends so near the end of the log was not over."""
REJECTED_AT_MOST = 0.5
"""Share of the flight that may be left out because the estimator doubted its sensors; where it always does, its doubts
tell nothing of a time."""


@dataclass(frozen=True, eq=False)
class Record:
    """A log without what its own record shows to be wrong, and the judgement of it."""

    log: FlightLog
    thrust_source: str | None
    """The best of THRUST_SOURCES that can be read."""
    flights: tuple[Span, ...]
    """Stretches from take-off to landing in which the vehicle is in control and the record is sound."""
    usable: tuple[Span, ...]
    """Parts of these that an analysis can use: without their ends and without what the findings leave out."""
    findings: tuple[Finding, ...]
    obstacles: tuple[Finding, ...]
    """Reasons why it cannot be analysed; none where it can."""

    @property
    def flight_s(self) -> float:
        """Time in flight."""
        return total(self.flights)

    @property
    def changes_s(self) -> tuple[float, ...]:
        """Times at which something of the record changes: mode, parameters of the thrust, the estimator's state."""
        modes = [event.time_s for event in events_of(self.log.meta) if event.what.startswith(MODE)]
        told = of_kind(self.findings, Kind.PARAMETER_CHANGED, Kind.RESET, Kind.LANE_SWITCH, Kind.CLOCK_JUMP)
        return tuple(sorted({*modes, *(begin for found in told for begin, _ in found.times_s)}))

    @property
    def velocity_doubted(self) -> tuple[str, ...]:
        """Axes along which the accelerometer and not the velocity tells the acceleration."""
        odd = [found for found in of_kind(self.findings, Kind.WITNESSES_DISAGREE) if found.figures["odd"] != "imu"]
        return tuple(axis for found in odd for axis in found.figures["axes"])


def examine(log: FlightLog, side_force: bool = False) -> Record:
    """Judge a log; nothing is raised. With `side_force` the vehicle can speed up without leaning."""
    with np.errstate(all="ignore"):  # of numbers that are no measurements
        return _examined(log, side_force)


def _examined(log: FlightLog, side_force: bool) -> Record:
    findings = list(log.findings)
    groups = {name: columns for name, columns in channel_groups(log).items() if name in MEASURED}
    log, found = interpolation.measured_rows(log, groups)
    findings += found
    log, found = channels.possible(log)
    findings += found
    log, found = attitude_reading.read_rightly(log)
    findings += found
    log, spikes, steps = jumps.without_spikes(log)
    clock, steps = _clock_jumps(log, steps)
    findings += clock
    source = thrust_source_of(log)
    flown = flight_time.flight_time(log, source)
    log, found = channels.living(log, flown.flights)
    findings += found
    if thrust_source_of(log) != source:
        source = thrust_source_of(log)
        flown = flight_time.flight_time(log, source)
    lost = out_of_control(log, flown.flights)
    findings += lost
    flights = without(flown.flights, [span for one in lost for span in one.times_s])
    findings = _with_resets(findings, steps, flights)
    findings += [one for one in spikes if any(one.touches(begin, end) for begin, end in flights)]
    findings += _of_ground(log, flown)
    findings += _gaps(log, source, flights)
    left_out = _left_out(findings, flights)
    if heading := next(filter(is_of_heading, findings), None):
        log, turned, cut = with_one_heading(log, heading, flights, left_out, LEFT_OUT_S[Kind.RESET])
        findings = [turned if found is heading else found for found in findings]
        left_out += cut
    usable_s = usable(flights, left_out)
    logged = not of_kind(findings, Kind.NO_HEADING)
    log, found = corrected_heading(log, usable_s, logged)
    findings += found
    contradicting = contradictions(log, side_force)
    as_logged = log
    log, found = _of_one_motion(log, source, usable_s)
    findings += found
    cut, found = level.of_one_level(log, usable_s)
    findings += found
    left_out += cut
    usable_s = usable(flights, left_out)
    log, found = _by_witnesses(log, as_logged, source, usable_s)
    findings += found
    lacking = _lacking(log, source)
    if not (logged or heading_error(log, usable_s).is_told):
        lacking.append(finding(Kind.LACKS, of="heading", column=False))
    obstacles = (*lacking, *contradicting, *_too_little(log, source, flown, usable_s))
    return Record(log, source, without(flights, left_out), usable_s, tuple(findings), obstacles)


def _of_one_motion(log: FlightLog, source: str | None, usable_s: tuple[Span, ...]) -> tuple[FlightLog, list[Finding]]:
    """The log with all channels on one clock and of one point of the body."""
    log, of_rates = delays.aligned(log, usable_s)
    log, of_rotors = delays.rotors_aligned(log, source, usable_s)
    log, of_point = lever_arm.at_centre_of_mass(log, source, usable_s)
    return log, [*of_rates, *of_rotors, *of_point]


def _by_witnesses(
    log: FlightLog, as_logged: FlightLog, source: str | None, usable_s: tuple[Span, ...]
) -> tuple[FlightLog, list[Finding]]:
    """The log without an accelerometer that is odd, and without the error of a height that follows a barometer's."""
    disagree = witnesses.disagreements(log, as_logged, source, usable_s)
    findings = witnesses.disagreement_findings(disagree)
    if any(one.odd == "imu" for one in disagree):
        log = replace(log, columns={name: values for name, values in log.columns.items() if name not in IMU})
    if not any(one.odd == "velocity" for one in disagree):
        log, found = without_height_error(log, source, usable_s)
        findings += found
    return log, findings


def thrust_source_of(log: FlightLog) -> str | None:
    """The best of THRUST_SOURCES of which a log holds values."""
    present = channel_groups(log)
    return next((name for name in THRUST_SOURCES if any(log.has(column) for column in present.get(name, ()))), None)


def _of_ground(log: FlightLog, flown: FlightTime) -> list[Finding]:
    """Findings on the ground: where it is at another height after a flight, and where the vehicle stands on it."""
    found = []
    for (before_s, before_m), (after_s, after_m) in itertools.pairwise(flown.rests_up_m):
        if abs(after_m - before_m) > GROUND_MOVED_M:
            found.append(finding(Kind.GROUND_MOVED, [(before_s, after_s)], before_m=before_m, after_m=after_m))
    if flown.on_ground:
        found.append(finding(Kind.ON_GROUND, flown.on_ground))
    found += _below_rest(log, flown)
    ends_s = max(ENDS_S, 2.0 * float(np.median(np.diff(log.time_s)))) if len(log) > 1 else ENDS_S
    if flown.flights and flown.flights[-1][1] > log.time_s[-1] - ends_s:
        found.append(finding(Kind.ENDS_IN_AIR, [flown.flights[-1][1:] * 2]))
    return found


def _below_rest(log: FlightLog, flown: FlightTime) -> list[Finding]:
    """Finding on heights in flight that are below those at which the vehicle stands before and after."""
    if not (flown.rests_up_m and log.has("z_m")):
        return []
    rest_m = min(height for _, height in flown.rests_up_m)
    heights = log["z_m"][within(log.time_s, usable(flown.flights, flown.on_ground))]
    heights = heights[np.isfinite(heights)]
    if len(heights) == 0:
        return []
    lowest_m = float(np.percentile(heights, LOWEST_PERCENT))
    if lowest_m > rest_m - BELOW_REST_M:
        return []
    return [finding(Kind.BELOW_REST, lowest_m=lowest_m, rest_m=rest_m)]


def _with_resets(findings: list[Finding], steps: Sequence[jumps.Jump], flights: tuple[Span, ...]) -> list[Finding]:
    """The findings with the jumps of the state in flight: one that the estimator said gets its size, others are new."""
    said = of_kind(findings, Kind.RESET)
    others = [found for found in findings if found.kind != Kind.RESET]
    begin, end = (flights[0][0], flights[-1][1]) if flights else (np.inf, -np.inf)
    steps = [step for step in steps if begin <= step.time_s <= end]
    merged: list[Finding] = []
    for name in dict.fromkeys([*(found.figures["of"] for found in said), *(step.quantity for step in steps)]):
        told = [time for found in said if found.figures["of"] == name for time, _ in found.times_s]
        told = [time for time in told if not flights or begin <= time <= end]
        own = [step for step in steps if step.quantity == name]
        sizes: list[float] = []
        times: list[float] = []
        for time in sorted([*told, *(step.time_s for step in own)]):
            if times and time - times[-1] < SAME_RESET_S:  # said twice, or said and seen
                continue
            size = sum(_largest(step) for step in own if abs(step.time_s - time) < SAME_RESET_S)
            if size or name != "heading":  # at one that turns nothing, nothing is wrong
                times.append(time)
                sizes.append(size)
        if times:
            merged.append(finding(Kind.RESET, [(time, time) for time in times], of=name, by=sizes))
    return [*others, *merged]


def _clock_jumps(log: FlightLog, steps: Sequence[jumps.Jump]) -> tuple[list[Finding], list[jumps.Jump]]:
    """Findings on jumps of the clock, and the other jumps: where the position stays and the time goes on, the time is
    wrong."""
    intervals = np.diff(log.time_s)
    usual_s = float(np.median(intervals)) if len(intervals) else 0.0
    by_s = {
        step.time_s: float(intervals[max(int(np.searchsorted(log.time_s, step.time_s)) - 1, 0)]) - usual_s
        for step in steps
        if step.quantity in ("horizontal position", "height")
    }
    at = sorted(time for time, by in by_s.items() if by > (CLOCK_STEPS - 1.0) * usual_s)
    found = [finding(Kind.CLOCK_JUMP, [(time, time) for time in at], by_s=[by_s[time] for time in at])] if at else []
    return found, [step for step in steps if step.time_s not in at]


def _largest(step: jumps.Jump) -> float:
    return max(step.by, key=abs)


def _gaps(log: FlightLog, source: str | None, flights: tuple[Span, ...]) -> list[Finding]:
    """Finding on the times in flight in which a channel that is needed brings nothing new for long."""
    present = channel_groups(log)
    known = {name: [column for column in present.get(name, ()) if log.has(column)] for name in (*NEEDED, source or "")}
    rates = [mean_rate_hz(log, columns, flights) for columns in known.values() if columns]
    if not flights or not rates or min(rates) <= 0.0:
        return []
    longest_s = max(GAP_UPDATES / min(rates), MAX_HELD_S)
    spans: list[Span] = []
    ends = [float(log.time_s[0]), float(log.time_s[-1])]
    for columns in known.values():
        updates = log.time_s[log.updates(*columns)].tolist() if columns else []  # a part that is missing is a gap
        at = [ends[0], *updates, ends[1]]
        spans += [(a, b) for a, b in itertools.pairwise(at) if b - a > longest_s]
    lost = without(flights, without(flights, spans))
    return [finding(Kind.GAPS, lost, seconds=total(lost), longest_s=longest_s)] if lost else []


def _left_out(findings: Iterable[Finding], flights: tuple[Span, ...]) -> list[Span]:
    """Times that findings take out of the flights."""
    kept = [found for found in findings if found.kind in LEFT_OUT_S and not is_of_heading(found)]
    doubts = [found for found in kept if found.kind in (Kind.REJECTED, Kind.GPS_LOST, Kind.STATE_INVALID)]
    doubted = [_widened(span, found.kind) for found in doubts for span in found.times_s]
    if total(flights) - total(without(flights, doubted)) > REJECTED_AT_MOST * total(flights):
        kept = [found for found in kept if found not in doubts]
    return [_widened(span, found.kind) for found in kept for span in found.times_s]


def _widened(span: Span, kind: Kind) -> Span:
    return span[0] - LEFT_OUT_S[kind], span[1] + LEFT_OUT_S[kind]


def _lacking(log: FlightLog, source: str | None) -> list[Finding]:
    """Channels that an analysis needs and the log lacks."""
    present = channel_groups(log)
    found = [finding(Kind.LACKS, of=name, column=False) for name in NEEDED if name not in present]
    columns = [column for name in NEEDED if name in present for column in GROUPS[name]]
    found += [finding(Kind.LACKS, of=column, column=True) for column in columns if not log.has(column)]
    return [*found, *([] if source else [finding(Kind.LACKS, of="thrust", column=False)])]


def _too_little(log: FlightLog, source: str | None, flown: FlightTime, usable_s: tuple[Span, ...]) -> Iterator[Finding]:
    """Channels that are too slow in flight, heights that point down, and flights that are too short."""
    spans = usable_s or flown.flights or tuple(_whole(log))
    for name in (*NEEDED, *((source,) if source else ())):
        known = [column for column in channel_groups(log).get(name, ()) if log.has(column)]
        rate = max(mean_rate_hz(log, known, spans), usual_rate_hz(log, known, spans)) if known else MIN_RATE_HZ
        if rate < MIN_RATE_HZ:
            yield finding(Kind.TOO_SLOW, channel=name, rate_hz=rate, least_hz=MIN_RATE_HZ)
    if flown.upside_down:
        yield finding(Kind.BELOW_GROUND)
    if total(usable_s) < MIN_FLIGHT_S:
        yield finding(Kind.TOO_SHORT, seconds=total(usable_s), least_s=MIN_FLIGHT_S)


def _whole(log: FlightLog) -> Iterator[Span]:
    if len(log):
        yield float(log.time_s[0]), float(log.time_s[-1])


def mean_rate_hz(log: FlightLog, columns: Sequence[str], spans: Sequence[Span]) -> float:
    """Mean number of updates per second within some stretches of time; of columns that come in turn, of the slowest."""
    sets = [[column] for column in columns] if come_in_turn(log, columns) else [columns]
    return min(sum(map(len, _updates_within(log, own, spans))) for own in sets) / max(total(spans), 1e-9)


def usual_rate_hz(log: FlightLog, columns: Sequence[str], spans: Sequence[Span]) -> float:
    """Update rate by the median time between updates; 0 where there are not two.

    An update that is lost, or that repeats a rounded value, lowers the mean rate but not this one.
    """
    own = columns[:1] if come_in_turn(log, columns) else columns
    steps = np.concatenate([np.zeros(0), *map(np.diff, _updates_within(log, own, spans))])
    return float(1.0 / np.median(steps)) if len(steps) else 0.0


def _updates_within(log: FlightLog, columns: Sequence[str], spans: Sequence[Span]) -> list[Floats]:
    at = log.time_s[updates_of_any(log, columns)]
    return [at[(at >= begin) & (at <= end)] for begin, end in spans]
