"""Write docs/benchmarks-public.md: `python -m studies.nanobench FOLDER`, or `make nanobench`."""

import argparse
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from quadctl.errors import LogError
from quadctl.lab.arrays import Floats
from quadctl.lab.rotation.innovations import Value
from quadctl.lab.rotation.parameters import Rotation, fit_rotation
from quadctl.lab.rotation.rollout import HORIZONS_S
from quadctl.lab.rotation.words import ROWS
from quadctl.logs.consistency import complaints
from quadctl.logs.record.copies import without_copies
from quadctl.logs.table import read_by_map
from quadctl.vehicle import Vehicle, load_vehicle
from studies.page import DOCS, ROOT, table, wrapped, write_page

from .rollouts import CORRECTED, ESTIMATED, FORECAST, MODELS, Flight, flight_of, judged

PAGE = DOCS / "benchmarks-public.md"
FOLDS = 3
FAMILIES = (("B2", "B6", "B7"), ("B3", "B10"), ("B5", "B8"), ("B9",))
"""Shapes of trajectory that are left out together."""
TOLD_S = 0.5
HEADINGS = ("model", "position m", "velocity m/s", "rotation rad", "rates rad/s")


def main() -> None:
    parser = argparse.ArgumentParser(description="Roll out the flights of NanoBench, and write the page.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--test", type=Path, help="judge the flights of this folder by fits to those of the first")
    parser.add_argument("--page", type=Path, default=PAGE)
    arguments = parser.parse_args()
    begin = time.monotonic()
    vehicle = load_vehicle(arguments.folder / "crazyflie21.yaml")
    n_logs, flights = _flights(arguments.folder, vehicle)
    if arguments.test is not None:
        _, test = _flights(arguments.test, vehicle)
        print(_errors(judged(flights, test, vehicle), HORIZONS_S.index(TOLD_S)))
        return
    rotation = fit_rotation([f.flown.record for f in flights], vehicle)

    def errors(test_of: Callable[[int, Flight], int]) -> dict[str, list[Floats]]:
        found: dict[str, list[Floats]] = {name: [] for name in MODELS}
        part_of = [test_of(i, f) for i, f in enumerate(flights)]
        for part in sorted(set(part_of)):
            test = [f for f, of in zip(flights, part_of, strict=True) if of == part]
            train = [f for f, of in zip(flights, part_of, strict=True) if of != part]
            for name, values in judged(train, test, vehicle).items():
                found[name] += values
            so_far = {name: np.round(np.mean(values, axis=0)[2], 3).tolist() for name, values in found.items()}
            print(f"part {part + 1}: {so_far}", flush=True)
        return found

    repeated, unseen = errors(lambda i, _: i % FOLDS), errors(lambda _, f: _family(f.shape))
    text = _page(n_logs, len(flights), rotation, repeated, unseen, time.monotonic() - begin)
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
    return len(logs), flights


def _family(shape: str) -> int:
    """Number of the family of a shape; other shapes are one family."""
    return next((n for n, family in enumerate(FAMILIES) if shape in family), len(FAMILIES))


def _page(
    n_logs: int,
    n_flights: int,
    rotation: Rotation,
    repeated: dict[str, list[Floats]],
    unseen: dict[str, list[Floats]],
    seconds: float,
) -> str:
    intro = f"""Written by `make nanobench` in {seconds / 60.0:.0f} minutes. {n_flights} of {n_logs} flights of a
    Crazyflie 2.1 of NanoBench (Ullah & Baca 2026, arXiv 2603.09908): copies and corrupt ones are left out. From many
    instants the whole state is rolled out with the commands that were sent (windows every 50 ms, mean errors, mean of
    the flights with its 95 % interval). No fit saw the flights that are judged; the physics is fitted to every second
    of the others, the forecasts and regressions to all. Errors grow with the speed of the flights: compare models on
    other flights by their ratio to **held**."""
    kinds = f"""- **held**: velocity and body rates stay as they are.

    - **ridge**: regression for each horizon on the state, its past 0.3 s and the commands until the
    horizon; it names no cause.

    - **{ESTIMATED}**: thrust map, drag, moments, lag and delay as below, with an observer of the slow force and the
    slow moment. What a simulator may use, which closes the loop itself. Replayed commands that answered
    disturbances, without these, drive it away from the record.

    - **{FORECAST}**: the past is explained by the physics as estimated; of what is to come, a share is trusted, with
    more damping. Shares, lags and the observer are fitted to the forecasts after 0.25 and 0.5 s. Of flights under this
    controller only, and no what-if: part of what the commands do answers disturbances that a forecast cannot know.

    - **{CORRECTED}**: with a ridge regression of what it leaves, by the same inputs and the forecast."""
    kinds = "- " + "\n- ".join(" ".join(k.split()).removeprefix("- ") for k in kinds.split("\n\n"))
    parameters = """By the prediction-error method on commands, gyro and accelerometer (Ljung 1999, ch. 13), which is
    right in closed loop as far as its model of the noise is. The gain per weight of thrust difference is the slope by
    the command over the elasticity of the thrust (% of the weight per % of command), which limits it: a voltage that
    sags with the thrust of all rotors is part of that elasticity, though a difference of rotors does not move it."""
    return "\n\n".join(
        [
            "# Public benchmarks",
            wrapped(intro).strip(),
            wrapped(kinds).strip(),
            f"## Errors after {TOLD_S:g} s",
            "Repetitions: a third of the flights is left out in turn.",
            _errors(repeated, HORIZONS_S.index(TOLD_S)),
            "Unseen shapes: all flights of a shape are left out ("
            + ", ".join("+".join(family) for family in FAMILIES)
            + ").",
            _errors(unseen, HORIZONS_S.index(TOLD_S)),
            "## Errors at other horizons, repetitions",
            _others(repeated),
            "## What was found",
            wrapped(parameters).strip(),
            _parameters(rotation),
            "[Rotation](rotation.md) does the same on your own logs.",
        ]
    )


def _errors(found: dict[str, list[Floats]], horizon: int) -> str:
    rows = []
    for name, flights in found.items():
        values = np.array([f[horizon] for f in flights])
        half = 1.96 * values.std(axis=0, ddof=1) / np.sqrt(len(values))
        cells = [f"{m:.3g} ± {h:.1g}" for m, h in zip(values.mean(axis=0), half, strict=True)]
        rows.append([name, *cells])
    return table(list(HEADINGS), rows)


def _others(found: dict[str, list[Floats]]) -> str:
    rows = []
    for i, horizon_s in enumerate(HORIZONS_S):
        if horizon_s != TOLD_S:
            means = {name: np.mean([f[i] for f in flights], axis=0) for name, flights in found.items()}
            rows += [[f"{horizon_s:g}", name, *(f"{m:.3g}" for m in mean)] for name, mean in means.items()]
    return table(["after s", *HEADINGS], rows, texts=(1,))


def _parameters(rotation: Rotation) -> str:
    rows: list[Sequence[str]] = []
    for axis in rotation.axes:
        told = rotation.told(axis)
        rows += [(f"{axis}: {name}, {unit}", _shown(told[key])) for key, name, unit in ROWS if key in told]
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
