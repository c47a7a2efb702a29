"""Each fault ends as the fault table says: docs/faults.md is made by the same flights.

Here those fly that only real time shows, on PX4, and on ArduPilot where it has its own way. What the state alone can
say is flown in lockstep (tests/flight/pilot), and all of it on both autopilots by `make faults`.
"""

import pytest

from studies.faults.cases import LINK, PEOPLE, PROCESS
from studies.faults.flights import Verdict, fly_all

pytestmark = [
    pytest.mark.realtime,
    pytest.mark.timeout(900),  # the first test waits for all flights
]

FLOWN_ELSEWHERE = ("Ctrl-C", "the mode is taken and given back")
"""In tests/realtime/test_realtime.py; in lockstep, from where it differs from the mode that is taken."""
ON_PX4 = [case.name for case in (*PROCESS, *LINK, *PEOPLE) if case.name not in FLOWN_ELSEWHERE]
ON_PX4 += ["position frozen", "estimator rejects its sensors", "landing does not end", "compensator beyond its data"]
ON_ARDUPILOT = [  # where it has its own way
    "event loop frozen for 3 s",
    "process killed",
    "autopilot hears nothing",
    "disarmed in flight",
    "autopilot restarts at once",
    "Ctrl-C, landing refused",
]
FLOWN = [(fault, "px4") for fault in ON_PX4] + [(fault, "ardupilot") for fault in ON_ARDUPILOT]


@pytest.fixture(scope="session")
def verdicts() -> dict[tuple[str, str], Verdict]:
    """All are flown for the first test that asks."""
    return {(v.fault, v.autopilot): v for v in fly_all(FLOWN)}


@pytest.mark.parametrize(("fault", "autopilot"), FLOWN)
def test_a_fault_ends_as_it_must(verdicts: dict[tuple[str, str], Verdict], fault: str, autopilot: str) -> None:
    assert verdicts[fault, autopilot].wrong == []
