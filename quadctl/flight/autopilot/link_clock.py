"""The autopilot's clock seen from ours: how late a message is, and whether the autopilot has restarted."""

import math
from collections import deque
from typing import NamedTuple

MAX_RATE_ERROR = 0.02
"""Largest error of the rate at which the autopilot's clock is taken to run, s/s: a simulator on a busy machine was
measured at 0.987 of real time, a crystal is a thousand times better."""
RATE_SPAN_S = 10.0
"""Shortest time over which the rate of the autopilot's clock is measured."""
RATE_TOLERANCE = 0.005
"""Largest error with which that rate is used, s/s."""
RECENT = 5
"""Number of round trips of which the shortest way out counts: a single one may be late by the computer's own fault."""
MAX_STRANGENESS_S = 10.0
"""Largest difference between the clock of round trips and that of messages; beyond it they are not the same clock."""
LEAK = 0.05
"""Rate at which the usual delay may grow where no round trips are known, s/s."""
RESTART_S = 1.0
"""Smallest step back of the autopilot's clock that is a restart; smaller ones are messages out of order."""


class _Offset(NamedTuple):
    """Bounds of the difference between our clock and the autopilot's at one time, s."""

    at_s: float
    low_s: float
    high_s: float

    @property
    def middle_s(self) -> float:
        return 0.5 * (self.low_s + self.high_s)

    @property
    def error_s(self) -> float:
        return 0.5 * (self.high_s - self.low_s)

    def later(self, at_s: float, rate: float) -> "_Offset":
        """Bounds at a later time, moved by the drift `rate`, wider by its largest error."""
        passed_s = max(at_s - self.at_s, 0.0)
        drift_s, error_s = rate * passed_s, MAX_RATE_ERROR * passed_s
        return _Offset(at_s, self.low_s + drift_s - error_s, self.high_s + drift_s + error_s)

    def within(self, other: "_Offset") -> "_Offset":
        """Bounds that hold by both; by `other` alone where they contradict each other, as after a step of a clock."""
        low_s, high_s = max(self.low_s, other.low_s), min(self.high_s, other.high_s)
        return _Offset(other.at_s, low_s, high_s) if low_s <= high_s else other


class LinkClock:
    """Tells from time stamps and round trips when a message was true, and how late a setpoint will arrive.

    A time stamp alone does not tell a delay from an offset between the two clocks. A round trip does: the autopilot
    read its clock after our question left and before its answer came, so the offset, ours less its own, is bounded from
    both sides, however the delay is shared by the two ways. The offset drifts as the clocks run at different rates; a
    delay never drifts into it, as each round trip bounds it anew. Its estimate is the middle of the bounds.

    An autopilot that answers no question leaves only the time stamps: then the smallest difference between stamp and
    arrival, forgotten slowly, is taken for no delay, and only what comes on top of it is seen. That is a queue of a
    radio, or of the kernel while this process was stopped; a delay that is constant, or grows slowly, is not seen.
    """

    def __init__(self) -> None:
        self.restarts = 0
        self.delay_s = 0.0
        """Delay of the latest stamped message, s."""
        self.setpoint_delay_s = 0.0
        """Time that a message of ours needs to the autopilot, s; 0 while no round trip is known."""
        self._stamp_s = -math.inf
        self._arrived_s = -math.inf
        self._usual_s = math.inf
        self._offset: _Offset | None = None
        self._anchor: _Offset | None = None
        self._rate = 0.0
        self._ways_out_s: deque[float] = deque(maxlen=RECENT)

    @property
    def measured(self) -> bool:
        """True when round trips tell the delay."""
        return self._offset is not None

    def exchanged(self, sent_s: float, stamp_s: float, received_s: float) -> None:
        """Take in a round trip: sent and received on our clock, `stamp_s` what the autopilot's clock said between."""
        if abs(stamp_s - self._stamp_s) > MAX_STRANGENESS_S:
            return
        bounds = _Offset(received_s, sent_s - stamp_s, received_s - stamp_s)
        if self._offset is None:
            self._offset = self._anchor = bounds
        else:
            self._offset = self._offset.later(received_s, self._rate).within(bounds)
            self._measure_rate(self._offset)
        self._ways_out_s.append(stamp_s + self._offset.middle_s - sent_s)
        self.setpoint_delay_s = max(min(self._ways_out_s), 0.0)

    def sampled_s(self, stamp_s: float, now_s: float) -> float:
        """Time on our clock at which a message stamped `stamp_s` by the autopilot, arriving at `now_s`, was true."""
        if stamp_s < self._stamp_s - RESTART_S:
            self.restarts += 1
            self._forget()
        difference_s = now_s - stamp_s
        if self._offset is None:
            offset_s = self._usual_s = min(self._usual_s + LEAK * (now_s - self._arrived_s), difference_s)
        else:
            offset_s = self._offset.later(now_s, self._rate).middle_s
        self._stamp_s, self._arrived_s = stamp_s, now_s
        self.delay_s = max(difference_s - offset_s, 0.0)
        return now_s - self.delay_s

    def _forget(self) -> None:
        """Forget the clock of before a restart."""
        self._usual_s, self._offset, self._anchor, self._rate = math.inf, None, None, 0.0
        self._ways_out_s.clear()
        self.setpoint_delay_s = 0.0

    def _measure_rate(self, now: _Offset) -> None:
        """Measure the drift of the offset, s/s, over a span that is long enough for its bounds."""
        before = self._anchor or now
        span_s = now.at_s - before.at_s
        if span_s >= RATE_SPAN_S and before.error_s + now.error_s <= RATE_TOLERANCE * span_s:
            self._rate, self._anchor = (now.middle_s - before.middle_s) / span_s, now
