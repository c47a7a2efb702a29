"""The page in a real browser (headless Chromium): the newcomer's path, click by click, and what goes wrong on it.

Screenshots go to build/screenshots. Times are printed, not judged: they say as much about the machine.
"""

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import polars as pl
import pytest

from quadctl.effects.ground_effect import Exponential
from quadctl.model import load_model
from quadctl.web.figures.downsample import POINTS
from tests.support.flights import obedient
from tests.support.lab_pages import CUT, PARTS, served, stand_on
from tests.support.lab_sessions import ADDED, VEHICLE, flown_and_searched, one_step_up, unexplained
from tests.support.other_site import attacking
from tests.support.visitors import (
    DESK,
    PATIENCE_MS,
    PHONE,
    ROOT,
    Browser,
    Screen,
    Visitor,
    expect,
    free_tcp_port,
    is_kept_out,
    needs_chromium,
    on_each_screen,
    own_environment,
    status,
)

pytestmark = needs_chromium

HOVERING = ROOT.parent / "shared" / "data" / "raptor" / "HOVERING.csv"
REAL_PX4 = ROOT.parent / "shared" / "data" / "real" / "px4"
MOST_CLICKS = 10


@pytest.fixture(scope="module")
def flown(shared: Path) -> Path:
    return flown_and_searched(shared)[0]


@pytest.fixture(scope="module")
def session(shared: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("searched") / "one.lab.yaml"
    path.write_text(flown_and_searched(shared)[1], encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def empty(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a lab for tests that begin without a flight: to serve it takes as long as most of what they do."""
    with served(tmp_path_factory.mktemp("empty") / "lab") as (url, _):
        yield url


def at_the_start(browser: Browser, url: str, screen: Screen = (DESK, "light")) -> Visitor:
    """A visitor before a page without a flight."""
    visitor = Visitor(browser, url, *screen)
    visitor.sees(".lab")
    if visitor.page.locator("button[aria-label='New session']").count():
        visitor.click("button[aria-label='New session']")
    visitor.sees("text=Find what your flight model is missing")
    visitor.waits_until_done()
    return visitor


@pytest.mark.long
def test_another_site_can_neither_frame_it_nor_talk_to_it(browser: Browser, empty: str) -> None:
    with attacking(empty) as site:
        assert is_kept_out(browser, site)
    at_the_start(browser, empty).leaves()


@pytest.mark.long
@on_each_screen
def test_a_new_vehicle_is_entered_as_a_few_numbers(browser: Browser, screen: Screen, tmp_path: Path) -> None:
    with served(tmp_path / "lab") as (url, _):
        visitor = Visitor(browser, url, *screen)
        visitor.sees("h2:has-text('Vehicle: raptor')")
        visitor.click("text=A new vehicle")
        visitor.sees("svg[aria-label^='4 rotors']:visible")
        visitor.page.get_by_label("Frame").last.click()
        visitor.click("[role=option]:has-text('hexa-x')")
        visitor.sees("svg[aria-label^='6 rotors']:visible")
        assert not visitor.page.get_by_text("The propellers would touch").last.is_visible()
        visitor.page.get_by_label("Diagonal").last.fill("0.45")
        visitor.sees("text=/The propellers would touch: .* from a diagonal of 0.508 m on/")
        assert visitor.page.locator(".form-fields:visible .q-field__label").evaluate_all(CUT) == []
        visitor.page.get_by_label("Name", exact=True).fill("mine")
        visitor.page.get_by_label("Mass with battery / kg").last.fill("")
        visitor.page.get_by_label("Throttle in hover, 0 to 1").last.fill("2")
        visitor.click("button:has-text('Use this vehicle')")
        visitor.sees("text=expected a number above 0 and below 1000")
        visitor.sees("text=/expected a number above 0 and below 1$/")
        expect(visitor.page.get_by_label("Mass with battery / kg").last).to_be_in_viewport()
        visitor.keeps("new-vehicle-wrong")
        visitor.page.get_by_label("Mass with battery / kg").last.fill("2.5")
        visitor.page.get_by_label("Throttle in hover, 0 to 1").last.fill("0.3")
        visitor.keeps("new-vehicle")
        visitor.click("button:has-text('Use this vehicle')")
        visitor.sees("h2:has-text('Vehicle: mine')")
        visitor.sees(f"p:has-text('{tmp_path / 'lab' / 'vehicles'}')")
        visitor.sees("#own-vehicles button:has-text('mine')")
        visitor.keeps("own-vehicle")
        visitor.click("text=What was entered for mine")
        for label, typed in (("Name", "mine"), ("Throttle in hover, 0 to 1", "0.3")):
            expect(visitor.page.get_by_label(label, exact=True).first).to_have_value(typed)
        visitor.click("text=What was entered for mine")
        visitor.click("text=Its numbers")
        visitor.sees("text=It then hovers at a throttle of 0.3.")
        visitor.page.get_by_label("Mass with battery / kg").nth(1).fill("5")  # the form before it is folded
        hovers = "text=/It then hovers at a throttle of 0.[456]/"  # the line from throttle to thrust stays
        visitor.sees(hovers)
        visitor.click("text=Its numbers")
        expect(visitor.page.locator(hovers)).to_be_hidden()  # while it folds, what is below moves
        visitor.click("text=As a file (YAML)")
        visitor.sees("textarea:visible")
        box = visitor.page.locator("textarea").bounding_box()
        assert box is not None and box["height"] < 500.0
        assert box["width"] > (250.0 if visitor.is_on_phone else 600.0)
        assert "mass_kg: 2.5" in visitor.page.locator("textarea").input_value()
        visitor.leaves()


@pytest.mark.long
def test_files_are_chosen_in_the_window_of_the_browser(browser: Browser, flown: Path, empty: str) -> None:
    visitor = at_the_start(browser, empty)
    with visitor.page.expect_file_chooser() as chosen:
        visitor.click("button:has-text('Choose files')")
    chosen.value.set_files(flown)
    visitor.sees("h2:has-text('measured and predicted')")
    visitor.leaves()


@pytest.mark.long
def test_a_long_log_is_shown_before_it_is_searched_in_as_many_points_as_a_screen_has(
    browser: Browser, empty: str, tmp_path: Path
) -> None:
    long = tmp_path / "long.csv"
    flown = obedient(load_model(VEHICLE).plus(Exponential(a=0.3, b=5.0)), 600.0, noise_m_s=0.01)
    pl.DataFrame(flown.columns).write_csv(long)
    visitor = at_the_start(browser, empty)
    visitor.drops(long)
    visitor.sees(".banner.search")
    figure = visitor.figure("Measured and predicted acceleration over time")
    assert 0 < visitor.points(figure, "measured") < 1.1 * POINTS < 0.1 * len(flown.time_s)
    expect(visitor.page.locator("#verdict")).to_have_count(0)
    visitor.keeps("long-log")
    visitor.click(".banner.search button:has-text('Cancel')")
    visitor.sees("button:has-text('Look for what is missing')")
    visitor.leaves()


@pytest.mark.long
@on_each_screen
def test_without_a_log_a_sample_flight_is_flown_and_a_tap_explains_a_word(
    browser: Browser, screen: Screen, empty: str
) -> None:
    visitor = at_the_start(browser, empty, screen)
    visitor.click("button:has-text('Try a sample flight')")
    visitor.sees(".banner.search")
    visitor.click("button.term:has-text('per-flight bias')")
    assert "fitted to each flight" in visitor.sees("p.meaning")
    visitor.keeps("sample-and-word")
    if visitor.is_on_phone:  # the same search
        visitor.click(".banner.search button:has-text('Cancel')")
        visitor.sees("button:has-text('Look for what is missing')")
    else:
        assert "ground effect" in visitor.sees("#verdict[data-verdict=missing]")
    visitor.leaves()


def test_the_address_is_told_when_it_answers(tmp_path: Path) -> None:
    port = free_tcp_port()
    words = ["lab", "--no-open", "--port", str(port), "--out", str(tmp_path / "lab")]
    with subprocess.Popen(
        [sys.executable, "-c", "from quadctl.cli import main; main()", *words],
        stdout=subprocess.PIPE,
        cwd=ROOT,
        env=own_environment(),
        text=True,
    ) as process:
        assert process.stdout is not None
        try:
            assert any(f"http://127.0.0.1:{port}" in line for line in process.stdout)
            assert status(f"http://127.0.0.1:{port}") == 200
            mapped = Path(f"/proc/{process.pid}/maps").read_text()
            assert "numpy" in mapped and "matplotlib" not in mapped  # a worker draws the report
        finally:
            process.kill()


@pytest.mark.long
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
        visitor.sees("text=is that the vehicle that flew?")  # a question that keeps nobody waiting
        visitor.resizes_a_figure_that_has_left()
        visitor.press("button[aria-label^='Add ground_effect']")
        after = visitor.waits_for_less_than(0.5 * before)
        assert "No missing effect is found" in visitor.sees("#verdict[data-verdict=none]")
        visitor.keeps("3-added")

        visitor.click("[role=tab]:has-text('Compensator')")
        visitor.sees("text=The check accepts it")
        exported = visitor.keeps_file(".main button:has-text('Download model')", tmp_path)
        (effect,) = load_model(exported).effects
        assert effect.family() == "ground_effect"
        assert "saved as raptor_ground_effect.yaml in the downloads folder" in visitor.sees(".banner.done")
        visitor.sees("code:has-text('quadctl compare raptor_ground_effect.yaml LOG')")
        visitor.keeps("exported")
        visitor.page.locator("button[aria-label='Dismiss']").click()
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


@pytest.mark.long
def test_two_tabs_show_the_same_and_neither_a_lost_connection_nor_a_new_start_loses_anything(
    browser: Browser, session: Path, tmp_path: Path
) -> None:
    port = free_tcp_port()
    with served(tmp_path / "lab", "--session", str(session), port=port) as (url, process):
        one, other = Visitor(browser, url), Visitor(browser, url, PHONE, "dark")
        one.sees("header >> text=2 windows")
        before = other.error_now()
        one.click("button[aria-label^='Add ground_effect']")
        after = other.waits_for_less_than(0.5 * before)
        other.keeps("missing")
        other.click(".step-button:has-text('rigid body')")
        expect(one.page.locator("#error-now")).to_have_text(f"{before:#.3g}", timeout=PATIENCE_MS)
        one.click(".step-button:has-text('+ ground effect')")
        one.waits_for_less_than(before)
        one.page.reload()
        assert one.error_now() == after
        one.sees("header >> text=2 windows")
        one.sees("#verdict[data-verdict=none]")
        process.send_signal(signal.SIGINT)
        process.wait(30.0)
        for each, size in ((one, DESK), (other, PHONE)):
            each.sees("text=Connection lost")
            over = each.page.locator("#popup").bounding_box()
            assert over is not None
            assert (over["width"], over["height"]) == pytest.approx((size["width"], size["height"]), abs=2.0)
            each.keeps("connection-lost")
        other.page.context.close()
    with served(tmp_path / "lab", "--session", str(tmp_path / "lab" / "session.lab.yaml"), port=port):
        one.sees("#verdict[data-verdict=none]")  # the same tab, without a hand
        assert one.error_now() == after
        expect(one.page.locator("text=Looking for what is missing")).to_have_count(0)
        expect(one.page.locator("header >> text=windows")).to_have_count(0)
        one.leaves()


@pytest.mark.long
def test_a_new_session_begins_as_a_new_tab_does_and_a_click_leads_back(
    browser: Browser, flown: Path, session: Path, tmp_path: Path
) -> None:
    with served(tmp_path / "lab", "--session", str(session)) as (url, _):
        visitor = Visitor(browser, url, PHONE, "dark")
        error = visitor.error_now()
        visitor.click("[role=tab]:has-text('Flights')")
        visitor.click("button:has-text('New session')")
        visitor.sees("text=Find what your flight model is missing")
        visitor.click("button:has-text('Go back to it')")
        expect(visitor.page.locator("#error-now")).to_have_text(f"{error:#.3g}", timeout=PATIENCE_MS)
        visitor.sees("[role=tab][aria-selected=true]:has-text('What is missing')")
        visitor.waits_until_done()  # until then another session is refused
        visitor.click("button:has-text('New session')")
        visitor.click(f"#earlier button:has-text('{flown.name}') >> nth=0")
        expect(visitor.page.locator("#error-now")).to_have_text(f"{error:#.3g}", timeout=PATIENCE_MS)
        visitor.leaves()


@pytest.mark.long
def test_a_link_leads_to_the_same_state_after_a_new_start_in_the_same_folder(
    browser: Browser, flown: Path, session: Path, tmp_path: Path
) -> None:
    port = free_tcp_port()
    with served(tmp_path / "lab", "--session", str(session), port=port) as (url, _):
        visitor = Visitor(browser, url)
        before = visitor.error_now()
        visitor.click("button[aria-label^='Add ground_effect']")
        after = visitor.waits_for_less_than(0.5 * before)
        visitor.waits_until_done()
        visitor.click("[role=tab]:has-text('Over time')")
        visitor.click("button:has-text('Speed of each motor')")
        visitor.page.wait_for_url("**channels=motor1_rpm**")
        link = visitor.page.url
        visitor.leaves()
    with served(tmp_path / "lab", str(flown), port=port):
        visitor = Visitor(browser, url, PHONE, "dark")
        visitor.page.goto(link)
        visitor.sees(f".step.here:has-text('+ {ADDED.partition('.')[0].replace('_', ' ')}')")
        visitor.sees("[role=tab][aria-selected=true]:has-text('Over time')")
        visitor.figure("Channels over time: motor1_rpm, motor2_rpm, motor3_rpm and motor4_rpm")
        assert visitor.error_now() == after
        visitor.click("[role=tab]:has-text('Flights')")
        visitor.sees(f"[data-log='{flown.name}']")
        visitor.leaves()


@pytest.mark.long
def test_what_no_effect_explains_is_said_as_an_expression_that_can_be_added(
    browser: Browser, session: Path, tmp_path: Path
) -> None:
    with served(tmp_path / "lab", "--session", str(unexplained(session))) as (url, _):
        visitor = Visitor(browser, url)
        assert "no known effect explains" in visitor.sees("#verdict[data-verdict=unexplained]")
        assert "exp(-" in visitor.sees("pre.expression")
        before = visitor.error_now()
        visitor.waits_until_done()
        visitor.keeps("unexplained")
        visitor.click("button:has-text('Add it as an effect of your own')")
        visitor.waits_for_less_than(0.7 * before)
        visitor.sees("text=Looking for what is missing")
        visitor.click(".main button:has-text('Cancel')")
        visitor.sees("button:has-text('Look for what is missing')")
        exported = visitor.keeps_file("header button:has-text('Download model')", tmp_path)
        assert load_model(exported).effects[0].family() == "unexplained"
        visitor.leaves()


@pytest.mark.long
def test_forecasts_of_the_whole_state_are_computed_on_request_and_kept(
    browser: Browser, session: Path, tmp_path: Path
) -> None:
    port, kept = free_tcp_port(), tmp_path / "lab" / "session.lab.yaml"
    ask, held = "button:has-text('Forecast the whole state')", "#rollouts tr:has-text('0.5 s'):has-text('held')"
    with served(tmp_path / "lab", "--session", str(session), port=port) as (url, _):
        visitor = Visitor(browser, url)
        visitor.sees("#error-now")
        visitor.waits_until_done()
        visitor.click("[role=tab]:has-text('Where it fails')")
        visitor.click(ask)
        visitor.sees(".banner.work:has-text('fitting to what is not held out, 1 of 2')")
        visitor.keeps("forecasting")
        visitor.click(".banner.work button:has-text('Cancel')")
        visitor.sees("text=Forecasting the whole state was cancelled; nothing is lost.")
        visitor.click(ask)
        visitor.page.locator(held).wait_for(timeout=5.0 * PATIENCE_MS)
        stayed, forecast = (
            [float(value.split()[0]) for value in visitor.sees(row).split("\t")[2:]]
            for row in (held, held.replace("held", "forecast"))
        )
        assert len(stayed) == 4 and all(told < had for told, had in zip(forecast, stayed, strict=True))
        visitor.waits_until_done()
        visitor.page.locator("#rollouts").scroll_into_view_if_needed()
        visitor.figure("Error of rotation, rad over the horizon")
        visitor.keeps("rollouts")
        assert visitor.barriers() == []
        visitor.leaves()
    with served(tmp_path / "lab", "--session", str(kept), port=port):
        visitor = Visitor(browser, url, PHONE, "dark")
        visitor.page.goto(f"{url}/?show=fails")
        visitor.sees(held)
        visitor.page.locator("#rollouts").scroll_into_view_if_needed()
        visitor.keeps("rollouts")
        visitor.leaves()


@pytest.mark.long
@pytest.mark.skipif(not REAL_PX4.is_dir(), reason="the flights of real autopilots are not here")
def test_modes_and_messages_of_a_real_autopilot_stand_on_the_axis_of_time(browser: Browser, tmp_path: Path) -> None:
    words = [str(REAL_PX4 / "vertical_runs.ulg"), "--model", str(REAL_PX4 / "vehicle.yaml")]
    with served(tmp_path / "lab", *words) as (url, _):
        visitor = Visitor(browser, url)
        visitor.sees("#error-now")
        visitor.click("[role=tab]:has-text('Over time')")
        channels = visitor.figure("Channels over time: z_m")
        visitor.sees(f"{channels} .annotation-text:has-text('mode OFFBOARD')")
        visitor.page.locator(channels).scroll_into_view_if_needed()
        visitor.keeps("marks")
        visitor.click("text=Modes, messages and parameter changes")
        visitor.sees("td:has-text('[commander] Takeoff detected')")
        visitor.click("[role=tab]:has-text('Flights')")
        visitor.click("text=A new vehicle")
        visitor.click("button:has-text('Fill in from vertical_runs.ulg')")
        visitor.sees(
            "text=vertical_runs.ulg says the rotors and the throttle in hover; enter the mass and the propellers"
        )
        visitor.page.locator("button:has-text('Use this vehicle')").scroll_into_view_if_needed()
        visitor.keeps("filled-in")
        visitor.leaves()


@pytest.mark.skipif("SCREENSHOTS" not in os.environ, reason="`make screenshots` takes the times")
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
@pytest.mark.parametrize("size", [DESK, PHONE], ids=["desk", "phone"])
def test_pictures_of_every_part(
    browser: Browser, flown: Path, session: Path, tmp_path: Path, size: dict[str, int], theme: str
) -> None:
    extended, hidden = one_step_up(session), flown.with_name("hidden.yaml")
    with served(tmp_path / "lab", "--session", str(extended), "--hidden", str(hidden)) as (url, _):
        visitor = Visitor(browser, url, size, theme)
        visitor.sees("#error-now")
        stand_on(visitor, "rigid body")
        visitor.keeps("missing")
        visitor.page.locator(".candidate.primary").scroll_into_view_if_needed()
        visitor.keeps("candidate")
        stand_on(visitor, "+ ground effect")
        for part, shown in PARTS[1:]:
            visitor.click(f"[role=tab]:has-text('{part}')")
            visitor.sees(shown)
            picture = part.lower().replace(" ", "-")
            visitor.keeps(picture)
            visitor.page.evaluate("() => scrollTo(0, 900)")
            visitor.keeps(f"{picture}-below")
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
