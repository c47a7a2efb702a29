"""`make sitl-check` on the mocks: it flies, refuses and lands as on the real autopilots, and prints a table."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from quadctl.sitl.rules.copter import SimulatedCopter
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.vehicle import load_vehicle
from tests.support.links import free_port, mock
from tests.support.places import ROOT

pytestmark = [pytest.mark.realtime, pytest.mark.long]

VEHICLES = {"px4": "vehicle.yaml", "ardupilot": "hexa_vehicle.yaml"}
CONFIGS = {"px4": "flight.yaml", "ardupilot": "hexa_flight.yaml"}
RULES = {"px4": SimulatedAutopilot, "ardupilot": SimulatedCopter}


def start(name: str, port: int, where: Path) -> "subprocess.Popen[str]":
    """The script, in a process of its own, on the autopilot at a port."""
    program = where / "quadctl"
    where.mkdir()
    program.write_text(f"#!/bin/sh\nexec {sys.executable} -c 'from quadctl.cli import main; main()' \"$@\"\n")
    program.chmod(0o755)
    settings = {
        "QUADCTL": str(program),
        "LOGS": str(where / "logs"),
        "LINK": f"udpin://127.0.0.1:{port}",
        "CONFIG": str(ROOT / "sitl" / name / CONFIGS[name]),
    }
    return subprocess.Popen(
        [ROOT / "sitl" / "check.sh"],
        cwd=ROOT,
        env=dict(os.environ) | settings,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def test_each_flight_of_the_check_ends_as_the_table_expects(tmp_path: Path) -> None:
    """A quadrotor of PX4 and a hexarotor of ArduPilot, at the same time because they take real time."""
    ports = {name: free_port() for name in RULES}
    px4, copter = (rules(load_vehicle(ROOT / "sitl" / name / VEHICLES[name])) for name, rules in RULES.items())
    with mock(px4, ports["px4"]), mock(copter, ports["ardupilot"]):
        checks = {name: start(name, port, tmp_path / name) for name, port in ports.items()}
        said = {name: check.communicate(timeout=300.0)[0] for name, check in checks.items()}
    for name, check in checks.items():
        table = [line.split() for line in said[name].splitlines() if line.startswith("link ")]
        assert [words[1:3] for words in table] == [
            ["staircase", "ok"],
            ["box", "ok"],
            ["second", "ok"],
            ["ctrl-c", "ok"],
        ], f"{name}\n{said[name]}"
        assert check.returncode == 0
    assert not px4.armed
    assert not copter.armed
