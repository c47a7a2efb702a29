"""Desk of the page: the messages, the work in progress, and whoever is told that something has changed."""

import asyncio
import logging
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Literal

from quadctl.errors import QuadctlError
from quadctl.logs.flight_log import FlightLog
from quadctl.web.work import jobs
from quadctl.web.work.exchange import Exchange
from quadctl.web.work.state import Message, Work
from quadctl.web.work.worker import CancelledError, Worker

_LOG = logging.getLogger(__name__)


@dataclass(repr=False, kw_only=True)
class Desk:
    """One work at a time and a search beside it, in a process each, so that neither waits for the other."""

    work: Work | None = None
    search: Work | None = None
    message: Message | None = None
    as_read: tuple[FlightLog, ...] = ()
    """Logs that have been read and are being prepared."""
    waiting: tuple[str, ...] = ()
    """Names of the files that are taken as soon as the work in progress is done."""
    windows: int = 0
    """Number of windows and tabs of browsers that show it now."""

    def __post_init__(self) -> None:
        self._listeners: list[Callable[[], None]] = []
        self._exchange = Exchange()
        self._quick = Worker(jobs.__name__, self._exchange)
        self._slow = Worker(jobs.__name__, self._exchange, patient=True)
        self._tasks: set[asyncio.Task[None]] = set()
        self._turn, self._free = asyncio.Lock(), asyncio.Event()

    def subscribe(self, listener: Callable[[], None]) -> Callable[[], None]:
        """Tell `listener` of every change; calling what is given back ends that."""
        self._listeners.append(listener)
        return lambda: self._listeners.remove(listener)

    def count_window(self, more: int) -> None:
        """Count windows that show it from now on; those that do no more, with a minus sign."""
        self.windows += more
        self._changed()

    def _changed(self) -> None:
        for listener in list(self._listeners):
            try:
                listener()
            except Exception:  # a page that cannot draw itself must not stop the work, nor the other pages
                _LOG.exception("a page could not be drawn")

    def say(
        self, kind: Literal["error", "done", "found"], text: str, undo: bool = False, go_back: bool = False
    ) -> None:
        self.message = Message(kind, text, undo, go_back)
        self._changed()

    def dismiss(self, message: Message | None = None) -> None:
        """Take away the message that stands; where `message` is given, only if it is that one."""
        if message is None or message is self.message:
            self.message = None
            self._changed()

    @asynccontextmanager
    async def in_turn(self, names: Sequence[str]) -> AsyncIterator[None]:
        """Wait with files of these names until no work is in progress, and those that came before are taken."""
        self.waiting = (*self.waiting, *names)
        self._changed()
        async with self._turn:
            while self.work is not None:
                self._free.clear()
                await self._free.wait()
            self.waiting = self.waiting[len(names) :]
            self._changed()
            yield

    def cancel(self) -> None:
        """End the work that is being done."""
        self._quick.cancel()

    @asynccontextmanager
    async def _working(self, title: str) -> AsyncIterator[Callable[[str], None]]:
        """Run one work at a time: show its progress, and say so when it fails or is cancelled."""
        if self.work is not None:
            self.say("error", f"{self.work.title} is not finished yet: wait for it, or cancel it.")
            raise CancelledError
        self.work = Work(title)
        self.message = None
        self._changed()

        def progress(text: str) -> None:
            self.work = Work(title, text)
            self._changed()

        try:
            yield progress
        except CancelledError:
            self.message = Message("done", f"{title} was cancelled; nothing is lost.")
        except QuadctlError as error:
            self.message = Message("error", str(error))
        finally:
            self.work, self.as_read = None, ()
            self._free.set()
            self._changed()

    def _begin(self, work: Awaitable[None]) -> None:
        task = asyncio.ensure_future(work)
        self._tasks.add(task)  # asyncio itself holds tasks only weakly
        task.add_done_callback(self._tasks.discard)

    def cancel_search(self) -> None:
        if self.search is not None:
            self.search = None
            self._slow.cancel()
            self._changed()

    def close(self) -> None:
        self._quick.close()
        self._slow.close()
        self._exchange.close()
