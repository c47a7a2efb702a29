"""The viewer's process: serves the live page of one flight, at low priority."""

import os
from collections.abc import Callable
from importlib.resources import files
from multiprocessing.connection import Connection

from nicegui import app, ui
from nicegui.client import Client
from starlette.middleware.trustedhost import TrustedHostMiddleware

from quadctl.flight.record.view_link import ViewEnd
from quadctl.web.elements.html import LOAD_PLOTLY
from quadctl.web.live.gate import Gate
from quadctl.web.live.history import Brief, History
from quadctl.web.live.page import LivePage
from quadctl.web.live.viewing import Viewing
from quadctl.web.port import run_pages

POLITENESS = 5
"""Nice value of the process: the flight goes first."""


def serve(brief: Brief, end: ViewEnd, pipe: Connection, host: str, port: int, token: str | None) -> None:
    """Serve the page of one flight.

    The process gets a session of its own: Ctrl-C in the terminal then reaches the flight only, which lands.
    """
    os.setsid()
    os.nice(POLITENESS)
    viewing = Viewing(History(brief), end, pipe)
    css = _css()

    @ui.page("/", title=f"quadctl live: {brief.mission.name}")
    async def index(client: Client) -> None:
        ui.add_css(css)
        ui.add_body_html(LOAD_PLOTLY)
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
