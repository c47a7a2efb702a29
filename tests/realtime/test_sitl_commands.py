"""Every command in the READMEs of sitl/ flies on the simulated autopilot in place of the real one, in real time."""

import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from quadctl.sitl.rules.copter import SimulatedCopter
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.sitl.vehicle.hidden import load_hidden
from quadctl.vehicle import load_vehicle
from tests.support.links import free_port, mock
from tests.support.places import ROOT

pytestmark = [pytest.mark.realtime, pytest.mark.long]

RULES = {"px4": SimulatedAutopilot, "ardupilot": SimulatedCopter}
PARAMETERS = {"px4": "parameters.txt", "ardupilot": "quadctl.parm"}


def commands(autopilot: str) -> Iterator[list[str]]:
    """The words of each `quadctl fly` in a README; MISSION is the staircase."""
    readme = (ROOT / "sitl" / autopilot / "README.md").read_text()
    for words in re.findall(r"quadctl (fly [^`\n]+)", readme):
        yield words.replace("MISSION", "sitl/staircase.yaml").split()


def on_the_mock(autopilot: str, words: list[str], stack: ExitStack) -> list[str]:
    """The same command with the link of a simulated autopilot that has the parameters of the start script."""
    if "--link" not in words:
        return words
    truth = load_hidden(ROOT / "sitl/px4/like_sih.yaml" if autopilot == "px4" else None)
    simulated = RULES[autopilot](load_vehicle(ROOT / "sitl" / autopilot / "vehicle.yaml"), truth, seed=1)
    for line in (ROOT / "sitl" / autopilot / PARAMETERS[autopilot]).read_text().splitlines():
        name, _, value = line.partition(" ")
        if name in simulated.parameters:
            simulated.parameters[name] = float(value)
    port, at = free_port(), words.index("--link") + 1
    stack.enter_context(mock(simulated, port))
    return [*words[:at], f"udpin://127.0.0.1:{port}", *words[at + 1 :]]


def test_every_command_of_the_readmes_flies_to_its_end(tmp_path: Path) -> None:
    """All at the same time, because they take real time."""
    with ExitStack() as stack:
        flights = {}
        for autopilot in RULES:
            for words in commands(autopilot):
                where = tmp_path / f"{autopilot}{len(flights)}"
                where.mkdir()
                call = [*on_the_mock(autopilot, words, stack), "--log-dir", str(where)]
                flights[f"{autopilot}: {' '.join(words)}"] = subprocess.Popen(
                    [sys.executable, "-c", "from quadctl.cli import main; main()", *call],
                    cwd=ROOT,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.STDOUT,
                    text=True,
                )
        said = {name: flight.communicate(timeout=120.0)[0] for name, flight in flights.items()}
    assert len(said) == 5
    for name, text in said.items():
        assert "sitl_staircase: completed after" in text, f"{name}\n{text}"
