"""Fixtures and rules of all tests."""

import functools
import gc
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

from quadctl.cli import main
from quadctl.cli.app import console
from quadctl.logs.flight_log import FlightLog
from quadctl.model import Model
from quadctl.vehicle import Vehicle, load_vehicle
from studies.faults.witness import Witness
from tests.support.commands import Result
from tests.support.flights import CUSHION, flown_once
from tests.support.places import NO_CHROMIUM, ROOT

pytest.register_assert_rewrite("watched", "log_files")

# No deadline: how long one example takes says more about the machine than about the code.
settings.register_profile("quadctl", deadline=None, max_examples=40)
settings.load_profile("quadctl")

# A shell starts what runs in the background deaf to Ctrl-C, and so would be the commands that tests interrupt.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


AGAIN = 4
"""Runs of a test in real time after the first, each for a machine that stood still."""


@functools.cache
def witness() -> Witness:
    return Witness()


LONG = (
    *("test_link_delay", "test_autopilots", "test_faults", "test_texts", "test_full_actuation", "test_sitl_commands"),
    *("test_view_page", "test_analysed_flight", "test_lab_page", "test_further_flights", "test_lab", "test_report"),
    *("test_panels", "test_fitter", "test_rotation", "test_dynamics", "test_cli", "test_forecast", "test_ground_curve"),
)
"""Files that take longest: they begin first, lest one of them alone keeps all others waiting at the end."""


def _place(item: pytest.Item) -> tuple[bool, int]:
    """Place in the order of all tests. Long ones of pages come last: CI begins with flights beside, which are above all
    else in priority, and a page that waits for its processor does not answer in time."""
    is_page = item.path.parent.name == "web" and item.get_closest_marker("long") is not None
    return is_page, LONG.index(item.path.stem) if item.path.stem in LONG else len(LONG)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    items.sort(key=_place)
    again = pytest.mark.flaky(reruns=AGAIN, condition=lambda: witness().stood_still())
    for item in items:
        if item.get_closest_marker("realtime"):
            item.add_marker(again)


def pytest_collection_finish() -> None:
    gc.collect()
    gc.freeze()  # what has been imported stays, and no later collection goes over it again


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    left_out = [report for report in terminalreporter.stats.get("skipped", []) if NO_CHROMIUM in str(report.longrepr)]
    if left_out:
        how = "put `chromium` on the PATH (Debian and Ubuntu: apt-get install chromium fonts-dejavu-core)"
        terminalreporter.write_line(f"Left out: {len(left_out)} tests of pages, as {NO_CHROMIUM}. To have them, {how}.")


@pytest.fixture(autouse=True)
def machine(request: pytest.FixtureRequest) -> Witness | None:
    """A witness of what the machine does while a test in real time runs."""
    if not request.node.get_closest_marker("realtime"):
        return None
    witness().forget()
    return witness()


@pytest.fixture(scope="session")
def raptor_path() -> Path:
    return ROOT / "config" / "vehicles" / "raptor.yaml"


@pytest.fixture(scope="session")
def raptor(raptor_path: Path) -> Vehicle:
    """1.5 kg, four upright rotors of 0.12 m radius at (+-0.124, +-0.124) m, 1.205 kg/m^3."""
    return load_vehicle(raptor_path)


@pytest.fixture(scope="session")
def rigid(raptor: Vehicle) -> Model:
    return Model(raptor)


@pytest.fixture(scope="session")
def shared(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Path:
    """Folder that all processes of a test run share."""
    own = tmp_path_factory.getbasetemp()
    return (own if worker_id == "master" else own.parent) / "shared"


@pytest.fixture(scope="session")
def staircases(shared: Path) -> list[FlightLog]:
    """Two hover staircases over a ground whose cushion is not in the catalogue."""
    return [flown_once("hover_staircase", [CUSHION], seed, shared) for seed in (1, 2)]


@pytest.fixture(scope="session")
def plain_runs(shared: Path) -> list[FlightLog]:
    """Runs forward and up and down, where no effect is hidden."""
    return [flown_once(mission, [], 3, shared) for mission in ("forward_runs", "vertical_runs")]


@pytest.fixture
def quadctl(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., Result]:
    """Function that runs a command in the repository's directory, on a terminal of 130 columns."""
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(console, "_width", 130)  # whatever the terminal was when the console was made

    def run(*arguments: object) -> Result:
        monkeypatch.setattr(sys, "argv", ["quadctl", *map(str, arguments)])
        capsys.readouterr()
        with pytest.raises(SystemExit) as ended:
            main()
        out, err = capsys.readouterr()
        return Result(int(ended.value.code or 0), out, err)

    return run


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Headless Chromium, driven by Playwright."""
    from playwright.sync_api import sync_playwright

    from tests.support.visitors import CHROMIUM

    with sync_playwright() as playwright:
        launched = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield launched
        launched.close()
