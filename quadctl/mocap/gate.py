"""Gate for the poses that may go to the autopilot: those that are numbers, new, fresh and possible."""

import math
from collections import deque
from typing import NamedTuple

from quadctl.mocap.findings import Kind
from quadctl.state import NAN, Quat, Vec3

UNIT_TOLERANCE = 0.01
STALE_S = 0.1
WINDOW_S = 5.0
"""Time after which the quickest pose is forgotten.

So long, poses are late after the sender's clock was set back or stood still; and a delay that grows is noticed if it
grows by `STALE_S` in less. A clock that runs wrong by 1 % moves by half of that.
"""
FROZEN_S = 0.1
"""A camera system that has lost a body repeats its last pose; a living one never is the same to the last bit."""
FASTEST_M_S = 20.0
"""More is another body's pose under this one's name, or a flip."""


class Pose(NamedTuple):
    """Pose of one rigid body, in the axes of the motion-capture system."""

    name: str
    received_s: float
    """On the clock of `time.monotonic`."""
    position: Vec3
    quaternion: Quat
    """Scalar first, body to world."""
    sent_s: float = NAN
    """On the sender's clock, where it tells."""


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


class Gate:
    """Judges pose after pose."""

    def __init__(self) -> None:
        self._seen: tuple[Vec3, Quat] | None = None
        self._changed_s = -math.inf
        self._passed: Pose | None = None
        self._clock = SenderClock()

    def age_s(self, pose: Pose, now_s: float) -> float:
        """Time since the pose came, and how much longer than usual it took to come, where the sender tells."""
        late_s = self._clock.late_s(pose.sent_s, pose.received_s) if math.isfinite(pose.sent_s) else 0.0
        return now_s - pose.received_s + late_s

    def objection(self, pose: Pose, now_s: float) -> Kind | None:
        """Reason why the pose must not pass; None where it may."""
        if not all(map(math.isfinite, (*pose.position, *pose.quaternion))):
            return Kind.NOT_FINITE
        if abs(math.hypot(*pose.quaternion) - 1.0) > UNIT_TOLERANCE:
            return Kind.NO_ATTITUDE
        if self.age_s(pose, now_s) > STALE_S:
            return Kind.STALE
        what = (pose.position, pose.quaternion)
        if what == self._seen:
            return Kind.FROZEN if pose.received_s - self._changed_s > FROZEN_S else Kind.REPEATED
        self._seen, self._changed_s = what, pose.received_s
        if self._passed is not None:
            elapsed_s = max(pose.received_s - self._passed.received_s, 0.001)
            if math.dist(pose.position, self._passed.position) > FASTEST_M_S * max(elapsed_s, 0.01):
                return Kind.JUMPED
        self._passed = pose
        return None
