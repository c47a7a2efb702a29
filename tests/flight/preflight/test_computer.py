"""The check says which rights the computer gives, and the line that gives them is one that does."""

import os
import re
import resource
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from quadctl.flight.preflight import computer
from quadctl.flight.preflight.computer import check_computer
from quadctl.flight.preflight.facts import Kind
from quadctl.flight.preflight.findings import Finding, Verdict
from quadctl.words import fact
from tests.support.commands import Result
from tests.support.places import ROOT

NOBODY = 65534


def on_computer(*used: str, monkeypatch: pytest.MonkeyPatch) -> Finding:
    """The finding where these means are permitted."""

    class Given:
        def __enter__(self) -> tuple[str, ...]:
            return ("select", *used)

        def __exit__(self, *_: object) -> None: ...

    monkeypatch.setattr(computer, "privileges", Given)
    return check_computer()


@pytest.fixture
def login(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Path]:
    """A Linux on which a user has logged in; the file is the process' cgroup."""
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(computer, "CONTAINERS", (tmp_path / "mark",))
    monkeypatch.setattr(computer, "CGROUP", tmp_path / "cgroup")
    (tmp_path / "cgroup").write_text("0::/user.slice/user-1000.slice/session-3.scope\n")
    return tmp_path / "cgroup"


def test_a_computer_that_gives_both_rights_is_right(monkeypatch: pytest.MonkeyPatch) -> None:
    finding = on_computer("SCHED_FIFO 20", "memory locked", monkeypatch=monkeypatch)
    assert finding == Finding(Verdict.OK, "computer", fact(Kind.RIGHTS, real_time_priority=True, locked_memory=True))


@pytest.mark.parametrize(
    ("used", "said"),
    [
        ((), "no real-time priority, no locked memory: "),
        (("SCHED_FIFO 20",), "real-time priority, no locked memory: "),
        (("memory locked",), "no real-time priority, locked memory: "),
    ],
)
def test_a_right_that_is_missing_is_a_warning(
    used: tuple[str, ...], said: str, login: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    finding = on_computer(*used, monkeypatch=monkeypatch)
    assert finding.verdict is Verdict.WARNING
    assert finding.text.startswith(said)
    assert "limits.d" in finding.text


def test_the_commands_say_it(quadctl: Callable[..., Result], login: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    flight = ("fly", "short_hop", "--link", f"serial://{login.parent}/tty:921600")
    on_computer("SCHED_FIFO 20", "memory locked", monkeypatch=monkeypatch)
    shown = quadctl("check", "short_hop").out.splitlines()
    assert ["ok", "computer", "real-time priority, locked memory"] in [
        re.split(r"  +", line.rstrip()) for line in shown
    ]
    assert "computer" not in quadctl(*flight).out
    on_computer("SCHED_FIFO 20", monkeypatch=monkeypatch)
    assert "warning  computer     real-time priority, no locked memory: " in quadctl("check", "short_hop").out
    assert "warning: computer: real-time priority, no locked memory: " in quadctl(*flight).out


def test_the_line_is_the_one_for_where_it_runs(login: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert computer.remedy() == computer.LOGIN
    login.write_text("0::/user.slice/user-1000.slice/user@1000.service/app.slice/terminal.service\n")
    assert computer.remedy() == computer.LOGIN
    login.write_text("0::/system.slice/system-quadctl.slice/quadctl@short_hop.service\n")
    assert computer.remedy() == computer.SERVICE
    (login.parent / "mark").touch()
    assert computer.remedy() == computer.CONTAINER
    monkeypatch.setattr(sys, "platform", "darwin")
    assert computer.remedy() == "Linux gives both"


def test_the_line_for_a_login_writes_limits(login: Path, tmp_path: Path) -> None:
    command = re.findall(r"`(.*?)`", computer.remedy())[0]
    limits = tmp_path / "quadctl.conf"
    command = command.replace("sudo tee /etc/security/limits.d/quadctl.conf", f"tee {limits}")
    subprocess.run(["bash", "-c", command], env={**os.environ, "USER": "pi"}, check=True, capture_output=True)
    assert limits.read_text() == "pi - rtprio 20\npi - memlock unlimited\n"


def as_nobody(rtprio: int, memlock: int) -> str:
    """The check's words to an ordinary user with these limits, whom only root can become."""
    program = (
        "import os, resource\n"
        "import quadctl.flight.preflight.computer as computer\n"
        f"resource.setrlimit(resource.RLIMIT_RTPRIO, ({rtprio},) * 2)\n"
        f"resource.setrlimit(resource.RLIMIT_MEMLOCK, ({memlock},) * 2)\n"
        f"os.setgroups([]); os.setgid({NOBODY}); os.setuid({NOBODY})\n"
        "print(computer.check_computer().text)\n"
    )
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=False)
    if "not allowed to raise maximum limit" in done.stderr:
        pytest.skip("limits cannot be raised here")
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can become somebody else")
class TestAnOrdinaryUser:
    """A capability (`--cap-add`, root's own before the change of user) does not reach a process without root."""

    def test_has_no_rights_without_limits(self) -> None:
        assert as_nobody(0, 65536).startswith("no real-time priority, no locked memory: ")

    def test_has_both_by_limits(self) -> None:
        assert as_nobody(20, resource.RLIM_INFINITY) == "real-time priority, locked memory\n"
