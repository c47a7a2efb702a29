"""The lines of a CSV file, whole or damaged, and their fields."""

import csv
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import BinaryIO

import numpy as np
import polars as pl
from numpy.typing import NDArray

from quadctl.errors import LogError
from quadctl.files import reading
from quadctl.logs.findings import Finding, Kind, finding

BYTE_ORDER_MARK = b"\xef\xbb\xbf"
CHUNK_BYTES = 1 << 23
"""Size of the parts in which a file is read and split into lines: the fields of a whole large file would need several
times its size."""


@dataclass(frozen=True, eq=False)
class Lines:
    """Lines of a file that can be read."""

    data: bytes
    """Whole lines, without the line feed of the last."""
    before: int
    """Number of lines before them in the file."""
    count: int
    """Number of the lines, blank ones included."""

    @property
    def text(self) -> pl.Series:
        """Lines that are not blank."""
        return self._kept[0]

    @property
    def number(self) -> NDArray[np.int64]:
        """Their numbers in the file, from 1, shape (n,)."""
        return self._kept[1]

    @cached_property
    def _kept(self) -> tuple[pl.Series, NDArray[np.int64]]:
        # Bytes that are no text, as a power cut leaves them, damage their line and not the file.
        text = self.data.decode("utf-8" if self.before else "utf-8-sig", errors="replace")
        kept = [(at, line) for at, raw in enumerate(text.split("\n"), self.before + 1) if (line := raw.strip("\r \t"))]
        return pl.Series([line for _, line in kept], dtype=pl.String), np.array([at for at, _ in kept], dtype=np.int64)

    def without_first(self) -> "Lines":
        """All but the first line that is not blank."""
        skipped, data = 0, self.data.removeprefix(BYTE_ORDER_MARK)
        blank = True
        while blank and data:
            line, _, data = data.partition(b"\n")
            skipped, blank = skipped + 1, not line.strip(b"\r \t")
        return Lines(data, self.before + skipped, self.count - skipped)


@dataclass(frozen=True)
class RawText:
    """The complete lines of a file; a large file is read and split into lines part by part."""

    path: Path
    spans: list[tuple[int, int]]
    """Place and size of each part in the file, bytes: whole lines, without the line feed of the last."""
    counts: list[int]
    """Number of lines of each."""
    findings: list[Finding]

    def parts(self) -> Iterator[Lines]:
        """The lines of each part; none for a part of blank lines."""
        before = 0
        with _opened(self.path) as file:
            for (begin, size), count in zip(self.spans, self.counts, strict=True):
                file.seek(begin)
                lines = Lines(file.read(size), before, count)
                before += count
                if lines.data.removeprefix(BYTE_ORDER_MARK).strip(b"\r\n \t"):
                    yield lines

    @property
    def first(self) -> tuple[int, str]:
        """Number and text of the first line that is not blank."""
        lines = next(self.parts())
        return int(lines.number[0]), str(lines.text[0])


def read_text(path: Path) -> RawText:
    """The complete lines of a file; raises LogError where it cannot be read, is empty or not text."""
    raw, blank, begin, rest, first = RawText(path, [], [], []), True, 0, b"", b""
    with _opened(path) as file:
        while chunk := file.read(CHUNK_BYTES):
            blank = blank and not chunk.strip()
            whole, newline, rest = (rest + chunk).rpartition(b"\n")
            if newline:
                first = first or whole.partition(b"\n")[0]
                raw.spans.append((begin, len(whole)))
                raw.counts.append(whole.count(b"\n") + 1)
                begin += len(whole) + 1
    if blank:
        raise LogError(f"{path}: is empty, expected a CSV flight log")
    if b"\0" in (first if raw.spans else rest):
        raise LogError(f"{path}: is not a text file, expected a CSV flight log")
    if not raw.spans and b"\r" in rest:
        raise LogError(f"{path}: ends its lines by carriage returns alone, expected line feeds")
    if rest.decode("utf-8" if raw.spans else "utf-8-sig", errors="replace").strip("\r \t\0"):
        # Even if it parses: nobody can tell whether its last number is whole.
        raw.findings.append(finding(Kind.LAST_LINE_CUT, line=sum(raw.counts) + 1))
    if next(raw.parts(), None) is None:
        raise LogError(f"{path}: has no complete line yet, expected a CSV flight log")
    return raw


@contextmanager
def _opened(path: Path) -> Iterator[BinaryIO]:
    if path.is_dir():
        raise LogError(f"{path}: is a directory, expected a CSV flight log")
    with reading(path, LogError), path.open("rb") as file:
        yield file


def split_line(line: str) -> list[str]:
    """The fields of a line; quoted ones may hold commas."""
    if '"' not in line:
        return line.split(",")
    try:
        return next(csv.reader([line]))
    except csv.Error:  # a field beyond the library's limit: whatever this is, it is no number
        return line.split(",")
