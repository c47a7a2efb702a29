"""Round trips of MAVLink's TIMESYNC: the answer repeats the number of our question and adds the autopilot's clock."""

from collections import deque
from collections.abc import Mapping
from typing import Any, NamedTuple

EVERY_S = 0.1
"""Interval of the questions."""
MOST_WAITING = 100
"""Number of questions whose answers are awaited: those of ten seconds."""


class RoundTrip(NamedTuple):
    """A question and its answer."""

    sent_s: float
    stamp_s: float
    """Autopilot's clock when it answered."""
    received_s: float


class RoundTrips:
    """Puts the questions and recognises their answers, each once. `question` and `answered` may be called on two
    threads."""

    def __init__(self) -> None:
        self._waiting: deque[int] = deque(maxlen=MOST_WAITING)

    def question(self, now_s: float) -> dict[str, int]:
        """Fields of the TIMESYNC message that is sent at `now_s`."""
        sent_ns = round(1e9 * now_s)
        self._waiting.append(sent_ns)
        return {"tc1": 0, "ts1": sent_ns}

    def answered(self, fields: Mapping[str, Any], now_s: float) -> RoundTrip | None:
        """Round trip that a TIMESYNC message ends; None for the autopilot's own question, and for a second answer."""
        sent_ns, stamp_ns = int(fields["ts1"]), int(fields["tc1"])
        if stamp_ns == 0:
            return None
        try:
            self._waiting.remove(sent_ns)
        except ValueError:
            return None
        return RoundTrip(1e-9 * sent_ns, 1e-9 * stamp_ns, now_s)
