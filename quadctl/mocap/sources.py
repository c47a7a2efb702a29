"""Where poses come from: UDP datagrams, a motion-capture system through the `motioncapture` package, or a recording."""

import json
import math
import socket
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol, Self

from quadctl.errors import LinkError, LogError
from quadctl.mocap.gate import Pose
from quadctl.state import NAN

SYSTEMS = ("vicon", "optitrack", "qualisys", "vrpn")
CONNECT_S = 5.0
EXPECTED = "udp://0.0.0.0:5005, " + ", ".join(f"{system}://HOST" for system in SYSTEMS) + " or replay:FILE.jsonl"


class Source(Protocol):
    """A context manager that gives poses."""

    others: set[str]
    """Names of bodies that were seen and not asked for."""

    def __enter__(self) -> Self: ...
    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...

    def receive(self, timeout_s: float) -> Pose | None:
        """The newest pose of the body, as soon as there is one that has not been given; None when the time is up."""


def open_source(url: str, body: str) -> Source:
    """The source at `url` for the rigid body of that name; raises LinkError or LogError when there is no such."""
    scheme, _, rest = url.partition(":")
    place = rest.removeprefix("//")
    if scheme == "udp":
        host, _, port = place.rpartition(":")
        if host and port.isdecimal() and 0 < int(port) < 65536:
            return UdpSource(host, int(port), body)
    elif scheme in (*SYSTEMS, "mock") and place:
        return CaptureSource(scheme, place, body)
    elif scheme == "replay" and place:
        return ReplaySource(Path(place), body)
    raise LinkError(f"The source {url!r} is not one that can be opened: expected {EXPECTED}.")


def parse_pose(data: str | bytes, received_s: float) -> Pose | None:
    """The pose of a datagram, None for what is none:

    {"name": "raptor", "position": [x, y, z], "quaternion": [w, x, y, z], "time": seconds}, `time` optional.
    """
    try:
        fields = json.loads(data)
        position, quaternion = (tuple(float(v) for v in fields[key]) for key in ("position", "quaternion"))
        sent_s = float(fields.get("time", NAN))
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return None
    if len(position) != 3 or len(quaternion) != 4:
        return None
    return Pose(str(fields.get("name", "")), received_s, position, quaternion, sent_s)


class UdpSource:
    """Datagrams with one pose each."""

    def __init__(self, host: str, port: int, body: str) -> None:
        """Raises LinkError when the port cannot be bound."""
        self.others: set[str] = set()
        self._body = body
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((host, port))
        except OSError as error:
            self._socket.close()
            raise LinkError(f"The source udp://{host}:{port} cannot be opened ({error.strerror}).") from None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        self._socket.close()

    def receive(self, timeout_s: float) -> Pose | None:
        """Older ones that wait behind each other are dropped."""
        newest: Pose | None = None
        end_s = time.monotonic() + timeout_s
        while True:
            self._socket.settimeout(max(end_s - time.monotonic(), 0.0) if newest is None else 0.0)
            try:
                data = self._socket.recv(65536)
            except (TimeoutError, BlockingIOError):
                return newest
            pose = parse_pose(data, time.monotonic())
            if pose is None:
                self.others.add("(a datagram that is no pose)")
            elif pose.name == self._body:
                newest = pose
            else:
                self.others.add(pose.name)


class _Mailbox:
    """Holds the newest pose, from a thread that may block to one that must not."""

    def __init__(self) -> None:
        self._pose: Pose | None = None
        self._failure: LinkError | None = None
        self._news = threading.Condition()

    def put(self, pose: Pose) -> None:
        with self._news:
            self._pose = pose
            self._news.notify()

    def fail(self, failure: LinkError) -> None:
        with self._news:
            self._failure = failure
            self._news.notify()

    def take(self, timeout_s: float) -> Pose | None:
        with self._news:
            self._news.wait_for(lambda: self._pose is not None or self._failure is not None, timeout_s)
            if self._failure is not None:
                raise self._failure
            pose, self._pose = self._pose, None
            return pose


class _ThreadedSource:
    """A source whose poses a thread of its own produces. It is a daemon: libraries block without end."""

    def __init__(self, body: str) -> None:
        self.others: set[str] = set()
        self._body = body
        self._mailbox = _Mailbox()
        self._stopping = threading.Event()

    def __enter__(self) -> Self:
        threading.Thread(target=self._run, name="mocap", daemon=True).start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        self._stopping.set()

    def receive(self, timeout_s: float) -> Pose | None:
        return self._mailbox.take(timeout_s)

    def _offer(self, pose: Pose) -> None:
        if pose.name == self._body:
            self._mailbox.put(pose)
        else:
            self.others.add(pose.name)

    def _run(self) -> None:
        raise NotImplementedError


class CaptureSource(_ThreadedSource):
    """A motion-capture system that the `motioncapture` package knows."""

    def __init__(self, system: str, host: str, body: str) -> None:
        """Raises LinkError when the package is not installed."""
        super().__init__(body)
        self._name = f"{system}://{host}"
        try:
            import motioncapture
        except ImportError:
            raise LinkError(
                f"The source {self._name} needs the package motioncapture: pip install 'quadctl[mocap]'."
            ) from None
        self._connect: Callable[[], Any] = lambda: motioncapture.connect(system, {"hostname": host})
        self._connected = threading.Event()
        self._begin_s = math.inf

    def receive(self, timeout_s: float) -> Pose | None:
        self._begin_s = min(self._begin_s, time.monotonic())
        if not self._connected.is_set() and time.monotonic() - self._begin_s > CONNECT_S:
            raise LinkError(f"The motion-capture system at {self._name} does not answer: check its address.")
        return super().receive(timeout_s)

    def _run(self) -> None:
        try:
            system = self._connect()
            self._connected.set()
            while not self._stopping.is_set():
                system.waitForNextFrame()
                received_s = time.monotonic()
                for name, body in system.rigidBodies.items():
                    x, y, z = map(float, body.position)
                    q = body.rotation
                    self._offer(Pose(name, received_s, (x, y, z), (q.w, q.x, q.y, q.z)))
        except Exception as error:  # whatever the library raises, on a thread that nobody sees
            self._mailbox.fail(LinkError(f"The motion-capture system at {self._name} gives up: {error}."))


class ReplaySource(_ThreadedSource):
    """A recording: one datagram's JSON on each line, given at the pace of its `time`."""

    def __init__(self, path: Path, body: str) -> None:
        """Raises LogError when the file cannot be read or holds no poses."""
        super().__init__(body)
        try:
            lines = path.read_text(encoding="utf-8").splitlines()
        except (OSError, UnicodeDecodeError) as error:
            raise LogError(f"{path}: cannot be read ({error})") from None
        self._poses = list(_timed(lines, path))
        if not self._poses:
            raise LogError(f"{path}: holds no poses, expected lines of JSON")

    def _run(self) -> None:
        begin_s, first_s = time.monotonic(), self._poses[0].sent_s
        for pose in self._poses:
            if self._stopping.wait(max(begin_s + pose.sent_s - first_s - time.monotonic(), 0.0)):
                return
            self._offer(pose._replace(received_s=time.monotonic()))


def _timed(lines: list[str], path: Path) -> Iterator[Pose]:
    for number, line in enumerate(lines, start=1):
        if line.strip():
            pose = parse_pose(line, NAN)
            if pose is None or not math.isfinite(pose.sent_s):
                raise LogError(
                    f'{path}, line {number}: is no pose with a time, expected {{"name": ..., "position": [x, y, z], '
                    '"quaternion": [w, x, y, z], "time": seconds}'
                )
            yield pose
