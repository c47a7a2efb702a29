"""Tables of other programs, by a map: a YAML file that names columns, units, frames and the order of quaternions.

A map tells where the quantities of a flight log are in a table (CSV or Parquet) and in which units and frames; reading
turns them into those of docs/log-format.md. Whether the map is right is not seen here but by `contradictions`.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, Self, TypeAlias

import numpy as np
import polars as pl
from pydantic import Field, model_validator

from quadctl.errors import LogError
from quadctl.frames import GRAVITY_M_S2, Quaternion, euler_from_quaternion, multiply, quaternion_from_euler, rotate
from quadctl.logs.cleaning import clean_log
from quadctl.logs.flight_log import ATTITUDE, IMU, POSITION, RATES, VELOCITY, FlightLog, Floats, did_you_mean
from quadctl.settings import Settings, load

World: TypeAlias = Literal["NED", "ENU", "NWU", "NEU"]
Body: TypeAlias = Literal["FRD", "FLU"]

_HALF = math.sqrt(0.5)
NORTH_EAST_DOWN: dict[str, Quaternion] = {
    "NED": (1.0, 0.0, 0.0, 0.0),
    "ENU": (0.0, _HALF, _HALF, 0.0),
    "NWU": (0.0, 1.0, 0.0, 0.0),
}
"""Rotation of each right-handed world frame into north, east, down."""
FROM_FRD: dict[str, Quaternion] = {"FRD": (1.0, 0.0, 0.0, 0.0), "FLU": (0.0, 1.0, 0.0, 0.0)}
"""Rotation of forward, right, down into each body frame; its own inverse."""

SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
METRES = {"m": 1.0, "cm": 0.01, "mm": 1e-3, "ft": 0.3048}
METRES_PER_SECOND = {"m/s": 1.0, "cm/s": 0.01, "mm/s": 1e-3, "km/h": 1.0 / 3.6, "kn": 0.514444, "ft/s": 0.3048}
RADIANS = {"rad": 1.0, "deg": math.pi / 180.0}
RADIANS_PER_SECOND = {"rad/s": 1.0, "deg/s": math.pi / 180.0}
ACCELERATIONS = {"m/s2": 1.0, "g": GRAVITY_M_S2}
REVOLUTIONS = {"rpm": 1.0, "rad/s": 30.0 / math.pi, "rev/s": 60.0}
SHARES = {"share": 1.0, "percent": 0.01}
NEWTONS = {"N": 1.0, "g": 1e-3 * GRAVITY_M_S2, "kg": GRAVITY_M_S2}
VOLTS = {"V": 1.0, "mV": 1e-3}
PULSE_US = (1000.0, 2000.0)
"""Pulse widths of an output that stands still and of full output."""


class _Clock(Settings):
    column: str
    unit: Literal["s", "ms", "us", "ns"] = "s"


class _WorldVector(Settings):
    columns: tuple[str, str, str]
    frame: World
    unit: Literal["m", "cm", "mm", "ft"] = "m"


class _Velocity(Settings):
    columns: tuple[str, str, str]
    frame: World | Body
    unit: Literal["m/s", "cm/s", "mm/s", "km/h", "kn", "ft/s"] = "m/s"


class _Attitude(Settings):
    columns: tuple[str, ...] = Field(min_length=3, max_length=4)
    order: Literal["wxyz", "xyzw", "roll pitch yaw"]
    unit: Literal["rad", "deg"] = "rad"
    world: Literal["NED", "ENU", "NWU"]
    body: Body

    @model_validator(mode="after")
    def _has_as_many_columns(self) -> Self:
        expected = 3 if self.order == "roll pitch yaw" else 4
        if len(self.columns) != expected:
            raise ValueError(f"columns has {len(self.columns)} names, expected {expected} for the order {self.order}")
        return self


class _Rates(Settings):
    columns: tuple[str, str, str]
    frame: Body
    unit: Literal["rad/s", "deg/s"] = "rad/s"


class _Accelerometer(Settings):
    columns: tuple[str, str, str]
    frame: Body
    unit: Literal["m/s2", "g"] = "m/s2"


class _Motors(Settings):
    columns: tuple[str, ...] = Field(min_length=1)
    """In the order of `rotors` in the vehicle file."""
    unit: Literal["rpm", "rad/s", "rev/s", "share", "percent", "us"]
    """Of a speed, or of an output: share, percent, pulse width."""


class _Thrust(Settings):
    column: str
    unit: Literal["N", "g", "kg"] = "N"


class _Throttle(Settings):
    column: str
    unit: Literal["share", "percent"] = "share"


class _Battery(Settings):
    column: str
    unit: Literal["V", "mV"] = "V"


class TableMap(Settings):
    """Content of a map; what a table does not have is left out."""

    source: str = ""
    """Where tables of this layout come from."""
    separator: str = Field(default=",", min_length=1, max_length=1)
    time: _Clock
    position: _WorldVector
    velocity: _Velocity | None = None
    """Left out: the slope of the position."""
    attitude: _Attitude
    rates: _Rates | None = None
    """Left out: the slope of the attitude."""
    accelerometer: _Accelerometer | None = None
    motors: _Motors | None = None
    thrust: _Thrust | None = None
    throttle: _Throttle | None = None
    battery: _Battery | None = None


def load_map(path: Path | str) -> TableMap:
    """Read a map; raises SettingsError with one sentence that names file, field, value and what was expected."""
    return load(path, TableMap)


def read_table(path: Path, separator: str = ",") -> pl.DataFrame:
    """A table with a header, from CSV or Parquet.

    Raises
    ------
    LogError
        It cannot be read as a table.
    """
    try:
        with path.open("rb") as file:
            is_parquet = file.read(4) == b"PAR1"
        if is_parquet:
            return pl.read_parquet(path)
        return pl.read_csv(path, separator=separator, infer_schema_length=None, truncate_ragged_lines=True)
    except (OSError, pl.exceptions.PolarsError) as error:
        reason = str(error).splitlines()[0].rstrip(".") if str(error) else type(error).__name__
        raise LogError(f"{path}: cannot be read as a table ({reason}), expected CSV with a header or Parquet") from None


def read_mapped(path: Path, table_map: TableMap, source: str) -> FlightLog:
    """The flight log in a table, as `table_map` says; `source` names the map in messages.

    Raises
    ------
    LogError
        The table cannot be read, a column that the map names is not there or holds no number, or the log is unusable.
    """
    return mapped(path, read_table(path, table_map.separator), table_map, source)


def mapped(path: Path, table: pl.DataFrame, table_map: TableMap, source: str) -> FlightLog:
    """The same for a table that has been read."""
    columns = _Columns(path, table, source)
    notes = []
    clock = columns.one("time", table_map.time.column)
    time = (clock - _first(clock)) * SECONDS[table_map.time.unit]
    turn = _attitude(columns, table_map.attitude)
    place = _north_east_up(columns.three("position", table_map.position), table_map.position.frame)
    place = [METRES[table_map.position.unit] * axis for axis in place]
    if table_map.velocity is None:
        speed = [_slope(time, axis) for axis in place]
        notes.append("the map has no velocity: it is the slope of the position")
    else:
        factor = METRES_PER_SECOND[table_map.velocity.unit]
        vector = [factor * axis for axis in columns.three("velocity", table_map.velocity)]
        speed = _north_east_up(vector, table_map.velocity.frame, turn)
    if table_map.rates is None:
        rates = _turning(time, turn)
        notes.append("the map has no rates: they are the slope of the attitude")
    else:
        factor = RADIANS_PER_SECOND[table_map.rates.unit]
        rates = _forward_right_down(columns.three("rates", table_map.rates), table_map.rates.frame, factor)
    angles = [np.degrees(angle) for angle in euler_from_quaternion(turn)]
    found: dict[str, Floats] = {"time_s": time}
    for names, values in ((POSITION, place), (VELOCITY, speed), (ATTITUDE, angles), (RATES, rates)):
        found |= dict(zip(names, values, strict=True))
    if (imu := table_map.accelerometer) is not None:
        values = _forward_right_down(columns.three("accelerometer", imu), imu.frame, ACCELERATIONS[imu.unit])
        found |= dict(zip(IMU, values, strict=True))
    found |= _of_motors(columns, table_map)
    return clean_log(path, found, notes=notes)


class _Columns:
    """Columns of a table as numbers, with a sentence for one that is not there."""

    def __init__(self, path: Path, table: pl.DataFrame, source: str) -> None:
        self._path, self._table, self._source = path, table, source

    def one(self, key: str, name: str) -> Floats:
        if name not in self._table.columns:
            hint = did_you_mean(name, self._table.columns)
            raise LogError(f"{self._source}: {key} names the column '{name}', which {self._path} does not have{hint}")
        series = self._table[name]
        if series.dtype in (pl.Datetime, pl.Date, pl.Time, pl.Duration):
            raise LogError(f"{self._path}: column '{name}' ({key}) holds dates, expected numbers")
        values: Floats = series.cast(pl.Float64, strict=False).fill_null(float("nan")).to_numpy().astype(np.float64)
        if not np.isfinite(values).any():
            raise LogError(f"{self._path}: column '{name}' ({key}) holds no number")
        return values

    def three(self, key: str, group: Any) -> list[Floats]:
        return [self.one(key, name) for name in group.columns]


def _first(values: Floats) -> float:
    return float(values[np.isfinite(values)][0])


def _north_east_up(vector: Sequence[Floats], frame: str, turn: Quaternion | None = None) -> list[Floats]:
    """Vector of a world frame, or with `turn` also of a body frame, in north, east, up."""
    a, b, c = vector
    if frame == "NEU":
        return [a, b, c]
    if frame in FROM_FRD:
        assert turn is not None
        north, east, down = rotate(turn, rotate(FROM_FRD[frame], (a, b, c)))
    else:
        north, east, down = rotate(NORTH_EAST_DOWN[frame], (a, b, c))
    return [north, east, -down]


def _forward_right_down(vector: Sequence[Floats], frame: str, factor: float) -> list[Floats]:
    a, b, c = vector
    return [factor * axis for axis in rotate(FROM_FRD[frame], (a, b, c))]


def _attitude(columns: _Columns, said: _Attitude) -> Quaternion:
    """Attitude of the table as a rotation from forward, right, down to north, east, down; each part of shape (n,)."""
    parts = columns.three("attitude", said)
    if said.order == "roll pitch yaw":
        roll, pitch, yaw = (RADIANS[said.unit] * part for part in parts)
        turn = quaternion_from_euler(roll, pitch, yaw)
    else:
        w, x, y, z = parts if said.order == "wxyz" else (parts[3], *parts[:3])
        length = np.sqrt(w * w + x * x + y * y + z * z)
        length = np.where(length > 0.5, length, np.nan)
        turn = w / length, x / length, y / length, z / length
    return multiply(NORTH_EAST_DOWN[said.world], multiply(turn, FROM_FRD[said.body]))


def _slope(time: Floats, values: Floats) -> Floats:
    with np.errstate(divide="ignore", invalid="ignore"):  # where time stands still: such rows are left out later
        return np.asarray(np.gradient(values, time))


def _turning(time: Floats, turn: Quaternion) -> list[Floats]:
    """Body rates, rad/s, from the change of the attitude: 2 q* dq/dt."""
    w, x, y, z = turn
    flips = np.cumprod(np.where(np.sum([q[1:] * q[:-1] for q in turn], axis=0) < 0.0, -1.0, 1.0))
    same = np.concatenate([[1.0], flips])  # q and -q are one attitude: take the nearer
    w, x, y, z = (same * part for part in (w, x, y, z))
    _, p, q, r = multiply((w, -x, -y, -z), (_slope(time, w), _slope(time, x), _slope(time, y), _slope(time, z)))
    return [2.0 * p, 2.0 * q, 2.0 * r]


def _of_motors(columns: _Columns, table_map: TableMap) -> Mapping[str, Floats]:
    found: dict[str, Floats] = {}
    if (motors := table_map.motors) is not None:
        for i, name in enumerate(motors.columns, start=1):
            values = columns.one("motors", name)
            if motors.unit in REVOLUTIONS:
                found[f"motor{i}_rpm"] = REVOLUTIONS[motors.unit] * values
            elif motors.unit == "us":
                found[f"motor{i}_output"] = (values - PULSE_US[0]) / (PULSE_US[1] - PULSE_US[0])
            else:
                found[f"motor{i}_output"] = SHARES[motors.unit] * values
    if (thrust := table_map.thrust) is not None:
        found["thrust_cmd_n"] = NEWTONS[thrust.unit] * columns.one("thrust", thrust.column)
    if (throttle := table_map.throttle) is not None:
        found["throttle_cmd"] = SHARES[throttle.unit] * columns.one("throttle", throttle.column)
    if (battery := table_map.battery) is not None:
        found["battery_v"] = VOLTS[battery.unit] * columns.one("battery", battery.column)
    return found
