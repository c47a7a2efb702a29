"""Values between the processes of the page: large arrays lie in files that all of them map, and are not sent again.

A flight of a million rows has half a gigabyte of arrays. Pickled into a pipe, each process would hold its own copy, and
two more on the way. Here a message holds the places of large arrays in files instead (pickle protocol 5, PEP 574), and
an array that came out of such a file goes on as its place. The pages of a file are in memory once for all processes.
"""

import contextlib
import mmap
import os
import pickle
import secrets
import tempfile
import weakref
from pathlib import Path
from typing import Any, NamedTuple

import cloudpickle  # effects in a person's own file are in no module that another process could import
import numpy as np

LARGE_BYTES = 1 << 20
"""Least size of an array that goes into a file."""
ALIGNMENT = 64


class Place(NamedTuple):
    """Place of an array: a file in the folder of the exchange, and its bytes there."""

    file: str
    begin: int
    size: int


class Exchange:
    """One process's end of the exchange. The process that makes the folder owns the files: it must outlive the others,
    and every message goes from it or to it.

    Arrays that were received can be changed: a page of a file that is written to becomes the process's own.
    """

    def __init__(self, folder: Path | None = None) -> None:
        """Use the `folder` of another process, or make one, which is removed with this exchange."""
        self._made = _temporary_folder() if folder is None else None
        self.folder = Path(self._made.name) if folder is None and self._made is not None else Path(folder or "")
        self._maps: weakref.WeakValueDictionary[str, mmap.mmap] = weakref.WeakValueDictionary()
        """Files that are mapped here, as long as an array lies in them."""

    def pack(self, value: Any) -> tuple[bytes, str]:
        """Bytes of a message, and the name of the file that was written for it; empty where none was."""
        buffers: list[memoryview] = []
        places: list[Place | None] = []

        def is_small(buffer: pickle.PickleBuffer) -> bool:
            raw = buffer.raw()
            if raw.nbytes < LARGE_BYTES:
                return True
            place = self._place_of(raw)
            places.append(place)
            if place is None:
                buffers.append(raw)
            return False

        body = cloudpickle.dumps(value, protocol=5, buffer_callback=is_small)
        try:
            name, new = self._written(buffers)
        except OSError:  # the disk is full: then all of it goes through the pipe
            return pickle.dumps((cloudpickle.dumps(value), [])), ""
        found = iter(new)
        return pickle.dumps((body, [place or next(found) for place in places])), name

    def unpack(self, message: bytes) -> Any:
        """The value in a message of the other process."""
        body, places = pickle.loads(message)
        return pickle.loads(body, buffers=[self._view(Place(*place)) for place in places])

    def forget(self, name: str) -> None:
        """Remove a file that was written here, unless arrays in it have come back."""
        if name and name not in self._maps:
            self._remove(name)

    def close(self) -> None:
        """Remove the folder, if it was made here; arrays that were received stay."""
        if self._made is not None:
            self._made.cleanup()

    def _written(self, buffers: list[memoryview]) -> tuple[str, list[Place]]:
        if not buffers:
            return "", []
        name, places = secrets.token_hex(8), []
        try:
            with (self.folder / name).open("xb") as file:
                for buffer in buffers:
                    file.seek(-file.tell() % ALIGNMENT, os.SEEK_CUR)
                    places.append(Place(name, file.tell(), buffer.nbytes))
                    file.write(buffer)
        except OSError:
            self._remove(name)
            raise
        return name, places

    def _view(self, place: Place) -> memoryview:
        mapped = self._maps.get(place.file)
        if mapped is None:
            with (self.folder / place.file).open("rb") as file:
                mapped = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_COPY)
            self._maps[place.file] = mapped
            if self._made is not None:
                weakref.finalize(mapped, self._remove, place.file)
        return memoryview(mapped)[place.begin : place.begin + place.size]

    def _place_of(self, raw: memoryview) -> Place | None:
        """Place of bytes that lie in a file which is mapped here."""
        address = _address(raw)
        for name, mapped in self._maps.items():
            begin = address - _address(mapped)
            if begin >= 0 and begin + raw.nbytes <= len(mapped):
                return Place(name, begin, raw.nbytes)
        return None

    def _remove(self, name: str) -> None:
        with contextlib.suppress(OSError):
            (self.folder / name).unlink()


def _temporary_folder() -> tempfile.TemporaryDirectory[str]:
    """A folder that is removed, but for files that are still mapped where the system keeps those."""
    return tempfile.TemporaryDirectory(prefix="quadctl-lab-", ignore_cleanup_errors=True)


def _address(buffer: Any) -> int:
    return int(np.frombuffer(buffer, np.uint8).ctypes.data)
