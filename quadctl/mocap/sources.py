"""Sources of poses: UDP datagrams or a recording; capture.py has the motion-capture systems."""

import json
import math
import socket
import time
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self

from quadctl.errors import LinkError, LogError
from quadctl.mocap.gate import Pose
from quadctl.state import NAN


class Source(Protocol):
    """A context manager that gives poses."""

    @property
    def others(self) -> set[str]:
        """Names of bodies that were seen and not asked for."""

    def __enter__(self) -> Self: ...
    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...

    def receive(self, timeout_s: float) -> Pose | None:
        """The newest pose of the body, as soon as there is one that has not been given; None when the time is up."""


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
        """Port 0 takes any that is free. Raises LinkError when the port cannot be bound."""
        self.others: set[str] = set()
        self._body = body
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((host, port))
        except OSError as error:
            self._socket.close()
            raise LinkError(f"The source udp://{host}:{port} cannot be opened ({error.strerror}).") from None

    @property
    def port(self) -> int:
        port: int = self._socket.getsockname()[1]
        return port

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


class ReplaySource:
    """A recording: one datagram's JSON on each line, given at the pace of its `time`."""

    def __init__(self, path: Path, body: str) -> None:
        """Raises LogError when the file cannot be read or holds no poses."""
        self.others: set[str] = set()
        try:
            lines = path.read_text(encoding="utf-8").splitlines()
        except (OSError, UnicodeDecodeError) as error:
            raise LogError(f"{path}: cannot be read ({error})") from None
        poses = list(_timed(lines, path))
        if not poses:
            raise LogError(f"{path}: holds no poses, expected lines of JSON")
        self.others = {pose.name for pose in poses if pose.name != body}
        self._waiting = deque(pose for pose in poses if pose.name == body)
        self._first_s = poses[0].sent_s
        self._begin_s = math.inf

    def __enter__(self) -> Self:
        self._begin_s = time.monotonic()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        return

    def receive(self, timeout_s: float) -> Pose | None:
        due_s = self._begin_s + self._waiting[0].sent_s - self._first_s if self._waiting else math.inf
        wait_s = due_s - time.monotonic()
        time.sleep(max(min(wait_s, timeout_s), 0.0))
        if wait_s > timeout_s:
            return None
        return self._waiting.popleft()._replace(received_s=time.monotonic())


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
