"""Fly faults, several at a time, and judge the results."""

import tempfile
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

from .cases import CASES, Case
from .scene import PROFILES, Scene, Seen
from .witness import Witness

JOBS = 5
"""Flights at a time: each takes real time, and little of the processor."""
ALONE = 2
"""Times that a flight is repeated alone, as a busy machine can spoil a flight in real time."""
MOST = 6
"""Flights alone, including those that do not count because the machine itself stood still."""


class Verdict(NamedTuple):
    """One fault on one autopilot."""

    fault: str
    autopilot: str
    seen: Seen
    wrong: list[str]
    attempts: int = 1


def fly(fault: str, autopilot: str, attempt: int = 1) -> Verdict:
    """Fly once with the fault of that name."""
    return _attempt(case_named(fault).on(autopilot), autopilot)._replace(attempts=attempt)


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
    """Faults on autopilots, in their order but for those that are flown again: they come last."""
    again = []
    with _pool(jobs) as pool:
        for verdict in pool.map(fly, *zip(*pairs, strict=True)):
            if verdict.wrong:
                again.append((verdict.fault, verdict.autopilot))
            else:
                yield verdict
    with _pool(1) as pool:
        for fault, autopilot in again:
            yield _alone(pool, fault, autopilot, Witness())


def _alone(pool: ProcessPoolExecutor, fault: str, autopilot: str, witness: Witness) -> Verdict:
    counted = 0
    for attempt in range(2, 2 + MOST):
        witness.forget()
        verdict = pool.submit(fly, fault, autopilot, attempt).result()
        counted += not witness.stood_still()
        if not verdict.wrong or counted == ALONE:
            break
    return verdict


def _pool(jobs: int) -> ProcessPoolExecutor:
    return ProcessPoolExecutor(jobs, mp_context=get_context("spawn"))


def case_named(name: str) -> Case:
    return next(case for case in CASES if case.name == name)
