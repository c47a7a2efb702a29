"""The UDP port of a link, which one program alone may hold: of two, the later one would take the other's datagrams.

MAVSDK opens its sockets with address reuse. So a port that somebody holds is refused before, and the reuse of our own
socket is switched off after: then no program that starts during a flight gets the port, whatever it asks for (Linux).
"""

import errno
import os
import socket
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from quadctl.errors import LinkError

PROC = Path("/proc")
SHOWN_LETTERS = 60
"""Length of a command line in a message."""


def require_free(url: str) -> None:
    """Raise LinkError when another socket holds the port of a `udpin` URL, and say whose it is, if that is known."""
    host, port = _address(url)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind((host, port))
        except OSError as error:
            if error.errno == errno.EADDRINUSE:
                raise LinkError(
                    f"The link {url} is not opened: UDP port {port} is held by {_holder(port)}. End that program, or "
                    "have the autopilot send to another port too: of two programs on one port, one hears nothing."
                ) from None


def own(url: str) -> None:
    """Switch address reuse off on the sockets of this process at the port of a `udpin` URL."""
    _, port = _address(url)
    for entry in _entries(PROC / "self" / "fd"):
        with suppress(OSError):
            if not str(entry.readlink()).startswith("socket:"):
                continue
            with socket.socket(fileno=os.dup(int(entry.name))) as ours:
                internet = ours.family in (socket.AF_INET, socket.AF_INET6)
                if internet and ours.type == socket.SOCK_DGRAM and ours.getsockname()[1] == port:
                    for option in (socket.SO_REUSEADDR, socket.SO_REUSEPORT):
                        ours.setsockopt(socket.SOL_SOCKET, option, 0)


def _address(url: str) -> tuple[str, int]:
    host, _, port = url.removeprefix("udpin://").rpartition(":")
    return host, int(port)


def _holder(port: int) -> str:
    """Name of the process that holds a UDP port; a vague one where the system does not tell."""
    wanted = {f"socket:[{inode}]" for inode in _inodes(port)}
    for process in _entries(PROC):
        if not process.name.isdigit():
            continue
        with suppress(OSError):
            if any(str(entry.readlink()) in wanted for entry in _entries(process / "fd")):
                command = (process / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace").strip()
                return f"process {process.name} ({command[:SHOWN_LETTERS]})"
    return "another program"


def _inodes(port: int) -> Iterator[str]:
    """Inodes of the sockets that are bound to a UDP port."""
    for table in ("udp", "udp6"):
        with suppress(OSError):
            for line in (PROC / "net" / table).read_text().splitlines()[1:]:
                words = line.split()
                if int(words[1].rpartition(":")[2], 16) == port:
                    yield words[9]


def _entries(folder: Path) -> list[Path]:
    """Entries of a folder that may be gone or closed to us."""
    with suppress(OSError):
        return list(folder.iterdir())
    return []
