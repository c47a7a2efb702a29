"""Recovery of a bag that ends early, as after a crash, or is damaged: what is whole of it, as a bag that has an end.

Bags hold their index at the end, and the libraries refuse one without it. This is what `mcap recover`, `rosbag reindex`
and `.recover` of sqlite3 do, for the messages alone.
"""

import bz2
import mmap
import os
import shutil
import sqlite3
import struct
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zlib import crc32

MCAP_MAGIC = b"\x89MCAP0\r\n"
_DATA_END, _FOOTER, _CHUNK = 0x0F, 0x02, 0x06
_CHUNK_HEAD = struct.Struct("<QQQI")
"""First and last time, size when unpacked, checksum (0: none) of a chunk in MCAP."""
ROS1_MAGIC = b"#ROSBAG V2.0\n"
_ROS1_MESSAGE, _ROS1_BAG, _ROS1_CHUNK, _ROS1_CHUNK_INFO, _ROS1_CONNECTION = 2, 3, 5, 6, 7
SQLITE_PAGES_AT = 28
"""Place of the number of pages in the head of a file of SQLite."""


@dataclass(frozen=True)
class Recovery:
    """Files of one bag that hold what is whole."""

    files: list[Path]
    is_cut_short: bool
    """True where a file, or the bag, has no end; False for damage before it."""


def recover(files: list[Path], suffix: str, folder: Path) -> Recovery:
    """Write what is whole of each file of a bag, all of one kind, into `folder`.

    Parameters
    ----------
    suffix
        Kind of the files: .mcap, .db3 or .bag.

    Raises
    ------
    Exception
        Nothing can be read of one of them; of any kind.
    """
    found: list[Path] = []
    is_cut = False
    for number, path in enumerate(files):
        found.append(folder / f"{number}{suffix}")
        is_cut |= _OF_KIND[suffix](path, found[-1])
    return Recovery(found, is_cut)


@contextmanager
def _mapped(path: Path) -> Iterator[mmap.mmap]:
    """Content of a file."""
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        yield data


# --- MCAP -------------------------------------------------------------------------------------------------------------


def _recover_mcap(path: Path, target: Path) -> bool:
    with (
        path.open("rb") as file,
        mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data,
        target.open("wb") as out,
    ):
        out.write(MCAP_MAGIC)
        for kind, body, whole in _mcap_records(data, len(MCAP_MAGIC)):
            if kind in (_DATA_END, _FOOTER):
                break
            if kind == _CHUNK:
                out.write(_mcap_record(_CHUNK, _whole_chunk(body)))
            elif whole:
                out.write(_mcap_record(kind, body))
        out.write(_mcap_record(_DATA_END, bytes(4)) + _mcap_record(_FOOTER, bytes(20)) + MCAP_MAGIC)
        return data[-len(MCAP_MAGIC) :] != MCAP_MAGIC


def _mcap_record(kind: int, body: bytes) -> bytes:
    return struct.pack("<BQ", kind, len(body)) + body


def _mcap_records(data: bytes | mmap.mmap, at: int) -> Iterator[tuple[int, bytes, bool]]:
    """(kind, content, is whole) of the records of a file or a chunk; the last may be cut."""
    while at + 9 <= len(data):
        kind, length = struct.unpack_from("<BQ", data, at)
        yield kind, data[at + 9 : at + 9 + length], at + 9 + length <= len(data)
        at += 9 + length


def _whole_chunk(body: bytes) -> bytes:
    """Content of a chunk with the whole records of what can be unpacked of `body`, itself unpacked and unchecked."""
    begin, end, size, checksum = _CHUNK_HEAD.unpack_from(body)
    (length,) = struct.unpack_from("<I", body, _CHUNK_HEAD.size)
    name_at = _CHUNK_HEAD.size + 4
    packing, packed = body[name_at : name_at + length].decode(), body[name_at + length + 8 :]
    records = _unpacked(packed, packing)
    if len(records) == size and checksum and crc32(records) != checksum:
        records = b""
    whole = b"".join(_mcap_record(kind, content) for kind, content, whole in _mcap_records(records, 0) if whole)
    return _CHUNK_HEAD.pack(begin, end, len(whole), 0) + struct.pack("<IQ", 0, len(whole)) + whole


def _unpacked(packed: bytes, packing: str) -> bytes:
    """As much as can be unpacked."""
    if packing in ("", "none"):
        return packed
    import lz4.frame
    import zstandard

    unpackers: dict[str, Any] = {
        "lz4": lz4.frame.LZ4FrameDecompressor,
        "zstd": lambda: zstandard.ZstdDecompressor().decompressobj(),
        "bz2": bz2.BZ2Decompressor,
    }
    unpacker = unpackers[packing]()
    try:
        return bytes(unpacker.decompress(packed))
    except (RuntimeError, OSError, EOFError, zstandard.ZstdError):
        return b""


# --- SQLite -----------------------------------------------------------------------------------------------------------


def _recover_sqlite(path: Path, target: Path) -> bool:
    copy = Path(shutil.copy(path, target.with_name(f"copy-{target.name}")))
    with copy.open("r+b") as file:
        head = file.read(SQLITE_PAGES_AT + 4)
        size = int.from_bytes(head[16:18])
        page, pages = 65536 if size == 1 else size, int.from_bytes(head[SQLITE_PAGES_AT:])
        there = file.seek(0, os.SEEK_END) // page
        file.truncate(there * page)  # half a page would be read as zeros
    journal = path.with_name(f"{path.name}-wal")
    if journal.is_file():  # of a recorder that was killed
        shutil.copy(journal, copy.with_name(f"{copy.name}-wal"))
        with closing(sqlite3.connect(copy)) as database:
            database.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    with closing(sqlite3.connect(copy)) as old, closing(sqlite3.connect(target)) as new:
        old.execute("PRAGMA writable_schema = ON")  # with it a file that is shorter than its head says is read, too
        tables = old.execute("SELECT name, sql FROM sqlite_master WHERE type = 'table' AND name NOT LIKE 'sqlite_%'")
        for name, sql in tables.fetchall():
            new.execute(sql)
            for order in ("ASC", "DESC"):  # up to the damage, from both sides
                try:
                    for row in old.execute(f'SELECT * FROM "{name}" ORDER BY rowid {order}'):
                        places = ", ".join("?" * len(row))
                        new.execute(f'INSERT OR IGNORE INTO "{name}" VALUES ({places})', row)
                except sqlite3.DatabaseError:
                    continue
                break
        new.commit()
    return there < pages


# --- ROS 1 ------------------------------------------------------------------------------------------------------------


def _recover_ros1(path: Path, target: Path) -> bool:
    from rosbags.rosbag1 import Writer
    from rosbags.typesys.msg import normalize_msgtype

    connections: dict[int, Any] = {}
    known: dict[tuple[str, ...], Any] = {}
    chunks = listed = 0
    with _mapped(path) as data, Writer(target) as out:
        for kind, head, body in _ros1_content(data):
            if kind == _ROS1_CONNECTION:
                about = _ros1_fields(body)
                texts = [about[name].decode() for name in ("type", "message_definition", "md5sum")]
                topic, of = head["topic"].decode(), about.get("callerid", b"").decode()
                if (key := (topic, of, *texts)) not in known:
                    kind_of_message, definition, digest = texts
                    known[key] = out.add_connection(
                        topic, normalize_msgtype(kind_of_message), msgdef=definition, md5sum=digest, callerid=of
                    )
                connections[_uint(head["conn"])] = known[key]
            elif kind == _ROS1_MESSAGE and _uint(head["conn"]) in connections:
                seconds, nanoseconds = struct.unpack("<II", head["time"])
                out.write(connections[_uint(head["conn"])], seconds * 10**9 + nanoseconds, body)
            elif kind == _ROS1_BAG:
                chunks = _uint(head["chunk_count"])
            elif kind == _ROS1_CHUNK_INFO:
                listed += 1
    return not 0 < chunks == listed


def _ros1_content(data: bytes | mmap.mmap) -> Iterator[tuple[int, dict[str, bytes], bytes]]:
    """(kind, head, content) of whole records, those in chunks among them."""
    for kind, head, body, whole in _ros1_records(data, len(ROS1_MAGIC)):
        if kind == _ROS1_CHUNK:
            inside = _unpacked(body, head["compression"].decode())
            yield from (record[:3] for record in _ros1_records(inside, 0) if record[3])
        elif whole:
            yield kind, head, body


def _ros1_records(data: bytes | mmap.mmap, at: int) -> Iterator[tuple[int, dict[str, bytes], bytes, bool]]:
    """(kind, head, content, is whole) of the records of a file or a chunk; the content of the last may be cut."""
    while at + 4 <= len(data):
        (length,) = struct.unpack_from("<I", data, at)
        body_at = at + 8 + length
        if body_at > len(data):
            return
        head = _ros1_fields(data[at + 4 : at + 4 + length])
        (size,) = struct.unpack_from("<I", data, body_at - 4)
        yield head["op"][0], head, data[body_at : body_at + size], body_at + size <= len(data)
        at = body_at + size


def _ros1_fields(data: bytes) -> dict[str, bytes]:
    fields, at = {}, 0
    while at + 4 <= len(data):
        (length,) = struct.unpack_from("<I", data, at)
        name, _, value = data[at + 4 : at + 4 + length].partition(b"=")
        fields[name.decode()] = value
        at += 4 + length
    return fields


def _uint(data: bytes) -> int:
    return int.from_bytes(data, "little")


_OF_KIND = {".mcap": _recover_mcap, ".db3": _recover_sqlite, ".bag": _recover_ros1}
"""Functions (path, target) -> whether the file has no end, by the suffix of its kind."""
