"""Results that several tests of the lab read."""

import fcntl
import pickle
from pathlib import Path

import pytest

from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.selection.diagnosis import Diagnosis, diagnose
from quadctl.logs.flight_log import FlightLog
from quadctl.model import Model


@pytest.fixture(scope="session")
def nothing(shared: Path, plain_runs: list[FlightLog], rigid: Model) -> Diagnosis:
    """Diagnosis of flights in which nothing is missing; of all processes of a test run the first to ask computes it."""
    kept = shared / "nothing.pickle"
    with (shared / "nothing.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not kept.exists():
            kept.write_bytes(pickle.dumps(diagnose(rigid, load_dataset(plain_runs, rigid.vehicle))))
    found: Diagnosis = pickle.loads(kept.read_bytes())
    return found
