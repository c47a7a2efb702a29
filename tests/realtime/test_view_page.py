"""The live view in a real browser (headless Chromium), during flights on a simulated autopilot over MAVLink.

The flights are not judged here: their guards forgive what a browser does to a small machine.
"""

import socket
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import yaml

from quadctl.flight.record.view_link import LANDED_BY
from tests.support.configurations import forgiving_config
from tests.support.other_site import attacking, upgrade_status
from tests.support.visitors import (
    DESK,
    PATIENCE_MS,
    PHONE,
    Browser,
    Visitor,
    command,
    expect,
    free_tcp_port,
    is_kept_out,
    needs_chromium,
    status,
)

pytestmark = [needs_chromium, pytest.mark.realtime]

TOKEN = "a-token-of-the-test"
SMALL = {"width": 320, "height": 320}
ABOVE = "The vehicle from above, with its path and setpoint"
HAS_CLIMBED = """figure => {
  const height = document.querySelector(figure).data.find(curve => curve.name === "its nose").z[0];
  return Math.abs(height - 0.6) < 0.1;
}"""
"""Tells whether the vehicle that is drawn hovers at its height."""
LONG_HOVER = {
    "name": "long_hover",
    "phases": [
        {"name": "takeoff", "kind": "move", "to_m": [0, 0, 0.6], "speed_m_s": 0.3},
        {"name": "hover", "kind": "hold", "duration_s": 240},
    ],
    "limits": {"min_z_m": 0.1, "max_z_m": 1.0, "max_distance_m": 1.0, "max_duration_s": 300},
}


@contextmanager
def flying(where: Path, *words: str) -> Iterator[tuple[int, subprocess.Popen[bytes]]]:
    """A flight that hovers until it is asked to land; the port of its view, and its process."""
    mission = where / "long_hover.yaml"
    mission.write_text(yaml.safe_dump(LONG_HOVER))
    port = free_tcp_port()
    config = str(forgiving_config(where))
    options = ["--sitl", "--config", config, "--view", "--view-port", str(port), "--log-dir", str(where)]
    with command(port, where / "out.txt", "fly", str(mission), *options, *words) as process:
        yield port, process


def is_in(visitor: Visitor, phase: str) -> None:
    expect(visitor.page.locator("#phase")).to_have_text(phase, timeout=PATIENCE_MS)


def ending(where: Path) -> str:
    (meta,) = where.glob("*.meta.yaml")
    return str(yaml.safe_load(meta.read_text())["ended"])


@pytest.mark.long
def test_a_flight_is_seen_in_four_tabs_and_landed_from_one(browser: Browser, tmp_path: Path) -> None:
    with flying(tmp_path) as (port, process):
        url = f"http://127.0.0.1:{port}"
        desk = Visitor(browser, url)
        is_in(desk, "hover")
        phone = Visitor(browser, url, PHONE, "dark")
        phone.sees("#events :text('takeoff')")
        phone.page.reload()
        is_in(phone, "hover")
        above = desk.figure(ABOVE)
        assert desk.points(above, "path") > 10 and desk.points(above, "setpoint") == 2
        desk.page.wait_for_function(HAS_CLIMBED, arg=above)
        desk.keeps("live")
        phone.page.locator(phone.figure(ABOVE)).scroll_into_view_if_needed()
        phone.keeps("live-above")
        phone.page.evaluate("scrollTo(0, 0)")
        desk.resizes_a_figure_that_has_left()
        phone.keeps("live")

        late = [Visitor(browser, url, SMALL) for _ in range(2)]  # to draw four large ones is much for a machine
        for each in late:
            is_in(each, "hover")
        phone.click("#land")  # once is not enough, and is no second press of another tab's
        expect(phone.page.locator("#land")).to_contain_text("Press again", timeout=PATIENCE_MS)
        phone.keeps("live-sure")
        desk.page.locator("#land").dblclick()
        for each in (desk, phone, *late):
            expect(each.page.locator("#banner")).to_contain_text(f"{LANDED_BY} after", timeout=PATIENCE_MS)
        phone.page.reload()
        expect(phone.page.locator("#banner")).to_contain_text(LANDED_BY, timeout=PATIENCE_MS)
        desk.keeps("live-over")
        phone.keeps("live-over")
        assert process.poll() is None
        for each in (desk, phone, *late):
            each.leaves()
        assert process.wait(PATIENCE_MS / 1000.0) == 1
    assert ending(tmp_path) == LANDED_BY


@pytest.mark.long
def test_without_a_token_no_other_address_reaches_it_and_with_one_nobody_who_lacks_it(
    browser: Browser, tmp_path: Path
) -> None:
    open_one, closed_one = tmp_path / "open", tmp_path / "closed"
    open_one.mkdir()
    closed_one.mkdir()
    with flying(open_one) as (port, _), socket.socket() as outside:
        assert outside.connect_ex(("127.0.0.2", port)) != 0
        assert status(f"http://127.0.0.1:{port}", Host="elsewhere.example") == 400
        other = "http://127.0.0.1:1"
        assert status(f"http://127.0.0.1:{port}", Origin=other) == 403
        assert upgrade_status(port, Origin=other) == 403
        with attacking(f"http://127.0.0.1:{port}") as site:
            assert is_kept_out(browser, site)
    with flying(closed_one, "--view-token", TOKEN) as (port, _):
        assert status(f"http://127.0.0.2:{port}") == 401
        assert status(f"http://127.0.0.2:{port}", Cookie="quadctl-view=wrong-token") == 401
        assert upgrade_status(port) == 403
        visitor = Visitor(browser, f"http://127.0.0.2:{port}/?token={TOKEN}", DESK, "dark")
        assert TOKEN not in visitor.page.url
        is_in(visitor, "hover")
        visitor.keeps("live")
        visitor.page.keyboard.type("ll")
        expect(visitor.page.locator("#banner")).to_contain_text(LANDED_BY, timeout=PATIENCE_MS)
        visitor.page.context.close()
    assert ending(closed_one) == LANDED_BY
