"""Write docs/autopilots.md: `python -m studies.autopilots`, or `make autopilots`; needs the recordings in ../shared."""

import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from studies.page import DOCS, table

from .flights import CHANNELS, DATA, MISSIONS, UNITS, Error, Flown, recorded, simulated
from .measured import NAMES, Fact, Measured, load_measured
from .probes import PROBES

PAGE = DOCS / "autopilots.md"
TITLES = {"px4": "PX4", "ardupilot": "ArduPilot Copter"}
HEAD = """# The simulated autopilots beside the real ones

The tests fly simulated autopilots (mocks). This page compares them with recordings of real ones, which flew in their
own simulators. `make autopilots` writes it. The facts are in `sitl/px4/measured.yaml` and
`sitl/ardupilot/measured.yaml`, with their sources. The mock behaves like that with `--hidden sitl/px4/like_sih.yaml` or
`--hidden sitl/ardupilot/like_sitl.yaml`.
Without such a file it is quicker than a real autopilot: it is ready at once, climbs and lands faster, and its estimate
is better. The tests compare each value that has one for the mock.
"""


def main() -> None:
    if not DATA.is_dir():
        sys.exit(f"{DATA}: expected the recordings of real autopilots")
    PAGE.write_text("\n".join([HEAD, *(line for name in NAMES for line in section(name))]) + "\n")


def section(name: str) -> Iterator[str]:
    """Lines about one autopilot."""
    measured = load_measured(name)
    yield f"## {TITLES[name]}\n\n{measured.version}.\n"
    yield from facts(name, measured)
    real = {mission: recorded(name, mission) for mission in MISSIONS}
    with tempfile.TemporaryDirectory() as folder:
        mock = {mission: simulated(name, mission, Path(folder)) for mission in MISSIONS}
        yield from tracking(real, mock)
    yield from errors(list(real.values()), list(mock.values()))
    yield "\nNot known, and not simulated: " + "; ".join(measured.unknown) + ".\n"


def facts(name: str, measured: Measured) -> Iterator[str]:
    found = [said(PROBES[fact.probe](name), fact) if fact.probe else "not compared" for fact in measured.facts]
    rows = [(f.what, said(f.value, f), mock, f.source) for f, mock in zip(measured.facts, found, strict=True)]
    yield table(("fact", "real", "mock", "source"), rows, range(4))


def said(value: str | float, fact: Fact) -> str:
    number = value if isinstance(value, str) else f"{value:.3g}"
    return f"{number} {fact.unit}".rstrip()


def tracking(real: dict[str, Flown], mock: dict[str, Flown]) -> Iterator[str]:
    yield "\nTracking error: RMSE of the position against the reference, cm (north, east, up).\n"
    rows = [(f"`{mission}`", centimetres(real[mission]), centimetres(mock[mission])) for mission in MISSIONS]
    yield table(("mission", "real", "mock"), rows, range(3))


def centimetres(flown: Flown) -> str:
    return ", ".join(f"{100.0 * rmse:.1f}" for rmse in flown.rmse_m)


def errors(real: Sequence[Flown], mock: Sequence[Flown]) -> Iterator[str]:
    yield "\nError of the estimate against the truth of the simulator, over the three missions: standard deviation in a"
    yield "flight, and the time in which its correlation falls to 1/e.\n"
    rows = [
        (channel, error(mean_error(real, i), unit), error(mean_error(mock, i), unit))
        for i, (channel, unit) in enumerate(zip(CHANNELS, UNITS, strict=True))
    ]
    yield table(("channel", "real", "mock"), rows, range(3))


def mean_error(flights: Sequence[Flown], channel: int) -> Error:
    """Root mean square of the sizes, and mean of the times, of the errors of several flights."""
    found = [flown.errors[channel] for flown in flights]
    return Error(float(np.sqrt(np.mean([e.std**2 for e in found]))), float(np.mean([e.time_s for e in found])))


def error(found: Error, unit: str) -> str:
    return f"{found.std:.2g} {unit}, {found.time_s:.1f} s"


if __name__ == "__main__":
    main()
