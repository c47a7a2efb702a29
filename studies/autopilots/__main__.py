"""Write docs/autopilots.md: `python -m studies.autopilots`, or `make autopilots`; needs the recordings in ../shared."""

import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

from studies.page import DOCS

from .flights import CHANNELS, DATA, MISSIONS, UNITS, Flown, mean_error, recorded, simulated
from .measured import NAMES, Fact, Measured, load_measured
from .probes import PROBES

PAGE = DOCS / "autopilots.md"
AXES = 3
TITLES = {"px4": "PX4", "ardupilot": "ArduPilot Copter"}
HEAD = """# The simulated autopilots beside the real ones

Written by `make autopilots`: simulated autopilots (mocks) beside recordings of real ones in their own simulators.
`sitl/px4/measured.yaml` and `sitl/ardupilot/measured.yaml` hold all facts with their sources, also those without a
mock's value, and what is not known. Mocks behave like this with `--hidden sitl/px4/like_sih.yaml` or
`sitl/ardupilot/like_sitl.yaml`.
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


def facts(name: str, measured: Measured) -> Iterator[str]:
    yield "| fact | real | mock |\n|---|---|---|"
    for fact in measured.facts:
        if fact.probe:
            yield f"| {fact.what} | {said(fact.value, fact)} | {said(PROBES[fact.probe](name), fact)} |"


def said(value: str | float, fact: Fact) -> str:
    number = value if isinstance(value, str) else f"{value:.3g}"
    return f"{number} {fact.unit}".rstrip()


def tracking(real: dict[str, Flown], mock: dict[str, Flown]) -> Iterator[str]:
    yield "\nTracking error, RMSE in cm (north, east, up):\n"
    yield "| mission | real | mock |\n|---|---|---|"
    for mission in MISSIONS:
        yield f"| `{mission}` | {centimetres(real[mission])} | {centimetres(mock[mission])} |"


def centimetres(flown: Flown) -> str:
    return ", ".join(f"{100.0 * rmse:.1f}" for rmse in flown.rmse_m)


def errors(real: Sequence[Flown], mock: Sequence[Flown]) -> Iterator[str]:
    yield "\nStandard deviation of the error of the estimate:\n"
    yield "| channels | real | mock |\n|---|---|---|"
    for first in range(0, len(CHANNELS), AXES):
        part = range(first, first + AXES)
        cells = (", ".join(f"{mean_error(flights, i).std:.2g}" for i in part) for flights in (real, mock))
        yield f"| {', '.join(CHANNELS[i] for i in part)}, {UNITS[first]} | {' | '.join(cells)} |"


if __name__ == "__main__":
    main()
