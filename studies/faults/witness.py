"""Witness of pauses of the machine itself: a virtual one may be stopped for longer than a flight in real time allows.

A test in real time that fails while that happened says nothing, and is run again.
"""

import multiprocessing
import os
import time
from contextlib import suppress
from typing import Any

ROUND_S = 0.01
STOOD_STILL_S = 0.1
"""Longest sleep that is tolerated: half of the age at which a flight gives up on a state."""


class Witness:
    """A process that does nothing but sleep, before all others where that is permitted, and notes its longest sleep."""

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._longest: Any = context.Value("d", 0.0, lock=False)
        self._lost: Any = context.Value("d", 0.0, lock=False)
        context.Process(target=_sleep, args=(self._longest, self._lost), daemon=True).start()

    def forget(self) -> None:
        """Forget the sleeps noted so far."""
        self._longest.value = self._lost.value = 0.0

    @property
    def lost_s(self) -> float:
        """Sum of the times by which it overslept by more than a round."""
        return float(self._lost.value)

    def stood_still(self) -> bool:
        """True when it overslept by so much that the machine cannot have been running."""
        return bool(self._longest.value > STOOD_STILL_S)


def _sleep(longest: Any, lost: Any) -> None:
    with suppress(AttributeError, OSError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(os.sched_get_priority_max(os.SCHED_FIFO)))
    before_s = time.monotonic()
    while True:
        time.sleep(ROUND_S)
        now_s = time.monotonic()
        overslept_s = now_s - before_s - ROUND_S
        longest.value = max(longest.value, overslept_s)
        lost.value += overslept_s if overslept_s > ROUND_S else 0.0
        before_s = now_s
