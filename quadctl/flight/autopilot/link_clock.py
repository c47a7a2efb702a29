"""The autopilot's clock seen from ours: how late a message is, and whether the autopilot has restarted."""

import math

LEAK = 0.05
"""Rate at which the usual delay may grow, s/s: a simulator slower than real time by this much is not taken for late."""
RESTART_S = 1.0
"""Smallest step back of the autopilot's clock that is a restart; smaller ones are messages out of order."""


class LinkClock:
    """Compares the time stamps in messages with their times of arrival.

    The smallest difference between the two, forgotten slowly, is the link's usual delay; what a message needs on top
    of that it has spent in a queue: of a radio, of the kernel while this process was stopped, of a library while the
    interpreter hung. All of them release their oldest messages first.
    """

    def __init__(self) -> None:
        self.restarts = 0
        self.delay_s = 0.0
        """Delay of the latest stamped message, s."""
        self._usual_s = math.inf
        self._arrived_s = -math.inf
        self._stamp_s = -math.inf

    def sampled_s(self, stamp_s: float, now_s: float) -> float:
        """Time on our clock at which a message stamped `stamp_s` by the autopilot, arriving at `now_s`, was true."""
        if stamp_s < self._stamp_s - RESTART_S:
            self.restarts += 1
            self._usual_s = math.inf
        difference_s = now_s - stamp_s
        if math.isfinite(self._usual_s):
            self._usual_s = min(self._usual_s + LEAK * (now_s - self._arrived_s), difference_s)
        else:
            self._usual_s = difference_s
        self._stamp_s, self._arrived_s = stamp_s, now_s
        self.delay_s = difference_s - self._usual_s
        return now_s - self.delay_s
