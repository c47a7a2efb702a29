"""A serial line without hardware, between a simulated autopilot and whatever opens its device."""

import os
import select
import socket
import termios
import threading
import tty
from contextlib import suppress
from pathlib import Path


class SerialLine:
    """A serial device that can be unplugged; what the autopilot sends to a UDP port comes out of it, and back."""

    def __init__(self, device: Path, udp_port: int) -> None:
        self.device = device
        self._udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._udp.bind(("127.0.0.1", udp_port))
        self._ends: tuple[int, int] | None = None
        self._lock = threading.Lock()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._carry)
        self.plug()

    @property
    def least_read(self) -> int:
        """Number of bytes that a read waits for (VMIN)."""
        assert self._ends is not None
        control_characters: list[int] = termios.tcgetattr(self._ends[1])[6]
        return control_characters[termios.VMIN]

    def plug(self) -> None:
        with self._lock:
            self._ends = os.openpty()
            tty.setraw(self._ends[1])
            os.set_blocking(self._ends[0], False)
            self.device.symlink_to(os.ttyname(self._ends[1]))

    def unplug(self) -> None:
        with self._lock:
            assert self._ends is not None
            self.device.unlink()
            for end in self._ends:
                os.close(end)
            self._ends = None

    def __enter__(self) -> "SerialLine":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stopping.set()
        self._thread.join()
        if self._ends is not None:
            self.unplug()
        self._udp.close()

    def _carry(self) -> None:
        peer = None
        while not self._stopping.is_set():
            ready = select.select([self._udp], [], [], 0.005)[0]
            data, peer = self._udp.recvfrom(65536) if ready else (b"", peer)
            with self._lock:
                if self._ends is None:
                    continue
                line = self._ends[0]
                if data:
                    with suppress(BlockingIOError):  # nobody reads: as on a real line, it is lost
                        os.write(line, data)
                while peer is not None and select.select([line], [], [], 0.0)[0]:
                    self._udp.sendto(os.read(line, 65536), peer)
