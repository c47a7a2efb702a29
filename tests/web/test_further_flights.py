"""Flights that come to a fitted model, in headless Chromium: on a desk, light, and on a telephone, dark.

Screenshots go to build/screenshots.
"""

import re
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import polars as pl
import psutil
import pytest

from tests.support.lab_pages import served, stand_on
from tests.support.lab_sessions import flown_and_searched, fly_over_a_cushion, one_step_up
from tests.support.visitors import PATIENCE_MS, SCREENS, Browser, Visitor, expect, needs_chromium

pytestmark = [needs_chromium, pytest.mark.long]

FITTED = "refitted"
"""Step of the model sequence whose model is fitted to the first flight."""
INTERVAL = re.compile(r"(-?[\d.]+(?:e-?\d+)?) ?\S* \[(\S+), (\S+)\]")


@pytest.fixture(scope="module")
def session(shared: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session with the flight that the model is fitted to, searched."""
    path = tmp_path_factory.mktemp("searched") / "one.lab.yaml"
    path.write_text(flown_and_searched(shared)[1], encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def lab(session: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """The address of a lab with that flight, and its process."""
    where = tmp_path_factory.mktemp("fitted")
    with served(where / "lab", "--session", str(one_step_up(session))) as at:
        yield at


at_the_desk = pytest.mark.parametrize("stays", SCREENS[:1], indirect=True)
"""For what does not depend on the screen."""


@pytest.fixture(scope="module", params=SCREENS)
def stays(
    request: pytest.FixtureRequest, browser: Browser, lab: tuple[str, subprocess.Popen[bytes]]
) -> Iterator[Visitor]:
    visitor = Visitor(browser, lab[0], *request.param)
    stand_on(visitor, "+ ground effect")
    visitor.press(".stack button:has-text('Refit')")
    visitor.sees(f".step.here .step-name:has-text('{FITTED}')")
    yield visitor
    visitor.leaves()


@pytest.fixture
def visitor(stays: Visitor) -> Iterator[Visitor]:
    stays.begins_again()
    stand_on(stays, FITTED)
    yield stays
    stays.has_no_complaint()


@contextmanager
def held_up(process: subprocess.Popen[bytes]) -> Iterator[None]:
    """Nothing is computed, as if it took long; the page itself answers."""
    workers = psutil.Process(process.pid).children(recursive=True)
    for worker in workers:
        worker.suspend()
    try:
        yield
    finally:
        for worker in workers:
            worker.resume()


@pytest.fixture(scope="module")
def others(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two other flights of the same vehicle over the same ground."""
    where = tmp_path_factory.mktemp("others")
    return [fly_over_a_cushion(where, f"{name}.csv", seed) for name, seed in (("second", 2), ("third", 3))]


def without_rotor_speeds(log: Path, name: str) -> Path:
    path = log.with_name(name)
    pl.read_csv(log, infer_schema_length=None).select(pl.exclude("^motor.*$")).write_csv(path)
    return path


def leave_out(visitor: Visitor, name: str) -> None:
    visitor.waits_until_done()
    visitor.click(f"button[aria-label='Leave out {name}']")
    expect(visitor.page.locator(f"[data-log='{name}']")).to_have_count(0, timeout=PATIENCE_MS)
    visitor.waits_until_done()


def numbers_in(text: str, pattern: str) -> list[float]:
    return [float(number) for number in re.findall(pattern, text)]


@at_the_desk
def test_the_model_has_one_error(visitor: Visitor) -> None:
    for step in ("rigid body", FITTED):
        stand_on(visitor, step)
        now = visitor.error_now()
        assert numbers_in(visitor.sees(".sequence"), r"error of the model \(RMSE\): ([\d.]+) m/s²") == [now]
        assert float(visitor.sees(".step.here .step-value")) == now
        assert numbers_in(visitor.sees(".part-overview"), r"Error, all axes: ([\d.]+) m/s²") == [now]
    visitor.click("[role=tab]:has-text('Where it fails')")
    visitor.sees("h2:has-text('On the flight path')")
    assert float(visitor.sees("#error-now")) == now
    visitor.keeps("one-error")


@at_the_desk
def test_every_parameter_lies_in_its_interval(visitor: Visitor) -> None:
    stack = visitor.sees(".stack")
    stand_on(visitor, "rigid body")
    card = visitor.sees(".candidate.primary")
    for text in (stack, card):
        found = [tuple(map(float, numbers)) for numbers in INTERVAL.findall(text)]
        assert len(found) == 2  # a and b
        assert all(low <= value <= high for value, low, high in found)


@at_the_desk
def test_a_flight_that_was_not_in_the_fit_is_named_with_its_error_and_a_refit_is_offered(
    visitor: Visitor, others: list[Path]
) -> None:
    visitor.click("[role=tab]:has-text('Flights')")
    visitor.drops(others[0])
    assert "The model is fitted to flight.csv only, not to second.csv." in visitor.sees("#fitted-to")
    for flight in ("flight.csv", "second.csv"):
        assert re.search(r"0\.\d+", visitor.sees(f".by-flight tr:has-text('{flight}')"))
    visitor.waits_until_done()
    visitor.page.evaluate("scrollTo(0, 0)")
    visitor.keeps("not-in-the-fit")
    visitor.press("#fitted-to button:has-text('Refit to all flights')")
    expect(visitor.page.locator("#fitted-to")).to_have_count(0, timeout=PATIENCE_MS)
    leave_out(visitor, "second.csv")
    visitor.press("button[aria-label='Undo']")  # the refit
    visitor.sees(f".step.here .step-name:has-text('{FITTED}')")


@pytest.mark.parametrize("answer", ["Use it anyway", "Leave it out"])
def test_a_log_that_seems_to_be_of_another_vehicle_is_asked_about_before_it_is_used(
    visitor: Visitor, others: list[Path], answer: str
) -> None:
    error = visitor.error_now()
    visitor.click("[role=tab]:has-text('Flights')")
    visitor.drops(without_rotor_speeds(others[0], "by_command.csv"))
    assert "The thrust of this flight is from" in visitor.sees("#doubt")
    asked = visitor.page.locator("[data-log='by_command.csv']")
    expect(asked.locator(".good")).to_have_count(0)
    expect(asked.locator(".warn")).to_be_visible()
    visitor.waits_until_done()
    assert visitor.error_now() == error
    visitor.keeps("another-vehicle")
    visitor.press(f"#doubt button:has-text('{answer}')")
    expect(visitor.page.locator("#doubt")).to_have_count(0, timeout=PATIENCE_MS)
    if answer == "Use it anyway":
        visitor.sees("[data-log='by_command.csv'] .good")
        leave_out(visitor, "by_command.csv")
    expect(asked).to_have_count(0)
    assert visitor.error_now() == error


def test_files_that_are_dropped_while_something_is_computed_wait_for_it(
    visitor: Visitor, lab: tuple[str, subprocess.Popen[bytes]], others: list[Path]
) -> None:
    visitor.click("[role=tab]:has-text('Flights')")
    visitor.sees("text=Drop flight logs here")
    with held_up(lab[1]):
        visitor.page.keyboard.press("r")
        visitor.sees(".banner.work:has-text('Refitting')")
        visitor.drops(*others)
        visitor.sees(".banner:has-text('Next: second.csv and third.csv.')")
        expect(visitor.page.locator(".banner.work button:has-text('Cancel')")).to_be_in_viewport(ratio=1.0)
        visitor.keeps("waiting")
    for path in others:
        visitor.sees(f"[data-log='{path.name}'] .good")
    expect(visitor.page.locator(".banner:has-text('Next:')")).to_have_count(0)
    for path in others:
        leave_out(visitor, path.name)
