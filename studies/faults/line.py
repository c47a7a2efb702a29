"""A line between an autopilot and a flight, with delay, jitter, loss and duplicates; both ends are local UDP."""

import contextlib
import heapq
import itertools
import random
import selectors
import socket
import threading
import time
from dataclasses import dataclass, field
from types import TracebackType
from typing import Self

HOST = "127.0.0.1"
LONGEST_WAIT_S = 0.1


@dataclass
class Troubles:
    """Troubles of one direction; set from any thread."""

    delay_s: float = 0.0
    growth: float = 0.0
    """Growth of the delay, s/s, from `grows_from_s` (of `time.monotonic`) on."""
    grows_from_s: float = 0.0
    most_s: float = 0.0
    """Largest delay to which it grows, s."""
    jitter_s: float = 0.0
    """Largest further delay, s, drawn for each datagram alone: those that wait longer are overtaken."""
    loss: float = 0.0
    """Share of datagrams that do not arrive."""
    duplicates: float = 0.0
    """Share of datagrams that arrive twice."""
    silent: bool = False
    """True: nothing arrives."""
    chance: random.Random = field(default_factory=lambda: random.Random(0))

    def arrivals_s(self, now_s: float) -> list[float]:
        """Times at which copies of a datagram that is sent now arrive: none, one or two."""
        if self.silent or self.chance.random() < self.loss:
            return []
        grown_s = min(self.growth * (now_s - self.grows_from_s), self.most_s) if self.growth > 0.0 else 0.0
        copies = 2 if self.chance.random() < self.duplicates else 1
        return [now_s + self.delay_s + grown_s + self.chance.uniform(0.0, self.jitter_s) for _ in range(copies)]


class Line:
    """Carries datagrams from `autopilot_port`, to which the autopilot sends, to `flight_port`, and back.

    A context manager.
    """

    def __init__(self, autopilot_port: int, flight_port: int) -> None:
        self.autopilot_port, self.flight_port = autopilot_port, flight_port
        self.down, self.up = Troubles(), Troubles()
        """Troubles of the autopilot's messages, and of ours."""
        self._autopilot_end = _bound(autopilot_port)
        self._flight_end = _bound(0)
        self._flight = (HOST, flight_port)
        self._autopilot: tuple[str, int] | None = None
        self._travelling: list[tuple[float, int, socket.socket, bytes, tuple[str, int]]] = []
        self._numbers = itertools.count()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._carry, name="line", daemon=True)

    def delay(self, seconds: float) -> None:
        """Delay everything by so much each way."""
        self.down.delay_s = self.up.delay_s = seconds

    def delay_more_and_more(self, growth: float, most_s: float) -> None:
        """Let the delay of each way grow by `growth` s/s from now on, up to `most_s`."""
        for way in (self.down, self.up):
            way.most_s, way.grows_from_s = most_s, time.monotonic()
            way.growth = growth

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stopping.set()
        self._thread.join()
        self._autopilot_end.close()
        self._flight_end.close()

    def _carry(self) -> None:
        with selectors.DefaultSelector() as selector:
            selector.register(self._autopilot_end, selectors.EVENT_READ)
            selector.register(self._flight_end, selectors.EVENT_READ)
            while not self._stopping.is_set():
                due_s = self._travelling[0][0] - time.monotonic() if self._travelling else LONGEST_WAIT_S
                for key, _ in selector.select(min(max(due_s, 0.0), LONGEST_WAIT_S)):
                    self._take(key.fileobj)
                self._deliver(time.monotonic())

    def _take(self, end: object) -> None:
        """Take all that waits at one end."""
        with contextlib.suppress(BlockingIOError):
            while True:
                try:
                    if end is self._autopilot_end:
                        data, self._autopilot = self._autopilot_end.recvfrom(65536)
                        self._send_off(self.down, self._flight_end, data, self._flight)
                    else:
                        data = self._flight_end.recv(65536)
                        if self._autopilot is not None:
                            self._send_off(self.up, self._autopilot_end, data, self._autopilot)
                except ConnectionError:  # nobody listens on the other side (yet)
                    continue

    def _send_off(self, way: Troubles, by: socket.socket, data: bytes, to: tuple[str, int]) -> None:
        for arrives_s in way.arrivals_s(time.monotonic()):
            heapq.heappush(self._travelling, (arrives_s, next(self._numbers), by, data, to))

    def _deliver(self, now_s: float) -> None:
        while self._travelling and self._travelling[0][0] <= now_s:
            _, _, by, data, to = heapq.heappop(self._travelling)
            with contextlib.suppress(ConnectionError, BlockingIOError):
                by.sendto(data, to)


def _bound(port: int) -> socket.socket:
    end = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    end.bind((HOST, port))
    end.setblocking(False)
    return end
