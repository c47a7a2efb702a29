"""Write docs/real-flights.md: what `discover` finds in public logs of real flights and of real autopilots.

`make real` runs this; the logs are looked for in ../shared/data, or in the folder that is given.
"""

import sys
import textwrap
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from quadctl.errors import QuadctlError
from quadctl.lab import diagnose, discover
from quadctl.lab.comparison.wording import parameters_in_words
from quadctl.lab.finding import Finding, Kind, parameters_of
from quadctl.lab.selection.diagnosis import Diagnosis
from quadctl.lab.selection.discovery import Discovery
from quadctl.lab.words import in_words
from quadctl.logs.consistency import complaints
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.record.copies import without_copies
from quadctl.logs.table import read_by_map
from studies.page import DOCS, ROOT, table
from studies.reliability import Named, names_in, reliability

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

DRAG = frozenset({"rotor_drag", "body_drag"})
LINE = frozenset({"thrust_scale", "thrust_map"})
"""The vehicle file's line from command to thrust is off: a scale or a line corrects it."""


@dataclass(frozen=True)
class Known:
    """Flights of which is known what the vehicle file lacks."""

    title: str
    vehicle: str
    logs: str
    """Pattern of their names."""
    there: frozenset[str]


KNOWN = (
    Known(
        "NanoBench, a Crazyflie in a closed room",
        "nanobench/crazyflie21.yaml",
        "nanobench/*.csv",
        DRAG | LINE | {"battery_sag", "motor_lag", "airspeed_moment"},
    ),
    Known("PX4 in its simulator", "real/px4/vehicle.yaml", "real/px4/*.ulg", frozenset({"rotor_drag", "motor_lag"})),
    Known("the same, older recordings", "px4/sih_quadx.yaml", "px4/*.ulg", frozenset({"rotor_drag", "motor_lag"})),
    Known("ArduPilot 4.5 in its simulator", "real/ardupilot/vehicle.yaml", "real/ardupilot/[efv]*.bin", DRAG),
    Known("the same, hover", "real/ardupilot/vehicle.yaml", "real/ardupilot/hover*.bin", DRAG),
    Known("the same, six rotors", "real/ardupilot/hexa_vehicle.yaml", "real/ardupilot/hexa*.bin", DRAG),
    Known("ArduPilot 4.7", "real/ardupilot/vehicle.yaml", "real/ardupilot47/47_h_none.bin", DRAG | LINE),
    Known(
        "the same, a weak battery",
        "real/ardupilot/vehicle.yaml",
        "real/ardupilot47/47_h_batt_sag.bin",
        DRAG | LINE | {"battery_sag"},
    ),
    Known(
        "the same, 0.45 kg more",
        "real/ardupilot/vehicle.yaml",
        "real/ardupilot47/47_h_payload15.bin",
        DRAG | LINE | {"payload"},
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
    pieces.append(known_section(data))
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
        parameters = (
            f": {parameters_in_words(parameters_of(effect, intervals[effect.name])['parameters'])}" if effect else ""
        )
        listed.append(f"`{step.effect}` {step.rmse['total']:.3f}{parameters}")
    diagnosis = found.diagnosis
    said = (
        ["Part of the remaining error depends on the logged variables, unexplained."] if diagnosis.unexplained else []
    )
    said += [
        f"Measured, but small: {in_words(Finding(Kind.EFFECT, parameters_of(c.effect, c.ci95)))}."
        for c in diagnosis.measured
    ]
    said += [f"Confounded: {' and '.join(pair)}." for pair in diagnosis.confounded]
    logs = ", ".join(f"`{Path(name).name}`" for name in flights.logs)
    about = textwrap.fill(f"{logs}. {flights.about} {begin}", 120)
    lines = "\n".join(textwrap.fill(f"- {line}", 120, subsequent_indent="  ") for line in [*listed, *said])
    return f"## {flights.title}\n\n{about}\n\n{lines}\n"


RECORDINGS = """## Flights whose missing effects are known

Each flight is diagnosed alone, from the rigid body. *There* is what the vehicle file is known to lack, and what the
diagnosis calls confounded with it; whether one flight shows all of it is not known. NanoBench flew in a closed room:
copies and corrupt flights are left out. The truth of the simulators of PX4 and ArduPilot is known.
"""
NAMES = """Share of the families called missing that are there:"""


def known_section(data: Path) -> str:
    """Names in flights with a known truth, and how many of them are there by their p-values."""
    lines: list[tuple[str, ...]] = []
    names: dict[str, list[Named]] = {"real flights": [], "autopilots' simulators": []}
    for known in KNOWN:
        print(known.title, flush=True)
        found = [diagnose(data / known.vehicle, log) for log in _read(known, data)]
        group = names["real flights" if "nanobench" in known.logs else "autopilots' simulators"]
        group += [name for diagnosis in found for name in names_in(diagnosis, known.there, _confounded(diagnosis))]
        lines.append(_line(known, found))
    headings = ("flights", "number", "there, and named in", "named, and not there")
    return "\n".join([RECORDINGS, table(headings, lines, (0, 2, 3)), "", NAMES, "", reliability(names), ""])


def _read(known: Known, data: Path) -> Iterator[FlightLog | Path]:
    paths = sorted(data.glob(known.logs))
    if "nanobench" not in known.logs:
        yield from paths
        return
    logs = [read_by_map(path, ROOT / "config" / "maps" / "nanobench.yaml") for path in paths]
    yield from (log for log in without_copies(logs) if not complaints(log))


def _confounded(diagnosis: Diagnosis) -> list[frozenset[str]]:
    return [frozenset(pair) for pair in diagnosis.confounded]


def _line(known: Known, found: list[Diagnosis]) -> tuple[str, ...]:
    named = Counter((n.family, n.is_there) for d in found for n in names_in(d, known.there, _confounded(d)))
    counts = [(f"{family} {number}", there) for (family, there), number in sorted(named.items())]
    right, wrong = (", ".join(text for text, there in counts if there is which) for which in (True, False))
    return known.title, str(len(found)), right or "-", wrong or "-"


if __name__ == "__main__":
    try:
        main(Path(sys.argv[1]) if len(sys.argv) > 1 else DATA)
    except QuadctlError as error:
        sys.exit(str(error))
