"""Each fault ends as the fault table says: docs/faults.md is made by the same flights.

Here one flies for each way to end: by the flight, without it, and by a person. All fly on both autopilots in
`make faults`, which CI runs, too, and which fails as these tests do.
"""

import pytest

from studies.faults.flights import Verdict, fly_all

pytestmark = [
    pytest.mark.realtime,
    pytest.mark.timeout(900),  # the first test waits for all flights
]

FLOWN = [
    ("event loop frozen for 0.6 s", "px4"),
    ("process killed", "ardupilot"),
    ("the mode is taken for 0.3 s", "px4"),
]


@pytest.fixture(scope="session")
def verdicts() -> dict[tuple[str, str], Verdict]:
    """All are flown for the first test that asks."""
    return {(v.fault, v.autopilot): v for v in fly_all(FLOWN)}


@pytest.mark.parametrize(("fault", "autopilot"), FLOWN)
def test_a_fault_ends_as_it_must(verdicts: dict[tuple[str, str], Verdict], fault: str, autopilot: str) -> None:
    assert verdicts[fault, autopilot].wrong == []
