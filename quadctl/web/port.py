"""The port that a page is served at, and how."""

import socket

from quadctl.errors import QuadctlError

RECONNECT_S = 120.0
"""So long a tab may be away and find its page as it was."""


def require_free(host: str, port: int, option: str) -> None:
    """Better said before anything is done; `option` is that of the command line which names another.

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
    """Serve the pages that are registered until the process ends; `show`: in a browser that is opened."""
    from nicegui import ui  # not in the process that flies: it only asks whether a port is free

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
