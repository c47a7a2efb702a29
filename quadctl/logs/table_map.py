"""A map: what the columns of a table of another program are, in about ten lines of YAML (docs/log-sources.md)."""

from collections.abc import Iterator
from pathlib import Path
from typing import Literal

from pydantic import Field, model_validator

from quadctl.logs.axes import AttitudeWorld, Body
from quadctl.logs.formats import MAP_SUFFIX
from quadctl.settings import Settings, load

SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
METRES = {"m": 1.0, "cm": 0.01, "mm": 1e-3, "ft": 0.3048}
METRES_PER_SECOND = {"m/s": 1.0, "cm/s": 0.01, "mm/s": 1e-3, "km/h": 1.0 / 3.6, "ft/s": 0.3048}
RADIANS = {"rad": 1.0, "deg": 0.017453292519943295}
RADIANS_PER_SECOND = {"rad/s": 1.0, "deg/s": 0.017453292519943295}
METRES_PER_SECOND2 = {"m/s2": 1.0, "g": 9.80665}
MOTORS = {
    "rpm": ("rpm", 1.0),
    "rad/s": ("rpm", 9.549296585513721),
    "rev/s": ("rpm", 60.0),
    "share": ("output", 1.0),
    "percent": ("output", 0.01),
}
"""Quantity of the log's columns, and the factor, by the unit of the motors."""
SHARES = {"share": 1.0, "percent": 0.01}
VOLTS = {"V": 1.0, "mV": 1e-3}

_Three = tuple[str, str, str]
_Nine = tuple[str, str, str, str, str, str, str, str, str]


class Clock(Settings):
    """One clock: a column that increases."""

    column: str
    unit: Literal["s", "ms", "us", "ns"]


class Group(Settings):
    """Columns that arrive together; rows in which one of them is missing hold no update."""

    time: Clock | None = None
    """Their own clock, with the same zero as the table's; the table's if None."""


class Several(Group):
    columns: tuple[str, ...]

    @property
    def names(self) -> dict[str, tuple[str, ...]]:
        """Columns of the table, by the field that names them."""
        return {"columns": self.columns}


class Single(Group):
    column: str

    @property
    def names(self) -> dict[str, tuple[str, ...]]:
        """Column of the table, by the field that names it."""
        return {"column": (self.column,)}


class Position(Several):
    columns: _Three
    frame: Literal["NED", "ENU", "NWU", "NEU"]
    unit: Literal["m", "cm", "mm", "ft"] = "m"


class Velocity(Several):
    columns: _Three
    frame: Literal["NED", "ENU", "NWU", "NEU", "FRD", "FLU"]
    unit: Literal["m/s", "cm/s", "mm/s", "km/h", "ft/s"] = "m/s"


class Attitude(Several):
    """A quaternion, a rotation matrix, or roll, pitch and yaw (ZYX), of `body` in `world`."""

    columns: tuple[str, str, str, str] | _Three | _Nine
    order: Literal["wxyz", "xyzw", "rows", "columns"] | None = None
    """Order of a quaternion's parts, or of a matrix's elements: row after row, or column after column."""
    unit: Literal["rad", "deg"] | None = None
    body: Body
    world: AttitudeWorld
    inverse: bool = False
    """True for a quaternion that rotates `world` to `body`."""

    @model_validator(mode="after")
    def _says_what_it_needs(self) -> "Attitude":
        if len(self.columns) == 4 and (self.order not in ("wxyz", "xyzw") or self.unit is not None):
            raise ValueError("has four columns, expected `order: wxyz` or `order: xyzw`, and no unit")
        if len(self.columns) == 3 and (self.unit is None or self.order is not None or self.inverse):
            raise ValueError("has three columns (roll, pitch, yaw), expected `unit: deg` or `unit: rad`, and no order")
        if len(self.columns) == 9 and (self.order not in ("rows", "columns") or self.unit is not None or self.inverse):
            raise ValueError("has nine columns (a matrix), expected `order: rows` or `order: columns`, and no unit")
        return self


class Rates(Several):
    columns: _Three
    frame: Body
    unit: Literal["rad/s", "deg/s"] = "rad/s"


class Imu(Several):
    """Specific force, as an accelerometer measures it."""

    columns: _Three
    frame: Body
    unit: Literal["m/s2", "g"] = "m/s2"


class Motors(Several):
    """Speeds of the rotors, or outputs to them, in the order of `rotors` in the vehicle file."""

    columns: tuple[str, ...] = Field(min_length=1, max_length=12)
    unit: Literal["rpm", "rad/s", "rev/s", "share", "percent"]


class Battery(Single):
    unit: Literal["V", "mV"] = "V"


class Throttle(Single):
    unit: Literal["share", "percent"] = "share"


class TableMap(Settings):
    """Meaning of the columns of a table."""

    source: str = ""
    """Description of the layout, for a reader of the map."""
    time: Clock
    position: Position
    velocity: Velocity
    attitude: Attitude
    rates: Rates | None = None
    imu: Imu | None = None
    motors: Motors | None = None
    battery: Battery | None = None
    throttle: Throttle | None = None

    def named_columns(self) -> Iterator[tuple[str, str]]:
        """(field of the map, column of the table) of all that the map names."""
        yield "time.column", self.time.column
        for name, group in self.groups():
            if group.time is not None:
                yield f"{name}.time.column", group.time.column
            for field, columns in group.names.items():
                yield from ((f"{name}.{field}", column) for column in columns)

    def groups(self) -> Iterator[tuple[str, Several | Single]]:
        """All groups that the map holds, by their names."""
        for name in type(self).model_fields:
            group = getattr(self, name)
            if isinstance(group, Several | Single):
                yield name, group


def load_map(path: Path) -> TableMap:
    """Read a map.

    Raises
    ------
    SettingsError
        The file cannot be read, or is no map.
    """
    return load(path, TableMap)


def map_beside(path: Path) -> Path | None:
    """The map of the table at `path`, if there is one beside it."""
    beside = path.with_suffix(MAP_SUFFIX)
    return beside if beside.is_file() else None
