"""Fly faults, some at a time, and judge what came of them."""

import tempfile
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

from .cases import CASES, Case
from .scene import PROFILES, Scene, Seen

JOBS = 4
"""Each takes real time, and little of the machine."""
ATTEMPTS = 3
"""A machine that is busy with other things can spoil a flight in real time: it is flown again."""


class Verdict(NamedTuple):
    """One fault on one autopilot."""

    fault: str
    autopilot: str
    seen: Seen
    wrong: list[str]
    attempts: int = 1


def fly(fault: str, autopilot: str) -> Verdict:
    """One flight with the fault of that name."""
    case = case_named(fault).on(autopilot)
    for attempt in range(1, ATTEMPTS + 1):
        verdict = _attempt(case, autopilot)._replace(attempts=attempt)
        if not verdict.wrong:
            break
    return verdict


def _attempt(case: Case, autopilot: str) -> Verdict:
    profile = PROFILES[autopilot]
    with tempfile.TemporaryDirectory() as folder:
        scene = Scene(profile, Path(folder), case.setting)
        try:
            seen = scene.watch(case.inject)
        except RuntimeError as error:
            return Verdict(case.name, autopilot, Seen(), [str(error)])
        finally:
            scene.close()
    return Verdict(case.name, autopilot, seen, case.wrong(seen, profile))


def fly_all(pairs: Iterable[tuple[str, str]], jobs: int = JOBS) -> Iterator[Verdict]:
    """Faults on autopilots, in their order."""
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        yield from pool.map(fly, *zip(*pairs, strict=True))


def case_named(name: str) -> Case:
    return next(case for case in CASES if case.name == name)
