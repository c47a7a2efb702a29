"""Access to the live view: with a token, for those who know it; without one, for this machine."""

import hmac
from collections.abc import Iterable
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs

from starlette.responses import PlainTextResponse, RedirectResponse
from starlette.types import ASGIApp, Receive, Scope, Send

COOKIE = "quadctl-view"
REFUSED = "This live view needs its token: open the address that quadctl printed, with ?token= at its end.\n"


class Gate:
    """Refuses every request, those of web sockets too, that does not hold the token.

    The address with `?token=` at its end sets a cookie, and leads to the page.
    """

    def __init__(self, app: ASGIApp, token: str) -> None:
        self._app = app
        self._token = token

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket") or self._knows(_cookies(scope)):
            await self._app(scope, receive, send)
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008})
        elif self._knows(parse_qs(scope["query_string"].decode("latin-1")).get("token", [])):
            inside = RedirectResponse(scope["path"])
            inside.set_cookie(COOKIE, self._token, httponly=True, samesite="strict")
            await inside(scope, receive, send)
        else:
            await PlainTextResponse(REFUSED, status_code=401)(scope, receive, send)

    def _knows(self, words: Iterable[str]) -> bool:
        return any(hmac.compare_digest(word.encode(), self._token.encode()) for word in words)


def _cookies(scope: Scope) -> list[str]:
    found = []
    for name, value in scope["headers"]:
        if name == b"cookie":
            try:
                cookies = SimpleCookie(value.decode("latin-1"))
            except CookieError:
                continue
            if COOKIE in cookies:
                found.append(cookies[COOKIE].value)
    return found
