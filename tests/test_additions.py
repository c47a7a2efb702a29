"""One addition of each kind, in a copy of the package, by the steps of CONTRIBUTING.md and no others."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.places import ROOT

pytestmark = pytest.mark.long

TRAJECTORY = '''
from typing import ClassVar

from quadctl.trajectories.base import Reference, Trajectory


class Zigzag(Trajectory):
    """Keys: side_m."""

    kind: ClassVar[str] = "zigzag"

    side_m: float

    def duration_s(self, start_m):
        return 8.0

    def reference(self, t_s, start_m):
        return Reference((start_m[0], start_m[1] + self.side_m * min(t_s, 8.0) / 8.0, start_m[2]))
'''
MISSION = """
name: zigzag
phases:
  - {name: up, kind: move, to_m: [0, 0, 1.0], speed_m_s: 0.5}
  - {name: zig, kind: zigzag, side_m: 0.5}
limits: {min_z_m: 0.08, max_z_m: 1.5, max_distance_m: 2.0, max_duration_s: 60}
"""
LOG_FORMAT = """
import numpy as np

from quadctl.logs.cleaning import clean_log
from quadctl.logs.columns import STATE_COLUMNS


def is_toy(head):
    return head.startswith(b"TOY")


def read_toy(path):
    time_s = np.array(path.read_text().split()[1:], dtype=float)
    return clean_log(path, dict.fromkeys(STATE_COLUMNS, 0.0 * time_s) | {"time_s": time_s})


def parameters_in_toy(path):
    return {"MPC_THR_HOVER": 0.4, "CA_ROTOR_COUNT": 4.0}
"""
FIRMWARE = """
from dataclasses import replace

from quadctl.flight.autopilot.px4 import PX4
from quadctl.thrust_chain.chain import PLAIN

TOY = replace(PX4, name="Toy", mav_autopilot=14, thrust_chain=PLAIN)
"""
RULES = """
from quadctl.sitl.rules.px4 import SimulatedAutopilot


class SimulatedToy(SimulatedAutopilot):
    name = "Toy"
"""
SERVER = """
from dataclasses import replace

from quadctl.sitl.rules.toy import SimulatedToy
from quadctl.sitl.server.px4 import MavlinkPx4


class MavlinkToy(MavlinkPx4):
    rules = SimulatedToy

    def new_manners(self):
        return replace(super().new_manners(), mav_autopilot=14)
"""
CONTACT = """
from pathlib import Path

from quadctl.flight.preflight.inquiry import ask_autopilot
from quadctl.flight.preflight.plan import read_flight
from quadctl.sitl.autopilots import Simulated
from quadctl.sitl.run import mock_process

if __name__ == "__main__":
    plan = read_flight(Path("missions/hover_staircase.yaml"), Path("config/flight.yaml"), None, None)
    with mock_process(plan.body.vehicle, None, 0, Simulated("toy")) as url:
        print(*ask_autopilot(plan, url, 1.0, Path(".")), sep="\\n")
"""


class Copy:
    """A copy of the package, to which things are added."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        shutil.copytree(ROOT / "quadctl", folder / "quadctl", ignore=shutil.ignore_patterns("__pycache__"))
        for name in ("missions", "config"):
            shutil.copytree(ROOT / name, folder / name)

    def add(self, path: str, text: str) -> None:
        (self.folder / path).write_text(text)

    def insert(self, path: str, before: str, text: str) -> None:
        """Insert a text at the one place where `before` stands."""
        whole = (self.folder / path).read_text()
        assert whole.count(before) == 1
        (self.folder / path).write_text(whole.replace(before, text + before))

    def run(self, *words: str) -> str:
        """Run Python in the copy; what it prints."""
        environment = os.environ | {"PYTHONPATH": str(self.folder), "COLUMNS": "200"}
        done = subprocess.run(
            [sys.executable, *words], cwd=self.folder, env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        return done.stdout


@pytest.fixture
def copy(tmp_path: Path) -> Copy:
    return Copy(tmp_path)


def test_a_trajectory_is_a_file(copy: Copy) -> None:
    copy.add("quadctl/trajectories/zigzag.py", TRAJECTORY)
    copy.add("zigzag.yaml", MISSION)
    assert "zigzag" in copy.run("-m", "quadctl", "mission", "show", "zigzag.yaml")


def test_a_log_format_is_a_file_and_a_line(copy: Copy) -> None:
    copy.add("quadctl/logs/toy.py", LOG_FORMAT)
    module = "quadctl.logs.toy"
    functions = f'"{module}:read_toy", "{module}:is_toy", parameters="{module}:parameters_in_toy"'
    line = f'    LogFormat("Toy", ".toy", {functions}),\n'
    copy.insert("quadctl/logs/formats.py", '    LogFormat("MAVLink telemetry"', line)
    copy.add("flight.toy", "TOY 0 0.5 1")
    assert "flight.toy" in copy.run("-m", "quadctl", "logs", "flight.toy")
    assert ".toy" in copy.run("-m", "quadctl", "vehicle", "new", "--help")
    words = ("--mass", "1", "--propeller", "0.2", "--frame", "quad-x", "--arm", "0.2")
    copy.run("-m", "quadctl", "vehicle", "new", "new.yaml", "--parameters", "flight.toy", *words)


def test_an_autopilot_is_three_files_and_two_lines(copy: Copy) -> None:
    copy.add("quadctl/flight/autopilot/toy.py", FIRMWARE)
    known = "quadctl/flight/autopilot/firmwares.py"
    copy.insert(known, "\nFIRMWARES", "from quadctl.flight.autopilot.toy import TOY\n")
    copy.insert(known, "PX4, ARDUPILOT)", "TOY, ")
    copy.add("quadctl/sitl/rules/toy.py", RULES)
    copy.add("quadctl/sitl/server/toy.py", SERVER)
    copy.insert("quadctl/sitl/autopilots.py", "    PX4 =", '    TOY = "toy", "quadctl.sitl.server.toy:MavlinkToy"\n')
    assert "toy" in copy.run("-m", "quadctl", "fly", "--help")
    copy.add("contact.py", CONTACT)
    assert "autopilot: Toy (system 1)" in copy.run("contact.py")
