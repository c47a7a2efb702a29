"""Ports, and the web server, for both pages."""

import socket

from quadctl.errors import QuadctlError
from quadctl.web.own_pages import OwnPagesOnly

RECONNECT_S = 120.0
"""Longest time for which a tab may lose its connection and find its page unchanged."""


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
