"""Time of a diagnosis, on the public HOVERING log where it is there, else on a simulated flight."""

import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import quadctl.sitl.run
from quadctl.flight.preflight.preparation import prepare_flight
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.selection.diagnosis import diagnose
from quadctl.logs.read import read_log
from quadctl.model import load_model
from studies.page import ROOT

HOVERING = ROOT / "../shared/data/raptor/HOVERING.csv"
Row = tuple[str, str, str]


def rows() -> Iterator[Row]:
    with tempfile.TemporaryDirectory() as directory:
        path = HOVERING if HOVERING.exists() else _flown(Path(directory))
        model = load_model(ROOT / "config/vehicles/raptor.yaml")
        begin = time.perf_counter()
        log = read_log(path)
        read = time.perf_counter()
        data = load_dataset([log], model.vehicle)
        diagnose(model, data)
        done = time.perf_counter()
    yield (
        f"diagnose {path.name}, {len(log)} rows",
        f"{done - read:.2f} s",
        f"{(done - read) / (read - begin):.0f} x the time to read the file ({1e3 * (read - begin):.0f} ms)",
    )


def _flown(directory: Path) -> Path:
    plan = prepare_flight(ROOT / "missions/hover_staircase.yaml", ROOT / "config/flight.yaml", "none", None)
    return Path(quadctl.sitl.run.simulate(plan, directory, None, 1).log)
