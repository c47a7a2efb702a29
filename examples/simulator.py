"""Flights for the examples: `quadctl simulate`, in a world whose physics the lab is not told."""

import json
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
VEHICLE = ROOT / "config" / "vehicles" / "raptor.yaml"
QUADCTL = Path(sys.executable).with_name("quadctl")
HIDDEN = """
effects:
  - effect: hidden.ground_cushion    # a ground effect that is not in the catalogue
    parameters: {gain: 0.25, width: 1.8}
"""


def fly(mission: str, folder: Path, model: str = "none", seed: int = 1) -> Path:
    """Fly a mission of `missions/` in the simulator and return the path of its log.

    `model`: the compensator, as `quadctl simulate --model` takes it.
    """
    folder.mkdir(parents=True, exist_ok=True)
    hidden, outcome = folder / "hidden.yaml", folder / "outcome.json"
    hidden.write_text(HIDDEN)
    command = [QUADCTL, "simulate", ROOT / "missions" / f"{mission}.yaml", "--model", model, "--hidden", hidden]
    command += ["--seed", str(seed), "--log-dir", folder, "--json", outcome]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return Path(json.loads(outcome.read_text())["log"])
