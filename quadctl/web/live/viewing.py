"""The viewer's end of the link to a flight: takes its records, sends the wish to land, ends when nobody looks."""

import asyncio
import contextlib
import time
from multiprocessing.connection import Connection

from nicegui import app
from nicegui.client import Client

from quadctl.flight.record.view_link import WISH_TO_LAND, ViewEnd, next_record
from quadctl.web.live.history import LOST, History

ASK_AGAIN_S = 0.2
"""A wish to land is repeated at this interval until the flight ends."""
GRACE_S = 5.0
"""Longest time that all tabs may be away, to be loaded again for example, when the flight is over."""


class Viewing:
    """The viewer's end of the link, and the tabs that are open."""

    def __init__(self, history: History, end: ViewEnd, pipe: Connection) -> None:
        self.history = history
        self.land_asked = False
        self._end = end
        self._pipe = pipe
        self._tabs: set[Client] = set()

    async def begin(self) -> None:
        loop = asyncio.get_running_loop()
        loop.add_reader(self._end, self._take_records)
        loop.add_reader(self._pipe.fileno(), self._take_ending, loop)
        self._pipe.send("served")
        self._later = loop.create_task(self._until_nobody_looks())

    def land(self) -> None:
        """Ask the flight to land."""
        self.land_asked = True
        self._send_wish()

    def opened(self, tab: Client) -> None:
        self._tabs.add(tab)
        tab.on_delete(lambda: self._tabs.discard(tab))

    def _take_records(self) -> None:
        with contextlib.suppress(OSError):  # the flight's end is closed
            while (record := next_record(self._end)) is not None:
                self.history.take(record)

    def _take_ending(self, loop: asyncio.AbstractEventLoop) -> None:
        try:
            self.history.ending = self._pipe.recv()
        except (EOFError, OSError):
            loop.remove_reader(self._pipe.fileno())
            self.history.ending = self.history.ending or LOST

    def _send_wish(self) -> None:
        with contextlib.suppress(OSError):
            self._end.send(WISH_TO_LAND)

    async def _until_nobody_looks(self) -> None:
        seen_s = time.monotonic()
        while time.monotonic() - seen_s < GRACE_S:
            await asyncio.sleep(ASK_AGAIN_S)
            if self.land_asked and self.history.can_land:
                self._send_wish()
            if self.history.ending is None or any(tab.has_socket_connection for tab in self._tabs):
                seen_s = time.monotonic()
        app.shutdown()
