"""Statistics of the flow of poses: rate, age when they leave, jitter, dropouts, poses withheld."""

import math
import statistics
from collections import Counter, deque

GAP_S = 0.1
"""A longer silence between two poses sent is a dropout: five of them are missing at 50 Hz."""
WINDOW = 200
"""Poses for the figures that are shown while it runs."""


class Flow:
    """Counts what is sent and withheld."""

    def __init__(self) -> None:
        self.sent = 0
        self.dropouts = 0
        self.longest_gap_s = 0.0
        self.withheld: Counter[str] = Counter()
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
            return f"{self.sent} poses sent"
        ages, intervals = list(self._ages), list(self._intervals)
        if window is not None:
            ages, intervals = ages[-window:], intervals[-window:]
        ages.sort()
        p50, p99 = (1e3 * ages[min(int(share * len(ages)), len(ages) - 1)] for share in (0.5, 0.99))
        text = (
            f"{self.rate_hz(window):.0f} Hz, age when sent {p50:.1f} ms (p99 {p99:.1f}), "
            f"jitter {1e3 * statistics.pstdev(intervals):.1f} ms, {self.dropouts} dropouts"
        )
        if self.dropouts:
            text += f", the longest {self.longest_gap_s:.2f} s"
        if self.withheld:
            text += ", withheld: " + ", ".join(f"{count} {reason}" for reason, count in self.withheld.most_common())
        return text

    def rate_hz(self, window: int | None = WINDOW) -> float:
        """Rate of the poses sent; 0 before the second."""
        intervals = list(self._intervals)
        if window is not None:
            intervals = intervals[-window:]
        return len(intervals) / sum(intervals) if intervals else 0.0
