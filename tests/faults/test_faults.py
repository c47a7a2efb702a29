"""Each fault ends as the fault table says: docs/faults.md is made by the same flights."""

import pytest

from .cases import CASES
from .fly import Verdict, fly_all
from .scene import PROFILES

pytestmark = pytest.mark.timeout(900)
"""The first test waits for all flights."""


@pytest.fixture(scope="session")
def verdicts() -> dict[tuple[str, str], Verdict]:
    """Some at a time, because each takes real time."""
    return {(v.fault, v.autopilot): v for v in fly_all(case.name for case in CASES)}


@pytest.mark.parametrize("autopilot", PROFILES)
@pytest.mark.parametrize("fault", [case.name for case in CASES])
def test_a_fault_ends_as_it_must(verdicts: dict[tuple[str, str], Verdict], fault: str, autopilot: str) -> None:
    assert verdicts[fault, autopilot].wrong == []
