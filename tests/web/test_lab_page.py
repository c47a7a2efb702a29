"""The page in a real browser (headless Chromium): the newcomer's path, click by click, and what goes wrong on it.

Screenshots go to build/screenshots. Times are printed, not judged: they say as much about the machine.
"""

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from quadctl.model import load_model
from quadctl.web.session.files import sha256_of
from quadctl.web.session.session import load_session
from tests.support.lab_sessions import ADDED, fly_over_a_cushion, one_step_up, searched, unexplained, wrong_files
from tests.support.other_site import attacking
from tests.support.visitors import (
    DESK,
    PATIENCE_MS,
    PHONE,
    ROOT,
    Browser,
    Visitor,
    command,
    expect,
    free_tcp_port,
    is_kept_out,
    needs_chromium,
    own_environment,
    status,
)

pytestmark = needs_chromium

HOVERING = ROOT.parent / "shared" / "data" / "raptor" / "HOVERING.csv"
REAL_PX4 = ROOT.parent / "shared" / "data" / "real" / "px4"
MOST_CLICKS = 10
PARTS = (
    ("What is missing", "h2:has-text('measured and predicted')"),
    ("Over time", "h2:has-text('The flight path')"),
    ("Where it fails", "h2:has-text('On the flight path')"),
    ("Compensator", "h2:has-text('Export')"),
    ("Flights", "h2:has-text('Vehicle')"),
)
"""Parts of the page, and what is there when they are drawn."""


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return fly_over_a_cushion(tmp_path_factory.mktemp("flown"))


@pytest.fixture(scope="module")
def session(flown: Path) -> Path:
    return searched(flown)


@pytest.fixture(scope="module")
def analysed(session: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a lab with that flight, the effect that was found, and few missions to choose the next from."""
    where = tmp_path_factory.mktemp("analysed")
    missions = where / "missions"
    missions.mkdir()
    for name in ("step_response.yaml", "forward_runs.yaml"):
        shutil.copy(ROOT / "missions" / name, missions)
    with served(where / "lab", "--session", str(one_step_up(session)), "--missions", str(missions)) as (url, _):
        yield url


@pytest.mark.long
def test_another_site_can_neither_frame_it_nor_talk_to_it(browser: Browser, tmp_path: Path) -> None:
    with served(tmp_path / "lab") as (url, _), attacking(url) as site:
        assert is_kept_out(browser, site)
        visitor = Visitor(browser, url)
        visitor.sees("text=Drop flight logs here")
        visitor.leaves()


@pytest.mark.long
def test_a_new_vehicle_is_entered_as_a_few_numbers(browser: Browser, tmp_path: Path) -> None:
    with served(tmp_path / "lab") as (url, _):
        visitor = Visitor(browser, url)
        visitor.sees("h2:has-text('Vehicle: raptor')")
        visitor.click("text=A new vehicle")
        visitor.sees("svg[aria-label^='4 rotors']:visible")
        visitor.page.get_by_label("Frame").last.click()
        visitor.click("[role=option]:has-text('hexa-x')")
        visitor.sees("svg[aria-label^='6 rotors']:visible")
        visitor.sees("text=/The propellers would touch: .* from a diagonal of 0.508 m on/")
        for size in (PHONE, DESK):
            visitor.page.set_viewport_size(size)
            assert visitor.page.locator(".form-fields:visible .q-field__label").evaluate_all(_CUT) == []
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
        assert box is not None and box["width"] > 600.0 and box["height"] < 500.0
        assert "mass_kg: 2.5" in visitor.page.locator("textarea").input_value()
        visitor.leaves()


@pytest.mark.long
def test_files_are_chosen_in_the_window_of_the_browser(browser: Browser, flown: Path, tmp_path: Path) -> None:
    with served(tmp_path / "lab") as (url, _):
        visitor = Visitor(browser, url)
        visitor.sees("button:has-text('Choose files')")
        with visitor.page.expect_file_chooser() as chosen:
            visitor.click("button:has-text('Choose files')")
        chosen.value.set_files(flown)
        visitor.sees("h2:has-text('measured and predicted')")
        visitor.leaves()


@pytest.mark.long
def test_without_a_log_a_sample_flight_is_flown_and_a_tap_explains_a_word(browser: Browser, tmp_path: Path) -> None:
    with served(tmp_path / "lab") as (url, _):
        visitor = Visitor(browser, url)
        visitor.click("button:has-text('Try a sample flight')")
        assert "ground effect" in visitor.sees("#verdict[data-verdict=missing]")
        visitor.click("button.term:has-text('trim')")
        assert "to hover" in visitor.sees("p.meaning")
        visitor.keeps("sample-and-word")
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


@contextmanager
def served(out: Path, *arguments: str, port: int | None = None) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """The lab's address, and the process that serves it."""
    port = port or free_tcp_port()
    options = ["--no-open", "--port", str(port), "--out", str(out)]
    with command(port, out.parent / f"{out.name}.log", "lab", *arguments, *options) as process:
        yield f"http://127.0.0.1:{port}", process


def stand_on(visitor: Visitor, step: str) -> None:
    """A step of the ladder."""
    visitor.click(f".step-button:has-text('{step}')")
    visitor.sees(f".step.here:has-text('{step}')")
    visitor.waits_until_done()


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
        assert "Nothing significant is missing" in visitor.sees("#verdict[data-verdict=none]")
        visitor.keeps("3-added")

        visitor.click("[role=tab]:has-text('Compensator')")
        visitor.sees("text=The check accepts it")
        exported = visitor.keeps_file(".main button:has-text('Export model')", tmp_path)
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
        other.keeps("phone-missing")
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
        one.sees("text=Connection lost")
        over = one.page.locator("#popup").bounding_box()
        assert over is not None
        assert (over["width"], over["height"]) == pytest.approx((DESK["width"], DESK["height"]), abs=2.0)
        one.keeps("connection-lost")
        other.page.context.close()
    with served(tmp_path / "lab", "--session", str(tmp_path / "lab" / "session.lab.yaml"), port=port):
        one.sees("#verdict[data-verdict=none]")  # the same tab, without a hand
        assert one.error_now() == after
        expect(one.page.locator("text=Looking for what is missing")).to_have_count(0)
        expect(one.page.locator("header >> text=windows")).to_have_count(0)
        one.leaves()


@pytest.mark.long
def test_a_new_session_begins_as_a_new_tab_does_and_a_click_leads_back(
    browser: Browser, flown: Path, tmp_path: Path
) -> None:
    with served(tmp_path / "lab", str(flown)) as (url, _):
        visitor = Visitor(browser, url)
        error = visitor.error_now()
        visitor.click("[role=tab]:has-text('Flights')")
        visitor.click("button:has-text('New session')")
        visitor.sees("text=Find what your flight model is missing")
        visitor.click("button:has-text('Go back to it')")
        expect(visitor.page.locator("#error-now")).to_have_text(f"{error:#.3g}", timeout=PATIENCE_MS)
        visitor.sees("[role=tab][aria-selected=true]:has-text('What is missing')")
        visitor.sees("#verdict[data-verdict]")  # until then it works on the session
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
        visitor = Visitor(browser, url)
        visitor.page.goto(link)
        visitor.sees(f".step.here:has-text('+ {ADDED.partition('.')[0].replace('_', ' ')}')")
        visitor.sees("[role=tab][aria-selected=true]:has-text('Over time')")
        visitor.figure("Channels over time: motor1_rpm, motor2_rpm, motor3_rpm and motor4_rpm")
        assert visitor.error_now() == after
        visitor.click("[role=tab]:has-text('Flights')")
        visitor.sees(f"[data-log='{flown.name}']")
        visitor.leaves()


@pytest.mark.long
class TestAnalysed:
    """Actions on flights that have been searched: nothing here searches again."""

    @pytest.fixture
    def visitor(self, browser: Browser, analysed: str) -> Iterator[Visitor]:
        visitor = Visitor(browser, analysed)
        visitor.sees("#error-now")
        visitor.waits_until_done()
        yield visitor
        visitor.leaves()

    def test_an_effect_is_switched_off_and_on_and_removed(self, visitor: Visitor) -> None:
        stand_on(visitor, "+ ground effect")
        after = visitor.error_now()
        visitor.press("[role=switch][aria-label$='on or off']")
        visitor.sees(".step.here:has-text('without ground effect')")
        without = visitor.error_now()
        assert without > 2.0 * after
        visitor.sees("text=An effect is switched off")
        visitor.waits_until_done()
        visitor.press("[role=switch][aria-label$='on or off']")
        assert visitor.waits_for_less_than(without) == after
        visitor.waits_until_done()
        visitor.press("button[aria-label^='Remove ground_effect']")
        visitor.sees(".step.here:has-text('\N{MINUS SIGN} ground effect')")
        assert visitor.error_now() > 2.0 * after
        visitor.sees("text=None yet: the rigid body")
        visitor.waits_until_done()
        stand_on(visitor, "+ ground effect")
        assert visitor.error_now() == after

    def test_what_is_selected_with_the_mouse_stands_out_in_time_and_space(self, visitor: Visitor) -> None:
        stand_on(visitor, "rigid body")
        visitor.click("[role=tab]:has-text('Where it fails')")
        profile = visitor.figure("residual up over height over radius")
        area = visitor.page.locator(f"{profile} .nsewdrag").first
        area.scroll_into_view_if_needed()
        box = area.bounding_box()
        assert box is not None
        left, y = box["x"] + 0.05 * box["width"], box["y"] + 0.5 * box["height"]
        visitor.page.mouse.move(left, y)
        visitor.page.mouse.down()
        visitor.page.mouse.move(left + 0.3 * box["width"], y, steps=4)
        visitor.page.mouse.up()
        assert "rotor height 1" in visitor.sees("text=Selected:")
        visitor.click("button[aria-label='Show the selected samples']")
        in_time, path = visitor.figure("Selected samples over time"), visitor.figure("Flight path")
        some = visitor.points(in_time, "selected")
        assert 0 < some == visitor.points(path, "selected") < visitor.points(path, "flight")
        visitor.keeps("selected")
        visitor.click("[role=tab]:has-text('Over time')")
        assert visitor.points(visitor.figure("Flight over time"), "selected") == some
        visitor.click("button:has-text('Clear')")
        expect(visitor.page.locator("text=Selected:")).to_have_count(0)

    @pytest.mark.parametrize("size", [DESK, PHONE], ids=["desk", "phone"])
    def test_work_and_its_cancel_button_stay_in_sight(
        self, browser: Browser, analysed: str, size: dict[str, int]
    ) -> None:
        visitor = Visitor(browser, analysed, size)
        visitor.click("[role=tab]:has-text('Compensator')")
        fly = visitor.page.locator("button:has-text('Fly it in simulation')")
        fly.scroll_into_view_if_needed()
        fly.click()
        cancel = visitor.page.locator(".banner.work button:has-text('Cancel')")
        expect(cancel).to_be_in_viewport(ratio=1.0)
        visitor.page.evaluate("window.scrollTo(0, document.body.scrollHeight)")
        expect(cancel).to_be_in_viewport(ratio=1.0)
        visitor.keeps(f"working-{'desk' if size is DESK else 'phone'}")
        cancel.click()
        assert "was cancelled; nothing is lost" in visitor.sees(".banner.done")
        visitor.click("button[aria-label='Dismiss']")
        visitor.leaves()

    def test_back_and_forward_move_between_the_parts_of_the_page(self, visitor: Visitor) -> None:
        for part in ("Over time", "Flights"):
            visitor.click(f"[role=tab]:has-text('{part}')")
            visitor.sees(f"[role=tab][aria-selected=true]:has-text('{part}')")
        visitor.page.go_back()
        visitor.sees("[role=tab][aria-selected=true]:has-text('Over time')")
        visitor.figure("Flight over time")
        visitor.page.go_forward()
        visitor.sees("[role=tab][aria-selected=true]:has-text('Flights')")
        visitor.sees("text=Drop flight logs here")

    def test_what_is_said_is_shown_in_the_flight_without_a_mouse(self, visitor: Visitor) -> None:
        stand_on(visitor, "rigid body")
        visitor.click("[role=tab]:has-text('Where it fails')")
        visitor.press("button[aria-label^='Show where in the flight']")
        assert visitor.points(visitor.figure("Selected samples over time"), "selected") > 0
        visitor.page.wait_for_function("document.querySelector('#selected').getBoundingClientRect().top < 100")
        visitor.keeps("shown-at-once")

    @pytest.mark.parametrize(("size", "theme"), [(DESK, "light"), (PHONE, "dark")], ids=["desk-light", "phone-dark"])
    def test_every_part_is_clean_for_axe(
        self, browser: Browser, analysed: str, size: dict[str, int], theme: str
    ) -> None:
        visitor = Visitor(browser, analysed, size, theme)
        visitor.sees("#error-now")
        visitor.waits_until_done()
        for tab in visitor.page.locator("[role=tab]").all():
            expect(tab).to_be_in_viewport(ratio=1.0)
        for part, shown in PARTS:
            visitor.click(f"[role=tab]:has-text('{part}')")
            visitor.sees(shown)
            visitor.waits_until_all_is_drawn()
            assert visitor.barriers() == [], part
        visitor.leaves()

    def test_any_channel_is_found_by_its_name(self, visitor: Visitor) -> None:
        visitor.click("[role=tab]:has-text('Over time')")
        visitor.figure("Channels over time: z_m and z_ref_m")
        visitor.page.locator(".channels input").click()
        visitor.page.keyboard.type("motor 3 sp")
        visitor.click("[role=option]:has-text('motor3_rpm')")
        visitor.page.keyboard.press("Escape")
        visitor.figure("Channels over time: z_m, z_ref_m and motor3_rpm")
        assert visitor.points(visitor.figure("Spectrum of motor3_rpm"), "filter of the analysis: gain") > 0

    def test_two_models_lie_over_each_other(self, visitor: Visitor, session: Path, tmp_path: Path) -> None:
        stand_on(visitor, "+ ground effect")
        exported = visitor.keeps_file("header button:has-text('Export model')", tmp_path)
        stand_on(visitor, "rigid body")
        visitor.click("[role=tab]:has-text('Over time')")
        figure = visitor.figure("Flight over time")
        assert visitor.points(figure, f"step 2: + {ADDED}") == 0
        visitor.page.get_by_label("A further model").last.click()
        visitor.click("[role=option]:has-text('step 2')")
        visitor.page.wait_for_function(_HAS_CURVE, arg=f"step 2: + {ADDED}")
        visitor.page.locator(".beside input[type=file]").set_input_files(exported)
        visitor.page.wait_for_function(_HAS_CURVE, arg=f"file {exported.name}")
        visitor.keeps("two-models")
        visitor.page.locator(".beside input[type=file]").set_input_files(session)
        assert "is a session, expected a model" in visitor.sees("[role=alert]")

    def test_the_flight_is_played_back_and_the_vehicle_follows_the_cursor(self, visitor: Visitor) -> None:
        stand_on(visitor, "rigid body")
        visitor.click("[role=tab]:has-text('Over time')")
        path, in_time = visitor.figure("Flight path"), visitor.figure("Flight over time")
        at_first = visitor.page.locator(path).evaluate(_PLACE)
        visitor.page.locator(f"{in_time} .nsewdrag").first.hover()
        visitor.page.wait_for_function(_HAS_MOVED, arg=[path, at_first])
        hovered = visitor.page.locator(path).evaluate(_PLACE)
        visitor.page.locator(path).scroll_into_view_if_needed()
        visitor.keeps("replay")
        visitor.click(".replay button:has-text('Play')")
        visitor.page.wait_for_function(_HAS_MOVED, arg=[path, hovered])
        visitor.click(".replay button:has-text('Pause')")
        visitor.page.mouse.move(0, 0)  # a mouse that the page scrolls over the other figure is a cursor there
        visitor.page.get_by_label("Time in the flight").fill("0")
        visitor.page.wait_for_function(_IS_AT, arg=[path, at_first])
        expect(visitor.page.locator(".replay .mono")).to_have_text(re.compile(r"[0-9.]+ s"))

    def test_a_link_leads_to_the_same_state(self, browser: Browser, analysed: str, visitor: Visitor) -> None:
        stand_on(visitor, "rigid body")
        visitor.click("button[aria-label^='Evidence for ground_effect']")
        visitor.sees("#evidence")
        visitor.click("[role=tab]:has-text('Over time')")
        visitor.click("button:has-text('north')")
        visitor.page.wait_for_url("**axis=north**")
        visitor.click("button:has-text('Speed of each motor')")
        visitor.page.wait_for_url("**channels=motor1_rpm**")
        other = Visitor(browser, analysed)
        other.page.goto(visitor.page.url)
        other.figure("Channels over time: motor1_rpm, motor2_rpm, motor3_rpm and motor4_rpm")
        expect(other.page.locator("button[aria-pressed=true]:has-text('north')")).to_be_visible()
        other.click("[role=tab]:has-text('What is missing')")
        other.sees("#evidence")
        other.leaves()

    def test_keys_move_through_the_page_and_undo(self, visitor: Visitor) -> None:
        stand_on(visitor, "rigid body")
        keys = visitor.page.keyboard
        keys.press("3")
        visitor.sees("[role=tab][aria-selected=true]:has-text('Where it fails')")
        keys.press("?")
        visitor.sees("kbd:has-text('Shift Z')")
        keys.press("Escape")
        expect(visitor.page.locator("kbd")).to_have_count(0)
        stand_on(visitor, "+ ground effect")
        keys.press("z")
        visitor.sees(".step.here:has-text('rigid body')")
        visitor.waits_until_done()
        keys.press("Shift+Z")
        visitor.sees(".step.here:has-text('+ ground effect')")
        visitor.waits_until_done()
        visitor.page.evaluate("scrollTo(0, document.body.scrollHeight)")
        keys.press("1")
        visitor.sees("#verdict")
        expect(visitor.page.locator("[role=tab][aria-selected=true]")).to_be_in_viewport()

    @pytest.mark.parametrize(("size", "theme"), [(DESK, "light"), (PHONE, "dark")], ids=["desk-light", "phone-dark"])
    def test_the_verdict_leads_to_its_evidence(
        self, browser: Browser, analysed: str, size: dict[str, int], theme: str
    ) -> None:
        visitor = Visitor(browser, analysed, size, theme)
        stand_on(visitor, "rigid body")
        visitor.sees("#verdict[data-verdict=missing]")
        visitor.click("button[aria-label^='Evidence for ground_effect']")
        curve = "#evidence .js-plotly-plot[aria-label^='Ground effect over']"
        visitor.sees(f"{curve} .main-svg")
        assert visitor.points(curve, "residual without it, mean ± 95%") > 5
        expect(visitor.page.locator("#evidence h2")).to_be_in_viewport()
        assert "why it lost" in visitor.sees("table.reasons")
        visitor.waits_until_all_is_drawn()
        assert visitor.barriers() == []
        visitor.keeps(f"evidence-{theme}")
        visitor.page.locator("table.reasons").first.scroll_into_view_if_needed()
        visitor.keeps(f"evidence-below-{theme}")
        visitor.click("button[aria-label='Close the evidence']")
        expect(visitor.page.locator("#evidence")).to_have_count(0)
        visitor.leaves()

    def test_an_effect_in_the_model_leads_to_its_evidence_from_any_part_of_the_page(self, visitor: Visitor) -> None:
        stand_on(visitor, "+ ground effect")
        visitor.click("[role=tab]:has-text('Flights')")
        visitor.click(".stack button[aria-label^='Evidence for ground_effect']")
        visitor.sees("#evidence .js-plotly-plot[aria-label^='Ground effect over'] .main-svg")
        assert "why it lost" in visitor.sees("table.reasons")
        visitor.sees(
            "#evidence p:has-text('With it instead of without it, the held-out acceleration error changes by')"
        )
        visitor.waits_until_done()
        assert visitor.barriers() == []
        visitor.click("button[aria-label='Close the evidence']")

    def test_a_telephone_shows_first_the_verdict_then_what_to_do_then_figures(
        self, browser: Browser, analysed: str
    ) -> None:
        tops = []
        for size in (PHONE, DESK):
            visitor = Visitor(browser, analysed, size)
            stand_on(visitor, "rigid body")
            places = ("#verdict", ".candidate.primary", ".part-overview .js-plotly-plot .main-svg")
            for place in places:
                visitor.sees(place)
            boxes = [visitor.page.locator(place).first.bounding_box() for place in places]
            tops.append([box["y"] for box in boxes if box is not None])
            visitor.click("[role=tab]:has-text('Where it fails')")
            visitor.sees(".figure figcaption:has-text('of the square on this axis')")
            assert visitor.page.locator("figcaption:visible").evaluate_all(_CUT) == []
            names = visitor.page.locator(".header-button").evaluate_all(_SHORT_NAMES)
            assert names == (['"New"', '"Save"', '"Report"', '"Export"'] if size is PHONE else 4 * ["none"])
            visitor.leaves()
        on_phone, on_desk = tops
        assert on_phone == sorted(on_phone)
        assert on_desk[2] == min(on_desk)

    def test_all_can_be_taken_along(self, visitor: Visitor, tmp_path: Path) -> None:
        stand_on(visitor, "+ ground effect")
        report = visitor.keeps_file("button:has-text('Report')", tmp_path).read_text(encoding="utf-8")
        assert "saved as report.html in the downloads folder" in visitor.sees(".banner.done")
        assert "Missing, in the order of adding: ground effect" in report
        assert "The fitted effect" in report
        visitor.reads(report, DESK, "report-desk")
        visitor.reads(report, PHONE, "report-phone")
        begins = {"png": b"\x89PNG", "svg": b"<svg", "csv": b"measured: time in the log / s,"}
        for form, begin in begins.items():
            path = visitor.keeps_file(f"figure button:has-text('{form.upper()}')", tmp_path)
            assert path.suffix == f".{form}" and path.read_bytes().startswith(begin)
        saved = visitor.keeps_file("button:has-text('Save session')", tmp_path)
        visitor.sees(".banner.done:has-text('The session is saved as session.lab.yaml')")
        again = load_session(saved)
        assert [rung.name for rung in again.rungs][:2] == ["rigid body", f"+ {ADDED}"]
        assert again.hashes == {log: sha256_of(log) for log in again.logs}
        assert again.view.startswith("show=missing")

    def test_the_next_flight_is_suggested_with_its_command(self, visitor: Visitor) -> None:
        stand_on(visitor, "rigid body")
        visitor.sees("#verdict[data-verdict=missing]")
        visitor.click("button:has-text('Suggest a flight')")
        assert re.fullmatch(r"quadctl fly \S+/missions/\w+\.yaml", visitor.sees("code.command"))
        visitor.keeps("suggested")

    def test_what_goes_wrong_is_said_in_a_sentence_and_costs_nothing(self, visitor: Visitor, tmp_path: Path) -> None:
        error = visitor.error_now()
        visitor.click("[role=tab]:has-text('Flights')")
        for path, said in wrong_files(tmp_path):
            visitor.drops(path)
            expect(visitor.page.locator("[role=alert]")).to_contain_text(said, timeout=PATIENCE_MS)
            expect(visitor.page.locator(".q-uploader__file")).to_have_count(0, timeout=PATIENCE_MS)  # nor a tick
        visitor.keeps("error")
        visitor.click("[role=tab]:has-text('What is missing')")
        visitor.sees("#verdict")  # what was found still holds: no flight was added
        visitor.click("[role=tab]:has-text('Flights')")
        visitor.click("button[aria-label='Leave out garbage.csv']")
        expect(visitor.page.locator("[data-log='garbage.csv']")).to_have_count(0, timeout=PATIENCE_MS)
        assert visitor.error_now() == error

    def test_what_no_person_asks_for_is_refused(self, analysed: str) -> None:
        assert status(analysed, Host="elsewhere.example") == 400
        assert status(analysed, **{"Content-Length": str(2**30)}) == 413


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
        exported = visitor.keeps_file("header button:has-text('Export model')", tmp_path)
        assert load_model(exported).effects[0].family() == "unexplained"
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
        visitor.sees("text=vertical_runs.ulg says the rotors and the throttle in hover")
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
@pytest.mark.parametrize("size", ["desk", "phone"])
def test_pictures_of_every_part(browser: Browser, session: Path, tmp_path: Path, size: str, theme: str) -> None:
    climbed, hidden = one_step_up(session), session.with_name("hidden.yaml")
    with served(tmp_path / "lab", "--session", str(climbed), "--hidden", str(hidden)) as (url, _):
        visitor = Visitor(browser, url, DESK if size == "desk" else PHONE, theme)
        visitor.sees("#error-now")
        stand_on(visitor, "rigid body")
        visitor.keeps(f"{size}-{theme}-missing")
        visitor.page.locator(".candidate.primary").scroll_into_view_if_needed()
        visitor.keeps(f"{size}-{theme}-candidate")
        stand_on(visitor, "+ ground effect")
        for part, shown in PARTS[1:]:
            visitor.click(f"[role=tab]:has-text('{part}')")
            visitor.sees(shown)
            visitor.keeps(f"{size}-{theme}-{part.lower().replace(' ', '-')}")
            visitor.page.evaluate("() => scrollTo(0, 900)")
            visitor.keeps(f"{size}-{theme}-{part.lower().replace(' ', '-')}-below")
        visitor.leaves()


_SHORT_NAMES = "buttons => buttons.map(button => getComputedStyle(button, '::after').content)"
"""Script: the words below the icons of buttons."""
_CUT = "labels => labels.filter(l => l.scrollWidth > l.clientWidth + 1).map(l => l.innerText)"
_HAS_CURVE = """name => [...document.querySelectorAll('.js-plotly-plot')].some(
  plot => (plot.data ?? []).some(curve => curve.name === name))"""
_PLACE = "plot => Array.from(plot.data.find(curve => curve.name === 'its nose').z)"
_HAS_MOVED = """([path, before]) => {
  const now = document.querySelector(path).data.find(curve => curve.name === 'its nose').z;
  return Math.abs(now[0] - before[0]) > 1e-3;
}"""
_IS_AT = """([path, place]) => document.querySelector(path).data.find(curve => curve.name === 'its nose').z
  .every((z, i) => Math.abs(z - place[i]) < 1e-6)"""
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
