"""Other sites: what a browser asks on their behalf is refused, and they cannot show a page in a frame."""

import asyncio
from typing import Any

import pytest

from quadctl.web.own_pages import OwnPagesOnly, is_foreign

HOST = "127.0.0.1:8080"
OWN = {"host": HOST, "origin": f"http://{HOST}"}
OTHER = {"host": HOST, "origin": "http://127.0.0.1:8081"}


@pytest.mark.parametrize(
    ("headers", "foreign"),
    [
        (OWN, False),
        (OTHER, True),
        ({"host": HOST, "origin": "null"}, True),  # a frame in a sandbox, a file
        ({"host": HOST}, False),  # a program that is no browser
        ({"host": HOST, "sec-fetch-site": "none", "sec-fetch-mode": "navigate"}, False),  # typed by hand
        ({"host": HOST, "sec-fetch-site": "cross-site", "sec-fetch-mode": "navigate"}, False),  # a link
        ({"host": HOST, "sec-fetch-site": "cross-site", "sec-fetch-mode": "no-cors"}, True),  # an image, a script
    ],
)
def test_a_site_is_known_by_its_headers(headers: dict[str, str], foreign: bool) -> None:
    assert is_foreign(headers) is foreign


def answered(kind: str, headers: dict[str, str]) -> list[dict[str, Any]]:
    """Messages that go back to the browser from a page that answers 200, or accepts."""
    sent: list[dict[str, Any]] = []

    async def page(scope: Any, receive: Any, send: Any) -> None:
        await send({"type": "http.response.start", "status": 200, "headers": []} if kind == "http" else ACCEPT)

    async def keep(message: Any) -> None:
        sent.append(message)

    raw = [(name.encode(), value.encode()) for name, value in headers.items()]
    asyncio.run(OwnPagesOnly(page)({"type": kind, "headers": raw}, None, keep))  # type: ignore[arg-type]
    return sent


ACCEPT = {"type": "websocket.accept"}


class TestOwnPagesOnly:
    def test_its_own_page_is_answered_and_forbids_every_frame(self) -> None:
        (start,) = answered("http", OWN)
        assert start["status"] == 200
        assert dict(start["headers"])[b"content-security-policy"] == b"frame-ancestors 'none'"

    def test_another_site_is_refused(self) -> None:
        assert answered("http", OTHER)[0]["status"] == 403

    def test_the_web_socket_is_for_its_own_page_only(self) -> None:
        assert answered("websocket", OWN) == [ACCEPT]
        assert answered("websocket", OTHER) == [{"type": "websocket.close", "code": 1008}]
