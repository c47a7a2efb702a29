"""Sites that may ask a page of quadctl: itself. All others are refused, and cannot show it in a frame."""

from collections.abc import Awaitable, Callable, Mapping, MutableMapping
from typing import Any
from urllib.parse import urlsplit

Message = MutableMapping[str, Any]
"""As ASGI defines it; the types of a web library would load it in the process that flies."""
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
Application = Callable[[Message, Receive, Send], Awaitable[None]]
NOT_FRAMED = [(b"content-security-policy", b"frame-ancestors 'none'"), (b"x-frame-options", b"DENY")]
"""Headers that forbid every site to show a page in a frame, where a person could be led to press its buttons."""
REFUSED = b"Only the page itself may ask this of quadctl, not another site.\n"


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

    def __init__(self, app: Application) -> None:
        self._app = app

    async def __call__(self, scope: Message, receive: Receive, send: Send) -> None:
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


def _not_framed(message: Message) -> Message:
    if message["type"] != "http.response.start":
        return message
    return {**message, "headers": [*message.get("headers", []), *NOT_FRAMED]}
