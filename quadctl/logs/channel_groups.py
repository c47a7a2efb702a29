"""Channels of a log: columns that arrive together."""

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from quadctl.logs.columns import MOTOR_QUANTITIES, REFERENCE_COLUMNS
from quadctl.logs.flight_log import ATTITUDE, IMU, POSITION, RATES, VELOCITY, FlightLog

_MOTOR_NAMES = {"rpm": "rpm", "voltage_v": "motor voltage", "current_a": "motor current", "output": "motor output"}
GROUPS = {
    "position": POSITION,
    "velocity": VELOCITY,
    "attitude": ATTITUDE,
    "rates": RATES,
    "acceleration": ("ax_m_s2", "ay_m_s2", "az_m_s2"),
    "imu": IMU,
    "battery": ("battery_v",),
    "barometer": ("baro_m", "baro_temperature_c"),
    "attitude command": ("roll_cmd_deg", "pitch_cmd_deg", "yaw_cmd_deg"),
    "throttle command": ("throttle_cmd",),
    "thrust command": ("thrust_cmd_n",),
    "reference": REFERENCE_COLUMNS,
}
"""Columns of each channel, those of the motors left out."""
IN_TURN = 0.2
"""Share of the updates in which a neighbour is updated, too, over the share that chance would give, below which columns
come in turn."""


def channel_groups(log: FlightLog) -> dict[str, tuple[str, ...]]:
    """The log's columns by channel: those that arrive together."""
    groups: dict[str, tuple[str, ...]] = {}
    for name, columns in GROUPS.items():
        groups[name] = tuple(column for column in columns if column in log.columns)
    for quantity in MOTOR_QUANTITIES:
        pattern = re.compile(rf"motor\d+_{quantity}")
        groups[_MOTOR_NAMES[quantity]] = tuple(column for column in log.columns if pattern.fullmatch(column))
    known = {"time_s", *(column for columns in groups.values() for column in columns)}
    groups |= {column: (column,) for column in log.columns if column not in known}
    return {name: columns for name, columns in groups.items() if columns}


def come_in_turn(log: FlightLog, columns: Sequence[str]) -> bool:
    """Tell whether columns are updated one after the other, as by a bus that asks one motor at a time.

    Columns that arrive together change together, though each may repeat a rounded value.
    """
    known = [column for column in columns if log.has(column)]
    if len(known) < 2:
        return False
    changed = np.zeros((len(known), len(log)), dtype=bool)
    for own, column in zip(changed, known, strict=True):
        own[log.updates(column)] = True
    any_of_them = int(changed.any(axis=0).sum())
    together = int((changed[1:] & changed[:-1]).sum()) / max(int(changed[1:].sum()), 1)
    return together < IN_TURN * (int(changed.sum()) / len(known)) / max(any_of_them, 1)


def updates_of_any(log: FlightLog, columns: Sequence[str]) -> NDArray[np.intp]:
    """Rows in which any of the columns got a new value, those without any left out."""
    values = np.column_stack([log[column] for column in columns])
    values = values[:, np.isfinite(values).any(axis=0)]
    rows = np.flatnonzero(np.isfinite(values).any(axis=1)) if values.size else np.empty(0, dtype=np.intp)
    known = values[rows]
    new = np.ones(len(rows), dtype=bool)
    new[1:] = ((known[1:] != known[:-1]) & ~(np.isnan(known[1:]) & np.isnan(known[:-1]))).any(axis=1)
    return rows[new]
