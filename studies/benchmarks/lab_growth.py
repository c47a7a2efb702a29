"""Growth of time and memory of the lab with the rows of the logs: `python -m studies.benchmarks.lab_growth [--rows N]`.

Flights of 50 000 rows at 50 Hz are made by a model, prepared and diagnosed, each number of rows in a process of its own
for the sake of its peak memory. What counts is the time per row beside that of the smallest run: 1.0 where the time is
linear. Up to a million rows by default; `--rows 50000 --rows 10000000` takes a quarter of an hour and some 5 GB.
"""

import argparse
import json
import resource
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from rich.console import Console

from quadctl.effects import Conditions, Effect
from quadctl.effects.ground_effect import Exponential
from quadctl.effects.inflow import AxialInflow
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.frames import GRAVITY_M_S2
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.selection.diagnosis import diagnose
from quadctl.logs.columns import STATE_COLUMNS, rpm_columns
from quadctl.logs.csv_log import write_csv
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.read import read_log
from quadctl.model import Model
from quadctl.vehicle import Vehicle, load_vehicle
from studies.page import ROOT

ROWS_PER_FLIGHT = 50_000
RATE_HZ = 50.0
SIZES = (50_000, 1_000_000)
ONE_LOG = (50_000, 1_000_000)
CANDIDATES = (ConstantScale, Exponential, LinearDrag, AxialInflow)
RAPTOR = ROOT / "config/vehicles/raptor.yaml"
Row = tuple[str, str, str]


def rows(sizes: Sequence[int] = SIZES) -> Iterator[Row]:
    """Growth for many logs, searched for a few effects."""
    first = None
    for size in sizes:
        measured = _in_a_process("--only", str(size))
        prepared_s, diagnosed_s = measured["prepared_s"], measured["diagnosed_s"]
        per_row = (prepared_s + diagnosed_s) / size
        first = first or per_row
        yield (
            f"{size} rows prepared and diagnosed, {len(CANDIDATES)} candidates",
            f"{prepared_s:.1f} + {diagnosed_s:.1f} s, largest memory {measured['peak_mb']:.0f} MB",
            f"{per_row / first:.2f} x the time per row of {sizes[0]} rows",
        )


def rows_of_one_log(sizes: Sequence[int] = ONE_LOG) -> Iterator[Row]:
    """Growth for a single log in a file, read, prepared and searched for every effect of the catalogue."""
    first = None
    for size in sizes:
        with TemporaryDirectory() as folder:
            path = Path(folder) / "made.csv"
            write_csv(made_up(load_vehicle(RAPTOR), 0, size), path)
            measured = _in_a_process("--file", str(path))
        total_s = measured["given_s"] + measured["prepared_s"] + measured["diagnosed_s"]
        first = first or total_s
        yield (
            f"one log of {size} rows read, prepared and diagnosed, every effect",
            f"{measured['given_s']:.1f} + {measured['prepared_s']:.1f} + {measured['diagnosed_s']:.1f} s, "
            f"largest memory {measured['peak_mb']:.0f} MB",
            f"{total_s / first:.2f} x the time of {sizes[0]} rows",
        )


def _in_a_process(*arguments: str) -> dict[str, float]:
    """Measurement of this module in a process of its own."""
    run = subprocess.run([sys.executable, __file__, *arguments], check=True, capture_output=True, text=True)
    measured: dict[str, float] = json.loads(run.stdout)
    return measured


def measure(logs: Iterator[FlightLog], candidates: Sequence[type[Effect]] | None = None) -> dict[str, float]:
    """Time and memory of this process for the logs; `given_s` is the time to read them, or to make them up."""
    vehicle = load_vehicle(RAPTOR)
    given_s = 0.0

    def timed() -> Iterator[FlightLog]:
        nonlocal given_s
        begin = time.process_time()
        for log in logs:
            given_s += time.process_time() - begin
            yield log
            begin = time.process_time()

    begin = time.process_time()
    data = load_dataset(timed(), vehicle)
    prepared = time.process_time()
    missing = diagnose(Model(vehicle), data, candidates).missing
    diagnosed = time.process_time()
    assert missing == ["ground_effect"], missing
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    times = {"given_s": given_s, "prepared_s": prepared - begin - given_s, "diagnosed_s": diagnosed - prepared}
    return times | {"peak_mb": peak_mb}


def made_up(vehicle: Vehicle, seed: int, count: int = ROWS_PER_FLIGHT) -> FlightLog:
    """A level flight over the heights, whose rotor speeds obey a ground effect; white noise on the velocity."""
    random = np.random.default_rng(seed)
    t = np.arange(count) / RATE_HZ
    columns = {name: 1e-6 * random.standard_normal(len(t)) for name in STATE_COLUMNS}
    w, swell = 2.0 * np.pi * 0.25, 2.0 * np.pi * 0.02
    z = 0.6 + 0.45 * np.sin(swell * t) ** 2 * np.sin(w * t)
    vz = np.gradient(z, t)
    force = vehicle.mass_kg * (np.gradient(vz, t) + GRAVITY_M_S2)
    level = (np.ones_like(t), 0.0 * t, 0.0 * t, 0.0 * t)
    c = Conditions(z + vehicle.rotor_height_m, (0.0 * t, 0.0 * t, -vz), level, t)
    each = force / Exponential(a=0.3, b=5.0).ratio(c, vehicle) / vehicle.n_rotors
    columns |= {"time_s": t, "z_m": z, "vz_m_s": vz + 0.01 * random.standard_normal(len(t))}
    columns |= {name: 0.01 * random.standard_normal(len(t)) for name in ("vx_m_s", "vy_m_s")}
    columns |= dict.fromkeys(rpm_columns(vehicle.n_rotors), np.sqrt(each / vehicle.rotor.thrust_n_per_rpm2))
    return FlightLog(name=f"made_{seed}.csv", path=None, columns=columns)


def main() -> None:
    parser = argparse.ArgumentParser(description="How time and memory of the lab grow with the rows of the logs.")
    parser.add_argument("--rows", type=int, action="append", help="may be repeated; the first is compared with")
    parser.add_argument("--only", type=int, help=argparse.SUPPRESS)  # what the processes are started with
    parser.add_argument("--file", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.file:
        print(json.dumps(measure(map(read_log, [given.file]))))
        return
    if given.only:
        vehicle, seeds = load_vehicle(RAPTOR), range(max(1, given.only // ROWS_PER_FLIGHT))
        print(json.dumps(measure((made_up(vehicle, seed) for seed in seeds), CANDIDATES)))
        return
    for line in (*rows(given.rows or SIZES), *rows_of_one_log(given.rows or ONE_LOG)):
        Console(width=150).print(*line, sep=" | ", markup=False, highlight=False)


if __name__ == "__main__":
    main()
