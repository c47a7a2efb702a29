"""The same flight under two names: in training and test data it would prove nothing."""

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from quadctl.errors import LogError
from quadctl.logs.findings import Kind, finding
from quadctl.logs.flight_log import ATTITUDE, POSITION, VELOCITY, FlightLog, Floats
from quadctl.logs.record.interpolation import resolution

STATE = (*POSITION, *VELOCITY, *ATTITUDE[:2])
FINEST = 1e-5
"""Least step to which the state is rounded before it is compared; a copy with fewer digits is compared by those."""
SAME_SHARE = 0.4
"""Share of the states of the shorter log that stand in the other one, too: two flights never meet in eight numbers."""
MOST_STATES = 20_000
"""Number of states that are compared of a log."""


def copies(logs: Sequence[FlightLog]) -> list[tuple[int, int]]:
    """Pairs of logs that hold the same flight, whole or in part, by their places."""
    states = [_states(log) for log in logs]
    return [(a, b) for a, b in itertools.combinations(range(len(logs)), 2) if _same(states[a], states[b])]


def without_copies(logs: Sequence[FlightLog]) -> list[FlightLog]:
    """The logs, each flight once: a later copy is left out, and the first one says so."""
    twins = copies(logs)
    left_out = {later for _, later in twins}
    kept = []
    for place, log in enumerate(logs):
        own = [logs[later].name for first, later in twins if first == place]
        if place not in left_out:
            told = [finding(Kind.COPY, other=name, left_out=True) for name in own]
            kept.append(replace(log, findings=[*log.findings, *told]))
    return kept


def refuse_copies(unseen: Sequence[FlightLog], seen: Sequence[FlightLog]) -> None:
    """Raise LogError where a flight to judge on is one that fits use, under whatever name, whole or in part."""
    for a, b in copies([*unseen, *seen]):
        if a < len(unseen) <= b:
            other = seen[b - len(unseen)].name
            raise LogError(f"{unseen[a].name}: holds the same flight as {other}, expected one that no fit uses")


def marked(logs: Sequence[FlightLog]) -> list[FlightLog]:
    """The logs, those that copy an earlier one with a finding that says so."""
    first_of: dict[int, int] = {}
    for first, later in copies(logs):
        first_of.setdefault(later, first)
    return [
        replace(log, findings=[*log.findings, finding(Kind.COPY, other=logs[first_of[place]].name, left_out=False)])
        if place in first_of
        else log
        for place, log in enumerate(logs)
    ]


def _states(log: FlightLog) -> Floats:
    """States of a log at its updates, shape (n, 8); none where it lacks a part of them."""
    if not all(log.has(name) for name in STATE):
        return np.zeros((0, len(STATE)))
    rows = log.updates(*STATE)
    rows = rows[:: max(1, len(rows) // MOST_STATES)]
    return np.column_stack([log[name][rows] for name in STATE])


def _same(one: Floats, other: Floats) -> bool:
    """Tell whether many states of the shorter log stand in the other one; those at rest, which repeat, count once."""
    if min(len(one), len(other)) < 10:
        return False
    pairs = zip(one.T, other.T, strict=True)
    steps = np.array([max(FINEST, resolution(a), resolution(b)) for a, b in pairs])
    a, b = ({row.tobytes() for row in np.rint(table / steps).astype(np.int64)} for table in (one, other))
    return len(a & b) > SAME_SHARE * min(len(a), len(b))
