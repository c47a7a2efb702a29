"""The companion computer's page, service, image and copies of logs do what they say."""

import configparser
import os
import re
import shlex
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from quadctl.flight.preflight import computer
from tests.docs.test_docs import BLOCK, commands
from tests.support.commands import Result
from tests.support.places import ROOT

PAGE = ROOT / "docs" / "companion.md"
FLYING = ROOT / "docs" / "flying.md"
UNIT = "config/companion/quadctl@.service"
REFUSED = "there is no config/flight.yaml here, expected one that describes your vehicle"


def block(first_word: str, page: Path = PAGE) -> str:
    """The block of commands that begins with a word."""
    (found,) = (text for text in BLOCK.findall(page.read_text()) if text.startswith(first_word))
    return str(found)


# --- the service -----------------------------------------------------------------------------------------------------


@pytest.fixture
def flights(quadctl: Callable[..., Result], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder as `quadctl init` makes it, in which one then is."""
    folder = tmp_path / "home" / "ada" / "flight"
    assert quadctl("init", folder).status == 0
    monkeypatch.chdir(folder)
    return folder


@pytest.fixture
def unit(flights: Path) -> configparser.ConfigParser:
    """The unit as the page's command writes it for the user `ada`."""
    rewritten, _, _ = block("sed").splitlines()[0].partition(" | ")
    done = subprocess.run(
        ["bash", "-c", rewritten], env={**os.environ, "USER": "ada"}, capture_output=True, text=True, check=True
    )
    (flights / "quadctl@.service").write_text(done.stdout)
    parsed = configparser.ConfigParser(interpolation=None)
    parsed.optionxform = str  # type: ignore[assignment,method-assign]
    parsed.read_string(done.stdout)
    return parsed


def test_the_service_has_the_rights_of_a_flight(unit: configparser.ConfigParser) -> None:
    service = unit["Service"]
    assert (service["LimitRTPRIO"], service["LimitMEMLOCK"]) == (str(computer.PRIORITY), "infinity")
    assert f"`LimitRTPRIO={service['LimitRTPRIO']}`" in computer.SERVICE
    assert service["SupplementaryGroups"] == "dialout"
    assert service["User"] == "ada"


def test_nothing_starts_a_flight_by_itself_and_a_stop_lands(unit: configparser.ConfigParser) -> None:
    service = unit["Service"]
    assert "Install" not in unit  # cannot be enabled
    assert service["Restart"] == "no"
    assert service.get("KillSignal", "SIGTERM") == "SIGTERM"  # which lands
    assert (service["KillMode"], service["TimeoutStopSec"]) == ("mixed", "3min")


def test_the_command_of_the_service_flies_the_mission_of_its_name(
    unit: configparser.ConfigParser, flights: Path, quadctl: Callable[..., Result]
) -> None:
    """Run dry: without the device it comes as far as opening it."""
    program, *words = shlex.split(unit["Service"]["ExecStart"].replace("%i", "short_hop"))
    assert program == "/home/ada/quadctl/bin/quadctl"
    assert "~/quadctl/bin/pip install" in block("sudo apt-get")  # where the page puts it
    assert unit["Service"]["WorkingDirectory"] == "/home/ada/flight"
    (flights / "logs").mkdir()
    device = str(flights / "tty")
    tried = quadctl_here(quadctl, flights, *[word.replace("/dev/serial0", device) for word in words])
    assert f"The link serial://{device}:921600 cannot be opened" in tried.err
    assert words[-2:] == ["--log-dir", "logs"]


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd is not installed")
def test_systemd_finds_no_fault_in_the_unit(unit: configparser.ConfigParser, flights: Path) -> None:
    file = flights / "quadctl@.service"
    there = shutil.which("true")
    file.write_text(file.read_text().replace("/home/ada/quadctl/bin/quadctl", str(there)).replace("User=ada\n", ""))
    done = subprocess.run(["systemd-analyze", "verify", file], capture_output=True, text=True, check=False)
    assert (done.returncode, [line for line in done.stderr.splitlines() if "quadctl@" in line]) == (0, [])


def quadctl_here(quadctl: Callable[..., Result], folder: Path, *words: str) -> Result:
    os.chdir(folder)
    return quadctl(*words)


# --- the page --------------------------------------------------------------------------------------------------------


def test_the_install_goes_into_an_environment_of_its_own() -> None:
    """`.ci/companion` runs this block; a bare `pip install` is refused by the system."""
    lines = block("sudo apt-get").splitlines()
    assert lines[1].startswith("python3 -m venv ")
    assert [line for line in lines if "pip" in line] == ["~/quadctl/bin/pip install --constraint constraints.txt ."]
    assert lines[-1].startswith("quadctl check ")
    shown = [line for page in (PAGE, FLYING) for line in commands(page, "pip")]
    assert shown == []


def test_the_line_that_gives_the_rights_is_the_one_that_the_check_names() -> None:
    assert block("printf").splitlines()[0] in computer.LOGIN


# --- the image -------------------------------------------------------------------------------------------------------


def test_the_image_refuses_to_fly_a_vehicle_that_nobody_described(
    quadctl: Callable[..., Result], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The folder of the image is made here, and its documented flight is tried there."""
    recipe = (ROOT / "Dockerfile").read_text()
    folder = re.findall(r"^WORKDIR (\S+)$", recipe, re.MULTILINE)[-1]
    monkeypatch.chdir(tmp_path)
    for made in re.findall(r"^RUN quadctl (.*)$", recipe, re.MULTILINE):
        assert quadctl_here(quadctl, tmp_path, *made.replace(folder, str(tmp_path)).split()).status == 0
    (flight,) = re.findall(r"^# +quadctl (fly .*)$", recipe, re.MULTILINE)
    refused = quadctl_here(quadctl, tmp_path, *flight.split())
    assert (refused.status, REFUSED in refused.err) == (1, True)


def test_the_image_is_started_with_the_limits_that_give_the_rights() -> None:
    recipe = (ROOT / "Dockerfile").read_text()
    limits = re.findall(r"--ulimit \S+=\S+", computer.CONTAINER.replace("`", " "))
    assert len(limits) == 2
    started = recipe.partition("docker run --rm -it")[2].partition("\n#       quadctl")[0]
    assert [limit for limit in limits if limit not in started] == []
    assert "--cap-add" not in started
    assert re.search(r"^USER (?!root)", recipe, re.MULTILINE)


# --- the logs --------------------------------------------------------------------------------------------------------


@pytest.mark.skipif(shutil.which("rsync") is None, reason="rsync is not installed")
def test_logs_are_copied_whole_with_their_sidecars(tmp_path: Path) -> None:
    there, here = tmp_path / "flight" / "logs", tmp_path / "desk"
    there.mkdir(parents=True)
    here.mkdir()
    (there / "hop.csv").write_text("time_s,z_m\n0.0,0.1\n" * 1000)
    (there / "hop.meta.yaml").write_text("ended: completed\n")
    copy, compare = (
        line.replace("pi@raspberrypi.local:", f"{tmp_path}/") for line in block("rsync", FLYING).splitlines()[:2]
    )

    def said(command: str) -> str:
        return subprocess.run(shlex.split(command), cwd=here, capture_output=True, text=True, check=True).stdout

    assert {"hop.csv", "hop.meta.yaml"} <= set(said(copy).split())
    assert {file.name: file.read_bytes() for file in (here / "logs").iterdir()} == {
        file.name: file.read_bytes() for file in there.iterdir()
    }
    assert said(compare) == ""
    copied = here / "logs" / "hop.csv"
    times = copied.stat()
    copied.write_text(copied.read_text().replace("0.1", "0.2", 1))
    os.utime(copied, ns=(times.st_atime_ns, times.st_mtime_ns))  # as damage on a disk: neither size nor time tell it
    assert "hop.csv" in said(compare)
