"""Tools for tests of the pages: a command that serves one, and a visitor in headless Chromium.

Screenshots go to build/screenshots.
"""

import http.client
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from PIL import Image

from tests.support.places import NO_CHROMIUM, ROOT

sync_api = pytest.importorskip("playwright.sync_api")
Axe = pytest.importorskip("axe_playwright_python.sync_playwright").Axe
from playwright.sync_api import Browser, Page, expect  # noqa: E402 - for the tests, which would have to look whether it is there

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason=NO_CHROMIUM)

SCREENSHOTS = ROOT / "build" / "screenshots"
DESK, PHONE = {"width": 1280, "height": 800}, {"width": 390, "height": 844}
Screen = tuple[dict[str, int], str]
"""Size and colours."""
SCREENS = [pytest.param((DESK, "light"), id="desk-light"), pytest.param((PHONE, "dark"), id="phone-dark")]
"""Screens that a person may sit at."""
on_each_screen = pytest.mark.parametrize("screen", SCREENS)
MOST_SCREENS = {False: 2.0, True: 4.0}
"""Most screens that a report with its details folded may fill, by whether it is read on a telephone."""
PATIENCE_MS = 120_000.0
CLICKS = 4
"""Most clicks for one thing, each with its share of the patience."""
expect.set_options(timeout=PATIENCE_MS)
IN_DOCS = {
    "2-missing-desk-light": "lab-page-see.png",
    "3-added-desk-light": "lab-page-added.png",
    "5-flown-desk-light": "lab-page-flown.png",
    "live-desk-light": "live-view.png",
}
"""Screenshots that the documentation shows; `make screenshots` takes them anew."""
FEW_COLOURS = 64
"""A page has no more, and git keeps every picture for ever."""
_ALL_DRAWN = "() => [...document.querySelectorAll('.js-plotly-plot')].every(p => p.querySelector('.main-svg'))"
_NOTHING_MOVES = """() => document.getAnimations().every(
  a => a.playState !== 'running' || a.effect.getTiming().iterations === Infinity)"""
_TWO_FRAMES = "() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"
_FORGET_CHOICES = """() => {
  history.replaceState(null, '', '/');
  window.dispatchEvent(new PopStateEvent('popstate'));
}"""
"""Script: do as if Back had led to the address without choices."""
_PRESS_ALL = "selector => document.querySelectorAll(selector).forEach(button => button.click())"
_POINTS = "(figure, curve) => figure.data.find(trace => trace.name === curve)?.x.length ?? 0"
_RESIZE_ONE_THAT_HAS_LEFT = """async () => {
  const { Plotly } = await import("nicegui-plotly");
  Plotly.Plots.resize(document.createElement("div"));
  const hidden = document.body.appendChild(document.createElement("div"));
  hidden.style.display = "none";
  Plotly.Plots.resize(hidden);
}"""
_IS_LESS = "than => parseFloat(document.querySelector('#error-now')?.innerText) < than"


def free_tcp_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def own_environment() -> dict[str, str]:
    """Environment of a command: NiceGUI serves otherwise where it believes to be tested."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST")}
    return environment | {"PYTHONPATH": str(ROOT)}


@contextmanager
def command(port: int, log: Path, *words: str) -> Iterator[subprocess.Popen[bytes]]:
    """A command of quadctl that serves a page at `port`; ended by Ctrl-C. What it prints goes to `log`."""
    code = "from quadctl.cli import main; main()"
    with log.open("wb") as file:
        process = subprocess.Popen(
            [sys.executable, "-c", code, *words], cwd=ROOT, env=own_environment(), stdout=file, stderr=file
        )
    try:
        wait_for(port, process)
        yield process
    finally:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(30.0)
        except subprocess.TimeoutExpired:  # a test has failed
            process.kill()
            raise


def wait_for(port: int, process: subprocess.Popen[bytes]) -> None:
    end = time.monotonic() + 90.0
    while time.monotonic() < end:
        assert process.poll() is None, "the page ended before it was served"
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.1)
    raise AssertionError("the page was not served")


def status(url: str, **headers: str) -> int:
    """Status of the server's answer to a request with these headers."""
    connection = http.client.HTTPConnection(url.removeprefix("http://"))
    connection.request("GET", "/", headers=headers)
    return connection.getresponse().status


def is_kept_out(browser: Browser, site: str) -> bool:
    """Tell whether another site that frames a page and opens its web socket (see `other_site`) gets neither."""
    with browser.new_context() as context:
        page = context.new_page()
        page.goto(site)
        page.wait_for_function("() => document.title !== 'waiting'")
        framed = page.frames[1]
        return page.title() == "refused" and "quadctl" not in framed.title() and framed.url.startswith("chrome-error:")


class Visitor:
    """A person at the page who counts clicks; whatever the page asks of another machine is noted."""

    def __init__(self, browser: Browser, url: str, size: dict[str, int] = DESK, theme: str = "light") -> None:
        context = browser.new_context(viewport=size, color_scheme=theme, accept_downloads=True)  # type: ignore[arg-type]
        context.set_default_timeout(PATIENCE_MS)
        self.page: Page = context.new_page()
        self.clicks = 0
        self.is_on_phone = size["width"] == PHONE["width"]
        self._screen = f"{'phone' if self.is_on_phone else 'desk'}-{theme}"
        self.elsewhere: list[str] = []
        self.mistakes: list[str] = []
        self.page.on("request", lambda request: self._note(request.url, url))
        self.page.on("pageerror", lambda error: self.mistakes.append(error.stack or str(error)))
        self.page.goto(url)

    def _note(self, asked: str, url: str) -> None:
        if not asked.startswith((url, "data:", "blob:")):
            self.elsewhere.append(asked)

    def click(self, selector: str) -> None:
        self.clicks += 1
        self.page.locator(selector).first.click()

    def clicks_until_it_sees(self, sought: str, selector: str) -> None:
        """Click again, as a person does, where a click was lost on a button that was drawn again at that moment."""
        seen = self.page.locator(sought).first
        for _ in range(CLICKS):
            self.click(selector)
            with suppress(sync_api.TimeoutError):
                return seen.wait_for(timeout=PATIENCE_MS / CLICKS)
        raise AssertionError(f"{CLICKS} clicks on {selector} do not lead to {sought}")

    def press(self, selector: str) -> None:
        """Click with the keyboard."""
        self.clicks += 1
        self.page.locator(selector).first.focus()
        self.page.keyboard.press("Enter")

    def sees(self, selector: str) -> str:
        # Not `expect`, which describes the whole page each time that what it waits for is not there yet.
        found = self.page.locator(selector).first
        found.wait_for()
        return str(found.evaluate("element => element.innerText ?? ''"))

    def error_now(self) -> float:
        return float(self.sees("#error-now"))

    def waits_for_less_than(self, error: float) -> float:
        self.page.wait_for_function(_IS_LESS, arg=error)
        return self.error_now()

    def waits_until_done(self) -> None:
        self.page.wait_for_function("document.querySelector('.banner.work') === null")

    def keeps(self, name: str) -> None:
        """A screenshot, as soon as all figures are drawn and nothing moves; its name ends with that of the screen."""
        SCREENSHOTS.mkdir(parents=True, exist_ok=True)
        self.waits_until_all_is_drawn()
        name = f"{name}-{self._screen}"
        self.page.screenshot(path=SCREENSHOTS / f"{name}.png", animations="disabled")
        if "SCREENSHOTS" in os.environ and name in IN_DOCS:
            with Image.open(SCREENSHOTS / f"{name}.png") as picture:
                picture.convert("RGB").quantize(FEW_COLOURS).save(ROOT / "docs" / IN_DOCS[name], optimize=True)

    def begins_again(self) -> None:
        """Leave all choices, as a new tab has them, without the time that a new tab takes; a search ends unfinished."""
        self.waits_until_done()
        self.page.evaluate(_PRESS_ALL, ".banner.search button, button[aria-label='Dismiss']")
        self.page.evaluate(_FORGET_CHOICES)
        self.sees("[role=tab][aria-selected=true]:has-text('What is missing')")
        self.page.mouse.move(0, 0)
        self.page.evaluate("scrollTo(0, 0)")
        self.clicks = 0

    def waits_until_all_is_drawn(self) -> None:
        self.page.wait_for_function(_ALL_DRAWN)
        self.page.wait_for_function(_NOTHING_MOVES)
        self.page.evaluate(_TWO_FRAMES)

    def reads(self, html: str) -> None:
        """Read a report on this screen: one page stands alone, no table is cut off, nobody is kept out."""
        page = self.page.context.new_page()
        page.set_content(html)
        SCREENSHOTS.mkdir(parents=True, exist_ok=True)
        page.screenshot(path=SCREENSHOTS / f"report-{self._screen}.png", full_page=True)
        screens = page.evaluate("document.documentElement.scrollHeight / innerHeight")
        assert screens < MOST_SCREENS[self.is_on_phone]
        page.evaluate("document.querySelectorAll('details').forEach(each => { each.open = true; })")
        assert page.locator(".scroll table").count() == page.locator(".scroll table:visible").count() > 0
        assert page.evaluate("[...document.querySelectorAll('.scroll')].every(e => e.scrollWidth <= e.clientWidth)")
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        assert _barriers(page) == []
        page.screenshot(path=SCREENSHOTS / f"report-open-{self._screen}.png", full_page=True)
        page.close()

    def barriers(self) -> list[str]:
        """Whatever axe-core finds on the page that keeps people out, with the element."""
        return _barriers(self.page)

    def keeps_file(self, selector: str, where: Path) -> Path:
        """The file that a click downloads, in the folder `where`.

        Work that ends draws its panels again, and a click on a button that is replaced at that moment is lost: so the
        visitor clicks when nothing is computed and all is drawn.
        """
        self.page.wait_for_function("document.querySelector('.banner.work, .banner.search') === null")
        self.waits_until_all_is_drawn()
        with self.page.expect_download() as download:
            self.click(selector)
        path = where / download.value.suggested_filename
        download.value.save_as(path)
        return path

    def figure(self, label: str) -> str:
        """The selector of a figure, which is drawn."""
        selector = f".js-plotly-plot[aria-label='{label}']"
        self.sees(f"{selector} .main-svg")
        return selector

    def resizes_a_figure_that_has_left(self) -> None:
        """Do as a browser that draws a figure anew in the moment in which its size changes."""
        self.page.evaluate(_RESIZE_ONE_THAT_HAS_LEFT)

    def points(self, figure: str, curve: str) -> int:
        """Number of points of a curve of a figure; 0 where there is no such curve."""
        return int(self.page.locator(figure).evaluate(_POINTS, curve))

    def drops(self, *files: Path) -> None:
        self.page.locator("input[type=file]").first.set_input_files(files)

    def has_no_complaint(self) -> None:
        assert not self.elsewhere, f"asked of another machine: {self.elsewhere}"
        assert not self.mistakes, f"mistakes of the page: {self.mistakes}"

    def leaves(self) -> None:
        self.has_no_complaint()
        self.page.context.close()


def _barriers(page: Page) -> list[str]:
    # The bar that Quasar shows while the browser loads a file has no name, and is gone in a moment.
    found = Axe().run(page, context={"exclude": [["#q-loading-bar"], [".q-loading-bar"]]}).response["violations"]
    return [f"{each['id']}: {node['html'][:120]}" for each in found for node in each["nodes"]]
