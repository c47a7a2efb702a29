"""Write docs/real-flights.md: what `discover` finds in public logs of real flights and of real autopilots.

`make real` runs this; the logs are looked for in ../shared/data, or in the folder that is given.
"""

import sys
import textwrap
import time
from dataclasses import dataclass
from pathlib import Path

from quadctl.errors import QuadctlError
from quadctl.lab import discover
from quadctl.lab.comparison.wording import parameters_in_words
from quadctl.lab.selection.discovery import Discovery
from studies.page import DOCS, ROOT, table

DATA = ROOT / "../shared/data"
PAGE = DOCS / "real-flights.md"
RAPTOR = ROOT / "config/vehicles/raptor.yaml"

INTRODUCTION = """# Real flights

Results of `quadctl discover` on public logs, starting from the rigid body. Written by `make real`. Errors are root mean
squares of the acceleration residual, m/s², on held-out blocks of time; intervals are 95 %. Trim and calibration of each
flight are fitted at every step, so the first error is that of the rigid body with its best trim.
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
        "Appius' thesis fits a e^(-bz) + c with a = 0.114, b = 5.39, c = 1.028 to this flight: the c is a thrust "
        "scale, which the thesis does not name. The frame is tilted against the floor by about 0.9 degrees, which "
        "is found as a tilted thrust. Rotor speeds arrive at 3 Hz, so all signals are filtered to 1 Hz.",
    ),
    Flights(
        "RAPTOR, forward runs",
        RAPTOR,
        ("raptor/FORWARD_SPEED.csv",),
        "The thesis finds no influence of the forward speed on the ground effect here; the effect of the speed is "
        "drag along the runs. Sideward drag cannot be determined: nobody flew sideward.",
    ),
    Flights(
        "RAPTOR, both together",
        RAPTOR,
        ("raptor/HOVERING.csv", "raptor/FORWARD_SPEED.csv"),
        "One model for two flights whose trims differ by more than a degree, at one heading: the tilt is not the "
        "same in both, and wind cannot be distinguished from it. Effects on the moments (a weak rotor, rotors in "
        "each other's wake) depend on rotor speeds at 3 Hz and on an inertia that nobody measured: check the "
        "propellers before you believe them.",
    ),
    Flights(
        "RAPTOR, steps while flying forward",
        RAPTOR,
        RAPTOR_STEPS,
        "Step responses without compensation, and the same flights high above the ground, at 0.5 and 1.25 m/s.",
    ),
    Flights(
        "RAPTOR, steps with commands only",
        RAPTOR,
        ("raptor/NO_COMPENSATION_01.csv", "raptor/NO_COMPENSATION_02.csv", "raptor/HIGH_ALTITUDE_01.csv"),
        "These logs hold no rotor speeds: thrust is computed from the commanded throttle with the vehicle file's "
        "line. A weak battery and a wrong line then look like a thrust scale.",
    ),
    Flights(
        "PX4 in its own simulator, hover staircase",
        DATA / "px4/sih_quadx.yaml",
        ("px4/A_staircase.ulg",),
        "No rotor speeds, thrust from motor outputs. In hover the estimator's velocity error is as large as the "
        "speed itself, so the drag is weakened, which its interval allows for, and an attitude error looks like a "
        "tilted thrust and a biased accelerometer at once. The simulator's own truth is not used.",
    ),
    Flights(
        "PX4 in its own simulator, forward runs",
        DATA / "px4/sih_quadx.yaml",
        ("px4/B_forward.ulg",),
        "The simulator's drag is linear with 1 1/s in all directions. Sideward the vehicle hardly moves, so that "
        "errors of the estimated velocity weaken d_y: its interval is drawn towards what they may have taken.",
    ),
    Flights(
        "ArduPilot in its own simulator, hover staircase",
        RAPTOR,
        ("ardupilot/stair_eq0.bin",),
        "There is no vehicle file for this simulated vehicle: RAPTOR's is wrong by a factor, which is found as a "
        "thrust scale.",
    ),
)


def main(data: Path) -> None:
    if not data.is_dir():
        raise QuadctlError(f"{data}: there are no logs, expected the folder of the public flight logs")
    pieces = [INTRODUCTION]
    for flights in SETS:
        print(flights.title, flush=True)
        began = time.process_time()
        found = discover(flights.vehicle, [data / name for name in flights.logs])
        pieces.append(section(flights, found, time.process_time() - began))
    PAGE.write_text("\n".join(pieces), encoding="utf-8")
    print(f"written: {PAGE}")


def section(flights: Flights, found: Discovery, seconds: float) -> str:
    words = {effect.name: effect for effect in found.model.effects}
    intervals = {item.effect.name: item.fitted.ci95 if item.fitted else {} for item in found.model.stack}
    rows = []
    for step in found.diagnosis.steps:
        effect = words.get(step.effect)
        parameters = parameters_in_words(effect, intervals[effect.name]) if effect else ""
        rows.append((step.effect or "rigid body", f"{step.rmse['total']:.3f}", parameters))
    rows.append(("noise floor of all variables together", f"{found.noise_floor['total']:.3f}", ""))
    shown = table(("model", "held-out error", "parameters in the end [95 %]"), rows, texts=(0, 2))
    said = [line for line in found.diagnosis.lines() if "->" not in line and not line.startswith("Missing")]
    logs = ", ".join(f"`{Path(name).name}`" for name in flights.logs)
    about = textwrap.fill(f"{logs}; {seconds:.0f} s of one processor. {flights.about}", 120)
    listed = "\n".join(textwrap.fill(f"- {line}", 120, subsequent_indent="  ") for line in said)
    return f"## {flights.title}\n\n{about}\n\n{shown}\n\n{listed}\n"


if __name__ == "__main__":
    try:
        main(Path(sys.argv[1]) if len(sys.argv) > 1 else DATA)
    except QuadctlError as error:
        sys.exit(str(error))
