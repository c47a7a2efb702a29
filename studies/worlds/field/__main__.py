"""Command that writes the cases of the field world: `python -m studies.worlds.field --out DIR --strength 1.0`."""

import argparse
import json
from pathlib import Path

import yaml

from studies.worlds.field.cases import Case
from studies.worlds.field.draws import draw_world
from studies.worlds.field.logs import write_log
from studies.worlds.field.simulation import simulate
from studies.worlds.field.truth import truth_document
from studies.worlds.field.vehicles import vehicle_document

BATCH_FLIGHTS = 60


def _batches(cases: list[Case]) -> list[list[Case]]:
    """Split cases into batches of about `BATCH_FLIGHTS` flights, which bounds the memory of the records."""
    batches: list[list[Case]] = [[]]
    for case in cases:
        if sum(len(other.flights) for other in batches[-1]) + len(case.flights) > BATCH_FLIGHTS:
            batches.append([])
        batches[-1].append(case)
    return batches


def write_world(cases: list[Case], out: Path) -> None:
    """Fly all cases and write a folder for each."""
    for batch in _batches(cases):
        tracks = simulate([case for case in batch for _ in case.flights], [f for case in batch for f in case.flights])
        for case in batch:
            own, tracks = tracks[: len(case.flights)], tracks[len(case.flights) :]
            folder = out / case.name
            folder.mkdir(parents=True, exist_ok=True)
            document = vehicle_document(case.vehicle, case.beliefs, case.states_motor_time, case.ceiling_m)
            (folder / "vehicle.yaml").write_text(yaml.safe_dump(document, sort_keys=False))
            for number, (flight, track) in enumerate(zip(case.flights, own, strict=True)):
                write_log(folder / f"flight{number + 1}.csv", case, flight, track)
            (folder / "truth.json").write_text(json.dumps(truth_document(case, own), indent=1) + "\n")


def main() -> None:
    """Read the arguments and write the world."""
    parser = argparse.ArgumentParser(prog="python -m studies.worlds.field", description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="folder for the cases")
    parser.add_argument("--strength", type=float, default=1.0, help="size of the effects: 1.0 as typical in the field")
    parser.add_argument("--seed", type=int, default=1, help="seed of all draws")
    parser.add_argument("--only", help="write only cases whose name contains this")
    arguments = parser.parse_args()
    write_world(draw_world(arguments.strength, arguments.seed, arguments.only), arguments.out)


if __name__ == "__main__":
    main()
