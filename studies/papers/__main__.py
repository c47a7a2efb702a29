"""python -m studies.papers: compute everything and write docs/papers.md with its figures."""

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np

from quadctl.errors import QuadctlError
from quadctl.lab.flights.preparation import prepare
from quadctl.logs.columns import rpm_columns
from quadctl.logs.flight_log import FlightLog
from studies.page import DOCS, wrapped
from studies.papers import (
    dena,
    dena_flight,
    four_vehicles,
    garofano,
    garofano_flight,
    thesis_ground_effect,
    thesis_sindy,
    thesis_steps,
    thesis_thrust,
)
from studies.papers.raptor import LOGS, log, raptor

INTRODUCTION = """# The papers, computed again

Written by `make papers`, with the code in `studies/papers/`, from the public flight logs of the thesis
(github.com/aurelappius/quad_logs) and from the simulator.

- Appius, *Modeling and Control of Quadcopters in Ground Effect using Physics Informed Machine Learning* (the thesis)
- Dena et al., ground effect of a quadrotor over several surfaces
- Garofano-Soldado et al., ground effect of hexarotors with tilted rotors
"""
PAGE = DOCS / "papers.md"
HOVER_ABOVE_M = 0.85


def hover_rpm(hovering: FlightLog) -> float:
    """Root mean square rotor speed of the hover log high above the ground, over updates."""
    names = rpm_columns(4)
    rows = hovering.updates(*names)
    rows = rows[hovering["z_m"][rows] > HOVER_ABOVE_M]
    return float(np.sqrt(np.mean([hovering[name][rows] ** 2 for name in names])))


def from_logs(folder: Path) -> list[str]:
    """The parts that need the public logs."""
    vehicle = raptor()
    logs = {name: log(name, folder) for name in thesis_ground_effect.PUBLISHED}
    hovering = logs["HOVERING"]
    return [
        thesis_thrust.section(vehicle, hover_rpm(hovering)),
        thesis_ground_effect.section(logs, vehicle),
        thesis_sindy.section(prepare(hovering, vehicle)),
        thesis_steps.section({name: log(name, folder) for name in thesis_steps.names()}),
    ]


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m studies.papers", description=__doc__)
    parser.add_argument("--logs", type=Path, default=LOGS, metavar="DIR", help="the thesis' public flight logs")
    folder = parser.parse_args().logs
    try:
        if not folder.is_dir():
            raise QuadctlError(f"{folder}: is not there, expected the folder of the thesis' flight logs (--logs DIR)")
        parts = [INTRODUCTION, *from_logs(folder), dena.section(raptor()), garofano.section()]
        with tempfile.TemporaryDirectory() as flights:
            parts.append(dena_flight.section(Path(flights) / "dena"))
            parts.append(garofano_flight.section(Path(flights) / "garofano"))
            parts.append(four_vehicles.section(Path(flights) / "vehicles"))
    except QuadctlError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    DOCS.mkdir(exist_ok=True)
    PAGE.write_text(wrapped("\n\n".join(parts)), encoding="utf-8")
    print(f"Written: {PAGE}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
