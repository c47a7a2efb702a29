"""Ports, the origins that may ask, and the web server, for both pages."""

import socket
from collections.abc import Mapping
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

from quadctl.errors import QuadctlError

if TYPE_CHECKING:  # not in the process that flies
    from starlette.types import ASGIApp, Message, Receive, Scope, Send

RECONNECT_S = 120.0
"""Longest time for which a tab may lose its connection and find its page unchanged."""
NOT_FRAMED = [(b"content-security-policy", b"frame-ancestors 'none'"), (b"x-frame-options", b"DENY")]
"""Headers that forbid every site to show a page in a frame, where a person could be led to press its buttons."""
REFUSED = b"Only the page itself may ask this of quadctl, not another site.\n"


def require_free(host: str, port: int, option: str) -> None:
    """Refuse a taken port before any work is done; `option` is the option of the command line that names another.

    Raises
    ------
    QuadctlError
        The port is taken.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError:
            raise QuadctlError(f"port {port} is taken, expected a free one: name another with {option}") from None


def is_foreign(headers: Mapping[str, str]) -> bool:
    """Tell whether another site asks: `headers` of an HTTP request or of a web socket, names in lower case.

    Programs that are no browser send neither header, and are not refused. A browser that follows a link sends no
    origin; what it asks for is shown as a page of its own, which cannot be framed.
    """
    origin = headers.get("origin")
    if origin is not None:
        return urlsplit(origin).netloc != headers.get("host")
    follows_a_link = headers.get("sec-fetch-mode") == "navigate"
    return headers.get("sec-fetch-site", "none") not in ("same-origin", "none") and not follows_a_link


class OwnPagesOnly:
    """Refuses requests and web sockets of other sites, and forbids them to frame a page."""

    def __init__(self, app: "ASGIApp") -> None:
        self._app = app

    async def __call__(self, scope: "Scope", receive: "Receive", send: "Send") -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        foreign = is_foreign({name.decode("latin-1"): value.decode("latin-1") for name, value in scope["headers"]})
        if foreign and scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008})
        elif foreign:
            await send({"type": "http.response.start", "status": 403, "headers": [*NOT_FRAMED]})
            await send({"type": "http.response.body", "body": REFUSED})
        else:
            await self._app(scope, receive, lambda message: send(_not_framed(message)))


def _not_framed(message: "Message") -> "Message":
    if message["type"] != "http.response.start":
        return message
    return {**message, "headers": [*message.get("headers", []), *NOT_FRAMED]}


def run_pages(host: str, port: int, *, show: bool) -> None:
    """Serve the registered pages to themselves until the process ends; `show`: open a browser too."""
    from nicegui import app, ui  # not in the process that flies: it only asks whether a port is free

    app.add_middleware(OwnPagesOnly)
    ui.run(
        host=host,
        port=port,
        show=show,
        reload=False,
        tailwind=False,
        dark=None,
        favicon="🚁",
        show_welcome_message=False,
        language="en-US",
        reconnect_timeout=RECONNECT_S,
        gzip_middleware_factory=None,  # nothing is far away: packing costs more than it saves
    )
