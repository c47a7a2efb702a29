"""Means of the operating system against late ticks: used where permitted, undone at the end, and reported."""

import asyncio
import contextlib
import ctypes
import gc
import os
import selectors
import struct
import sys
from collections.abc import Coroutine, Iterator
from pathlib import Path
from typing import Any, TypeVar

T = TypeVar("T")

PRIORITY = 20
"""Priority under SCHED_FIFO: above all ordinary processes, below the kernel's interrupt threads (50)."""
SWITCH_INTERVAL_S = 0.0005
"""Longest time for which another thread (recorder, display) may keep the interpreter from the loop; by default 5 ms."""
REAL_TIME_PRIORITY, MEMORY_LOCKED = f"SCHED_FIFO {PRIORITY}", "memory locked"
"""Names of the means that a user has to be given the right to."""
IDLE_STATES = Path("/dev/cpu_dma_latency")
"""Linux' interface for the longest time, an int32 in us, in which a processor may wake up, for as long as it is open
(Linux kernel documentation, PM Quality of Service Interface)."""
MCL_CURRENT, MCL_FUTURE, MCL_ONFAULT = 1, 2, 4


def run(main: Coroutine[Any, Any, T]) -> T:
    """Run a flight's coroutine on a loop that wakes up in time: epoll rounds time-outs up to ms, select does not."""
    with asyncio.Runner(loop_factory=lambda: asyncio.SelectorEventLoop(selectors.SelectSelector())) as runner:
        return runner.run(main)


@contextlib.contextmanager
def privileges() -> Iterator[tuple[str, ...]]:
    """Context with every permitted means in use; gives their names for the log and the user.

    Threads inherit the scheduler from the one that starts them, so open the link inside: the library's threads, and
    those that share the interpreter's lock with the loop, must not be held up either.
    """
    used = ["select", f"switch interval {1e3 * SWITCH_INTERVAL_S:g} ms", "gc frozen"]
    with contextlib.ExitStack() as undo:
        undo.callback(sys.setswitchinterval, sys.getswitchinterval())
        sys.setswitchinterval(SWITCH_INTERVAL_S)
        gc.collect()
        gc.freeze()  # what is frozen is never scanned again
        undo.callback(gc.unfreeze)
        if hasattr(os, "sched_setscheduler"):
            before = os.sched_getscheduler(0), os.sched_getparam(0)
            with contextlib.suppress(OSError):
                os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
                undo.callback(os.sched_setscheduler, 0, *before)
                used.append(REAL_TIME_PRIORITY)
        if _memory_locked():
            undo.callback(_libc().munlockall)
            used.append(MEMORY_LOCKED)
        with contextlib.suppress(OSError):
            undo.callback(os.close, _kept_awake())
            used.append("processor kept awake")
        yield tuple(used)


def _memory_locked() -> bool:
    """Lock memory pages once they have been used."""
    try:
        return bool(_libc().mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT) == 0)
    except (AttributeError, OSError, TypeError):  # no Linux
        return False


def _kept_awake() -> int:
    """Keep the processor from idle states, out of which it comes late and with cold caches; the open file does it."""
    file = os.open(IDLE_STATES, os.O_WRONLY)
    try:
        os.write(file, struct.pack("i", 0))
    except OSError:
        os.close(file)
        raise
    return file


def _libc() -> ctypes.CDLL:
    return ctypes.CDLL(None)
