"""The page of a flight that has been searched, in headless Chromium: on a desk, light, and on a telephone, dark.
Nothing here searches again.

Screenshots go to build/screenshots.
"""

import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from quadctl.web.session.files import sha256_of
from quadctl.web.session.session import load_session
from tests.support.lab_pages import CUT, PARTS, served, stand_on
from tests.support.lab_sessions import ADDED, flown_and_searched, one_step_up, wrong_files
from tests.support.visitors import (
    DESK,
    PATIENCE_MS,
    PHONE,
    ROOT,
    SCREENS,
    Browser,
    Visitor,
    expect,
    needs_chromium,
    status,
)

pytestmark = [needs_chromium, pytest.mark.long]


@pytest.fixture(scope="module")
def session(shared: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("searched") / "one.lab.yaml"
    path.write_text(flown_and_searched(shared)[1], encoding="utf-8")
    return path


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


at_the_desk = pytest.mark.parametrize("stays", SCREENS[:1], indirect=True)
"""For what does not depend on the screen."""


@pytest.fixture(scope="module", params=SCREENS)
def stays(request: pytest.FixtureRequest, browser: Browser, analysed: str) -> Iterator[Visitor]:
    """A visitor who stays for all tests of one screen: opening the page takes as long as most of what they do."""
    visitor = Visitor(browser, analysed, *request.param)
    visitor.sees("#error-now")
    yield visitor
    visitor.leaves()


@pytest.fixture
def visitor(stays: Visitor) -> Iterator[Visitor]:
    stays.begins_again()
    yield stays
    stays.has_no_complaint()


@at_the_desk
def test_an_effect_is_switched_off_and_on_and_removed(visitor: Visitor) -> None:
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
    visitor.sees("text=No effect yet: raptor is a rigid body")
    visitor.waits_until_done()
    stand_on(visitor, "+ ground effect")
    assert visitor.error_now() == after


@at_the_desk
def test_what_is_selected_with_the_mouse_stands_out_in_time_and_space(visitor: Visitor) -> None:
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


def test_work_and_its_cancel_button_stay_in_sight(visitor: Visitor) -> None:
    visitor.click("[role=tab]:has-text('Compensator')")
    fly = visitor.page.locator("button:has-text('Fly it in simulation')")
    fly.scroll_into_view_if_needed()
    fly.click()
    cancel = visitor.page.locator(".banner.work button:has-text('Cancel')")
    expect(cancel).to_be_in_viewport(ratio=1.0)
    visitor.page.evaluate("window.scrollTo(0, document.body.scrollHeight)")
    expect(cancel).to_be_in_viewport(ratio=1.0)
    visitor.keeps("working")
    cancel.click()
    assert "was cancelled; nothing is lost" in visitor.sees(".banner.done")


@at_the_desk
def test_back_and_forward_move_between_the_parts_of_the_page(visitor: Visitor) -> None:
    for part in ("Over time", "Flights"):
        visitor.click(f"[role=tab]:has-text('{part}')")
        visitor.sees(f"[role=tab][aria-selected=true]:has-text('{part}')")
    visitor.page.go_back()
    visitor.sees("[role=tab][aria-selected=true]:has-text('Over time')")
    visitor.figure("Flight over time")
    visitor.page.go_forward()
    visitor.sees("[role=tab][aria-selected=true]:has-text('Flights')")
    visitor.sees("text=Drop flight logs here")


@at_the_desk
def test_what_is_said_is_shown_in_the_flight_without_a_mouse(visitor: Visitor) -> None:
    stand_on(visitor, "rigid body")
    visitor.click("[role=tab]:has-text('Where it fails')")
    visitor.press("button[aria-label^='Show where in the flight']")
    assert visitor.points(visitor.figure("Selected samples over time"), "selected") > 0
    visitor.page.wait_for_function("document.querySelector('#selected').getBoundingClientRect().top < 100")
    visitor.keeps("shown-at-once")


def test_every_part_is_clean_for_axe(visitor: Visitor) -> None:
    for tab in visitor.page.locator("[role=tab]").all():
        expect(tab).to_be_in_viewport(ratio=1.0)
    for part, shown in PARTS:
        visitor.click(f"[role=tab]:has-text('{part}')")
        visitor.sees(shown)
        visitor.waits_until_all_is_drawn()
        assert visitor.barriers() == [], part


@at_the_desk
def test_any_channel_is_found_by_its_name(visitor: Visitor) -> None:
    visitor.click("[role=tab]:has-text('Over time')")
    visitor.figure("Channels over time: z_m and z_ref_m")
    visitor.page.locator(".channels input").click()
    visitor.page.keyboard.type("motor 3 sp")
    visitor.click("[role=option]:has-text('motor3_rpm')")
    visitor.page.keyboard.press("Escape")
    visitor.figure("Channels over time: z_m, z_ref_m and motor3_rpm")
    assert visitor.points(visitor.figure("Spectrum of motor3_rpm"), "filter of the analysis: gain") > 0


@at_the_desk
def test_two_models_lie_over_each_other(visitor: Visitor, session: Path, tmp_path: Path) -> None:
    stand_on(visitor, "+ ground effect")
    exported = visitor.keeps_file("header button:has-text('Download model')", tmp_path)
    stand_on(visitor, "rigid body")
    visitor.click("[role=tab]:has-text('Over time')")
    figure = visitor.figure("Flight over time")
    assert visitor.points(figure, f"step 2: + {ADDED}") == 0
    visitor.page.get_by_label("Another model").last.click()
    visitor.click("[role=option]:has-text('step 2')")
    visitor.page.wait_for_function(_HAS_CURVE, arg=f"step 2: + {ADDED}")
    visitor.page.locator(".beside input[type=file]").set_input_files(exported)
    visitor.page.wait_for_function(_HAS_CURVE, arg=f"file {exported.name}")
    visitor.keeps("two-models")
    visitor.page.locator(".beside input[type=file]").set_input_files(session)
    assert "is a session, expected a model" in visitor.sees("[role=alert]")


@at_the_desk
def test_the_flight_is_played_back_and_the_vehicle_follows_the_cursor(visitor: Visitor) -> None:
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


@at_the_desk
def test_a_link_leads_to_the_same_state(browser: Browser, analysed: str, visitor: Visitor) -> None:
    stand_on(visitor, "rigid body")
    visitor.click("button[aria-label^='Evidence for ground_effect']")
    visitor.sees("#evidence")
    visitor.click("[role=tab]:has-text('Over time')")
    visitor.click("button:has-text('north')")
    visitor.page.wait_for_url("**axis=north**")
    visitor.click("button:has-text('Speed of each motor')")
    visitor.page.wait_for_url("**channels=motor1_rpm**")
    other = Visitor(browser, analysed, PHONE if visitor.is_on_phone else DESK)
    other.page.goto(visitor.page.url)
    other.figure("Channels over time: motor1_rpm, motor2_rpm, motor3_rpm and motor4_rpm")
    other.sees("button[aria-pressed=true]:has-text('north')")
    other.click("[role=tab]:has-text('What is missing')")
    other.sees("#evidence")
    other.leaves()


@at_the_desk
def test_keys_move_through_the_page_and_undo(visitor: Visitor) -> None:
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


def test_the_verdict_leads_to_its_evidence(visitor: Visitor) -> None:
    stand_on(visitor, "rigid body")
    visitor.sees("#verdict[data-verdict=missing]")
    visitor.click("button[aria-label^='Evidence for ground_effect']")
    curve = "#evidence .js-plotly-plot[aria-label^='Ground effect over']"
    visitor.sees(f"{curve} .main-svg")
    assert visitor.points(curve, "residual without it, mean and 95% interval") > 5
    expect(visitor.page.locator("#evidence h2")).to_be_in_viewport()
    assert "why it lost" in visitor.sees("table.reasons")
    visitor.waits_until_all_is_drawn()
    assert visitor.barriers() == []
    visitor.keeps("evidence")
    visitor.page.locator("table.reasons").first.scroll_into_view_if_needed()
    visitor.keeps("evidence-below")
    visitor.click("button[aria-label='Close the evidence']")
    expect(visitor.page.locator("#evidence")).to_have_count(0)


@at_the_desk
def test_an_effect_in_the_model_leads_to_its_evidence_from_any_part_of_the_page(visitor: Visitor) -> None:
    stand_on(visitor, "+ ground effect")
    visitor.click("[role=tab]:has-text('Flights')")
    visitor.click(".stack button[aria-label^='Evidence for ground_effect']")
    visitor.sees("#evidence .js-plotly-plot[aria-label^='Ground effect over'] .main-svg")
    assert "why it lost" in visitor.sees("table.reasons")
    visitor.sees("#evidence p:has-text('With it instead of without it, the held-out acceleration error changes by')")
    visitor.waits_until_done()
    assert visitor.barriers() == []
    visitor.click("button[aria-label='Close the evidence']")


def test_a_telephone_shows_first_the_verdict_then_what_to_do_then_figures(visitor: Visitor) -> None:
    stand_on(visitor, "rigid body")
    places = ("#verdict", ".candidate.primary", ".part-overview .js-plotly-plot .main-svg")
    for place in places:
        visitor.sees(place)
    boxes = [visitor.page.locator(place).first.bounding_box() for place in places]
    tops = [box["y"] for box in boxes if box is not None]
    assert tops == sorted(tops) if visitor.is_on_phone else tops[2] == min(tops)
    visitor.click("[role=tab]:has-text('Where it fails')")
    visitor.sees(".figure figcaption:has-text('of the squared error of this axis')")
    assert visitor.page.locator("figcaption:visible").evaluate_all(CUT) == []
    names = visitor.page.locator(".header-button").evaluate_all(_SHORT_NAMES)
    assert names == (['"New"', '"Save"', '"Report"', '"Download"'] if visitor.is_on_phone else 4 * ["none"])


def test_all_can_be_taken_along(visitor: Visitor, tmp_path: Path) -> None:
    stand_on(visitor, "+ ground effect")
    report = visitor.keeps_file("button:has-text('Report')", tmp_path).read_text(encoding="utf-8")
    assert "saved as report.html in the downloads folder" in visitor.sees(".banner.done")
    assert "Missing: ground effect." in report
    assert "The fitted effect" in report
    visitor.reads(report)
    begins = {"png": b"\x89PNG", "svg": b"<svg", "csv": b"measured: time in the log / s,"}
    for form, begin in begins.items():
        path = visitor.keeps_file(f"figure button:has-text('{form.upper()}')", tmp_path)
        assert path.suffix == f".{form}" and path.read_bytes().startswith(begin)
    saved = visitor.keeps_file("button:has-text('Save session')", tmp_path)
    visitor.sees(".banner.done:has-text('The session is saved as session.lab.yaml')")
    again = load_session(saved)
    assert [step.name for step in again.sequence][:2] == ["rigid body", f"+ {ADDED}"]
    assert again.hashes == {log: sha256_of(log) for log in again.logs}
    assert again.view.startswith("show=missing")


@at_the_desk
def test_the_next_flight_is_suggested_with_its_command(visitor: Visitor) -> None:
    stand_on(visitor, "rigid body")
    visitor.sees("#verdict[data-verdict=missing]")
    visitor.click("button:has-text('Suggest a flight')")
    assert re.fullmatch(r"quadctl fly \S+/missions/\w+\.yaml", visitor.sees("code.command"))
    visitor.keeps("suggested")


@at_the_desk
def test_what_goes_wrong_is_said_in_a_sentence_and_costs_nothing(visitor: Visitor, tmp_path: Path) -> None:
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


def test_what_no_person_asks_for_is_refused(analysed: str) -> None:
    assert status(analysed, Host="elsewhere.example") == 400
    assert status(analysed, **{"Content-Length": str(2**30)}) == 413


_SHORT_NAMES = "buttons => buttons.map(button => getComputedStyle(button, '::after').content)"
"""Script: the words below the icons of buttons."""
_HAS_CURVE = """name => [...document.querySelectorAll('.js-plotly-plot')].some(
  plot => (plot.data ?? []).some(curve => curve.name === name))"""
_PLACE = "plot => Array.from(plot.data.find(curve => curve.name === 'its nose').z)"
_HAS_MOVED = """([path, before]) => {
  const now = document.querySelector(path).data.find(curve => curve.name === 'its nose').z;
  return Math.abs(now[0] - before[0]) > 1e-3;
}"""
_IS_AT = """([path, place]) => document.querySelector(path).data.find(curve => curve.name === 'its nose').z
  .every((z, i) => Math.abs(z - place[i]) < 1e-6)"""
