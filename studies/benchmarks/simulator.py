"""Speed of a simulated flight as a multiple of real time, recorder included, on one core."""

import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import quadctl.sitl.run
from quadctl.flight.preflight.preparation import prepare_flight
from studies.page import ROOT

Row = tuple[str, str, str]


def rows() -> Iterator[Row]:
    for model in ("none", "sanchez"):
        plan = prepare_flight(ROOT / "missions/step_response.yaml", ROOT / "config/flight.yaml", model, None)
        with tempfile.TemporaryDirectory() as directory:
            begin = time.perf_counter()
            outcome = quadctl.sitl.run.simulate(plan, Path(directory), None, 1)
            wall_s = time.perf_counter() - begin
        flown_s = outcome.ticks / plan.settings.controller.rate_hz
        yield (
            f"simulate step_response, compensator {model}",
            f"{wall_s:.2f} s",
            f"{flown_s / wall_s:.0f} x real time ({flown_s:.0f} s flown, physics at 500 Hz)",
        )
