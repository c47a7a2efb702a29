"""End of a PX4 ULog: whether the file stops within a message, as one does that was cut, whatever is damaged before."""

import itertools
import mmap
import struct
from pathlib import Path

HEADER_BYTES = 16
"""Length of the header, before the first message."""
MESSAGE_KINDS = frozenset(b"BFIMPQARDSLCO")
"""Letters of the messages of a ULog."""
CHAIN = 8
"""Number of messages one after the other by which the first is found again, behind damage or in the middle."""
LAST_BYTES = 1 << 20
"""Length of a file's end that is looked at: the largest message takes a sixteenth."""
_DATA, _FLAGS = ord("D"), ord("B")
_OFFSETS = struct.Struct("<3Q")
_OFFSETS_AT = HEADER_BYTES + 3 + 16
"""Place of the offsets at which data were appended, in the message of the flags, which is the first."""


def is_cut_short(path: Path) -> bool:
    """Tell whether a ULog, or the part of it before appended data, ends within a message.

    Each message begins with its length and its kind; those of one topic have one length.
    """
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        edges = [HEADER_BYTES, *_appended(data), len(data)]
        if edges != sorted(edges):
            return True
        return any(_Messages(data, end).stop_within_one(begin) for begin, end in itertools.pairwise(edges))


def _appended(data: mmap.mmap) -> list[int]:
    """Places at which a later start of the autopilot appended what it found of a crash."""
    if len(data) < _OFFSETS_AT + _OFFSETS.size or data[HEADER_BYTES + 2] != _FLAGS:
        return []
    return [at for at in _OFFSETS.unpack_from(data, _OFFSETS_AT) if at]


class _Messages:
    """Messages of a file up to `end`."""

    def __init__(self, data: mmap.mmap, end: int) -> None:
        self._data, self._end = data, end
        self._lengths: dict[int, int] = {}
        """By the number of the topic."""

    def stop_within_one(self, at: int) -> bool:
        """Tell whether the last one, of those from `at` on, is not whole."""
        if at < self._end - LAST_BYTES:
            at = self._found_again(self._end - LAST_BYTES) or at
        while at + 3 <= self._end:
            after = self._after(at)
            if after is not None and after <= self._end:
                self._learn(at)
                at = after
                continue
            found = None if after is not None and self._is_known(at) else self._found_again(at + 1)
            if found is None:
                return after is not None  # else it is damage, up to the end
            at = found
        return at != self._end

    def _after(self, at: int) -> int | None:
        """Place after the message at `at`; None where there is none."""
        length, kind = self._data[at] | self._data[at + 1] << 8, self._data[at + 2]
        if kind not in MESSAGE_KINDS or length == 0:
            return None
        if kind == _DATA and at + 5 <= self._end and length != self._lengths.get(self._topic(at), length):
            return None
        return at + 3 + length

    def _topic(self, at: int) -> int:
        return int.from_bytes(self._data[at + 3 : at + 5], "little")

    def _learn(self, at: int) -> None:
        if self._data[at + 2] == _DATA:
            self._lengths.setdefault(self._topic(at), self._data[at] | self._data[at + 1] << 8)

    def _is_known(self, at: int) -> bool:
        """Tell whether a message of a topic is as long as others of it."""
        if self._data[at + 2] != _DATA or self._after(at) is None:
            return False
        return at + 5 <= self._end and self._topic(at) in self._lengths

    def _found_again(self, at: int) -> int | None:
        """First place from `at` on at which some messages follow each other, or known ones up to the end; else None."""
        return next((begin for begin in range(at, self._end - 2) if self._is_chain(begin)), None)

    def _is_chain(self, at: int) -> bool:
        known = 0
        for _ in range(CHAIN):
            if at + 3 > self._end:
                return known > 0
            if (after := self._after(at)) is None:
                return False
            known += self._is_known(at)
            if after >= self._end:
                return known > 0
            at = after
        return True
