"""Real time, over MAVLink, through MAVSDK: one flight, and the command when it is interrupted."""

import gc
import io
import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from rich.console import Console

from quadctl.flight.preflight.preparation import prepare_flight
from quadctl.flight.realtime import privileges
from quadctl.flight.session import fly_real_time
from quadctl.logs.read import read_log
from quadctl.sitl.run import mock_process
from studies.faults.witness import Witness
from tests.support.configurations import CONFIG, configuration, forgiving_config
from tests.support.places import ROOT

pytestmark = pytest.mark.realtime

TIMEOUT_S = 90.0


def meta_of(log: Path) -> dict[str, Any]:
    loaded: dict[str, Any] = yaml.safe_load(log.with_suffix(".meta.yaml").read_text())
    return loaded


def test_a_short_hop_in_real_time(tmp_path: Path, machine: Witness) -> None:
    plan = prepare_flight(ROOT / "tests" / "support" / "hop.yaml", CONFIG, None, None)
    with mock_process(plan.body.vehicle, None, 1) as url:
        told = io.StringIO()
        outcome = fly_real_time(plan, url, tmp_path, Console(file=told))
    assert outcome.completed, outcome.ended
    assert outcome.phases == ["takeoff", "hover", "down"]
    assert outcome.problem is None
    # What the autopilot does when we fall silent is asked before anything is armed.
    assert (
        "warning: parameters: RTL_RETURN_ALT: a return climbs to up to 30 m first: there is a ceiling at"
        in told.getvalue()
    )
    log = read_log(outcome.log)
    assert log.notes == []
    assert log.phase is not None
    stages = [stage for stage in dict.fromkeys(log.phase.tolist()) if stage != "wait"]
    assert stages == ["stream", "start", "spool_up", *outcome.phases, "land", "done"]
    flying = np.isin(log.phase, outcome.phases)
    for rotor in range(1, 5):
        assert (log[f"motor{rotor}_rpm"][flying] > 900.0).all()
    t = log.time_s[flying]
    assert t[-1] - t[0] == pytest.approx(plan.mission.duration_s, abs=0.3)
    ticks = 50.0 * (t[-1] - t[0]) + 1
    # While the machine itself stood still there were none: they are given up, not caught up.
    assert 0.98 * ticks - 50.0 * machine.lost_s <= len(t) <= 1.02 * ticks
    # Those that there are, are on the beat.
    periods = 50.0 * np.diff(t - log["tick_late_s"][flying])
    assert np.median(periods) == pytest.approx(1.0, abs=0.01)
    assert np.mean(np.abs(periods - np.round(periods)) > 0.1) < 0.02
    hover_end = np.flatnonzero(log.phase == "hover")[-1]
    assert log["z_m"][hover_end] == pytest.approx(0.6, abs=0.05)
    # The model is watched behind the setpoints: from the second tick off the ground on, and not after the mission.
    known = np.isfinite(log["residual_up_m_s2"])
    assert known[log.phase == "hover"].mean() > 0.98
    assert not known[~flying].any()
    assert np.abs(log["residual_north_m_s2"][log.phase == "hover"]).max() < 0.5
    # Landed, and disarmed: otherwise the flight would not have ended as completed.
    assert log["z_m"][-1] == pytest.approx(0.05, abs=0.01)
    assert log["motor1_rpm"][-1] < 1000.0
    assert np.isnan(log["throttle_cmd"][log.phase == "done"]).all()
    meta = meta_of(Path(outcome.log))
    assert (meta["mission"], meta["ended"]) == ("hop", "completed")
    assert "PX4" in meta["autopilot"]
    assert "select" in meta["real_time"]
    assert [event["answer"] for event in meta["events"] if event["answer"]] == ["land"]


def test_what_keeps_the_ticks_punctual_is_told_and_undone() -> None:
    def settings() -> tuple[object, ...]:
        return os.sched_getscheduler(0), sys.getswitchinterval(), gc.get_freeze_count()

    before = settings()
    with privileges() as used:
        assert gc.get_freeze_count() > 0
        assert sys.getswitchinterval() < before[1]  # type: ignore[operator]
        assert ("SCHED_FIFO 20" in used) == (os.sched_getscheduler(0) == os.SCHED_FIFO)
    assert settings() == before


def test_the_processor_is_kept_awake_for_as_long_as_the_flight_lasts(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """The kernel takes the int32 0 for "no idle state" until the file is closed."""
    interface = tmp_path / "cpu_dma_latency"
    interface.touch()
    monkeypatch.setattr("quadctl.flight.realtime.IDLE_STATES", interface)

    def is_open() -> bool:
        return str(interface) in {os.path.realpath(link) for link in Path("/proc/self/fd").iterdir()}

    with privileges() as used:
        assert "processor kept awake" in used
        assert is_open() and interface.read_bytes() == bytes(4)
    assert not is_open()


def test_what_is_not_permitted_is_done_without_and_not_claimed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    monkeypatch.setattr("quadctl.flight.realtime._memory_locked", lambda: False)
    monkeypatch.setattr("quadctl.flight.realtime.IDLE_STATES", tmp_path / "not there")
    with privileges() as used:
        assert used == ("select", "switch interval 0.5 ms", "gc frozen")


@dataclass
class Flight:
    """`quadctl fly --sitl` in a process of its own."""

    process: subprocess.Popen[str]
    where: Path

    def until(self, condition: Callable[[], bool]) -> None:
        """Wait for what the process does to its files."""
        end_s = time.monotonic() + TIMEOUT_S
        while not condition():
            assert self.process.poll() is None, self.process.communicate()
            assert time.monotonic() < end_s, "it takes too long"
            time.sleep(0.05)

    @property
    def in_hover(self) -> bool:
        return any(",hover\n" in path.read_text() for path in self.where.glob("*.csv"))


def quadctl(where: Path, *words: str) -> Flight:
    code = "from quadctl.cli import main; main()"
    process = subprocess.Popen(
        [sys.executable, "-c", code, *words, "--log-dir", str(where), "--json", str(where / "out.json")],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    return Flight(process, where)


SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@pytest.fixture(scope="module")
def interrupted(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[signal.Signals, Flight]]:
    """A flight for each signal, all at the same time, because they take real time."""
    flights = {}
    for s in SIGNALS:
        where = tmp_path_factory.mktemp(s.name)
        config = str(forgiving_config(where))
        flights[s] = quadctl(where, "fly", "tests/support/hop.yaml", "--sitl", "--config", config)
    yield flights
    for flight in flights.values():
        flight.process.kill()
        flight.process.communicate()


def test_a_flight_that_is_interrupted_lands(interrupted: dict[signal.Signals, Flight]) -> None:
    for number, flight in interrupted.items():
        flight.until(lambda f=flight: f.in_hover)  # type: ignore[misc]
        flight.process.send_signal(number)
    for number, flight in interrupted.items():
        out, err = flight.process.communicate(timeout=TIMEOUT_S)
        reason = f"asked to land by {number.name}"
        assert flight.process.returncode == 1
        assert err == f"quadctl: the flight was not completed: {reason}\n"
        assert "Traceback" not in out
        (path,) = flight.where.glob("*.csv")
        log = read_log(path)
        assert log.notes == []  # no damaged line
        assert log.phase is not None
        stages = [stage for stage in dict.fromkeys(log.phase.tolist()) if stage != "wait"]
        assert stages == ["stream", "start", "spool_up", "takeoff", "hover", "land", "done"]
        assert log["z_m"][-1] == pytest.approx(0.05, abs=0.01)
        assert meta_of(path)["ended"] == reason
        result = json.loads((flight.where / "out.json").read_text())
        assert (result["completed"], result["ended"], result["log"]) == (False, reason, str(path))
        assert result["ticks"] == len(log)


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def test_a_link_where_nobody_answers_is_one_sentence(tmp_path: Path) -> None:
    url = f"udpin://127.0.0.1:{free_port()}"
    config = str(configuration(tmp_path, link={"timeout_s": 0.5}))
    flight = quadctl(tmp_path, "fly", "missions/short_hop.yaml", "--link", url, "--config", config)
    out, err = flight.process.communicate(timeout=TIMEOUT_S)
    assert flight.process.returncode == 1
    assert err.startswith(f"quadctl: No autopilot answers at {url} within 0.5 s: ")
    assert err.count("\n") == 1
    assert "Traceback" not in out
    assert not list(tmp_path.glob("*.csv"))


def test_ctrl_c_before_the_flight_is_one_sentence(tmp_path: Path) -> None:
    """Asyncio's own answer to Ctrl-C, delivered as soon as the link is open and waits for an autopilot."""
    url = f"udpin://127.0.0.1:{free_port()}"
    config = str(configuration(tmp_path, link={"timeout_s": 60.0}))
    code = (
        "import asyncio, os, signal\n"
        "import quadctl.flight.autopilot.mavsdk_link as link\n"
        "wait = link._first_autopilot\n"
        "async def interrupted(*a):\n"
        "    asyncio.get_running_loop().call_later(0.1, os.kill, os.getpid(), signal.SIGINT)\n"
        "    return await wait(*a)\n"
        "link._first_autopilot = interrupted\n"
        "from quadctl.cli import main; main()"
    )
    words = ["fly", "missions/short_hop.yaml", "--link", url, "--config", config, "--log-dir", str(tmp_path)]
    done = subprocess.run(
        [sys.executable, "-c", code, *words], cwd=ROOT, capture_output=True, text=True, check=False, timeout=TIMEOUT_S
    )
    assert done.returncode == 1
    assert done.stderr.startswith("quadctl: interrupted while the link was being opened")
    assert done.stderr.count("\n") == 1


def test_a_link_that_is_none_is_one_sentence(tmp_path: Path) -> None:
    flight = quadctl(tmp_path, "fly", "missions/short_hop.yaml", "--link", "udpin://:14540")
    _, err = flight.process.communicate(timeout=TIMEOUT_S)
    assert flight.process.returncode == 1
    assert err.startswith("quadctl: The link 'udpin://:14540' is not one that can be opened: expected udpin://")
    assert err.count("\n") == 1
