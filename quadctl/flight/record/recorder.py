"""The flight recorder: one CSV row per tick, and a meta file with the settings and the events of the flight.

Written on a thread of its own, so that no disk can hold up the loop.

What is written is on the disk at most a second later. A disk that fails costs the rest of the log, not the flight. A
file that exists is never written over.
"""

import math
import os
import queue
import threading
import time
from collections.abc import Mapping
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, TextIO

import yaml

from quadctl import __version__
from quadctl.errors import FlightError
from quadctl.flight.pilot.tick import Tick
from quadctl.frames import euler_from_quaternion
from quadctl.logs.columns import (
    COMMAND_COLUMNS,
    LATERAL_COLUMNS,
    LOOP_COLUMNS,
    PHASE_COLUMN,
    REFERENCE_COLUMNS,
    RESIDUAL_COLUMNS,
    STATE_COLUMNS,
    motor_columns,
    rpm_columns,
)
from quadctl.state import NAN

SYNC_EVERY_S = 0.5
ROOM_BYTES = 256 * 1024
"""Room on the disk that is kept for the end of the flight, with all its events."""
CLOSE_TIMEOUT_S = 10.0
RECORDED_HEIGHTS = ("baro_m", "range_m")
"""Columns of the sensors of the height that a flight of our own knows."""
_NO_EULER = (NAN, NAN, NAN)
_NO_LATERAL = (NAN, NAN)


def header(n_rotors: int, lateral: bool = False, heights: bool = False) -> list[str]:
    """Column names of a recorded flight; with `lateral`, of one that commands lateral force, with `heights`, of one
    whose barometer and range finder are told."""
    return [
        *STATE_COLUMNS,
        *rpm_columns(n_rotors),
        *motor_columns(n_rotors, "voltage_v"),
        *motor_columns(n_rotors, "current_a"),
        *motor_columns(n_rotors, "output"),
        "battery_v",
        *COMMAND_COLUMNS,
        "thrust_ratio",
        "compensator_trust",
        *REFERENCE_COLUMNS,
        *LOOP_COLUMNS,
        *(LATERAL_COLUMNS if lateral else ()),
        *RESIDUAL_COLUMNS,
        *(RECORDED_HEIGHTS if heights else ()),
        PHASE_COLUMN,
    ]


def row(tick: Tick, n_rotors: int, lateral: bool = False, heights: bool = False) -> list[float | str]:
    """One tick as the values of `header`."""
    s = tick.state
    north, east, down = s.position_ned_m
    vn, ve, vd = s.velocity_ned_m_s
    values: list[float | str] = [
        tick.time_s,
        north,
        east,
        tick.ground_down_m - down,
        vn,
        ve,
        -vd,
        *_degrees(euler_from_quaternion(s.attitude)),
        *s.rates_rad_s,
        *_padded(s.rotor_rpm, n_rotors),
        *_padded(s.motor_voltage_v, n_rotors),
        *_padded(s.motor_current_a, n_rotors),
        *_padded(s.motor_output, n_rotors),
        s.battery_v,
        tick.output.thrust_n if tick.output else NAN,
        tick.target.throttle if tick.target else NAN,
        *(_degrees(euler_from_quaternion(tick.target.attitude)) if tick.target else _NO_EULER),
        tick.output.compensation.thrust_ratio if tick.output else NAN,
        tick.output.compensation.trust if tick.output else NAN,
    ]
    if tick.setpoint:
        (x, y, z), (u, v, w) = tick.setpoint.position_ned_m, tick.setpoint.velocity_ned_m_s
        values += [x, y, tick.ground_down_m - z, u, v, -w]
    else:
        values += [NAN] * 6
    values += [s.control_age_s, tick.late_s]
    if lateral:
        values += (tick.output and tick.output.lateral_n) or _NO_LATERAL
        values += (tick.target and tick.target.lateral) or _NO_LATERAL
    residual_north, residual_east, residual_down = tick.model_error.ned_m_s2
    values += [*tick.model_error.body_m_s2, residual_north, residual_east, -residual_down]
    if heights:
        values += [s.baro_m, s.range_m]
    return [*values, tick.phase]


class Recorder:
    """Writes `<directory>/<time>_<mission>.csv` and its `.meta.yaml`."""

    def __init__(
        self,
        directory: Path,
        mission: str,
        n_rotors: int,
        meta: Mapping[str, Any],
        lateral: bool = False,
        heights: bool = False,
    ) -> None:
        """Open the files; `lateral`: the flight commands lateral force; `heights`: its barometer is told.

        Raises
        ------
        FlightError
            The directory cannot be written: better known before the flight than after it.
        """
        self._n_rotors = n_rotors
        self._lateral = lateral
        self._heights = heights
        self._meta = {
            "software": f"quadctl {__version__}",
            "started": datetime.now(UTC).isoformat(timespec="seconds"),
            **meta,
        }
        self._events: list[dict[str, Any]] = []
        self._room: Path | None = None
        """File that holds room for the meta file at the end."""
        self.problem: str | None = None
        """Reason why the log is incomplete, or None."""
        try:
            directory.mkdir(parents=True, exist_ok=True)
            self.path, self._file = _new_file(directory, mission)
            self.meta_path = self.path.with_suffix(".meta.yaml")
            self._room = self.meta_path.with_suffix(".room")
            _reserve(self._room, ROOM_BYTES)
            self._write_meta("in flight")
            self._file.write(",".join(header(n_rotors, lateral, heights)) + "\n")
            self._file.flush()
        except OSError as error:
            self._leave_room()
            raise FlightError(f"{directory}: cannot be written for the flight log ({error.strerror})") from None
        self._queue: queue.SimpleQueue[Tick | None] = queue.SimpleQueue()
        self._closing = False
        """True when the writer thread has taken the last item from the queue."""
        self._thread = threading.Thread(target=self._write, name="recorder", daemon=True)
        self._thread.start()

    def __call__(self, tick: Tick) -> None:
        """Take a copy of a tick; returns at once."""
        self._queue.put(tick)

    def close(self, ended: str) -> None:
        """Write the remaining rows, and the end of the flight into the meta file."""
        self._queue.put(None)
        self._thread.join(timeout=CLOSE_TIMEOUT_S)
        if self._thread.is_alive():
            self.problem = f"{self.path}: the log is incomplete (the disk does not answer)"
        try:
            self._write_meta(ended)
        except OSError:
            self._write_meta_into_room(ended)
        self._leave_room()

    def _write(self) -> None:
        try:
            self._drain()
        except Exception as error:  # whatever it is, it must not end the thread with the queue filling up
            reason = error.strerror if isinstance(error, OSError) else repr(error)
            self.problem = f"{self.path}: the log is incomplete ({reason})"
            while not self._closing:  # the flight goes on; what it must explain is kept for the meta file
                tick = self._queue.get()
                if tick is None:
                    self._closing = True
                else:
                    self._note(tick)

    def _drain(self) -> None:
        synced = time.monotonic()
        with self._file as file:
            while True:
                try:
                    tick = self._queue.get(timeout=SYNC_EVERY_S)
                except queue.Empty:
                    _sync(file)
                    continue
                if tick is None:
                    self._closing = True
                    break
                self._note(tick)  # first: its row may be the one that finds the disk full
                file.write(",".join(map(_text, row(tick, self._n_rotors, self._lateral, self._heights))) + "\n")
                if tick.events:
                    _sync(file)  # the rows that led to it
                    self._write_meta("in flight")
                if time.monotonic() - synced > SYNC_EVERY_S:
                    _sync(file)
                    synced = time.monotonic()
            _sync(file)

    def _note(self, tick: Tick) -> None:
        for event in tick.events:
            told = {"time_s": round(event.time_s, 3), "what": event.what, "answer": event.answer}
            known = {"guard": event.guard, "kind": event.kind}
            self._events.append(told | {name: value for name, value in known.items() if value})

    def _write_meta_into_room(self, ended: str) -> None:
        """Write the meta file into the room that was kept for it on a disk that is full by now."""
        assert self._room is not None
        try:
            with self._room.open("r+", encoding="utf-8") as file:
                file.write(self._text_of_meta(ended))
                file.truncate()
                _sync(file)
            self._room.replace(self.meta_path)
        except OSError as error:
            self.problem = self.problem or f"{self.meta_path}: {error.strerror}"

    def _leave_room(self) -> None:
        """Give back the room, where it was taken."""
        if self._room is not None:
            with suppress(OSError):
                self._room.unlink(missing_ok=True)

    def _text_of_meta(self, ended: str) -> str:
        return yaml.safe_dump({**self._meta, "events": self._events, "ended": ended}, sort_keys=False)

    def _write_meta(self, ended: str) -> None:
        """Write the meta file in one step: a full disk or a power cut leaves the old file, not half of a new one."""
        text = self._text_of_meta(ended)
        new = self.meta_path.with_suffix(".new")
        try:
            with new.open("w", encoding="utf-8") as file:
                file.write(text)
                _sync(file)
            new.replace(self.meta_path)
        except OSError:
            new.unlink(missing_ok=True)
            raise


def _sync(file: TextIO) -> None:
    """Flush a file to the disk itself."""
    file.flush()
    os.fsync(file.fileno())


def _reserve(path: Path, size: int) -> None:
    """Make a file whose room on the disk is taken."""
    with path.open("wb") as file:
        if hasattr(os, "posix_fallocate"):
            os.posix_fallocate(file.fileno(), 0, size)
        else:
            file.write(bytes(size))


def _new_file(directory: Path, mission: str) -> tuple[Path, TextIO]:
    stamp = datetime.now(UTC).strftime("%Y%m%d_%H%M%S")
    for attempt in range(1000):
        suffix = f"_{attempt + 1}" if attempt else ""
        path = directory / f"{stamp}_{mission}{suffix}.csv"
        try:
            return path, path.open("x", encoding="utf-8")
        except FileExistsError:
            continue
    raise FlightError(f"{directory}: holds a thousand logs of this second already")


def _text(value: float | str) -> str:
    if isinstance(value, str):
        return value
    return f"{value:.7g}" if math.isfinite(value) else "nan"


def _degrees(angles: tuple[float, float, float]) -> tuple[float, float, float]:
    return math.degrees(angles[0]), math.degrees(angles[1]), math.degrees(angles[2])


def _padded(values: tuple[float, ...], n: int) -> tuple[float, ...]:
    return (*values[:n], *([NAN] * (n - len(values))))
