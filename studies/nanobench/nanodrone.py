"""The nano-drone benchmark of IDSIA (arXiv 2512.14450), where its files are: `python -m studies.nanobench.nanodrone
FOLDER`, with the folders `train` and `test` of its repository's `data`.

Its metric: the mean Euclidean error of position, velocity and rates, and the mean angle of the rotation's error, 1, 10
and 50 steps of 0.01 s after each sample; trained on square, random and chirp, judged on melon. Windows begin two
seconds into a flight, as the observer needs a past, and none crosses from one flight to the next.
"""

import argparse
from pathlib import Path

from quadctl.errors import QuadctlError
from quadctl.logs.table import read_by_map
from quadctl.vehicle import Vehicle, load_vehicle
from studies.page import ROOT

from .rollouts import Flight, flight_of, judged
from .tables import QUANTITIES, horizons_table, means, times_table

VEHICLE = ROOT / "config" / "vehicles" / "crazyflie21_brushless.yaml"
MAP = ROOT / "config" / "maps" / "nanodrone.yaml"
HORIZONS_S = (0.01, 0.1, 0.5)
PUBLISHED = {
    "naive: the state stays": (
        (0.0143, 0.0329, 0.0071, 0.0796),
        (0.143, 0.3182, 0.0692, 0.3596),
        (0.6797, 1.4749, 0.3041, 0.8837),
    ),
    "physics": ((0.0013, 0.008, 0.0011, 0.0796), (0.0126, 0.057, 0.0205, 0.3596), (0.1269, 0.5781, 0.2544, 0.8837)),
    "MLP": ((0.0032, 0.0116, 0.0022, 0.1138), (0.0305, 0.089, 0.0331, 0.5949), (0.1712, 0.572, 0.2268, 0.9005)),
    "hybrid": ((0.0016, 0.0092, 0.0027, 0.0912), (0.0166, 0.0613, 0.0376, 0.488), (0.1119, 0.5556, 0.2306, 0.5979)),
    "LSTM": ((0.0079, 0.0247, 0.0066, 0.1021), (0.039, 0.1175, 0.0372, 0.4292), (0.2572, 0.7407, 0.2325, 1.2407)),
}
"""Errors in `QUANTITIES` of each model by horizon: results/model_comparison.ipynb of its repository, 2026-02-16."""


def main() -> None:
    parser = argparse.ArgumentParser(description="Roll out the flights of IDSIA's nano-drone benchmark.")
    parser.add_argument("folder", type=Path, help="the repository's `data`: train/*.csv and test/*.csv")
    folder = parser.parse_args().folder
    try:
        print(report(folder))
    except QuadctlError as error:
        parser.error(str(error))


def report(folder: Path) -> str:
    """Tables of our models, of those that the benchmark publishes, and of times.

    Raises
    ------
    QuadctlError
        A folder holds no flight; or as `read_by_map` and `flight_of`.
    """
    vehicle = load_vehicle(VEHICLE)
    train, test = (flights_of(folder / part, vehicle) for part in ("train", "test"))
    found = judged(train, test, vehicle, HORIZONS_S, every=1)
    heading = f"{len(train)} flights to train, {len(test)} to test"
    both = (horizons_table(of, HORIZONS_S) for of in (means(found), PUBLISHED))
    return "\n\n".join([heading, " / ".join(QUANTITIES), *both, times_table(found)])


def flights_of(folder: Path, vehicle: Vehicle) -> list[Flight]:
    """Whole flights: the benchmark's files hold no time on the ground."""
    logs = [read_by_map(path, MAP) for path in sorted(folder.glob("*.csv"))]
    if not logs:
        raise QuadctlError(f"{folder}: holds no flight, expected CSV files of the benchmark")
    return [
        flight_of(log, log.name.split("_")[0], vehicle, (float(log.time_s[0]), float(log.time_s[-1]))) for log in logs
    ]


if __name__ == "__main__":
    main()
