"""The same flight under two names: in training and test data it would prove nothing."""

import itertools
from collections.abc import Sequence

import numpy as np

from quadctl.logs.flight_log import ATTITUDE, POSITION, VELOCITY, FlightLog

DIGITS = {**dict.fromkeys(POSITION, 0.01), **dict.fromkeys(VELOCITY, 0.01), **dict.fromkeys(ATTITUDE[:2], 0.1)}
"""Steps to which the state is rounded: a copy may hold fewer digits."""
SAME_SHARE = 0.4
"""Share of the states of the shorter log that stand in the other one, too: two flights never meet in eight numbers."""
MOST_STATES = 20_000
"""Number of states that are compared of a log."""


def copies(logs: Sequence[FlightLog]) -> list[tuple[int, int]]:
    """Pairs of logs that hold the same flight, whole or in part, by their places."""
    states = [_states(log) for log in logs]
    return [
        (a, b)
        for a, b in itertools.combinations(range(len(logs)), 2)
        if min(len(states[a]), len(states[b])) > 10
        and len(states[a] & states[b]) > SAME_SHARE * min(len(states[a]), len(states[b]))
    ]


def _states(log: FlightLog) -> set[bytes]:
    """States of a log, rounded; those at rest, which repeat, count once."""
    names = [name for name in DIGITS if log.has(name)]
    if len(names) < len(DIGITS):
        return set()
    rows = log.updates(*names)
    steps = max(1, len(rows) // MOST_STATES)
    table = np.rint(np.column_stack([log[name][rows[::steps]] / DIGITS[name] for name in names])).astype(np.int32)
    return {row.tobytes() for row in table}
