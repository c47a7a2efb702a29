"""Trajectories, one file each: `kind: NAME` in a mission's phase picks the class. Adding one is adding its file."""

import importlib
import pkgutil
from collections.abc import Iterator

from quadctl.errors import SettingsError
from quadctl.trajectories.base import Reference, Trajectory
from quadctl.words import nearest

__all__ = ["Reference", "Trajectory", "find_trajectory", "known_trajectories"]


def known_trajectories() -> dict[str, type[Trajectory]]:
    """All trajectories of this package by kind."""
    for module in pkgutil.iter_modules(__path__):
        importlib.import_module(f"{__name__}.{module.name}")
    return {kind.kind: kind for kind in _kinds_of(Trajectory)}


def _kinds_of(parent: type[Trajectory]) -> Iterator[type[Trajectory]]:
    for kind in parent.__subclasses__():
        yield kind
        yield from _kinds_of(kind)


def find_trajectory(kind: str, source: str) -> type[Trajectory]:
    """The trajectory called `kind`; raises SettingsError with the nearest known name."""
    known = known_trajectories()
    if kind not in known:
        hint = nearest(kind, known) or f", expected one of: {', '.join(sorted(known))}"
        raise SettingsError(f"{source}: there is no trajectory '{kind}'{hint}")
    return known[kind]
