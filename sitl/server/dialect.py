"""MAVLink messages that PX4 sends or takes and pymavlink's bundled dialects do not know yet."""

import struct
from collections.abc import Mapping
from typing import Any, ClassVar

from pymavlink.dialects.v20 import ardupilotmega

ESC_STATUS_ID = 291
CURRENT_MODE_ID = 436
EVENT_ID = 410
SET_ATTITUDE_TARGET_ID = 82
THRUST_BODY_SET = 32
"""Bit of its `type_mask`: `thrust_body` takes the place of `thrust`."""


_LETTERS = {"uint8_t": "B", "uint16_t": "H", "uint32_t": "I", "uint64_t": "Q", "int32_t": "i", "float": "f"}
"""Letters of `struct` by the types of MAVLink."""


class _Message(ardupilotmega.MAVLink_message):  # type: ignore[misc]  # pymavlink has no type information
    """A message whose class attributes are those that pymavlink's generator writes; built from its fields in order."""

    id: ClassVar[int]
    msgname: ClassVar[str]
    fieldnames: ClassVar[list[str]]
    ordered_fieldnames: ClassVar[list[str]]
    lengths: ClassVar[list[int]]
    crc_extra: ClassVar[int]
    unpacker: ClassVar[struct.Struct]
    instance_field: ClassVar[str | None] = None
    instance_offset: ClassVar[int] = -1

    def __init__(self, *values: Any) -> None:
        super().__init__(self.id, self.msgname)
        self._fieldnames = self.fieldnames
        self._instance_field = self.instance_field
        self._instance_offset = self.instance_offset
        for name, value in zip(self.fieldnames, values, strict=True):
            setattr(self, name, value)

    def pack(self, mav: Any, force_mavlink1: bool = False) -> bytes:
        numbers: list[float] = []
        for name, length in zip(self.ordered_fieldnames, self.lengths, strict=True):
            value = getattr(self, name)
            numbers += [value] if length == 1 else value
        packed: bytes = self._pack(mav, self.crc_extra, self.unpacker.pack(*numbers), force_mavlink1=force_mavlink1)
        return packed


def _message(
    number: int, name: str, crc_extra: int, fields: Mapping[str, str], extension: str = "", **more: Any
) -> type[_Message]:
    """Class of a message, by its definition.

    `fields` are its types by name, `int32_t[4]` for an array, in the order of the definition. On the wire larger types
    come first, and an `extension` last.
    """
    parts = {field: of.rstrip("]").partition("[") for field, of in fields.items()}
    letters = {field: _LETTERS[of] for field, (of, _, _) in parts.items()}
    arrays = {field: int(length or 0) for field, (_, _, length) in parts.items()}
    wire = sorted(fields, key=lambda field: (field == extension, -struct.calcsize(f"<{letters[field]}")))
    about = {
        "id": number,
        "msgname": name,
        "name": name,
        "fieldnames": list(fields),
        "ordered_fieldnames": wire,
        "fieldtypes": [of for of, _, _ in parts.values()],
        "fieldunits_by_name": {},
        "native_format": bytearray(f"<{''.join(letters[field] for field in wire)}".encode()),
        "orders": [wire.index(field) for field in fields],
        "lengths": [arrays[field] or 1 for field in wire],
        "array_lengths": [arrays[field] for field in wire],
        "crc_extra": crc_extra,
        "unpacker": struct.Struct("<" + "".join(f"{arrays[field] or 1}{letters[field]}" for field in wire)),
    }
    return type(name, (_Message,), about | more)


EscStatus = _message(
    *(ESC_STATUS_ID, "ESC_STATUS", 10),
    {"index": "uint8_t", "time_usec": "uint64_t", "rpm": "int32_t[4]", "voltage": "float[4]", "current": "float[4]"},
    instance_field="index",
    instance_offset=56,
)
"""Speed, voltage and current of up to four motors; `index` is the first motor's number from 0."""
CurrentMode = _message(
    *(CURRENT_MODE_ID, "CURRENT_MODE", 193),
    {"standard_mode": "uint8_t", "custom_mode": "uint32_t", "intended_custom_mode": "uint32_t"},
)
"""The mode by its standard number (0: none) and as in the heartbeat, and the one that was wanted."""
Event = _message(
    *(EVENT_ID, "EVENT", 160),
    {
        **{"destination_component": "uint8_t", "destination_system": "uint8_t", "id": "uint32_t"},
        **{"event_time_boot_ms": "uint32_t", "sequence": "uint16_t", "log_levels": "uint8_t"},
        "arguments": "uint8_t[40]",
    },
)
"""The number of an event, its log levels, and its arguments as bytes."""
SetAttitudeTarget = _message(
    *(SET_ATTITUDE_TARGET_ID, "SET_ATTITUDE_TARGET", 49),
    {
        "time_boot_ms": "uint32_t",
        **dict.fromkeys(("target_system", "target_component", "type_mask"), "uint8_t"),
        "q": "float[4]",
        **dict.fromkeys(("body_roll_rate", "body_pitch_rate", "body_yaw_rate", "thrust"), "float"),
        "thrust_body": "float[3]",
    },
    extension="thrust_body",
)
"""With its extension: thrust in three dimensions of the body, FRD, -1..1."""


def register(dialect: Any = ardupilotmega) -> None:
    """Let a pymavlink dialect module parse the messages of this file; may be called again."""
    for kind in (EscStatus, CurrentMode, Event):
        dialect.mavlink_map.setdefault(kind.id, kind)
    if "thrust_body" not in dialect.mavlink_map[SET_ATTITUDE_TARGET_ID].fieldnames:
        dialect.mavlink_map[SET_ATTITUDE_TARGET_ID] = SetAttitudeTarget
