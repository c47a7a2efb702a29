"""The nano-drone benchmark of IDSIA (arXiv 2512.14450), where its files are: `python -m studies.nanobench.nanodrone
FOLDER`, with the folders `train` and `test` of its repository's `data`.

Its metric: the mean Euclidean error of position, velocity and rates, and the mean angle of the rotation's error, 1, 10
and 50 steps of 0.01 s after each sample; trained on square, random and chirp, judged on melon. Windows begin two
seconds into a flight, as the observer needs a past, and none crosses from one flight to the next.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

from quadctl.logs.table import read_by_map
from quadctl.vehicle import Vehicle, load_vehicle
from studies.page import ROOT, table

from .rollouts import Flight, Judged, flight_of, judged
from .tables import QUANTITIES, horizons_table, times_table

VEHICLE = ROOT / "config" / "vehicles" / "crazyflie21_brushless.yaml"
MAP = ROOT / "config" / "maps" / "nanodrone.yaml"
HORIZONS_S = (0.01, 0.1, 0.5)
PUBLISHED = {
    0.01: {
        "naive: the state stays": (0.0143, 0.0329, 0.0071, 0.0796),
        "physics": (0.0013, 0.0080, 0.0011, 0.0796),
        "MLP": (0.0032, 0.0116, 0.0022, 0.1138),
        "hybrid": (0.0016, 0.0092, 0.0027, 0.0912),
        "LSTM": (0.0079, 0.0247, 0.0066, 0.1021),
    },
    0.1: {
        "naive: the state stays": (0.1430, 0.3182, 0.0692, 0.3596),
        "physics": (0.0126, 0.0570, 0.0205, 0.3596),
        "MLP": (0.0305, 0.0890, 0.0331, 0.5949),
        "hybrid": (0.0166, 0.0613, 0.0376, 0.4880),
        "LSTM": (0.0390, 0.1175, 0.0372, 0.4292),
    },
    0.5: {
        "naive: the state stays": (0.6797, 1.4749, 0.3041, 0.8837),
        "physics": (0.1269, 0.5781, 0.2544, 0.8837),
        "MLP": (0.1712, 0.5720, 0.2268, 0.9005),
        "hybrid": (0.1119, 0.5556, 0.2306, 0.5979),
        "LSTM": (0.2572, 0.7407, 0.2325, 1.2407),
    },
}
"""Errors in `QUANTITIES` by horizon and model: results/model_comparison.ipynb of the benchmark's repository, of
2026-02-16."""


def main() -> None:
    parser = argparse.ArgumentParser(description="Roll out the flights of IDSIA's nano-drone benchmark.")
    parser.add_argument("folder", type=Path, help="the repository's `data`: train/*.csv and test/*.csv")
    folder = parser.parse_args().folder
    print(report(folder))


def report(folder: Path) -> str:
    """Tables of our models and of those that the benchmark publishes.

    Raises
    ------
    QuadctlError
        As `read_by_map` and `flight_of`.
    """
    vehicle = load_vehicle(VEHICLE)
    train, test = (flights_of(sorted((folder / part).glob("*.csv")), vehicle) for part in ("train", "test"))
    found = judged(train, test, vehicle, HORIZONS_S, every=1)
    heading = f"{len(train)} flights to train, {len(test)} to test"
    return "\n\n".join([heading, tables(found), "Published", published(), times_table(found)])


def flights_of(paths: Sequence[Path], vehicle: Vehicle) -> list[Flight]:
    """Whole flights: the benchmark's files hold no time on the ground."""
    logs = [read_by_map(path, MAP) for path in paths]
    return [
        flight_of(log, log.name.split("_")[0], vehicle, (float(log.time_s[0]), float(log.time_s[-1]))) for log in logs
    ]


def tables(found: dict[str, Judged]) -> str:
    return horizons_table(found, HORIZONS_S, range(len(HORIZONS_S)))


def published() -> str:
    rows = [
        [f"{after_s:g}", name, *(f"{value:.3g}" for value in values)]
        for after_s, of in PUBLISHED.items()
        for name, values in of.items()
    ]
    return table(["after s", "model", *QUANTITIES], rows, texts=(1,))


if __name__ == "__main__":
    main()
