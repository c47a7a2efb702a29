"""Simulated flights load no MAVLink library, nor the lab: a child process flies one and lists its modules."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.places import ROOT

LINKS = ("mavsdk", "grpc", "pymavlink", "serial")
HEAVY = ("scipy", "polars", "matplotlib", "jinja2", "joblib", "pysindy", "nicegui")

SIMULATE = """
from quadctl.cli import app
app(["simulate", "missions/short_hop.yaml", "--log-dir", {folder!r}], standalone_mode=False)
"""
LOCKSTEP = """
from pathlib import Path
from quadctl.flight.preflight.preparation import prepare_flight
from quadctl.sitl.run import simulate
plan = prepare_flight(Path("missions/short_hop.yaml"), None, "none", None)
assert simulate(plan, Path({folder!r}), None, 1).completed
"""
DEMO = """
from pathlib import Path
from rich.console import Console
import quadctl.sitl.run
from quadctl.demo import Demo
demo = Demo(Path({folder!r}), None, quadctl.sitl.run, Console(quiet=True))
assert len(demo.fly("short_hop", "none", 1).columns)
"""
PAGE = """
from pathlib import Path
import quadctl.sitl.run
from quadctl.model import load_model
from quadctl.web.work.simulated import Simulation
model, folder = Path("config/vehicles/raptor.yaml"), Path({folder!r})
world = Simulation(quadctl.sitl.run.simulate, Path("missions"), folder)
saved = world._saved(load_model(model))
assert len(world._fly("short_hop", saved, saved, 1).columns)
"""
PLANNING = "import quadctl.lab.planning.suggestion, quadctl.lab.planning.planned_flight"


def loaded(code: str, folder: Path) -> set[str]:
    """Top-level packages in a process that ran `code` in the repository."""
    ask = "import sys; print('loaded', *{name.partition('.')[0] for name in sys.modules})"
    code = f"{code.format(folder=str(folder))}\n{ask}"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    word, *packages = done.stdout.splitlines()[-1].split()
    assert word == "loaded"
    return set(packages)


@pytest.mark.parametrize("code", [SIMULATE, LOCKSTEP], ids=["the command", "from Python"])
def test_a_simulated_flight_loads_neither_a_link_nor_the_lab(code: str, tmp_path: Path) -> None:
    assert loaded(code, tmp_path).isdisjoint((*LINKS, *HEAVY))


@pytest.mark.parametrize(
    "code", [DEMO, PAGE, PLANNING], ids=["the demo's", "the page's", "the planning of the next flight"]
)
def test_simulated_flights_of_the_lab_load_no_link(code: str, tmp_path: Path) -> None:
    assert loaded(code, tmp_path).isdisjoint(LINKS)
