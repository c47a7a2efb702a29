"""The serial line of a link, set so that MAVSDK waits for data.

MAVSDK opens the device with VMIN 0 and VTIME 0. A read of nothing is then answered at once and asked again, without
end, and takes a whole core. With VMIN 1 it is woken up when a byte comes.
"""

import contextlib
import os
from collections.abc import Iterator

CONTROL_CHARACTERS = 6
"""Place of the control characters, VMIN among them, in what `termios.tcgetattr` returns."""


def let_reads_wait(device: str) -> bool:
    """Set VMIN 1 on an open device, for all that have it open, and tell whether it has it now.

    The setting lasts until the device is opened again by MAVSDK, or closed by all.
    """
    try:
        import termios
    except ImportError:  # Windows, where MAVSDK waits by other means
        return True
    try:
        with _opened(device) as line:
            attributes = termios.tcgetattr(line)
            attributes[CONTROL_CHARACTERS][termios.VMIN] = 1
            attributes[CONTROL_CHARACTERS][termios.VTIME] = 0
            termios.tcsetattr(line, termios.TCSANOW, attributes)
            return bool(termios.tcgetattr(line)[CONTROL_CHARACTERS][termios.VMIN] == 1)
    except (OSError, termios.error):
        return False


@contextlib.contextmanager
def _opened(device: str) -> Iterator[int]:
    """A second descriptor of the device, without waiting for a modem, and not as the terminal of this process."""
    line = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        yield line
    finally:
        os.close(line)
