"""Check of the computer that flies: can it fly at all, and does it give the rights without which another program can
delay a tick?"""

import signal
import sys
from importlib.util import find_spec
from pathlib import Path

from quadctl.flight.preflight.facts import Kind
from quadctl.flight.preflight.findings import Finding, judged
from quadctl.flight.realtime import MEMORY_LOCKED, PRIORITY, REAL_TIME_PRIORITY, privileges
from quadctl.words import fact

NO_MAVSDK = (
    "MAVSDK, by which it speaks with an autopilot, and which is not installed: there are packages for 64-bit Linux "
    "(x86-64, Arm), for Windows, and for macOS 15 or newer"
)
NO_SIGNALS = (
    "signals by which it lands when its terminal is closed or it is told to end (SIGHUP, SIGTERM): Windows has none"
)
LINUX = "Linux gives both"
CONTAINERS = (Path("/.dockerenv"), Path("/run/.containerenv"))
"""Files by which Docker and Podman mark a container."""
CGROUP = Path("/proc/self/cgroup")

LIMITS = "/etc/security/limits.d/quadctl.conf"
LOGIN = (
    f"""`printf "$USER - %s\\n" "rtprio {PRIORITY}" "memlock unlimited" | sudo tee {LIMITS}`, """
    "and a new login, give both"
)
SERVICE = f"`LimitRTPRIO={PRIORITY}` and `LimitMEMLOCK=infinity` in the service's unit give both"
CONTAINER = f"`--ulimit rtprio={PRIORITY} --ulimit memlock=-1` of `docker run` gives both"


def lacking_to_fly() -> str | None:
    """Need of a flight that this computer does not meet; None: it can fly."""
    if find_spec("mavsdk") is None:
        return NO_MAVSDK
    return None if hasattr(signal, "SIGHUP") else NO_SIGNALS


def check_computer() -> Finding:
    """Take the rights, and let go of them again; one that is refused is a warning with the line that gives it."""
    with privileges() as used:
        given = {"real_time_priority": REAL_TIME_PRIORITY in used, "locked_memory": MEMORY_LOCKED in used}
    warning = None if all(given.values()) else fact(Kind.DELAYS, remedy=remedy())
    return judged("computer", fact(Kind.RIGHTS, **given), warning=warning)


def remedy() -> str:
    """One line that gives both rights, for where this process runs: limits of a login do not reach a service."""
    if not sys.platform.startswith("linux"):
        return LINUX
    if any(mark.exists() for mark in CONTAINERS):
        return CONTAINER
    return SERVICE if _in_service() else LOGIN


def _in_service() -> bool:
    """True in a service of the system; a login has a scope, or a service of the user's own."""
    try:
        group = CGROUP.read_text().strip()
    except OSError:
        return False
    return "/system.slice/" in group and group.endswith(".service")
