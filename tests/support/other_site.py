"""Another site that a person has open beside a page of quadctl, and that tries to use it."""

import http.client
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from typing import Any

_ATTACK = """<title>waiting</title><iframe src="{url}"></iframe><script>
const socket = new WebSocket("{url}/_nicegui_ws/socket.io/?EIO=4&transport=websocket".replace("http", "ws"));
socket.onopen = () => document.title = "open";
socket.onerror = () => document.title = "refused";
</script>"""


@contextmanager
def attacking(url: str) -> Iterator[str]:
    """Address of a site that frames the page at `url` and opens its web socket; its title says what came of that."""

    class Answer(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(_ATTACK.replace("{url}", url).encode())

        def log_message(self, *_: Any) -> None:
            """Nothing: it would stand between the lines of the tests."""

    with ThreadingHTTPServer(("127.0.0.1", 0), Answer) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


def upgrade_status(port: int, **further: str) -> int:
    """Answer of a page's server to a web socket with these headers."""
    connection = http.client.HTTPConnection("127.0.0.1", port)
    headers = {"Connection": "Upgrade", "Upgrade": "websocket", "Sec-WebSocket-Version": "13"}
    key = {"Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA=="}
    connection.request("GET", "/_nicegui_ws/socket.io/?EIO=4&transport=websocket", headers=headers | key | further)
    return connection.getresponse().status
