"""`quadctl` in a process that can be made to stall: SIGUSR1 freezes the event loop, SIGUSR2 the whole interpreter.

`python -m studies.faults.flier fly ...`; how long is the environment variable STALL_S, in seconds.
"""

import ctypes
import os
import signal
import time

from quadctl.cli import main

STALL_S = float(os.environ.get("STALL_S", "3"))


def freeze_loop(*_: object) -> None:
    """The other threads go on, MAVSDK's too."""
    time.sleep(STALL_S)


def hold_interpreter(*_: object) -> None:
    """A call into C that does not let go of the interpreter's lock: no line of Python runs anywhere."""
    ctypes.PyDLL(None).usleep(int(1e6 * STALL_S))


if __name__ == "__main__":
    signal.signal(signal.SIGUSR1, freeze_loop)
    signal.signal(signal.SIGUSR2, hold_interpreter)
    main()
