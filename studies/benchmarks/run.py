"""All benchmarks, one table, on the terminal and in docs/benchmarks.md. Each time is also given relative to
another time of the same run, because machines differ.

make bench
"""

import os
import platform
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from rich.console import Console
from rich.table import Table

from quadctl.flight.preflight.plan import FlightPlan
from quadctl.flight.preflight.preparation import prepare_flight
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.selection.diagnosis import diagnose
from quadctl.logs.read import read_log
from quadctl.model import load_model
from quadctl.sitl.run import simulate
from studies.benchmarks import lab_growth
from studies.benchmarks.lab_growth import RAPTOR, Row
from studies.page import DOCS, ROOT, table, write_page

PAGE = DOCS / "benchmarks.md"
HOVERING = ROOT / "../shared/data/raptor/HOVERING.csv"
"""Public log; where it is not there, a simulated flight takes its place."""
HEADINGS = ("what", "measured", "relative to another time of the same run")
ABOUT = """# Benchmarks

Written by `make bench` on one machine: {machine}.
Each row also gives the time relative to another time of the same run. That of a tick of control is on
[its own page](control-loop.md).
"""


def diagnosis() -> Iterator[Row]:
    """Time of a diagnosis."""
    with tempfile.TemporaryDirectory() as directory:
        path = HOVERING
        if not path.exists():
            path = Path(simulate(_plan("hover_staircase", "none"), Path(directory), None, 1).log)
        model = load_model(RAPTOR)
        begin = time.perf_counter()
        log = read_log(path)
        read = time.perf_counter()
        diagnose(model, load_dataset([log], model.vehicle))
        done = time.perf_counter()
    yield (
        f"diagnose {path.name}, {len(log)} rows",
        f"{done - read:.2f} s",
        f"{(done - read) / (read - begin):.0f} x the time to read the file ({1e3 * (read - begin):.0f} ms)",
    )


def simulation() -> Iterator[Row]:
    """Speed of a simulated flight as a multiple of real time, recorder included, on one core."""
    for model in ("none", "sanchez"):
        plan = _plan("step_response", model)
        with tempfile.TemporaryDirectory() as directory:
            begin = time.perf_counter()
            outcome = simulate(plan, Path(directory), None, 1)
            wall_s = time.perf_counter() - begin
        flown_s = outcome.ticks / plan.settings.controller.rate_hz
        yield (
            f"simulate step_response, compensator {model}",
            f"{wall_s:.2f} s",
            f"{flown_s / wall_s:.0f} x real time ({flown_s:.0f} s flown, physics at 500 Hz)",
        )


def _plan(mission: str, model: str) -> FlightPlan:
    return prepare_flight(ROOT / "missions" / f"{mission}.yaml", ROOT / "config/flight.yaml", model, None)


def main() -> None:
    machine = f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}"
    shown = Table(*HEADINGS, title=machine)
    lines: list[Row] = []
    for rows in (diagnosis, lab_growth.rows, lab_growth.rows_of_one_log, simulation):
        for row in rows():
            shown.add_row(*row)
            lines.append(row)
    Console().print(shown)
    write_page(PAGE, f"{ABOUT.format(machine=machine)}\n{table(HEADINGS, lines, texts=range(3))}")


if __name__ == "__main__":
    main()
