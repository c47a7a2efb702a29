"""Fly faults, some at a time, and judge what came of them."""

import tempfile
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

from .cases import CASES, Case
from .scene import PROFILES, Scene, Seen

JOBS = 2
ATTEMPTS = 3
"""A machine that is busy with other things can spoil a flight in real time: it is flown again."""


class Verdict(NamedTuple):
    """One fault on one autopilot."""

    fault: str
    autopilot: str
    seen: Seen
    wrong: list[str]


def fly(fault: str, autopilot: str) -> Verdict:
    """One flight with the fault of that name."""
    case = case_named(fault)
    verdict = _attempt(case, autopilot)
    for _ in range(ATTEMPTS - 1):
        if not verdict.wrong:
            break
        verdict = _attempt(case, autopilot)
    return verdict


def _attempt(case: Case, autopilot: str) -> Verdict:
    profile = PROFILES[autopilot]
    modes = {"land": "LAND", "hold": profile.hold, "failsafe": profile.failsafe, "stick": profile.stick}
    with tempfile.TemporaryDirectory() as folder:
        scene = Scene(profile, Path(folder), case.stall_s)
        try:
            seen = scene.watch(case.inject)
        except RuntimeError as error:
            return Verdict(case.name, autopilot, Seen(), [str(error)])
        finally:
            scene.close()
    return Verdict(case.name, autopilot, seen, case.wrong(seen, modes))


def fly_all(faults: Iterable[str], autopilots: Iterable[str] = PROFILES, jobs: int = JOBS) -> Iterator[Verdict]:
    """Every fault on every autopilot, in their order."""
    pairs = [(fault, autopilot) for fault in faults for autopilot in autopilots]
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        yield from pool.map(fly, *zip(*pairs, strict=True))


def case_named(name: str) -> Case:
    return next(case for case in CASES if case.name == name)
