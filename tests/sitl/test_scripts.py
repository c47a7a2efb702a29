"""Scripts that start and check the real autopilots' simulators."""

import os
import subprocess
from pathlib import Path

import pytest

from quadctl.flight.autopilot.ardupilot import ARDUPILOT
from quadctl.flight.autopilot.mavlink import OWN_SYSTEM_ID
from tests.support.places import ROOT


def test_the_check_of_real_simulators_says_when_there_is_none() -> None:
    done = subprocess.run(
        [ROOT / "sitl" / "check.sh"], env={"PATH": os.environ["PATH"]}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert done.stderr.startswith("no autopilot to check: say PX4=DIRECTORY, ARDUPILOT=DIRECTORY or LINK=URL")


def test_a_frame_that_is_not_known_is_said() -> None:
    settings = {"PATH": os.environ["PATH"], "LINK": "udpin://127.0.0.1:1", "FRAME": "octa"}
    done = subprocess.run([ROOT / "sitl" / "check.sh"], env=settings, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr == "FRAME=octa: expected quad or hexa\n"


@pytest.mark.parametrize("autopilot", ["px4", "ardupilot"])
def test_a_start_script_says_what_it_misses(autopilot: str, tmp_path: Path) -> None:
    start = ROOT / "sitl" / autopilot / "start.sh"
    done = subprocess.run([start, tmp_path], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith(f"{tmp_path}/b")
    assert "is not there; usage: start.sh DIRECTORY" in done.stderr


def test_the_parameters_that_ardupilots_simulator_starts_with_are_those_of_a_flight_by_all_their_names() -> None:
    """A version ignores the name that it does not know."""
    lines = (ROOT / "sitl" / "ardupilot" / "quadctl.parm").read_text().splitlines()
    values = dict(line.split() for line in lines if not line.startswith("#"))
    for need in ARDUPILOT.requirements(OWN_SYSTEM_ID):
        newer = ARDUPILOT.renamed.get(need.parameter)
        for name in [need.parameter, *([newer.name] if newer else [])]:
            assert need.met(float(values[name])), name
