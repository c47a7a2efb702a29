"""The real-time loop: ticks on absolute deadlines, one task, nothing in it that can block.

A tick reads the latest state, lets the pilot decide, puts the target on the wire and gives a copy to the listeners
(recorder, display, tally), which return at once. Requests such as arming wait for the autopilot in tasks of their own.
The link repeats nothing by itself, so a loop that stalls falls silent, and the autopilot's failsafe acts.
"""

import asyncio
import contextlib
import itertools
import signal
import time
from collections.abc import Callable, Iterator, Sequence

from quadctl.errors import FlightError, RefusalError
from quadctl.flight.autopilot.port import Autopilot
from quadctl.flight.pilot.pilot import Pilot
from quadctl.flight.pilot.tick import Request, Stage, Tick
from quadctl.state import AttitudeTarget

Listener = Callable[[Tick], None]

LAST_WORD_S = 3.0
LANDING_SIGNALS = [number for number in signal.Signals if number.name in ("SIGINT", "SIGTERM", "SIGHUP")]


async def fly(autopilot: Autopilot, pilot: Pilot, rate_hz: float, listeners: Sequence[Listener]) -> None:
    """Fly the pilot's mission on a connected autopilot, until the motors are off or the pilot gives up."""
    tasks: set[asyncio.Task[None]] = set()
    period_s = 1.0 / rate_hz
    deadline = time.monotonic()
    try:
        while not pilot.done:
            began = time.monotonic()
            late_s = max(0.0, began - deadline)
            tick = pilot.tick(autopilot.state(), late_s)
            if tick.target is not None:
                _send(tick.target, began, autopilot, pilot)
            for request in tick.requests:
                task = asyncio.create_task(_carry_out(request, autopilot, pilot))
                tasks.add(task)
                task.add_done_callback(tasks.discard)
            for listener in listeners:
                listener(tick)
            pilot.reflect()
            # Absolute deadlines; those that have passed are given up, not caught up.
            now = time.monotonic()
            deadline += period_s * max(1, int((now - deadline) / period_s) + 1)
            await asyncio.sleep(deadline - now)
    except BaseException:
        # A defect of ours: no more targets, and the autopilot lands if it still hears us and nobody else flies it.
        if pilot.stage is not Stage.RELEASED:
            with contextlib.suppress(FlightError, TimeoutError):
                await asyncio.wait_for(autopilot.land(), LAST_WORD_S)
        raise
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


def _send(target: AttitudeTarget, began_s: float, autopilot: Autopilot, pilot: Pilot) -> None:
    """Send the target, unless this very tick was stalled: then the state behind it is too old."""
    stalled_s = time.monotonic() - began_s
    if stalled_s > pilot.settings.guards.max_tick_late_s:
        pilot.fail(f"the control loop stalled for {stalled_s:.2f} s")
        return
    try:
        autopilot.send(target)
    except FlightError as error:
        pilot.fail(str(error))


async def _carry_out(request: Request, autopilot: Autopilot, pilot: Pilot) -> None:
    try:
        if request is Request.OFFBOARD:
            await autopilot.start_offboard()
        elif request is Request.LEAVE_OFFBOARD:
            await autopilot.leave_offboard()
        elif request is Request.CHECKS:
            await autopilot.run_checks()
        elif request is Request.ARM:
            await autopilot.arm()
        elif request is Request.TAKE_OFF:
            await autopilot.take_off(pilot.take_off_m)
        else:
            await autopilot.land()
    except FlightError as error:
        pilot.request_failed(request, str(error), refused=isinstance(error, RefusalError))


@contextlib.contextmanager
def landing_on_signals(pilot: Pilot) -> Iterator[None]:
    """Context in which Ctrl-C, SIGTERM and the loss of the terminal (ssh over a radio link) make the pilot land.

    A second Ctrl-C makes it let go at once. The other signals may come twice for one cause, so they do not.
    """
    loop = asyncio.get_running_loop()
    for number in LANDING_SIGNALS:
        loop.add_signal_handler(number, pilot.ask_to_land, f"asked to land by {number.name}")
    interrupts = itertools.count(1)

    def interrupt() -> None:
        if next(interrupts) == 1:
            pilot.ask_to_land("asked to land by SIGINT")
        else:
            pilot.ask_to_let_go("asked to let go by a second SIGINT")

    loop.add_signal_handler(signal.SIGINT, interrupt)
    try:
        yield
    finally:
        for number in LANDING_SIGNALS:
            loop.remove_signal_handler(number)
