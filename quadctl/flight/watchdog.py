"""The end of a program that hangs in flight: then its heartbeats stop, too, and the autopilot's failsafe can act."""

import faulthandler
import time
from types import TracebackType
from typing import Self

from quadctl.flight.pilot.tick import Tick

HANG_S = 6.0
"""Time after which the process ends itself, from the last arming: far beyond any stall that a flight survives."""
REARM_S = 2.0
STDERR = 2
"""The descriptor, which a test or a display does not replace."""


class Watchdog:
    """Listener that ends this process, with a traceback, when no tick comes for 4 to 6 s.

    MAVSDK's threads send heartbeats even if the loop, or the whole interpreter, hangs; ArduPilot, which lands when they
    stop, would then hover until its battery is empty. faulthandler's timer needs no lock of the interpreter.
    """

    def __enter__(self) -> Self:
        self._arm(time.monotonic())
        return self

    def __call__(self, tick: Tick) -> None:
        now_s = time.monotonic()
        if now_s - self._armed_s >= REARM_S:
            self._arm(now_s)

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        faulthandler.cancel_dump_traceback_later()

    def _arm(self, now_s: float) -> None:
        self._armed_s = now_s
        faulthandler.dump_traceback_later(HANG_S, exit=True, file=STDERR)
