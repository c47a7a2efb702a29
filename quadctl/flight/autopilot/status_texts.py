"""Texts of the autopilot: STATUSTEXT messages, whose chunks become whole texts again."""

from collections.abc import Mapping
from typing import Any, NamedTuple

from quadctl.state import StatusText

CHUNK = 50
"""Length of a chunk; a shorter one is the last of its text."""
PATIENCE_S = 0.5
"""Time after which no further chunk of a text is expected: they are sent one right after another."""
KEPT = 50
"""Number of texts that are kept."""
LOST = "..."
"""Mark in place of each chunk that did not arrive."""


class _Unfinished(NamedTuple):
    """Text of which more chunks may come."""

    number: int
    received_s: float
    severity: int
    chunks: dict[int, str]

    @property
    def complete(self) -> bool:
        last = max(self.chunks)
        return len(self.chunks[last]) < CHUNK and len(self.chunks) == last + 1

    @property
    def text(self) -> StatusText:
        """Parts that have arrived, as one text."""
        joined = "".join(self.chunks.get(i, LOST) for i in range(max(self.chunks) + 1))
        # PX4 ends a text with a tab when the same is sent as an event too.
        return StatusText(self.received_s, self.severity, joined.strip("\0\t "))


class StatusTexts:
    """The latest texts. A text is whole when its short last chunk has come; the next text, or time, ends it too, as a
    text of exactly 50 characters has no short chunk."""

    def __init__(self) -> None:
        self.texts: tuple[StatusText, ...] = ()
        """Texts that are over, oldest first; a new tuple for each."""
        self._unfinished: _Unfinished | None = None

    def take(self, fields: Mapping[str, Any], now_s: float) -> None:
        """Take in the fields of one STATUSTEXT."""
        number, place = int(fields.get("id", 0)), int(fields.get("chunk_seq", 0))
        chunk = fields["text"].split("\0", 1)[0]
        unfinished = self._unfinished
        if unfinished is None or unfinished.number != number or place in unfinished.chunks:
            self._end()
            unfinished = self._unfinished = _Unfinished(number, now_s, int(fields["severity"]), {})
        unfinished.chunks[place] = chunk
        if unfinished.complete:
            self._end()

    def settle(self, now_s: float) -> None:
        """End a text of which no more is to be expected."""
        if self._unfinished is not None and now_s - self._unfinished.received_s > PATIENCE_S:
            self._end()

    def since(self, since_s: float) -> list[StatusText]:
        """Texts that began to arrive at `since_s` or later, the last of them perhaps not whole."""
        begun = [] if self._unfinished is None else [self._unfinished.text]
        return [text for text in (*self.texts, *begun) if text.received_s >= since_s]

    def _end(self) -> None:
        if self._unfinished is not None:
            self.texts = (*self.texts, self._unfinished.text)[-KEPT:]
            self._unfinished = None
