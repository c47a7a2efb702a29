"""Motion-capture systems, through the `motioncapture` package, in a process of its own.

Its calls block without letting another thread run, for ever where a system does not answer: beside them neither Ctrl-C
nor the flow of poses would work. The process sends what it gets as the datagrams of `UdpSource`.
"""

import importlib.util
import json
import math
import multiprocessing
import signal
import socket
import time
from multiprocessing.connection import Connection
from pathlib import Path
from types import TracebackType
from typing import Self

from quadctl.errors import LinkError
from quadctl.mocap.gate import Pose
from quadctl.mocap.sources import ReplaySource, Source, UdpSource

SYSTEMS = ("vicon", "optitrack", "qualisys", "vrpn")
EXPECTED = "udp://0.0.0.0:5005, " + ", ".join(f"{system}://HOST" for system in SYSTEMS) + " or replay:FILE.jsonl"
"""URLs of sources."""
CONNECT_S = 8.0
"""For the package to load and the system to answer."""


def open_source(url: str, body: str) -> Source:
    """The source at `url` for the rigid body of that name; raises LinkError or LogError when there is no such."""
    scheme, _, rest = url.partition(":")
    place = rest.removeprefix("//")
    if scheme == "udp":
        host, _, port = place.rpartition(":")
        if host and port.isdecimal() and 0 < int(port) < 65536:
            return UdpSource(host, int(port), body)
    elif scheme in SYSTEMS and place:
        return CaptureSource(scheme, place, body)
    elif scheme == "replay" and place:
        return ReplaySource(Path(place), body)
    raise LinkError(f"The source {url!r} is not one that can be opened: expected {EXPECTED}.")


class CaptureSource:
    """The poses of a system of `SYSTEMS` at `host`."""

    def __init__(self, system: str, host: str, body: str) -> None:
        """Raises LinkError when the package is not installed."""
        self._name = f"{system}://{host}"
        if importlib.util.find_spec("motioncapture") is None:
            raise LinkError(f"The source {self._name} needs the package motioncapture: pip install 'quadctl[mocap]'.")
        self._udp = UdpSource("127.0.0.1", 0, body)
        context = multiprocessing.get_context("spawn")
        self._news, there = context.Pipe(duplex=False)
        self._process = context.Process(target=_serve, args=(system, host, self._udp.port, there), daemon=True)
        self._process_end = there
        self._deadline_s = math.inf

    @property
    def others(self) -> set[str]:
        return self._udp.others

    def __enter__(self) -> Self:
        self._process.start()
        self._process_end.close()  # the child has its own: when that closes, the child is dead
        self._deadline_s = time.monotonic() + CONNECT_S
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        self._process.kill()
        self._process.join()
        self._udp.__exit__(kind, error, tb)

    def receive(self, timeout_s: float) -> Pose | None:
        """Raises LinkError when the system does not answer or its library gives up."""
        if self._news.poll():
            try:
                failure: str = self._news.recv()
            except EOFError:
                failure = "its library has crashed"
            if failure:
                raise LinkError(f"The motion-capture system at {self._name} cannot be read: {failure}.")
            self._deadline_s = math.inf
        if time.monotonic() > self._deadline_s:
            raise LinkError(f"The motion-capture system at {self._name} does not answer: check its address.")
        return self._udp.receive(timeout_s)


def _serve(system: str, host: str, port: int, news: Connection) -> None:
    """In the child: an empty text when connected, what went wrong otherwise."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        import motioncapture

        capture = motioncapture.connect(system, {"hostname": host})
        news.send("")
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
            while True:
                capture.waitForNextFrame()
                now_s = time.monotonic()
                for name, body in capture.rigidBodies.items():
                    q = body.rotation
                    fields = {"name": name, "position": [float(v) for v in body.position], "time": now_s}
                    fields["quaternion"] = [q.w, q.x, q.y, q.z]
                    out.sendto(json.dumps(fields).encode(), ("127.0.0.1", port))
    except Exception as error:  # whatever the library raises; the parent says it
        news.send(str(error) or type(error).__name__)
