"""The viewer's process: takes records from the flight, serves the page, and ends when nobody looks any more."""

import asyncio
import contextlib
import os
import time
from collections.abc import Callable
from importlib.resources import files
from multiprocessing.connection import Connection

from nicegui import app, ui
from nicegui.client import Client
from starlette.middleware.trustedhost import TrustedHostMiddleware

from quadctl.flight.record.view_link import WISH_TO_LAND, ViewEnd, next_record
from quadctl.web.live.gate import Gate
from quadctl.web.live.history import LOST, Brief, History
from quadctl.web.live.page import LivePage
from quadctl.web.port import run_pages

POLITENESS = 5
"""Of nice: the flight goes first."""
ASK_AGAIN_S = 0.2
"""A wish to land is repeated until the flight ends."""
GRACE_S = 5.0
"""How long a page may be away, to be loaded again for example, when the flight is over."""


class Viewing:
    """The viewer's end of the link."""

    def __init__(self, history: History, end: ViewEnd, pipe: Connection) -> None:
        self.history = history
        self.land_asked = False
        self._end = end
        self._pipe = pipe
        self._tabs: set[Client] = set()

    async def begin(self) -> None:
        loop = asyncio.get_running_loop()
        loop.add_reader(self._end, self._take_records)
        loop.add_reader(self._pipe.fileno(), self._take_ending, loop)
        self._pipe.send("served")
        self._later = loop.create_task(self._until_nobody_looks())

    def land(self) -> None:
        """Ask the flight to land."""
        self.land_asked = True
        self._send_wish()

    def opened(self, tab: Client) -> None:
        self._tabs.add(tab)
        tab.on_delete(lambda: self._tabs.discard(tab))

    def _take_records(self) -> None:
        with contextlib.suppress(OSError):  # the flight's end is closed
            while (record := next_record(self._end)) is not None:
                self.history.take(record)

    def _take_ending(self, loop: asyncio.AbstractEventLoop) -> None:
        try:
            self.history.ending = self._pipe.recv()
        except (EOFError, OSError):
            loop.remove_reader(self._pipe.fileno())
            self.history.ending = self.history.ending or LOST

    def _send_wish(self) -> None:
        with contextlib.suppress(OSError):
            self._end.send(WISH_TO_LAND)

    async def _until_nobody_looks(self) -> None:
        seen_s = time.monotonic()
        while time.monotonic() - seen_s < GRACE_S:
            await asyncio.sleep(ASK_AGAIN_S)
            if self.land_asked and self.history.can_land:
                self._send_wish()
            if self.history.ending is None or any(tab.has_socket_connection for tab in self._tabs):
                seen_s = time.monotonic()
        app.shutdown()


def serve(brief: Brief, end: ViewEnd, pipe: Connection, host: str, port: int, token: str | None) -> None:
    """Serve the page of one flight. In a session of its own: Ctrl-C in the terminal is for the flight, which lands."""
    os.setsid()
    os.nice(POLITENESS)
    viewing = Viewing(History(brief), end, pipe)
    css = _css()

    @ui.page("/", title=f"quadctl live: {brief.mission.name}")
    async def index(client: Client) -> None:
        ui.add_css(css)
        viewing.opened(client)
        await LivePage(viewing).open(client)

    app.on_startup(viewing.begin)
    _guard(host, token)
    run_pages(host, port, show=False)


def _guard(host: str, token: str | None) -> None:
    add: Callable[..., None] = app.add_middleware
    if token is None:
        add(TrustedHostMiddleware, allowed_hosts=[host, "localhost"])
    else:
        add(Gate, token=token)


def _css() -> str:
    static = files("quadctl.web").joinpath("static")
    return "".join(static.joinpath(name).read_text(encoding="utf-8") for name in ("page.css", "live.css"))
