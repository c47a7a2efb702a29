"""Upload of files, each streamed to the disk as it comes.

NiceGUI's own upload reads a form, which keeps a copy of every file in the folder for temporary files and then another
one: of a log of a million rows that takes seconds, and on a small computer that folder is memory.
"""

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote
from uuid import uuid4

from nicegui import app, ui
from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response

WRITTEN_AT_ONCE_BYTES = 1 << 22
NAME = "X-File-Name"
"""Header with the name of the file, in the encoding of addresses. No form of another site can send it."""
_HEADERS = f"files => [{{name: '{NAME}', value: encodeURIComponent(files[0].name)}}]"


@dataclass(frozen=True)
class SentFile:
    """A file that a browser has sent."""

    name: str
    """As the browser calls it: it may hold anything."""
    path: Path
    error: OSError | None = None
    """Reason why it could not be written."""

    async def save(self, path: Path) -> None:
        """Move it to `path`, in the folder where it was written; raises OSError where that fails."""
        if self.error is not None:
            raise self.error
        self.path.replace(path)


class StreamedUpload(ui.upload):
    """Upload that writes each file into a folder while it comes."""

    def __init__(self, *, multiple: bool = False, max_file_size: int | None = None, label: str = "") -> None:
        super().__init__(multiple=multiple, max_file_size=max_file_size, label=label, auto_upload=True)
        self._sent: list[SentFile] = []
        self._address = f"/upload/{self.client.id}/{self.id}"

    def stream_to(self, folder: Path, take: Callable[[Sequence[SentFile]], Awaitable[None]]) -> None:
        """Write the files into `folder`, and give all of a drop to `take` when they are there; what that does not save
        is removed."""
        self._props.update({"url": self._address, "send-raw": True, ":headers": _HEADERS})

        async def receive(request: Request) -> Response:
            return await self._receive(request, folder)

        app.add_api_route(self._address, receive, methods=["POST"], include_in_schema=False)
        self.on("finish", lambda: self._give(take), args=[])

    async def _receive(self, request: Request, folder: Path) -> Response:
        if NAME not in request.headers or self.is_ignoring_events:
            return Response(status_code=403)
        path = folder / f".{uuid4().hex}.tmp"
        sent = SentFile(unquote(request.headers[NAME]), path)
        try:
            await _write(request, path)
        except ClientDisconnect:
            path.unlink(missing_ok=True)
            return Response(status_code=400)
        except OSError as error:
            path.unlink(missing_ok=True)
            sent = SentFile(sent.name, path, error)
        self._sent.append(sent)
        return Response()

    async def _give(self, take: Callable[[Sequence[SentFile]], Awaitable[None]]) -> None:
        """Give the files that have come, in the order of their names: they may have come in any."""
        sent, self._sent = sorted(self._sent, key=lambda file: file.name), []
        if sent:
            await take(sent)
        _remove(sent)

    def _handle_delete(self) -> None:
        app.remove_route(self._address)
        _remove(self._sent)
        super()._handle_delete()


def choose_button(upload: ui.upload, label: str, icon: str, props: str) -> None:
    """Draw a button that opens the window in which files for `upload` are chosen: only in the browser itself may a
    click do so."""
    choose = ui.button(label, icon=icon).props(f"no-caps {props}")
    choose.on("click", js_handler=f"() => runMethod({upload.id}, 'pickFiles', [])")


async def _write(request: Request, path: Path) -> None:
    """Write the body of a request to a new file; a disk is slow, and others wait for the page meanwhile."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("xb") as file:
        waiting = bytearray()
        async for chunk in request.stream():
            waiting += chunk
            if len(waiting) >= WRITTEN_AT_ONCE_BYTES:
                await asyncio.to_thread(file.write, waiting)
                waiting = bytearray()
        await asyncio.to_thread(file.write, waiting)


def _remove(sent: Sequence[SentFile]) -> None:
    for file in sent:
        file.path.unlink(missing_ok=True)
