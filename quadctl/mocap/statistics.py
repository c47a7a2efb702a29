"""Statistics of the flow of poses: rate, age when they leave, jitter, dropouts, poses withheld."""

import math
import statistics
from collections import Counter, deque

from quadctl.mocap.findings import Kind
from quadctl.words import Template, When, Words

GAP_S = 0.1
"""A longer silence between two poses sent is a dropout: five of them are missing at 50 Hz."""
WINDOW = 200
"""Poses for the figures that are shown while it runs."""
LINE: Template = (
    "{rate_hz:.0f} Hz, age when sent {p50_ms:.1f} ms (p99 {p99_ms:.1f}), jitter {jitter_ms:.1f} ms, "
    "{dropouts} dropouts",
    When("dropouts", ", the longest {longest_gap_s:.2f} s"),
    When("withheld", ", withheld: {withheld}"),
)
NO_RATE = "{} poses sent"


class Flow:
    """Counts what is sent and withheld."""

    def __init__(self) -> None:
        self.sent = 0
        self.dropouts = 0
        self.longest_gap_s = 0.0
        self.withheld: Counter[Kind] = Counter()
        self._first_s = self._last_s = math.nan
        self._ages: deque[float] = deque(maxlen=100_000)
        self._intervals: deque[float] = deque(maxlen=100_000)

    def add(self, now_s: float, age_s: float) -> None:
        """A pose leaves."""
        if self.sent == 0:
            self._first_s = now_s
        else:
            gap_s = now_s - self._last_s
            self._intervals.append(gap_s)
            self.longest_gap_s = max(self.longest_gap_s, gap_s)
            self.dropouts += gap_s > GAP_S
        self._last_s = now_s
        self._ages.append(age_s)
        self.sent += 1

    def line(self, window: int | None = WINDOW) -> str:
        """The latest figures; with None those of the whole run."""
        if not self._intervals:
            return NO_RATE.format(self.sent)
        ages, intervals = list(self._ages), list(self._intervals)
        if window is not None:
            ages, intervals = ages[-window:], intervals[-window:]
        ages.sort()
        p50, p99 = (1e3 * ages[min(int(share * len(ages)), len(ages) - 1)] for share in (0.5, 0.99))
        return Words().say(
            LINE,
            {
                "rate_hz": self.rate_hz(window),
                "p50_ms": p50,
                "p99_ms": p99,
                "jitter_ms": 1e3 * statistics.pstdev(intervals),
                "dropouts": self.dropouts,
                "longest_gap_s": self.longest_gap_s,
                "withheld": self.withheld_in_words(),
            },
        )

    def withheld_in_words(self) -> str:
        """Number of poses withheld for each reason, the most frequent first."""
        return ", ".join(f"{count} {kind.said({})}" for kind, count in self.withheld.most_common())

    def rate_hz(self, window: int | None = WINDOW) -> float:
        """Rate of the poses sent; 0 before the second."""
        intervals = list(self._intervals)
        if window is not None:
            intervals = intervals[-window:]
        return len(intervals) / sum(intervals) if intervals else 0.0
