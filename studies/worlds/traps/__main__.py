"""Flies, diagnoses and judges all, and writes the page: `python -m studies.worlds.traps --page docs/traps.md`."""

import argparse
import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from quadctl.logs.csv_log import write_csv
from studies.page import table as page_table
from studies.page import write_page
from studies.worlds.traps.flights import CONTROLS, TRAPS
from studies.worlds.traps.judgement import Outcome, Trap, intervals, judge, said
from studies.worlds.traps.second import SECOND
from studies.worlds.traps.simulation import VEHICLES
from studies.worlds.traps.third import THIRD


def model_file(trap: Trap, folder: Path) -> Path:
    """Model file of a trap; one of the user's own is written to `folder`."""
    if isinstance(trap.vehicle, str):
        return VEHICLES / f"{trap.vehicle}.yaml"
    path = folder / f"{trap.name}.yaml"
    path.write_text(yaml.safe_dump(dict(trap.vehicle)), encoding="utf-8")
    return path


def diagnosed(trap: Trap, folder: Path) -> dict[str, Any]:
    """Answer of `quadctl diagnose --json` to the flights of a trap, which are written to `folder`; where it refuses
    them, the verdict `refused` and its sentence."""
    answer, logs = folder / f"{trap.name}.json", []
    for flight in trap.generate():
        logs.append(str(folder / flight.name))
        write_csv(flight, folder / flight.name)
    command = [sys.executable, "-m", "quadctl", "diagnose", str(model_file(trap, folder)), *logs]
    run = subprocess.run([*command, "--json", str(answer)], check=False, capture_output=True, text=True)
    if run.returncode:
        return {"verdict": "refused", "sentence": run.stderr.strip(), "missing": [], "ladder": [], "ranking": []}
    result: dict[str, Any] = json.loads(answer.read_text(encoding="utf-8"))
    return result


def table(answers: Sequence[tuple[Trap, Mapping[str, Any]]]) -> str:
    """Rows of the page."""
    rows: list[tuple[str, ...]] = []
    for trap, result in answers:
        cells = (
            f"**{trap.name}**: {in_short(trap)}",
            trap.honest.words.removesuffix(", or unexplained"),
            briefly(trap, result),
            judge(trap.honest, result),
        )
        rows.append(cells)
    return page_table(["trap", "honest answer", "what it said", "fooled"], rows, range(4))


def in_short(trap: Trap) -> str:
    """First clause of the description of a trap."""
    return re.split(r"[.,;:] ", trap.text)[0].removesuffix(".")


def briefly(trap: Trap, result: Mapping[str, Any]) -> str:
    """Verdict or families, and the intervals by which the answer is judged."""
    judged = {*trap.honest.intervals, *trap.honest.either}
    parts = [" + ".join(result["missing"]) or str(result["verdict"])]
    parts += [
        f"{name} " + (f"{low:.3g}" if low == high else f"[{low:.3g}, {high:.3g}]")
        for effect, name, (low, high) in intervals(result)
        if f"{effect} {name}" in judged
    ]
    return ", ".join(parts)


INTRODUCTION = """# Traps

Written by `python -m studies.worlds.traps --page docs/traps.md`. Flights that are meant to make `quadctl diagnose` say
something false with confidence: name an effect that is not there, give a 95 % interval without the truth, or call a
clean vehicle faulty. Three authors who had not read the lab wrote ten each, in
[simulations](../studies/worlds/traps/simulation.py) [of their own](../studies/worlds/traps/third.py), with the honest
answers, before the lab had seen a flight. `unexplained` is always honest, and so is a confounded pair where one of the
two is true.
"""


def section(title: str, traps: Sequence[tuple[Trap, Mapping[str, Any]]]) -> str:
    """Heading, count and table of a group of flights."""
    outcomes = [judge(trap.honest, result) for trap, result in traps]
    counts = (
        f"Fooled by **{outcomes.count(Outcome.FOOLED)} of {len(outcomes)}**; {outcomes.count(Outcome.MISSED)} missed."
    )
    return f"## {title}\n\n{counts}\n\n{table(traps)}\n"


def page(
    controls: Sequence[tuple[Trap, Mapping[str, Any]]],
    traps: Sequence[tuple[Trap, Mapping[str, Any]]],
    second: Sequence[tuple[Trap, Mapping[str, Any]]],
    third: Sequence[tuple[Trap, Mapping[str, Any]]],
) -> str:
    """Markdown of the study, without its notes."""
    groups = (("The ten", traps), ("The second ten", second), ("The third ten", third))
    fooled = sum(judge(trap.honest, result) is Outcome.FOOLED for trap, result in controls)
    plain = f"Of {len(controls)} plain flights, which check the simulation, {fooled} fooled it.\n"
    return "\n".join([INTRODUCTION, *(section(title, group) for title, group in groups), plain])


def main() -> None:
    """Fly, diagnose and judge all, and write the page; with `--only`, print the answers alone."""
    parser = argparse.ArgumentParser(prog="python -m studies.worlds.traps", description=__doc__)
    parser.add_argument("--page", type=Path, help="page to write")
    parser.add_argument(
        "--only", choices=[trap.name for trap in (*CONTROLS, *TRAPS, *SECOND, *THIRD)], nargs="+", help="some of them"
    )
    arguments = parser.parse_args()
    groups: list[list[tuple[Trap, Mapping[str, Any]]]] = []
    with tempfile.TemporaryDirectory() as folder:
        for group in (CONTROLS, TRAPS, SECOND, THIRD):
            groups.append([])
            for trap in group:
                if arguments.only and trap.name not in arguments.only:
                    continue
                result = diagnosed(trap, Path(folder))
                groups[-1].append((trap, result))
                print(f"{trap.name}: {said(result)}: fooled: {judge(trap.honest, result)}", flush=True)
    if arguments.page and not arguments.only:
        write_page(arguments.page, page(*groups))


if __name__ == "__main__":
    main()
