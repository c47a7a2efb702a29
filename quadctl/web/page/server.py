"""Serve the page, to this machine only."""

import asyncio
from collections.abc import Awaitable, Callable
from importlib.resources import files

from nicegui import app, ui
from nicegui.client import Client
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response

from quadctl.logs.memory import return_freed_memory
from quadctl.web.elements.html import LOAD_PLOTLY
from quadctl.web.page.page import TELL_OF_BACK, Page
from quadctl.web.port import require_free, run_pages
from quadctl.web.session.files import MAX_UPLOAD_BYTES
from quadctl.web.session.session import Session
from quadctl.web.workbench.intake import Intake
from quadctl.web.workbench.workbench import Workbench

HOST = "127.0.0.1"
BETWEEN_TRIALS_S = 0.05
"""Time between two trials whether the server answers."""
FORM_BYTES = 2**20
"""Allowance for the form that a browser sends the files in."""


def serve(
    make_bench: Callable[[], Workbench],
    session: Session,
    intake: Callable[[Workbench], Intake],
    port: int,
    show: bool,
    announce: Callable[[str], None],
) -> None:
    """Serve one workbench until Ctrl-C; it begins with `session`. `announce` is told the address when it answers.

    Raises
    ------
    QuadctlError
        The port is taken.
    """
    require_free(HOST, port, "--port")
    return_freed_memory()
    bench = make_bench()
    taking = intake(bench)
    css = files("quadctl.web").joinpath("static/page.css").read_text(encoding="utf-8")

    @ui.page("/", title="quadctl lab")
    async def index(client: Client, request: Request) -> None:
        ui.add_css(css)
        ui.add_body_html(LOAD_PLOTLY + TELL_OF_BACK)
        await Page(bench, taking, client, request.url.query).open()

    app.on_startup(lambda: bench.resume(session))
    app.on_startup(lambda: _announce(port, announce))
    app.on_shutdown(bench.close)
    app.add_middleware(TrustedHostMiddleware, allowed_hosts=[HOST, "localhost"])
    app.middleware("http")(_refuse_large)
    run_pages(HOST, port, show=show)


async def _announce(port: int, announce: Callable[[str], None]) -> None:
    """Tell the address as soon as it answers."""
    while True:
        try:
            _, connection = await asyncio.open_connection(HOST, port)
            break
        except OSError:
            await asyncio.sleep(BETWEEN_TRIALS_S)
    connection.close()
    announce(f"http://{HOST}:{port}")


async def _refuse_large(request: Request, respond: Callable[[Request], Awaitable[Response]]) -> Response:
    """A page can be told to send anything: what is too large is refused before it is read."""
    length = request.headers.get("content-length", "0")
    if not length.isdigit() or int(length) > MAX_UPLOAD_BYTES + FORM_BYTES:
        return PlainTextResponse(f"more than {MAX_UPLOAD_BYTES // 2**20} MB cannot be taken", status_code=413)
    return await respond(request)
