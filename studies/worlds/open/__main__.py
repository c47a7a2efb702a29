"""Command that simulates the cases of the world and writes one folder for each."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from studies.worlds.open.cases import Case
from studies.worlds.open.draw import draw
from studies.worlds.open.files import write_case
from studies.worlds.open.mixtures import CLEAN, PAIRS
from studies.worlds.open.simulate import simulate
from studies.worlds.open.singles import SINGLE
from studies.worlds.open.verdicts import flaw

ATTEMPTS = 5


def generate(cases: Sequence[Case], out: Path, strength: float, seed: int) -> list[str]:
    """Write all cases, each drawn anew while it is no good; returns the names of those that were dropped."""
    waiting = list(cases)
    for attempt in range(ATTEMPTS):
        drawn = [draw(case, strength, seed, attempt) for case in waiting]
        records = iter(simulate([flight for d in drawn for flight in d.flights]))
        waiting = []
        for d in drawn:
            mine = [next(records) for _ in d.flights]
            reason = flaw(d, mine)
            if reason is None:
                size = write_case(out / d.case.name, d, mine)
                print(f"{d.case.name}: {' + '.join(d.case.effects) or 'nothing'}, {size:.2f} m/s^2")
            else:
                print(f"{d.case.name}: drawn anew, {reason}", file=sys.stderr)
                waiting.append(d.case)
        if not waiting:
            break
    return [case.name for case in waiting]


def main() -> None:
    """Read the arguments and generate."""
    parser = argparse.ArgumentParser(prog="python -m studies.worlds.open", description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="folder to write")
    parser.add_argument("--strength", type=float, default=1.0, help="factor on the sizes of all effects")
    parser.add_argument("--seed", type=int, default=1, help="seed of all random numbers")
    parser.add_argument("--only", help="only the cases whose name begins so")
    arguments = parser.parse_args()
    cases = [case for case in SINGLE + PAIRS + CLEAN if case.name.startswith(arguments.only or "")]
    if not cases:
        parser.error(f"no case begins with {arguments.only}")
    for name in generate(cases, arguments.out, arguments.strength, arguments.seed):
        print(f"{name}: dropped", file=sys.stderr)


if __name__ == "__main__":
    main()
