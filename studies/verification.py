"""False alarms and power of `quadctl verify`, on simulated flights of a vehicle that changes or does not.

`python -m studies.verification --flights 1000` writes the table of docs/verify.md to the terminal. Each flight has a
thrust trim and a tilt of its own, as real flights do.
"""

import argparse
import os
import tempfile
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml

from quadctl.flight.preflight.preparation import prepare_flight
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.selection.discovery import discover
from quadctl.lab.selection.verification import FlightCheck, verify
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.read import read_log
from quadctl.model import Model
from quadctl.sitl.run import simulate

ROOT = Path(__file__).parents[1]
TRIM_THRUST, TRIM_TILT_DEG = 0.004, 0.3
"""Standard deviations of what flights of one vehicle differ by."""
FITTED_ON = ("hover_staircase", "excitation", "forward_runs")

Effects = dict[str, dict[str, float]]


class Case(NamedTuple):
    """A change of the vehicle since the fit."""

    name: str
    change: Effects
    """Effects whose parameters differ from `BEFORE`, or that are new."""
    mission: str = "excitation"
    """Mission of the new flight."""


BEFORE: Effects = {
    "thrust_scale.constant": {"factor": 0.95},
    "ground_effect.exponential": {"a": 0.3, "b": 5.0},
    "rotor_drag.linear": {"d_x": 0.35, "d_y": 0.35, "d_z": 0.2},
}
UNCHANGED = Case("nothing", {})
CASES = (
    Case("nothing, hover staircase", {}, "hover_staircase"),
    Case("mass + 5 % (as thrust - 5 %)", {"thrust_scale.constant": {"factor": 0.95 / 1.05}}),
    Case("drag + 40 %", {"rotor_drag.linear": {"d_x": 0.49, "d_y": 0.49, "d_z": 0.28}}),
    Case("ground effect + 50 %", {"ground_effect.exponential": {"a": 0.45, "b": 5.0}}, "hover_staircase"),
    Case("rotor 1 gives 8 % less", {"rotor_fault.weak": {"rotor": 1.0, "loss": 0.08}}),
)


def fly(mission: str, case: Case, seed: int, folder: Path) -> FlightLog:
    """One flight, with a trim that its seed draws."""
    random = np.random.default_rng(10_000 + seed)
    effects: dict[str, dict[str, Any]] = {name: dict(values) for name, values in (BEFORE | case.change).items()}
    effects["thrust_scale.constant"]["factor"] *= 1.0 + TRIM_THRUST * random.standard_normal()
    roll, pitch = TRIM_TILT_DEG * random.standard_normal(2)
    effects["thrust_tilt.fixed"] = {"roll_deg": float(roll), "pitch_deg": float(pitch)}
    folder.mkdir(parents=True, exist_ok=True)
    hidden = folder / "hidden.yaml"
    stack = [{"effect": name, "parameters": {k: float(v) for k, v in p.items()}} for name, p in effects.items()]
    hidden.write_text(yaml.safe_dump({"effects": stack}))
    plan = prepare_flight(ROOT / "missions" / f"{mission}.yaml", ROOT / "config/flight.yaml", "none", None)
    return read_log(simulate(plan, folder, hidden, seed).log)


def fitted(folder: Path) -> Model:
    """The model that a user would have: what `discover` finds in three flights."""
    logs = [fly(mission, UNCHANGED, i, folder / mission) for i, mission in enumerate(FITTED_ON, start=1)]
    plan = prepare_flight(ROOT / "missions/short_hop.yaml", ROOT / "config/flight.yaml", "none", None)
    return discover(Model(plan.body.vehicle), load_dataset(logs, plan.body.vehicle)).model


def check(job: tuple[Model, Case, int]) -> FlightCheck:
    """Verify the model on one new flight."""
    model, case, seed = job
    with tempfile.TemporaryDirectory() as folder:
        log = fly(case.mission, case, seed, Path(folder))
        return verify(model, [load_dataset([log], model.vehicle)]).checks[0]


def row(name: str, checks: Sequence[FlightCheck]) -> str:
    """One row of the table: flights on which the model does not hold, and why."""
    alarms = [c for c in checks if not c.holds]
    parameters: dict[str, int] = {}
    for c in alarms:
        for what in {*(f"{x.parameter} of {x.effect}" for x in c.changes), *(f"{m} missing" for m in c.missing)}:
            parameters[what] = parameters.get(what, 0) + 1
    why = ", ".join(f"{what}: {n}" for what, n in sorted(parameters.items(), key=lambda item: -item[1]))
    return f"| {name} | {len(alarms)} of {len(checks)} | {why or '-'} |"


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m studies.verification", description=__doc__)
    parser.add_argument("--flights", type=int, default=1000, help="flights without a change")
    parser.add_argument("--changed", type=int, default=40, help="flights with each change")
    parser.add_argument("--jobs", type=int, default=2)
    arguments = parser.parse_args()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # for the processes: two of them have two cores
    with tempfile.TemporaryDirectory() as folder, ProcessPoolExecutor(arguments.jobs, get_context("spawn")) as pool:
        model = pool.submit(fitted, Path(folder)).result()
        print("Fitted:", ", ".join(effect.name for effect in model.effects), flush=True)
        for i, case in enumerate((UNCHANGED, *CASES)):
            n = arguments.flights if case is UNCHANGED else arguments.changed
            jobs = [(model, case, 1000 * (i + 1) + seed) for seed in range(n)]
            print(row(case.name, list(pool.map(check, jobs))), flush=True)


if __name__ == "__main__":
    main()
