"""Each fault ends as the fault table says: docs/faults.md is made by the same flights.

Here some fly that only real time shows, on PX4, and on ArduPilot where it has its own way. All fly on both autopilots
in `make faults`, which CI runs, too, and which fails as these tests do.
"""

import pytest

from studies.faults.flights import Verdict, fly_all

pytestmark = [
    pytest.mark.realtime,
    pytest.mark.timeout(900),  # the first test waits for all flights
]

ON_PX4 = (
    "event loop frozen for 0.6 s",
    "process killed",
    "position aid lost",
    "autopilot's messages stop",
    "the mode is taken for 0.3 s",
)
ON_ARDUPILOT = (  # where it has its own way, or the line has
    "event loop frozen for ever",
    "heartbeats stop",
    "delay grows by 20 ms/s each way",
)
FLOWN = [(fault, "px4") for fault in ON_PX4] + [(fault, "ardupilot") for fault in ON_ARDUPILOT]


@pytest.fixture(scope="session")
def verdicts() -> dict[tuple[str, str], Verdict]:
    """All are flown for the first test that asks."""
    return {(v.fault, v.autopilot): v for v in fly_all(FLOWN)}


@pytest.mark.parametrize(("fault", "autopilot"), FLOWN)
def test_a_fault_ends_as_it_must(verdicts: dict[tuple[str, str], Verdict], fault: str, autopilot: str) -> None:
    assert verdicts[fault, autopilot].wrong == []
