"""The port that a page is served at."""

import socket

from quadctl.errors import QuadctlError


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
