"""Flies, diagnoses and judges all, and writes the page: `python -m studies.worlds.traps --page docs/traps.md`."""

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from quadctl.logs.csv_log import write_csv
from studies.page import table as page_table
from studies.page import write_page
from studies.worlds.traps.flights import CONTROLS, TRAPS
from studies.worlds.traps.judgement import Outcome, Trap, judge, said
from studies.worlds.traps.second import SECOND
from studies.worlds.traps.simulation import VEHICLES


def diagnosed(trap: Trap, folder: Path) -> dict[str, Any]:
    """Answer of `quadctl diagnose --json` to the flights of a trap, which are written to `folder`; where it refuses
    them, the verdict `refused` and its sentence."""
    answer, logs = folder / f"{trap.name}.json", []
    for flight in trap.generate():
        logs.append(str(folder / flight.name))
        write_csv(flight, folder / flight.name)
    command = [sys.executable, "-m", "quadctl", "diagnose", str(VEHICLES / f"{trap.vehicle}.yaml"), *logs]
    run = subprocess.run([*command, "--json", str(answer)], check=False, capture_output=True, text=True)
    if run.returncode:
        return {"verdict": "refused", "sentence": run.stderr.strip()}
    result: dict[str, Any] = json.loads(answer.read_text(encoding="utf-8"))
    return result


def table(answers: Sequence[tuple[Trap, Mapping[str, Any]]]) -> str:
    """Rows of the page."""
    rows = []
    for trap, result in answers:
        outcome = judge(trap.honest, result)
        rows.append((f"**{trap.name}** ({trap.vehicle}): {trap.text}", trap.honest.words, said(result), outcome))
    return page_table(["trap", "honest answer", "what it said", "fooled"], rows, range(4))


INTRODUCTION = """# Traps

Written by `python -m studies.worlds.traps --page docs/traps.md`. Ten flights that are meant to make `quadctl
diagnose` say something false with confidence: name an effect that is not there, give a 95 % interval that leaves out
the truth, or call a clean vehicle faulty. They were written by somebody who had not read the lab, in a simulation of
their own ([studies/worlds/traps](../studies/worlds/traps/simulation.py)), and so were the honest answers, before the
lab had seen a flight. A pair that these data do not distinguish is honest where one of the two is true. *Missed* is an
answer that says nothing false and overlooks the effect. An effect that is there but too small to be called missing is
shown and not judged.
"""


SECOND_INTRODUCTION = """Written later, of other kinds, by somebody else who had not read the lab; the honest answers
were committed before the lab had seen one of the flights. Two traps are two flights of one vehicle.
"""


def section(title: str, traps: Sequence[tuple[Trap, Mapping[str, Any]]], introduction: str = "") -> str:
    """Heading, count and table of ten traps."""
    outcomes = [judge(trap.honest, result) for trap, result in traps]
    counts = f"Fooled by **{outcomes.count(Outcome.FOOLED)} of {len(outcomes)}**"
    counts += f"; {outcomes.count(Outcome.MISSED)} missed.\n"
    before = f"{introduction}\n" if introduction else ""
    return f"## {title}\n\n{before}{counts}\n{table(traps)}\n"


def page(
    controls: Sequence[tuple[Trap, Mapping[str, Any]]],
    traps: Sequence[tuple[Trap, Mapping[str, Any]]],
    second: Sequence[tuple[Trap, Mapping[str, Any]]],
) -> str:
    """Markdown of the study, without its notes."""
    shown = f"{section('The ten', traps)}\n{section('The second ten', second, SECOND_INTRODUCTION)}"
    return f"{INTRODUCTION}\n{shown}\n## Controls\n\nPlain flights, to check the simulation.\n\n{table(controls)}\n"


def main() -> None:
    """Fly, diagnose and judge all, and write the page; with `--only`, print the answers alone."""
    parser = argparse.ArgumentParser(prog="python -m studies.worlds.traps", description=__doc__)
    parser.add_argument("--page", type=Path, help="page to write")
    parser.add_argument(
        "--only", choices=[trap.name for trap in (*CONTROLS, *TRAPS, *SECOND)], nargs="+", help="some of them"
    )
    arguments = parser.parse_args()
    groups: list[list[tuple[Trap, Mapping[str, Any]]]] = []
    with tempfile.TemporaryDirectory() as folder:
        for group in (CONTROLS, TRAPS, SECOND):
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
