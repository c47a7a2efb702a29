"""False alarms and power of `quadctl verify`, on simulated flights of a vehicle that changes or does not.

`python -m studies.verification --flights 1000` writes the table of docs/verify.md. Each flight has a thrust trim and a
tilt of its own, as real flights do. The model and the outcome of each flight are kept in a folder: a run that was
stopped goes on where it was, and a run with more flights adds those that are missing. Delete the folder after a change
of the code.
"""

import argparse
import json
import os
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml
from scipy.stats import binomtest

from quadctl.flight.preflight.preparation import prepare_flight
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.selection.discovery import discover
from quadctl.lab.verification import FALSE_ALARMS, FlightCheck, verify
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.read import read_log
from quadctl.model import Model, load_model, save_model
from quadctl.sitl.run import simulate
from studies.page import DOCS, ROOT, write_part

PAGE = DOCS / "verify.md"
BEGIN, END = "<!-- measured: written by `python -m studies.verification` -->", "<!-- end of measured -->"
TRIM_THRUST, TRIM_TILT_DEG = 0.004, 0.3
"""Standard deviations of what flights of one vehicle differ by."""
FITTED_ON = ("hover_staircase", "excitation", "forward_runs")

Effects = dict[str, dict[str, float]]


@dataclass(frozen=True, eq=False)
class Case:
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


class Job(NamedTuple):
    """One new flight."""

    case: Case
    seed: int


class Outcome(NamedTuple):
    """Verdict on one new flight."""

    case: str
    seed: int
    reasons: tuple[str, ...]
    """Parameters that are called changed, and effects that are called missing; empty where the model holds."""


def reasons_of(check: FlightCheck) -> tuple[str, ...]:
    """Each reason once."""
    changed = {f"{c.parameter} of {c.effect}" for c in check.changes}
    return tuple(sorted(changed | {f"{family} missing" for family in check.missing}))


def fly_and_check(model: Model, job: Job) -> Outcome:
    """Verify the model on one new flight."""
    with tempfile.TemporaryDirectory() as folder:
        log = fly(job.case.mission, job.case, job.seed, Path(folder))
        (check,) = verify(model, [load_dataset([log], model.vehicle)]).checks
    return Outcome(job.case.name, job.seed, reasons_of(check))


def outcomes(
    jobs: Sequence[Job], kept: Path, run: Callable[[Sequence[Job]], Iterable[Outcome]]
) -> dict[tuple[str, int], Outcome]:
    """Outcomes of all `jobs`, by case and seed: those in the file `kept` are not run again, the others are added to it.

    `run` gives the outcomes of jobs, one after the other; each is written before the next is awaited.
    """
    known = {(each.case, each.seed): each for each in _kept(kept)}
    missing = [job for job in jobs if (job.case.name, job.seed) not in known]
    with kept.open("a", encoding="utf-8") as file:
        for outcome in run(missing):
            file.write(json.dumps(outcome._asdict()) + "\n")
            file.flush()
            known[outcome.case, outcome.seed] = outcome
    return {(job.case.name, job.seed): known[job.case.name, job.seed] for job in jobs}


def _kept(path: Path) -> Iterator[Outcome]:
    """Outcomes in a file; a line that was cut short by the end of a run is cut off."""
    if not path.is_file():
        return
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    whole = [line for line in lines if line.endswith("}\n")]
    if len(whole) < len(lines):
        path.write_text("".join(whole), encoding="utf-8")
    for line in whole:
        found = json.loads(line)
        yield Outcome(found["case"], found["seed"], tuple(found["reasons"]))


def row(case: Case, found: Sequence[Outcome]) -> str:
    """One row of the table: flights on which the model does not hold, and why."""
    alarms = [outcome for outcome in found if outcome.reasons]
    counts: dict[str, int] = {}
    for outcome in alarms:
        for reason in outcome.reasons:
            counts[reason] = counts.get(reason, 0) + 1
    why = ", ".join(f"{reason}: {n}" for reason, n in sorted(counts.items(), key=lambda item: -item[1]))
    return f"| {case.name} | {len(alarms)} of {len(found)} | {share(len(alarms), len(found))} | {why or '-'} |"


def share(alarms: int, flights: int) -> str:
    """Share in percent, with its exact 95 % interval (Clopper & Pearson 1934)."""
    interval = binomtest(alarms, flights).proportion_ci(0.95)
    return f"{100 * alarms / flights:.3g} % [{100 * interval.low:.2g}, {100 * interval.high:.3g}]"


def section(found: Mapping[Case, Sequence[Outcome]]) -> str:
    """Text between the marks of the page."""
    heading = ["| change since the fit | does not hold | share, 95 % interval | because of |", "|---|---:|---:|---|"]
    flights = len(found[UNCHANGED])
    alarms = sum(bool(outcome.reasons) for outcome in found[UNCHANGED])
    nominal = f"nominal are {100 * FALSE_ALARMS:g} % at most"
    rate = f"{alarms} false alarms in {flights} flights are {share(alarms, flights)}; {nominal}."
    return "\n".join([*heading, *(row(case, each) for case, each in found.items()), "", rate])


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m studies.verification", description=__doc__)
    parser.add_argument("--flights", type=int, default=1000, help="flights without a change")
    parser.add_argument("--changed", type=int, default=40, help="flights with each change")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--folder", type=Path, default=Path("out/verification"), help="keeps the outcomes")
    parser.add_argument("--page", type=Path, default=PAGE)
    arguments = parser.parse_args()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # for the processes: two of them have two cores
    arguments.folder.mkdir(parents=True, exist_ok=True)
    path = arguments.folder / "model.yaml"
    with ProcessPoolExecutor(arguments.jobs, get_context("spawn")) as pool:
        if not path.is_file():
            save_model(pool.submit(fitted, arguments.folder / "fitted_on").result(), path)
        model = load_model(path)
        print("Fitted:", ", ".join(effect.name for effect in model.effects), flush=True)

        def run(jobs: Sequence[Job]) -> Iterator[Outcome]:
            return pool.map(partial(fly_and_check, model), jobs)

        found: dict[Case, list[Outcome]] = {}
        for i, case in enumerate((UNCHANGED, *CASES)):
            n = arguments.flights if case is UNCHANGED else arguments.changed
            jobs = [Job(case, 1000 * (i + 1) + seed) for seed in range(n)]
            found[case] = list(outcomes(jobs, arguments.folder / "outcomes.jsonl", run).values())
            print(row(case, found[case]), flush=True)
    write_part(arguments.page, BEGIN, END, section(found))


if __name__ == "__main__":
    main()
