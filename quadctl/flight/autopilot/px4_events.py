"""PX4's reasons against arming: EVENT messages of its health and arming checks, numbers that become words again.

A reason often exists as an event only: of six in a recorded boot, one came as a text too. An event carries the hash
of its name, so the words in px4_events.json hold for every version that has the check. They are those of the metadata
that PX4 (BSD licence) writes into its logs, of March 2026; a check that it did not have then is not shown.
"""

import json
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any, NamedTuple

AUTOPILOT = 1
"""First byte of the number of an event that the autopilot itself sends."""
SUMMARY = 11047904
"""Event that begins a report of the arming checks; those of the report follow."""
NO_SETPOINTS = 3087815
"""Reason against offboard that always holds before the first setpoint."""
WARNING = 4
"""Log level of a warning; levels above it are no objections."""
MODES = {
    "MANUAL": 1 << 0,
    "ALTCTL": 1 << 1,
    "POSCTL": 1 << 2,
    "MISSION": 1 << 3,
    "HOLD": 1 << 4,
    "RTL": 1 << 5,
    "ACRO": 1 << 10,
    "OFFBOARD": 1 << 14,
    "STABILIZED": 1 << 15,
    "TAKEOFF": 1 << 17,
    "LAND": 1 << 18,
}
"""Bit of each mode in the set of modes that a reason concerns (navigation_mode_group_t)."""
TEXTS: Mapping[int, str] = {
    int(number): text for number, text in json.loads((files(__package__) / "px4_events.json").read_bytes()).items()
}
"""Words of the checks, by the number of their event; {} is the number of the sensor, battery or channel."""


class _Reason(NamedTuple):
    modes: int
    """Modes that it bars."""
    text: str


class ArmingReport:
    """The last report of PX4's arming checks, of which an event that is lost is simply missing."""

    def __init__(self) -> None:
        self._reasons: list[_Reason] = []

    def take(self, fields: Mapping[str, Any]) -> None:
        """Take in the fields of one EVENT."""
        component, number = divmod(int(fields["id"]), 1 << 24)
        if component != AUTOPILOT:
            return
        if number == SUMMARY:
            self._reasons = []
        elif number in TEXTS and number != NO_SETPOINTS and int(fields["log_levels"]) & 0xF <= WARNING:
            data: Sequence[int] = fields["arguments"]
            # Each begins with the modes, 4 bytes, and the part that it is about; then an instance, where it has one.
            self._reasons.append(_Reason(int.from_bytes(bytes(data[:4]), "little"), TEXTS[number].format(data[5])))

    def against(self, *modes: str) -> tuple[str, ...]:
        """Reasons that bar any of these modes, each once."""
        wanted = sum({MODES.get(mode, 0) for mode in modes})
        return tuple(dict.fromkeys(reason.text for reason in self._reasons if reason.modes & wanted))
