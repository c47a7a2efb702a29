"""MAVLink messages that PX4 sends or takes and pymavlink's bundled dialects do not know yet."""

import struct
from typing import Any, ClassVar

from pymavlink.dialects.v20 import ardupilotmega

ESC_STATUS_ID = 291
CURRENT_MODE_ID = 436
EVENT_ID = 410
SET_ATTITUDE_TARGET_ID = 82
THRUST_BODY_SET = 32
"""Bit of its `type_mask`: `thrust_body` takes the place of `thrust`."""


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


class EscStatus(_Message):
    """ESC_STATUS: speed, voltage and current of up to four motors; `index` is the first motor's number from 0."""

    id = ESC_STATUS_ID
    msgname = "ESC_STATUS"
    name = "ESC_STATUS"
    fieldnames: ClassVar[list[str]] = ["index", "time_usec", "rpm", "voltage", "current"]
    ordered_fieldnames: ClassVar[list[str]] = ["time_usec", "rpm", "voltage", "current", "index"]
    fieldtypes: ClassVar[list[str]] = ["uint8_t", "uint64_t", "int32_t", "float", "float"]
    fieldunits_by_name: ClassVar[dict[str, str]] = {"time_usec": "us", "rpm": "rpm", "voltage": "V", "current": "A"}
    native_format = bytearray(b"<QiffB")
    orders: ClassVar[list[int]] = [4, 0, 1, 2, 3]
    lengths: ClassVar[list[int]] = [1, 4, 4, 4, 1]
    array_lengths: ClassVar[list[int]] = [0, 4, 4, 4, 0]
    crc_extra = 10
    unpacker = struct.Struct("<Q4i4f4fB")
    instance_field = "index"
    instance_offset = 56


class CurrentMode(_Message):
    """CURRENT_MODE: the mode by its standard number (0: none) and as in the heartbeat, and the one that was wanted."""

    id = CURRENT_MODE_ID
    msgname = "CURRENT_MODE"
    name = "CURRENT_MODE"
    fieldnames: ClassVar[list[str]] = ["standard_mode", "custom_mode", "intended_custom_mode"]
    ordered_fieldnames: ClassVar[list[str]] = ["custom_mode", "intended_custom_mode", "standard_mode"]
    fieldtypes: ClassVar[list[str]] = ["uint8_t", "uint32_t", "uint32_t"]
    fieldunits_by_name: ClassVar[dict[str, str]] = {}
    native_format = bytearray(b"<IIB")
    orders: ClassVar[list[int]] = [2, 0, 1]
    lengths: ClassVar[list[int]] = [1, 1, 1]
    array_lengths: ClassVar[list[int]] = [0, 0, 0]
    crc_extra = 193
    unpacker = struct.Struct("<IIB")


class Event(_Message):
    """EVENT: the number of an event, its log levels, and its arguments as bytes."""

    id = EVENT_ID
    msgname = "EVENT"
    name = "EVENT"
    fieldnames: ClassVar[list[str]] = [
        *("destination_component", "destination_system", "id", "event_time_boot_ms", "sequence", "log_levels"),
        "arguments",
    ]
    ordered_fieldnames: ClassVar[list[str]] = [
        *("id", "event_time_boot_ms", "sequence", "destination_component", "destination_system", "log_levels"),
        "arguments",
    ]
    fieldtypes: ClassVar[list[str]] = ["uint8_t", "uint8_t", "uint32_t", "uint32_t", "uint16_t", "uint8_t", "uint8_t"]
    fieldunits_by_name: ClassVar[dict[str, str]] = {}
    native_format = bytearray(b"<IIHBBBB")
    orders: ClassVar[list[int]] = [3, 4, 0, 1, 2, 5, 6]
    lengths: ClassVar[list[int]] = [1, 1, 1, 1, 1, 1, 40]
    array_lengths: ClassVar[list[int]] = [0, 0, 0, 0, 0, 0, 40]
    crc_extra = 160
    unpacker = struct.Struct("<IIHBBB40B")


class SetAttitudeTarget(_Message):
    """SET_ATTITUDE_TARGET with its extension: thrust in three dimensions of the body, FRD, -1..1."""

    id = SET_ATTITUDE_TARGET_ID
    msgname = "SET_ATTITUDE_TARGET"
    name = "SET_ATTITUDE_TARGET"
    fieldnames: ClassVar[list[str]] = [
        *("time_boot_ms", "target_system", "target_component", "type_mask", "q"),
        *("body_roll_rate", "body_pitch_rate", "body_yaw_rate", "thrust", "thrust_body"),
    ]
    ordered_fieldnames: ClassVar[list[str]] = [
        *("time_boot_ms", "q", "body_roll_rate", "body_pitch_rate", "body_yaw_rate", "thrust"),
        *("target_system", "target_component", "type_mask", "thrust_body"),
    ]
    fieldtypes: ClassVar[list[str]] = ["uint32_t", *["uint8_t"] * 3, *["float"] * 6]
    fieldunits_by_name: ClassVar[dict[str, str]] = {
        "time_boot_ms": "ms",
        "body_roll_rate": "rad/s",
        "body_pitch_rate": "rad/s",
        "body_yaw_rate": "rad/s",
    }
    native_format = bytearray(b"<IfffffBBBf")
    orders: ClassVar[list[int]] = [0, 6, 7, 8, 1, 2, 3, 4, 5, 9]
    lengths: ClassVar[list[int]] = [1, 4, 1, 1, 1, 1, 1, 1, 1, 3]
    array_lengths: ClassVar[list[int]] = [0, 4, 0, 0, 0, 0, 0, 0, 0, 3]
    crc_extra = 49
    unpacker = struct.Struct("<I4f4f3B3f")


def register(dialect: Any = ardupilotmega) -> None:
    """Let a pymavlink dialect module parse the messages of this file; may be called again."""
    dialect.mavlink_map.setdefault(ESC_STATUS_ID, EscStatus)
    dialect.mavlink_map.setdefault(CURRENT_MODE_ID, CurrentMode)
    dialect.mavlink_map.setdefault(EVENT_ID, Event)
    if "thrust_body" not in dialect.mavlink_map[SET_ATTITUDE_TARGET_ID].fieldnames:
        dialect.mavlink_map[SET_ATTITUDE_TARGET_ID] = SetAttitudeTarget
