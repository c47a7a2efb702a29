"""The page in a real browser (headless Chromium): the newcomer's path, click by click, and what goes wrong on it.

Screenshots go to build/screenshots. Times are printed, not judged: they say as much about the machine.
"""

import os
import re
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import yaml

from quadctl.flight.session import prepare_flight
from quadctl.model import load_model
from sitl.run import simulate
from visitors import (
    DESK,
    PATIENCE_MS,
    PHONE,
    ROOT,
    Browser,
    Visitor,
    command,
    expect,
    free_tcp_port,
    needs_chromium,
    status,
)

pytestmark = needs_chromium

HOVERING = ROOT.parent / "shared" / "data" / "raptor" / "HOVERING.csv"
MOST_CLICKS = 10
CUSHION = {"effects": [{"effect": "hidden.ground_cushion", "parameters": {"gain": 0.25, "width": 1.8}}]}
STAIRCASE = {
    "name": "short_staircase",
    "phases": [
        {"name": "takeoff", "kind": "move", "to_m": [0, 0, 0.9], "speed_m_s": 0.5},
        {"name": "down", "kind": "staircase", "to_z_m": 0.1, "step_m": 0.1, "hold_s": 3},
        {"name": "up", "kind": "staircase", "to_z_m": 0.9, "step_m": 0.1, "hold_s": 3},
    ],
    "limits": {"min_z_m": 0.08, "max_z_m": 1.2, "max_distance_m": 1.0, "max_duration_s": 120},
}


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log of a flight over a ground whose cushion is in no catalogue; the truth is beside it."""
    where = tmp_path_factory.mktemp("flown")
    mission, hidden = where / "short_staircase.yaml", where / "hidden.yaml"
    mission.write_text(yaml.safe_dump(STAIRCASE))
    hidden.write_text(yaml.safe_dump(CUSHION))
    outcome = simulate(prepare_flight(mission, ROOT / "config" / "flight.yaml", "none", None), where, hidden, 1)
    return Path(shutil.move(outcome.log, where / "flight.csv"))


@contextmanager
def served(out: Path, *arguments: str) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """The lab's address, and the process that serves it."""
    port = free_tcp_port()
    options = ["--no-open", "--port", str(port), "--out", str(out)]
    with command(port, out.parent / f"{out.name}.log", "lab", *arguments, *options) as process:
        yield f"http://127.0.0.1:{port}", process


def test_a_newcomer_finds_the_missing_effect_and_flies_it_in_at_most_ten_clicks(
    browser: Browser, flown: Path, tmp_path: Path
) -> None:
    with served(tmp_path / "lab", "--hidden", str(flown.with_name("hidden.yaml"))) as (url, _):
        visitor = Visitor(browser, url)
        visitor.sees("text=Drop flight logs here")
        visitor.keeps("1-start")
        visitor.clicks += 1  # choosing the file
        visitor.drops(flown)

        assert "ground effect" in visitor.sees("#verdict[data-verdict=missing]")
        before = visitor.error_now()
        visitor.keeps("2-missing")
        visitor.press("button[aria-label^='Add ground_effect']")
        after = visitor.waits_for_less_than(0.5 * before)
        assert "Nothing significant is missing" in visitor.sees("#verdict[data-verdict=none]")
        visitor.keeps("3-added")

        visitor.click("[role=tab]:has-text('Compensator')")
        visitor.sees("text=The check finds nothing against flying it")
        with visitor.page.expect_download() as download:
            visitor.click("main button:has-text('Export model')")
        exported = tmp_path / "exported.yaml"
        download.value.save_as(exported)
        (effect,) = load_model(exported).effects
        assert effect.family() == "ground_effect"
        visitor.keeps("4-compensator")

        visitor.click("button:has-text('Fly it in simulation')")
        row = visitor.sees("table.metrics tr:has-text('M_B, absolute')")
        without, compensated = (float(number) for number in re.findall(r"\d\.\d+", row)[:2])
        assert compensated < 0.5 * without
        visitor.page.locator("table.metrics").scroll_into_view_if_needed()
        visitor.keeps("5-flown")

        assert visitor.clicks <= MOST_CLICKS
        print(f"\n{visitor.clicks} clicks; error {before:g} -> {after:g} m/s^2; M_B {without:g} -> {compensated:g} m s")
        visitor.leaves()


def test_two_tabs_show_the_same_and_a_reload_or_a_new_start_loses_nothing(
    browser: Browser, flown: Path, tmp_path: Path
) -> None:
    with served(tmp_path / "lab", str(flown)) as (url, process):
        one, other = Visitor(browser, url), Visitor(browser, url, PHONE, "dark")
        one.sees("#verdict[data-verdict=missing]")
        before = other.error_now()
        one.click("button[aria-label^='Add ground_effect']")
        after = other.waits_for_less_than(0.5 * before)
        other.keeps("phone-missing")
        other.click(".step-button:has-text('rigid body')")
        expect(one.page.locator("#error-now")).to_have_text(f"{before:#.3g}", timeout=PATIENCE_MS)
        one.click(".step-button:has-text('ground_effect')")
        one.waits_for_less_than(before)
        one.page.reload()
        assert one.error_now() == after
        process.send_signal(signal.SIGINT)
        process.wait(30.0)
        one.sees("text=Connection lost")
        one.page.context.close()
        other.page.context.close()
    with served(tmp_path / "lab", "--session", str(tmp_path / "lab" / "session.lab.yaml")) as (url, _):
        again = Visitor(browser, url)
        assert again.error_now() == after
        again.leaves()


def test_what_goes_wrong_is_said_in_a_sentence_and_costs_nothing(browser: Browser, flown: Path, tmp_path: Path) -> None:
    garbage, picture, huge = tmp_path / "garbage.csv", tmp_path / "picture.png", tmp_path / "huge.csv"
    garbage.write_text("this,is\nno,log\n")
    picture.write_bytes(b"\x89PNG")
    with huge.open("wb") as file:
        file.truncate(2**30)
    outside = tmp_path / "outside.yaml"
    outside.write_text("logs: [/etc/passwd]\nrungs: []\n")
    with served(tmp_path / "lab", str(flown)) as (url, _):
        visitor = Visitor(browser, url)
        assert status(url, Host="elsewhere.example") == 400
        assert status(url, **{"Content-Length": str(2**30)}) == 413
        visitor.sees("text=Looking for what is missing")
        visitor.click("main button:has-text('Cancel')")
        visitor.sees("button:has-text('Look for what is missing')")
        visitor.click("[role=tab]:has-text('Flights')")
        for path, said in (
            (garbage, "garbage.csv"),
            (picture, "is no flight log by its name"),
            (huge, "expected at most"),
            (outside, "is outside"),
        ):
            visitor.drops(path)
            expect(visitor.page.locator("[role=alert]")).to_contain_text(said, timeout=PATIENCE_MS)
        visitor.keeps("error")
        visitor.click("button[aria-label='Leave out garbage.csv']")
        expect(visitor.page.locator("[data-log='garbage.csv']")).to_have_count(0, timeout=PATIENCE_MS)
        assert visitor.error_now() > 0.0
        visitor.leaves()


@pytest.mark.skipif(not HOVERING.is_file(), reason="the thesis' flights are not here")
def test_how_fast_the_page_is_on_a_real_flight(browser: Browser, tmp_path: Path) -> None:
    with served(tmp_path / "lab", str(HOVERING)) as (url, _):
        Visitor(browser, url).sees("#verdict")  # the browser has loaded its libraries, the lab its own
        began = time.perf_counter()
        visitor = Visitor(browser, url)
        visitor.sees(".js-plotly-plot .main-svg")
        first_plot_s = time.perf_counter() - began
        visitor.sees("#verdict")
        error = visitor.error_now()
        began = time.perf_counter()
        visitor.click(".candidate.primary button")
        visitor.waits_for_less_than(error)
        added_s = time.perf_counter() - began
        zoom_s = visitor.page.evaluate(_ZOOM) / 1000.0
        print(f"\nHOVERING.csv: first plot {first_plot_s:.2f} s, Add {added_s:.2f} s, zoom {zoom_s:.3f} s")
        visitor.leaves()


@pytest.mark.skipif("SCREENSHOTS" not in os.environ, reason="`make screenshots` takes them")
@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("size", ["desk", "phone"])
def test_pictures_of_every_part(browser: Browser, flown: Path, tmp_path: Path, size: str, theme: str) -> None:
    with served(tmp_path / "lab", str(flown), "--hidden", str(flown.with_name("hidden.yaml"))) as (url, _):
        visitor = Visitor(browser, url, DESK if size == "desk" else PHONE, theme)
        visitor.sees("#verdict[data-verdict=missing]")
        visitor.keeps(f"{size}-{theme}-missing")
        visitor.page.locator(".candidate.primary").scroll_into_view_if_needed()
        visitor.keeps(f"{size}-{theme}-candidate")
        visitor.click("button[aria-label^='Add ground_effect']")
        visitor.sees("#verdict[data-verdict=none]")
        for part, shown in (
            ("Over time", "h2:has-text('way through space')"),
            ("Where it fails", "h2:has-text('On the way')"),
            ("Compensator", "text=The check finds nothing against"),
            ("Flights", "h2:has-text('Vehicle')"),
        ):
            visitor.click(f"[role=tab]:has-text('{part}')")
            visitor.sees(shown)
            visitor.page.wait_for_timeout(1500)  # figures are drawn after they are there
            visitor.keeps(f"{size}-{theme}-{part.lower().replace(' ', '-')}")
            visitor.page.mouse.wheel(0, 900)
            visitor.page.wait_for_timeout(500)
            visitor.keeps(f"{size}-{theme}-{part.lower().replace(' ', '-')}-below")
        visitor.leaves()


_ZOOM = """async () => {
  const plot = document.querySelector('.js-plotly-plot');
  const began = performance.now();
  await new Promise(done => {
    plot.on('plotly_restyle', done);
    plot.layout.xaxis.range = [40, 60];
    plot.emit('plotly_relayout', {'xaxis.range[0]': 40, 'xaxis.range[1]': 60});
  });
  return performance.now() - began;
}"""
