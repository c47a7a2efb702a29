"""Upload: files are written as they come, given together, and nothing is left of those that did not come."""

import asyncio
import errno
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest
from nicegui import Client, ui
from starlette.requests import Request
from starlette.responses import Response

from quadctl.web.elements import upload
from quadctl.web.elements.upload import NAME, SentFile, StreamedUpload


class Drop:
    """An upload on a page, and what it gave."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.given: list[tuple[str, bytes]] = []
        self.errors: list[str | None] = []
        self.element = StreamedUpload(multiple=True)
        self.element.stream_to(folder, self.take)

    async def take(self, files: Sequence[SentFile]) -> None:
        for file in files:
            try:
                await file.save(self.folder / "kept")
                self.given.append((file.name, (self.folder / "kept").read_bytes()))
            except OSError as error:
                self.errors.append(error.strerror)

    def sends(self, name: str, *parts: bytes, whole: bool = True, header: str = NAME) -> Response:
        """Send a file in parts; a connection that is lost says so."""
        messages: Iterator[dict[str, object]] = iter(
            [{"type": "http.request", "body": part, "more_body": not whole or part is not parts[-1]} for part in parts]
            + [{"type": "http.disconnect"}]
        )

        async def receive() -> dict[str, object]:
            return next(messages)

        scope = {"type": "http", "method": "POST", "headers": [(header.lower().encode(), name.encode())]}
        return asyncio.run(self.element._receive(Request(scope, receive), self.folder))  # type: ignore[arg-type]

    def finishes(self) -> None:
        asyncio.run(self.element._give(self.take))

    @property
    def left(self) -> list[str]:
        return [path.name for path in self.folder.iterdir() if path.name != "kept"]


@pytest.fixture
def drop(tmp_path: Path) -> Iterator[Drop]:
    with Client(ui.page("/")):
        yield Drop(tmp_path)


def test_files_of_a_drop_are_given_together_in_the_order_of_their_names(drop: Drop) -> None:
    for name, content in (("b.csv", b"later"), ("%C3%BC%20a.csv", b"umlaut"), ("a.csv", b"first")):
        assert drop.sends(name, content[:2], content[2:]).status_code == 200
    assert drop.given == []
    drop.finishes()
    assert drop.given == [("a.csv", b"first"), ("b.csv", b"later"), ("ü a.csv", b"umlaut")]
    drop.finishes()
    assert len(drop.given) == 3
    assert drop.left == []


def test_nothing_is_left_of_a_file_whose_sender_went_away(drop: Drop) -> None:
    assert drop.sends("a.csv", b"x" * 100, whole=False).status_code == 400
    assert drop.left == []
    drop.finishes()
    assert drop.given == []


def test_a_file_that_cannot_be_written_says_why(drop: Drop, monkeypatch: pytest.MonkeyPatch) -> None:
    async def full(request: Request, path: Path) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(upload, "_write", full)
    drop.sends("a.csv", b"x")
    drop.finishes()
    assert drop.errors == ["No space left on device"]


def test_a_form_of_another_site_has_no_such_header(drop: Drop) -> None:
    assert drop.sends("a.csv", b"x", header="content-type").status_code == 403
    assert drop.left == []


def test_what_nobody_took_goes_with_the_element(drop: Drop) -> None:
    drop.sends("a.csv", b"x")
    assert len(drop.left) == 1
    drop.element.delete()
    assert drop.left == []
