"""Start the live view of a flight in a process of its own, and end it when its last tab is closed.

The process that flies imports this module, so it imports nothing of the page itself.
"""

import contextlib
import importlib.util
import multiprocessing
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess

from quadctl.errors import QuadctlError
from quadctl.flight.pilot.outcome import Outcome
from quadctl.flight.record.view_link import ViewEnd, connected_ends
from quadctl.web.live.history import Brief, Ending
from quadctl.web.port import require_free

THIS_MACHINE, EVERYWHERE = "127.0.0.1", "0.0.0.0"
START_TIMEOUT_S = 60.0


class Viewer:
    """The flight's end of the link to the live view."""

    def __init__(self, end: ViewEnd, pipe: Connection) -> None:
        self.end = end
        self._pipe = pipe
        self._told = False

    def tell(self, outcome: Outcome) -> None:
        """Tell the viewer the outcome of the flight."""
        self._say(Ending(outcome.completed, outcome.lines()))

    def fail(self, sentence: str) -> None:
        """Tell the viewer why there was no flight, unless it has been told an outcome."""
        if not self._told:
            self._say(Ending(False, [sentence]))

    def _say(self, ending: Ending) -> None:
        self._told = True
        with contextlib.suppress(OSError):  # it is gone
            self._pipe.send(ending)


@contextlib.contextmanager
def live_view(brief: Brief, port: int, token: str | None, announce: Callable[[str], None]) -> Iterator[Viewer]:
    """Run a viewer for one flight; at the end, wait until its last tab is closed, or Ctrl-C.

    `announce` is called with sentences for the terminal.

    Raises
    ------
    QuadctlError
        NiceGUI is not installed, the port is taken, or the page could not be served.
    """
    if importlib.util.find_spec("nicegui") is None:
        raise QuadctlError("--view needs nicegui, which the lean install leaves out: pip install 'quadctl[web]'")
    host = THIS_MACHINE if token is None else EVERYWHERE
    require_free(host, port, "--view-port")
    flight, viewer = connected_ends()
    here, there = multiprocessing.Pipe()
    process = multiprocessing.get_context("spawn").Process(
        name="MainProcess",  # NiceGUI serves in no other
        target=_serve,
        args=(brief, viewer, there, host, port, token),
        daemon=True,
    )
    process.start()
    there.close()
    viewer.close()
    with flight, here:
        try:
            _wait_until_served(here)
            query = "" if token is None else f"/?token={token}"
            where = "for this machine only" if token is None else "on this machine's other addresses too"
            announce(f"The live view is at http://{THIS_MACHINE}:{port}{query}, {where}.")
            made = Viewer(flight, here)
            try:
                yield made
            except QuadctlError as error:
                made.fail(str(error))
                _wait_for_tabs(process, announce)
                raise
            _wait_for_tabs(process, announce)
        finally:
            process.terminate()
            process.join()


def _serve(brief: Brief, end: ViewEnd, pipe: Connection, host: str, port: int, token: str | None) -> None:
    """Serve the page, in the child process."""
    from quadctl.web.live.server import serve

    serve(brief, end, pipe, host, port, token)


def _wait_until_served(pipe: Connection) -> None:
    with contextlib.suppress(EOFError):  # it died
        if pipe.poll(START_TIMEOUT_S) and pipe.recv() == "served":
            return
    raise QuadctlError("the live view did not start")


def _wait_for_tabs(process: BaseProcess, announce: Callable[[str], None]) -> None:
    if process.is_alive():
        announce("The live view stays until its last tab is closed, or Ctrl-C.")
        with contextlib.suppress(KeyboardInterrupt):
            process.join()
