"""A line between an autopilot and a flight, with delay, jitter, loss and duplicates; both ends are local UDP."""

import contextlib
import heapq
import itertools
import multiprocessing
import random
import selectors
import socket
import time
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from types import TracebackType
from typing import Self

from quadctl.sitl.server.server import put_first

HOST = "127.0.0.1"
_PROCESSES = multiprocessing.get_context("spawn")


@dataclass
class Troubles:
    """Troubles of one direction."""

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

    A context manager. It is a process of its own: a thread beside the autopilot's would wait for its interpreter.
    """

    def __init__(self, autopilot_port: int, flight_port: int) -> None:
        self.autopilot_port, self.flight_port = autopilot_port, flight_port
        self.down, self.up = Troubles(), Troubles()
        """Troubles of the autopilot's messages, and of ours; what is changed later counts from `apply` on."""
        self._autopilot_end, self._flight_end = _bound(autopilot_port), _bound(0)
        self._orders, orders = _PROCESSES.Pipe()
        ends = self._autopilot_end, self._flight_end
        self._process = _PROCESSES.Process(target=_serve, args=(*ends, flight_port, orders), daemon=True)

    def apply(self) -> None:
        """Let the troubles of both ways be as they are set now."""
        self._orders.send((self.down, self.up))

    def delay(self, seconds: float) -> None:
        """Delay everything by so much each way."""
        self.down.delay_s = self.up.delay_s = seconds
        self.apply()

    def delay_more_and_more(self, growth: float, most_s: float) -> None:
        """Let the delay of each way grow by `growth` s/s from now on, up to `most_s`."""
        for way in (self.down, self.up):
            way.most_s, way.grows_from_s, way.growth = most_s, time.monotonic(), growth
        self.apply()

    def __enter__(self) -> Self:
        self.apply()
        self._process.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._orders.send(None)
        self._process.join()
        self._autopilot_end.close()
        self._flight_end.close()


class _Carrier:
    """The line's own process: what it carries, and where to."""

    def __init__(self, autopilot_end: socket.socket, flight_end: socket.socket, flight_port: int) -> None:
        self._autopilot_end, self._flight_end = autopilot_end, flight_end
        self._flight = (HOST, flight_port)
        self._autopilot: tuple[str, int] | None = None
        self._down, self._up = Troubles(), Troubles()
        self._travelling: list[tuple[float, int, socket.socket, bytes, tuple[str, int]]] = []
        self._numbers = itertools.count()

    def carry(self, orders: "Connection[object, tuple[Troubles, Troubles] | None]") -> None:
        """Carry datagrams, with the troubles that are ordered, until None is."""
        with selectors.DefaultSelector() as selector:
            for end in (self._autopilot_end, self._flight_end, orders):
                selector.register(end, selectors.EVENT_READ)
            while True:
                wait_s = max(self._travelling[0][0] - time.monotonic(), 0.0) if self._travelling else None
                for key, _ in selector.select(wait_s):
                    if key.fileobj is not orders:
                        self._take(key.fileobj)
                        continue
                    ordered = orders.recv()
                    if ordered is None:
                        return
                    self._down, self._up = ordered
                self._deliver(time.monotonic())

    def _take(self, end: object) -> None:
        """Take all that waits at one end."""
        with contextlib.suppress(BlockingIOError):
            while True:
                try:
                    if end is self._autopilot_end:
                        data, self._autopilot = self._autopilot_end.recvfrom(65536)
                        self._send_off(self._down, self._flight_end, data, self._flight)
                    else:
                        data = self._flight_end.recv(65536)
                        if self._autopilot is not None:
                            self._send_off(self._up, self._autopilot_end, data, self._autopilot)
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


def _serve(
    autopilot_end: socket.socket,
    flight_end: socket.socket,
    flight_port: int,
    orders: "Connection[object, tuple[Troubles, Troubles] | None]",
) -> None:
    put_first()
    _Carrier(autopilot_end, flight_end, flight_port).carry(orders)


def _bound(port: int) -> socket.socket:
    end = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    end.bind((HOST, port))
    end.setblocking(False)
    return end
