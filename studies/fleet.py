"""A simulated fleet in which one vehicle's rotor wears, and one vehicle gets a drag: are these found, and no others?

`python -m studies.fleet FOLDER` flies it (`--vehicles` times `--flights` flights), measures it with `quadctl fleet`,
and prints what was found and how long it took. Flights that are there are not flown again. Each flight of each vehicle
has a thrust trim and a tilt of its own, and each vehicle its own thrust per weight.
"""

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml

from quadctl.flight.preflight.preparation import prepare_flight
from quadctl.sitl.run import simulate
from studies.page import ROOT

MODEL = ROOT / "config/vehicles/raptor.yaml"
MISSION = ROOT / "missions/excitation.yaml"
VEHICLE_STD, TRIM_STD, TRIM_DEG = 0.02, 0.004, 0.3
"""Standard deviations: thrust per weight between vehicles, and between flights of one; tilt between flights."""
WORN, WORN_ROTOR, LOSS_PER_FLIGHT = 7, 2, 0.001
"""The vehicle of which a rotor loses 1 % of its thrust in ten flights."""
LOADED, DRAG, LOADED_DRAG = 12, 0.3, 0.36
"""The vehicle that gets 20 % more drag halfway, as by a payload bay."""


class Job(NamedTuple):
    """One flight of the fleet."""

    vehicle: int
    flight: int
    flights: int
    folder: Path


def hidden(job: Job) -> dict[str, Any]:
    """The world of one flight, as `quadctl simulate --hidden` reads it."""
    of_vehicle = np.random.default_rng((1, job.vehicle))
    of_flight = np.random.default_rng((2, job.vehicle, job.flight))
    factor = 1.0 + VEHICLE_STD * of_vehicle.standard_normal() + TRIM_STD * of_flight.standard_normal()
    roll, pitch = TRIM_DEG * of_flight.standard_normal(2)
    drag = LOADED_DRAG if job.vehicle == LOADED and job.flight >= job.flights // 2 else DRAG
    effects: list[tuple[str, dict[str, float]]] = [
        ("thrust_scale.constant", {"factor": float(factor)}),
        ("rotor_drag.linear", {"d_x": drag, "d_y": drag, "d_z": 0.2}),
        ("thrust_tilt.fixed", {"roll_deg": float(roll), "pitch_deg": float(pitch)}),
    ]
    if job.vehicle == WORN and job.flight:
        effects.append(("rotor_fault.weak", {"rotor": float(WORN_ROTOR), "loss": LOSS_PER_FLIGHT * job.flight}))
    return {"effects": [{"effect": name, "parameters": parameters} for name, parameters in effects]}


def fly(job: Job) -> Path:
    """Fly one flight of two minutes, unless it is there."""
    folder = job.folder / f"vehicle_{job.vehicle:02d}" / f"flight_{job.flight:03d}"
    done = sorted(folder.glob("*.csv"))
    if done:
        return done[0]
    folder.mkdir(parents=True, exist_ok=True)
    world = folder / "hidden.yaml"
    world.write_text(yaml.safe_dump(hidden(job)))
    plan = prepare_flight(MISSION, ROOT / "config/flight.yaml", "none", None)
    return Path(simulate(plan, folder, world, 1000 * job.vehicle + job.flight).log)


def jobs_of(vehicles: int, flights: int, folder: Path) -> Iterator[Job]:
    for vehicle in range(1, vehicles + 1):
        for flight in range(flights):
            yield Job(vehicle, flight, flights, folder)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m studies.fleet", description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--vehicles", type=int, default=50)
    parser.add_argument("--flights", type=int, default=20)
    parser.add_argument("--jobs", type=int, default=2)
    arguments = parser.parse_args()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # for the processes: two of them have two cores
    logs = arguments.folder / "logs"
    with ProcessPoolExecutor(arguments.jobs, get_context("spawn")) as pool:
        list(pool.map(fly, jobs_of(arguments.vehicles, arguments.flights, logs), chunksize=4))
    model = arguments.folder / "model.yaml"
    effects = [{"effect": "rotor_drag.linear", "parameters": {"d_x": DRAG, "d_y": DRAG, "d_z": 0.2}}]
    model.write_text(yaml.safe_dump({"vehicle": str(MODEL), "effects": effects}))
    began_s = time.monotonic()
    command = [sys.executable, "-m", "quadctl", "fleet", str(logs), "--model", str(model)]
    outputs = ["--html", str(arguments.folder / "fleet.html"), "--json", str(arguments.folder / "fleet.json")]
    subprocess.run([*command, *outputs, "--jobs", str(arguments.jobs)], check=True)
    print(f"{time.monotonic() - began_s:.0f} s for {arguments.vehicles * arguments.flights} flights")


if __name__ == "__main__":
    main()
