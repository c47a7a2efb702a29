"""Write docs/benchmarks-public.md: `python -m studies.nanobench FOLDER`, or `make nanobench`."""

import argparse
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from quadctl.errors import LogError, QuadctlError
from quadctl.lab.rotation.parameters import Rotation, fit_rotation
from quadctl.lab.rotation.rollout_errors import HORIZONS_S
from quadctl.lab.rotation.value import Value
from quadctl.lab.rotation.words import ROWS
from quadctl.logs.consistency import complaints
from quadctl.logs.record.copies import without_copies
from quadctl.logs.table import read_by_map
from quadctl.vehicle import Vehicle, load_vehicle
from studies.page import DOCS, ROOT, table, wrapped, write_page

from .rollouts import (
    CORRECTED,
    ESTIMATED,
    FORECAST,
    HELD,
    NETWORK,
    RIDGE,
    Flight,
    Judged,
    flight_of,
    judged,
    together,
)
from .tables import errors_table, horizons_table, means, times_table

PAGE = DOCS / "benchmarks-public.md"
FOLDS = 3
FAMILIES = (("B2", "B6", "B7"), ("B3", "B10"), ("B5", "B8"), ("B9",))
"""Shapes of trajectory that are left out together."""
TOLD_S = 0.5
TOLD = HORIZONS_S.index(TOLD_S)
TEST_EVERY = 5


def main() -> None:
    parser = argparse.ArgumentParser(description="Roll out the flights of NanoBench, and write the page.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--test", type=Path, help="judge the flights of this folder by fits to those of the first")
    parser.add_argument("--page", type=Path, default=PAGE)
    arguments = parser.parse_args()
    begin = time.process_time()
    try:
        vehicle = load_vehicle(arguments.folder / "crazyflie21.yaml")
        n_logs, flights = _flights(arguments.folder, vehicle)
        _, test = (0, []) if arguments.test is None else _flights(arguments.test, vehicle)
    except QuadctlError as error:
        parser.error(str(error))
    if arguments.test is not None:
        found = judged(flights, test, vehicle, HORIZONS_S, TEST_EVERY)
        print(errors_table(found, TOLD), times_table(found), sep="\n\n")
        return
    rotation = fit_rotation([f.flown.record for f in flights], vehicle)

    def errors(test_of: Callable[[int, Flight], int]) -> dict[str, Judged]:
        part_of, parts = [test_of(i, f) for i, f in enumerate(flights)], []
        for part in sorted(set(part_of)):
            test = [f for f, of in zip(flights, part_of, strict=True) if of == part]
            train = [f for f, of in zip(flights, part_of, strict=True) if of != part]
            parts.append(judged(train, test, vehicle, HORIZONS_S, TEST_EVERY))
            so_far = {name: np.round(m[TOLD], 3).tolist() for name, m in means(parts[-1]).items()}
            print(f"part {part + 1}: {so_far}", flush=True)
        return together(parts)

    repeated, unseen = errors(lambda i, _: i % FOLDS), errors(lambda _, f: _family(f.shape))
    text = _page(n_logs, len(flights), rotation, repeated, unseen, time.process_time() - begin)
    write_page(arguments.page, text)


def _flights(folder: Path, vehicle: Vehicle) -> tuple[int, list[Flight]]:
    """Number of logs in a folder, and the flights of those that are neither copies nor corrupt."""
    logs = [read_by_map(p, ROOT / "config" / "maps" / "nanobench.yaml") for p in sorted(folder.glob("*.csv"))]
    kept = [log for log in without_copies(logs) if not complaints(log)]
    flights = []
    for log in kept:
        try:
            flights.append(flight_of(log, log.name.split("_")[0], vehicle))
        except LogError as error:
            print(f"left out: {error}", flush=True)
    if not flights:
        raise QuadctlError(f"{folder}: holds no flight, expected CSV files of the benchmark")
    return len(logs), flights


def _family(shape: str) -> int:
    """Number of the family of a shape; other shapes are one family."""
    return next((n for n, family in enumerate(FAMILIES) if shape in family), len(FAMILIES))


def _page(
    n_logs: int,
    n_flights: int,
    rotation: Rotation,
    repeated: dict[str, Judged],
    unseen: dict[str, Judged],
    seconds: float,
) -> str:
    intro = f"""`make nanobench` wrote this in {seconds / 60.0:.0f} minutes of processor time. {n_flights} of {n_logs}
    flights of a Crazyflie 2.1 of NanoBench (Ullah & Baca 2026, arXiv 2603.09908); copies and corrupt ones are left out.
    The whole state is rolled out with the commands that were sent, from a window every 50 ms: mean errors, mean of the
    flights with its 95 % interval. No fit saw the flights that are judged. Errors grow with the speed of the flights:
    compare models on other flights by their ratio to **{HELD}**."""
    kinds = f"""- **{HELD}**: velocity and body rates stay as they are.

    - **{RIDGE}**, **{NETWORK}**: regressions for each horizon on the state, its past 0.3 s and the commands until the
    horizon; they name no cause. The perceptrons (scikit-learn) are the mean of four with 32 hidden units, each stopped
    by flights that it does not learn from.

    - **{ESTIMATED}**: the model that `quadctl rotation -o` saves, with its observer of slow forces and moments, as
    [exported code](export.md#the-past-and-rollouts) rolls it out: of what turns the body it trusts a share, with more
    damping. A simulator, which closes the loop itself, uses the model without that.

    - **{FORECAST}**: the past is explained by the physics as estimated; of what is to come a share is trusted, with
    more damping, fitted to the forecasts after 0.25 and 0.5 s. Of flights under this controller only, and no what-if.

    - **{CORRECTED}**: with a ridge regression of what it leaves, by the same inputs and the forecast."""
    kinds = "- " + "\n- ".join(" ".join(k.split()).removeprefix("- ") for k in kinds.split("\n\n"))
    parameters = """By the prediction-error method on commands, gyro and accelerometer (Ljung 1999, ch. 13), which is
    right in closed loop as far as its model of the noise is. The gain per weight of thrust difference is the slope by
    the command over the elasticity of the thrust (% of the weight per % of command), which limits it."""
    others = [i for i in range(len(HORIZONS_S)) if i != TOLD]
    return "\n\n".join(
        [
            "# Public benchmarks",
            wrapped(intro).strip(),
            f"## Errors after {TOLD_S:g} s",
            "Repetitions: a third of the flights is left out in turn.",
            errors_table(repeated, TOLD),
            "Unseen shapes: all flights of a shape are left out ("
            + ", ".join("+".join(family) for family in FAMILIES)
            + ").",
            errors_table(unseen, TOLD),
            wrapped(kinds).strip(),
            "## Errors at other horizons, repetitions",
            "Position m / velocity m/s / rotation rad / rates rad/s.",
            horizons_table({n: m[others] for n, m in means(repeated).items()}, [HORIZONS_S[i] for i in others]),
            "## What was found",
            wrapped(parameters).strip(),
            _parameters(rotation),
            "[Rotation](rotation.md) does the same on your own logs.",
            "## Times",
            "Processor time of a fit to two thirds of the flights, and of a window, all four horizons together.",
            times_table(repeated),
        ]
    )


def _parameters(rotation: Rotation) -> str:
    rows: list[Sequence[str]] = []
    for axis in rotation.axes:
        told = rotation.told(axis)
        rows += [
            (f"{axis}: {name}, {unit}", _shown(told[key])) for key, name, unit in ROWS if key in told and key != "slope"
        ]
    rows += [(f"drag {name}, 1/s", _shown(fit.values["drag_1_s"])) for name, fit in rotation.drag.items() if fit.white]
    if rotation.thrust.found is not None:
        rows.append(
            ("elasticity of the thrust, weights per relative change of the command", _shown(rotation.thrust.found))
        )
    return table(["parameter", "value [95 % interval]"], rows)


def _shown(value: Value) -> str:
    return f"{value.value:.3g} [{value.low:.3g}, {value.high:.3g}]"


if __name__ == "__main__":
    main()
