"""Command: `python -m studies.worlds.blade --out DIR --strength 1.0 --seed 1 [--only NAME]`."""

import argparse
import time
from pathlib import Path

from studies.worlds.blade.cases import RECIPES
from studies.worlds.blade.world import write_world


def main() -> None:
    """Fly the cases and write their folders."""
    parser = argparse.ArgumentParser(prog="python -m studies.worlds.blade", description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="folder for the cases")
    parser.add_argument("--strength", type=float, default=1.0, help="factor of the sizes of all effects")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", action="append", choices=sorted(RECIPES), help="one case; may be given again")
    arguments = parser.parse_args()
    start = time.perf_counter()
    cases = write_world(arguments.out, arguments.only or list(RECIPES), arguments.seed, arguments.strength)
    flights = sum(len(case.flights) for case in cases)
    print(f"{len(cases)} cases, {flights} flights in {time.perf_counter() - start:.0f} s")


if __name__ == "__main__":
    main()
