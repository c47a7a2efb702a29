"""Records of ArduPilot's DataFlash logs, as arrays by message and field: of binary logs (`.bin`), and of those that a
ground station wrote as text (`.log`).

Both describe each message by a record FMT. Up to ArduCopter 3.2 time is in milliseconds, and some messages have none:
they get that of the record before them.
"""

import re
import struct
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from quadctl.errors import LogError
from quadctl.files import reading
from quadctl.logs.findings import Finding, Kind, finding
from quadctl.logs.formats import HEAD_BYTES

Message: TypeAlias = dict[str, NDArray[Any]]
"""Arrays of shape (n,) by the names of the fields, in the units of ArduPilot's documentation; TimeUS is among them."""

TEXT_FIELDS = ("Name", "FWS", "Message")
"""Fields that are no numbers."""
_HEAD = b"\xa3\x95"
_FMT = 0x80
_FMT_BODY = struct.Struct("<BB4s16s64s")
_FMT_LINE = re.compile(rb"^FMT, *\d+, *\d+, *\w+, *\w+", re.MULTILINE)
_LETTERS_OF_TEXT, _LETTERS_OF_WHOLE = "nNZ", "bBhHiIqQM"
MAX_WHOLE = 2.0**53
"""Whole numbers beyond this are damaged: no message counts so far."""


@dataclass(frozen=True)
class Records:
    """Content of a log."""

    messages: dict[str, Message]
    """The wanted ones, by name."""
    counts: Mapping[str, int]
    """Number of records of each message, FMT left out."""
    n_formats: int
    """Number of FMT."""
    findings: list[Finding]


def is_dataflash(head: bytes) -> bool:
    """True for a file that begins with `head` as a DataFlash log does, binary or text."""
    return head.startswith(_HEAD) or is_text(head)


def is_text(head: bytes) -> bool:
    """True for a file that begins with `head` as a DataFlash log as text does; some begin with lines of their own."""
    return not head.startswith(_HEAD) and _FMT_LINE.search(head) is not None


def read_records(path: Path, wanted: Mapping[str, Sequence[str]]) -> Records:
    """Read a log.

    Parameters
    ----------
    wanted
        Names of messages, each with the fields without which it says nothing; any other field may be missing.

    Raises
    ------
    LogError
        The file cannot be read.
    """
    with reading(path, LogError):
        data = path.read_bytes()
    return _of_text(data, wanted) if is_text(data[:HEAD_BYTES]) else _of_binary(data, wanted)


# --- binary -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Format:
    """A message, as this file describes it."""

    body: np.dtype[Any]
    scale: dict[str, float]
    """By the names of the fields that are logged as scaled integers."""
    offsets: list[int]
    """Positions in the file at which the bodies begin."""


def _of_binary(data: bytes, wanted: Mapping[str, Sequence[str]]) -> Records:
    """Find the messages. Damage is stepped over, to the next header of a message that the file describes."""
    lengths, names = {_FMT: 3 + _FMT_BODY.size}, {_FMT: "FMT"}
    formats: dict[str, _Format] = {}
    places: dict[int, list[int]] = {}
    counts: Counter[int] = Counter()
    damaged, first_damage = 0, None
    at, end = 0, len(data)
    while at + 3 <= end:
        kind = data[at + 2]
        length = lengths.get(kind, 0) if data.startswith(_HEAD, at) else 0
        if length and at + length > end:
            break
        if not length:
            if _is_filling(data, at):
                at = end
                break
            first_damage = at if first_damage is None else first_damage
            after = data.find(_HEAD, at + 1)
            after = end if after < 0 else after
            damaged += after - at
            at = after
            continue
        counts[kind] += 1
        if kind in places:
            places[kind].append(at + 3)
        elif kind == _FMT:
            of, size, *text = _FMT_BODY.unpack_from(data, at + 3)
            name, letters, fields = (part.rstrip(b"\0").decode("ascii", "replace") for part in text)
            lengths.setdefault(of, size)  # the same description may come again
            names.setdefault(of, name)
            if name in wanted and (made := _format(letters, fields.split(","), size, wanted[name])):
                formats[name] = made
                places[of] = made.offsets
        at += length
    findings = [finding(Kind.CUT_SHORT)] if at < end and not _is_filling(data, at) else []
    if damaged:
        findings.append(finding(Kind.DAMAGED_BYTES, bytes=damaged, first=first_damage))
    decoded = {name: _decoded(data, form) for name, form in formats.items() if form.offsets}
    timed = _timed({name: (np.array(formats[name].offsets), message) for name, message in decoded.items()})
    named = {names[kind]: count for kind, count in counts.items() if kind != _FMT}
    return Records(timed, named, counts[_FMT], findings)


def _is_filling(data: bytes, at: int) -> bool:
    """Tell whether the rest of a file is what the last page of a flash memory is filled up with."""
    return len(data) - at < 512 and not data[at:].strip(b"\0\xff")


def _format(letters: str, fields: list[str], length: int, needed: Sequence[str]) -> _Format | None:
    """Layout of a message, None where its description is damaged."""
    from pymavlink.DFReader import FORMAT_TO_STRUCT

    try:
        codes = [FORMAT_TO_STRUCT[letter][0] for letter in letters]
        kinds = [f"S{code[:-1]}" if code.endswith("s") else f"<{code}" for code in codes]
        body = np.dtype(list(zip(fields, kinds, strict=True)))
    except (KeyError, ValueError):
        return None
    scale = {field: FORMAT_TO_STRUCT[letter][1] for field, letter in zip(fields, letters, strict=True)}
    if body.itemsize != length - 3 or not set(needed) <= set(fields):
        return None
    if body.names != tuple(fields) or any((body[field].kind == "S") != (field in TEXT_FIELDS) for field in fields):
        return None
    return _Format(body, {field: by for field, by in scale.items() if by is not None}, [])


def _decoded(data: bytes, form: _Format) -> Message:
    where = np.array(form.offsets)[:, None] + np.arange(form.body.itemsize)
    table = np.frombuffer(data, dtype=np.uint8)[where].view(form.body)[:, 0]
    fields = form.body.names or ()
    return {field: table[field] * form.scale[field] if field in form.scale else table[field] for field in fields}


# --- text -------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Lines:
    """Lines of one message, as the file describes it: values, already scaled, between commas."""

    fields: list[str]
    letters: str
    numbers: list[int]
    """Numbers of the lines in the file."""
    texts: list[bytes]


def _of_text(data: bytes, wanted: Mapping[str, Sequence[str]]) -> Records:
    counts: Counter[str] = Counter()
    n_formats = 0
    formats: dict[str, _Lines] = {}
    damage: dict[int, str] = {}
    known: set[bytes] = set()
    *lines, rest = data.split(b"\n")
    for number, line in enumerate(lines, 1):
        head, _, values = line.partition(b",")
        head = head.strip()
        if head == b"FMT":
            n_formats += 1
            of, form = _described(values)
            known.add(of.encode())
            if form is not None and of in wanted and set(wanted[of]) <= set(form.fields):
                formats.setdefault(of, form)
        elif head in known:
            name = head.decode("ascii")
            counts[name] += 1
            if name in formats:
                formats[name].numbers.append(number)
                formats[name].texts.append(values)
        elif known and line.strip():
            damage[number] = f"begins with {head[:20].decode('ascii', 'replace')!r}"
    found = {name: _values_of(form, damage) for name, form in formats.items() if form.texts}
    findings = [finding(Kind.LAST_LINE_CUT, line=len(lines) + 1)] if rest.strip(b"\0\r \t") else []
    if damage:
        first = min(damage)
        findings.append(finding(Kind.DAMAGED_LINES, lines=len(damage), line=first, what=damage[first]))
    messages = _timed({name: (at, message) for name, (at, message) in found.items() if len(at)})
    return Records(messages, counts, n_formats, findings)


def _described(values: bytes) -> tuple[str, _Lines | None]:
    """Name of the message that a line FMT describes, and its lines, still none; None where it is damaged."""
    parts = [part.strip().decode("ascii", "replace") for part in values.split(b",")]
    name, letters, fields = (*parts[2:4], *[""] * (2 - len(parts[2:4])), parts[4:])
    return name, _Lines(fields, letters, [], []) if fields and len(fields) == len(letters) else None


def _values_of(form: _Lines, damage: dict[int, str]) -> tuple[NDArray[np.int64], Message]:
    """Numbers of the whole lines of a message, and its values; damaged ones are entered in `damage`."""
    kept: list[tuple[int, list[bytes]]] = []
    n = len(form.fields)
    for number, text in zip(form.numbers, form.texts, strict=True):
        parts = [part.strip() for part in text.split(b",", n - 1)]  # the last, a text, may hold commas
        if len(parts) == n and (form.letters[-1] in _LETTERS_OF_TEXT or b"," not in parts[-1]):
            kept.append((number, parts))
        else:
            damage[number] = f"{text.count(b',') + 1} fields instead of {n}"
    kinds = [_kind(letter, [parts[i] for _, parts in kept]) for i, letter in enumerate(form.letters)]
    whole = list(_whole(kept, kinds, form.fields, damage))
    cells = [[parts[i] for _, parts in whole] for i in range(n)]
    columns = {field: _array(kind, values) for field, kind, values in zip(form.fields, kinds, cells, strict=True)}
    return np.array([number for number, _ in whole], dtype=np.int64), columns


def _array(kind: type[int | float | str], cells: list[bytes]) -> NDArray[Any]:
    if kind is str:
        return np.array(cells, dtype=np.bytes_)
    values = np.array(cells, dtype=np.float64)
    return values.astype(np.int64) if kind is int else values


def _kind(letter: str, cells: list[bytes]) -> type[int | float | str]:
    """Kind of the values of a field; a mode has a number or a name."""
    if letter in _LETTERS_OF_TEXT or (letter == "M" and not all(_is_number(cell, int) for cell in cells)):
        return str
    return int if letter in _LETTERS_OF_WHOLE else float


def _whole(
    rows: list[tuple[int, list[bytes]]],
    kinds: Sequence[type[int | float | str]],
    fields: list[str],
    damage: dict[int, str],
) -> Iterator[tuple[int, list[bytes]]]:
    """Rows whose numbers are numbers."""
    for number, parts in rows:
        wrong = next((i for i, kind in enumerate(kinds) if kind is not str and not _is_number(parts[i], kind)), None)
        if wrong is None:
            yield number, parts
        else:
            shown = parts[wrong][:20].decode("ascii", "replace")
            damage[number] = f"{fields[wrong]} is {shown!r} instead of a number"


def _is_number(text: bytes, kind: type[int | float | str]) -> bool:
    try:
        value = float(text)
    except ValueError:
        return False
    return kind is float or (value.is_integer() and abs(value) < MAX_WHOLE)


# --- time -------------------------------------------------------------------------------------------------------------


def _timed(found: Mapping[str, tuple[NDArray[np.int64], Message]]) -> dict[str, Message]:
    """Messages with their times: those without one have that of the last before them, by their places in the file."""
    stamps = {name: time_us for name, (_, message) in found.items() if (time_us := _time_us(name, message)) is not None}
    places = np.concatenate([found[name][0] for name in stamps] or [np.zeros(0, dtype=np.int64)])
    order = np.argsort(places)
    known, times = places[order], np.concatenate([*stamps.values(), np.zeros(0)])[order]
    timed = {}
    for name, (place, message) in found.items():
        if name in stamps:
            timed[name] = message | {"TimeUS": stamps[name]}
        else:
            last = np.maximum(np.searchsorted(known, place, side="right") - 1, 0)
            timed[name] = message | {"TimeUS": times[last] if len(times) else np.zeros(len(place))}
    return timed


def _time_us(name: str, message: Message) -> NDArray[Any] | None:
    """Time since the boot; None where the message has none."""
    if "TimeUS" in message:
        return message["TimeUS"]
    # TimeMS of GPS is that of the satellites, and T that of the boot.
    field = "T" if name == "GPS" else "TimeMS"
    return 1000.0 * message[field].astype(np.float64) if field in message else None
