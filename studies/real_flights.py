"""Write docs/real-flights.md: what `discover` finds in public logs of real flights and of real autopilots.

`make real` runs this; the logs are looked for in ../shared/data, or in the folder that is given.
"""

import sys
import textwrap
from dataclasses import dataclass
from pathlib import Path

from quadctl.errors import QuadctlError
from quadctl.lab import discover
from quadctl.lab.comparison.wording import parameters_in_words
from quadctl.lab.selection.discovery import Discovery
from studies.page import DOCS, ROOT

DATA = ROOT / "../shared/data"
PAGE = DOCS / "real-flights.md"
RAPTOR = ROOT / "config/vehicles/raptor.yaml"

INTRODUCTION = """# Real flights

Written by `make real`: `quadctl discover` on public logs, from the rigid body. Errors are root mean squares of the
acceleration residual, m/s², on held-out blocks of time; the choice of effects has seen them. Intervals are 95 %.
[Reference error and other terms](statistics.md#terms).
"""


@dataclass(frozen=True)
class Flights:
    """Logs that are analysed together, and what a reader should know of them."""

    title: str
    vehicle: Path
    logs: tuple[str, ...]
    about: str


RAPTOR_STEPS = tuple(
    f"raptor/{kind}_V_{v}.csv" for kind in ("NO_COMPENSATION", "HIGH_ALTITUDE") for v in ("050", "125")
)
SETS = (
    Flights(
        "RAPTOR, hovering over the ground",
        RAPTOR,
        ("raptor/HOVERING.csv",),
        "The thesis fits a e^(-bz) + c with a = 0.114, b = 5.39, c = 1.028: the c is a thrust scale.",
    ),
    Flights(
        "RAPTOR, forward runs",
        RAPTOR,
        ("raptor/FORWARD_SPEED.csv",),
        "Nobody flew sideward.",
    ),
    Flights(
        "RAPTOR, both together",
        RAPTOR,
        ("raptor/HOVERING.csv", "raptor/FORWARD_SPEED.csv"),
        "The tilt is not the same in both.",
    ),
    Flights(
        "RAPTOR, steps while flying forward",
        RAPTOR,
        RAPTOR_STEPS,
        "With and without ground effect, at 0.5 and 1.25 m/s.",
    ),
    Flights(
        "RAPTOR, steps with commands only",
        RAPTOR,
        ("raptor/NO_COMPENSATION_01.csv", "raptor/NO_COMPENSATION_02.csv", "raptor/HIGH_ALTITUDE_01.csv"),
        "No rotor speeds: a weak battery and a wrong throttle line look like a thrust scale.",
    ),
    Flights(
        "PX4 in its own simulator, hover staircase",
        DATA / "px4/sih_quadx.yaml",
        ("px4/A_staircase.ulg",),
        "Thrust from motor outputs; the estimator's velocity error weakens the drag.",
    ),
    Flights(
        "PX4 in its own simulator, forward runs",
        DATA / "px4/sih_quadx.yaml",
        ("px4/B_forward.ulg",),
        "The true drag is 1 1/s in all directions; sideward the vehicle hardly moves.",
    ),
    Flights(
        "ArduPilot in its own simulator, hover staircase",
        RAPTOR,
        ("ardupilot/stair_eq0.bin",),
        "RAPTOR's vehicle file is wrong by a factor here.",
    ),
)


def main(data: Path) -> None:
    if not data.is_dir():
        raise QuadctlError(f"{data}: there are no logs, expected the folder of the public flight logs")
    pieces = [INTRODUCTION]
    for flights in SETS:
        print(flights.title, flush=True)
        found = discover(flights.vehicle, [data / name for name in flights.logs])
        pieces.append(section(flights, found))
    PAGE.write_text("\n".join(pieces), encoding="utf-8")
    print(f"written: {PAGE}")


def section(flights: Flights, found: Discovery) -> str:
    words = {effect.name: effect for effect in found.model.effects}
    intervals = {item.effect.name: item.fitted.ci95 if item.fitted else {} for item in found.model.stack}
    steps = found.diagnosis.steps
    begin = f"Rigid body {steps[0].rmse['total']:.3f}, reference error {found.noise_floor['total']:.3f}."
    listed = []
    for step in steps[1:]:
        effect = words.get(step.effect)
        parameters = f": {parameters_in_words(effect, intervals[effect.name])}" if effect else ""
        listed.append(f"`{step.effect}` {step.rmse['total']:.3f}{parameters}")
    diagnosis = found.diagnosis
    said = (
        ["Part of the remaining error depends on the logged variables, unexplained."] if diagnosis.unexplained else []
    )
    said += [
        f"Measured, but small: {c.effect.name}, {parameters_in_words(c.effect, c.ci95)}." for c in diagnosis.measured
    ]
    said += [f"Confounded: {' and '.join(pair)}." for pair in diagnosis.confounded]
    logs = ", ".join(f"`{Path(name).name}`" for name in flights.logs)
    about = textwrap.fill(f"{logs}. {flights.about} {begin}", 120)
    lines = "\n".join(textwrap.fill(f"- {line}", 120, subsequent_indent="  ") for line in [*listed, *said])
    return f"## {flights.title}\n\n{about}\n\n{lines}\n"


if __name__ == "__main__":
    try:
        main(Path(sys.argv[1]) if len(sys.argv) > 1 else DATA)
    except QuadctlError as error:
        sys.exit(str(error))
