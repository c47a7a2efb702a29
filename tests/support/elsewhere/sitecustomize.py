"""Python as a computer has it that is no Linux, for the modules of quadctl: no MAVSDK, nothing of POSIX alone.

A process imports this at its start where its folder is on PYTHONPATH, and so do all processes that it starts. Other
libraries keep what they need, since they have code of their own for each system.
"""

import builtins
import ctypes
import errno
import multiprocessing
import os
import pathlib
import signal
import socket
import sys
from collections.abc import Mapping
from types import ModuleType
from typing import Any, NoReturn

MISSING = frozenset({"mavsdk", "termios", "fcntl", "pty", "tty", "resource", "pwd", "grp"})
"""Modules that are not there."""
LACKING = {
    signal: ("SIGHUP", "SIGUSR1", "SIGUSR2", "SIGKILL", "SIGSTOP", "SIGCONT"),
    socket: ("AF_UNIX", "SO_REUSEPORT"),
    os: ("nice", "fork", "killpg", "getuid", "geteuid", "sched_setscheduler", "sched_getscheduler", "sched_param"),
}
"""Names that modules of the standard library do not have."""


def _without(module: ModuleType, names: tuple[str, ...]) -> ModuleType:
    seen = ModuleType(module.__name__, module.__doc__)
    vars(seen).update({name: value for name, value in vars(module).items() if name not in names})
    return seen


def _library(name: str | None, *_: object) -> NoReturn:
    """Load a library: the program itself is none."""
    if name is None:
        raise TypeError("argument of type 'NoneType' is not iterable")
    raise OSError(f"{name} is not there")


def _no_link(self: pathlib.Path, *_: object) -> NoReturn:
    raise OSError(errno.EPERM, "a required privilege is not held by the client", str(self))


_SEEN = {module.__name__: _without(module, names) for module, names in LACKING.items()}
_SEEN["ctypes"] = _without(ctypes, ())
_SEEN["ctypes"].CDLL = _library  # type: ignore[attr-defined]
_import = builtins.__import__


def _import_elsewhere(
    name: str,
    globals: Mapping[str, Any] | None = None,  # noqa: A002
    locals: Mapping[str, Any] | None = None,  # noqa: A002
    fromlist: tuple[str, ...] | None = (),
    level: int = 0,
) -> ModuleType:
    importer = str((globals or {}).get("__name__", ""))
    top = name.partition(".")[0]
    if level == 0 and importer.partition(".")[0] == "quadctl":
        if top in MISSING:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        if name in _SEEN:
            return _SEEN[name]
    return _import(name, globals, locals, fromlist, level)


builtins.__import__ = _import_elsewhere
pathlib.Path.symlink_to = _no_link  # type: ignore[method-assign,assignment]
multiprocessing.get_all_start_methods = lambda: ["spawn"]
sys.modules["mavsdk"] = None  # type: ignore[assignment]
