"""The sender's clock seen from ours: how much later than usual a pose has come."""

from collections import deque

WINDOW_S = 5.0
"""Time after which the quickest pose is forgotten.

So long, poses are late after the sender's clock was set back or stood still; and a delay that grows is noticed if it
grows by `gate.STALE_S` in less. A clock that runs wrong by 1 % moves by half of that.
"""


class SenderClock:
    """Compares the sender's time stamps with the arrivals.

    The two clocks need not agree: the quickest pose of the last seconds stands for no delay. It is forgotten then,
    because the clocks drift apart (50 ppm are 0.1 s in half an hour), and one of them may be set.
    """

    def __init__(self) -> None:
        self._quickest: deque[tuple[float, float]] = deque()
        """Arrival and difference of the quickest pose, then of the quickest after it, and so on: both increase."""

    def late_s(self, sent_s: float, received_s: float) -> float:
        """Time by which a pose took longer than the quickest one of the window, s. Poses in order of their arrival."""
        quickest, difference_s = self._quickest, received_s - sent_s
        while quickest and quickest[-1][1] >= difference_s:
            quickest.pop()
        quickest.append((received_s, difference_s))
        while quickest[0][0] < received_s - WINDOW_S:
            quickest.popleft()
        return difference_s - quickest[0][1]
