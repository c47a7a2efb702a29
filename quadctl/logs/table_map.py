"""A map: what the columns of a table of another program are, in about ten lines of YAML (docs/log-sources.md)."""

from collections.abc import Iterator
from pathlib import Path
from typing import Literal

from pydantic import Field, PositiveFloat, model_validator

from quadctl.logs.axes import AttitudeWorld, Body
from quadctl.logs.formats import MAP_SUFFIX
from quadctl.settings import Settings, load

SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "date": 1.0}
"""Seconds per unit; dates are in seconds once they are read."""
METRES = {"m": 1.0, "cm": 0.01, "mm": 1e-3, "ft": 0.3048}
METRES_PER_SECOND = {
    "m/s": 1.0,
    "cm/s": 0.01,
    "mm/s": 1e-3,
    "km/h": 1.0 / 3.6,
    "ft/s": 0.3048,
    "mph": 0.44704,
    "kn": 1852.0 / 3600.0,
}
DEGREES = {"deg": 1.0, "degE7": 1e-7}
RADIANS = {"rad": 1.0, "deg": 0.017453292519943295}
RADIANS_PER_SECOND = {"rad/s": 1.0, "deg/s": 0.017453292519943295}
METRES_PER_SECOND2 = {"m/s2": 1.0, "g": 9.80665}
MOTORS = {
    "rpm": ("rpm", 1.0),
    "rad/s": ("rpm", 9.549296585513721),
    "rev/s": ("rpm", 60.0),
    "share": ("output", 1.0),
    "percent": ("output", 0.01),
    "pwm": ("output", 1.0),
    "us": ("output", 1.0),
}
"""Quantity of the log's columns, and the factor, by the unit of the motors; counts and pulses are made shares first."""
PULSES_US = (1000.0, 2000.0)
"""Pulses of no and of full output, where a map does not say."""
SHARES = {"share": 1.0, "percent": 0.01}
VOLTS = {"V": 1.0, "mV": 1e-3}

_Three = tuple[str, str, str]
_Nine = tuple[str, str, str, str, str, str, str, str, str]


class Clock(Settings):
    """One clock: a column that increases."""

    column: str
    unit: Literal["s", "ms", "us", "ns", "date"]
    """`date` for texts as ISO 8601 has them, dates or times of a day; without an offset they are UTC."""


class Group(Settings):
    """Columns that arrive together; rows in which one of them is missing hold no update."""

    time: Clock | None = None
    """Their own clock, with the same zero as the table's; the table's if None."""


class Several(Group):
    columns: tuple[str, ...]
    """A name with a sign before it, `-pitch`, is the negative of the column."""

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
    frame: Literal["NED", "ENU", "NWU", "NEU", "LLA"]
    """LLA: latitude, longitude and height; north, east and up are then counted from the first position."""
    unit: Literal["m", "cm", "mm", "ft", "deg", "degE7"] = "m"
    """With LLA, of latitude and longitude."""
    height_unit: Literal["m", "cm", "mm", "ft"] | None = None
    """With LLA; m if None."""

    @model_validator(mode="after")
    def _says_what_it_needs(self) -> "Position":
        if self.frame == "LLA" and self.unit not in DEGREES:
            raise ValueError(f"has `frame: LLA` and `unit: {self.unit}`, expected `unit: deg` or `unit: degE7`")
        if self.frame != "LLA" and (self.unit in DEGREES or self.height_unit is not None):
            raise ValueError(f"has `frame: {self.frame}`, expected `frame: LLA` with degrees or a unit of the height")
        return self


class Velocity(Several):
    columns: _Three
    frame: Literal["NED", "ENU", "NWU", "NEU", "FRD", "FLU"]
    unit: Literal["m/s", "cm/s", "mm/s", "km/h", "ft/s", "mph", "kn"] = "m/s"


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
    by: Literal["motion_capture", "estimator"] | None = None
    """Source of the attitude, where it is known: the axes of a motion capture's rigid body may be off by degrees."""

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
    unit: Literal["rpm", "rad/s", "rev/s", "share", "percent", "pwm", "us"]
    full: PositiveFloat | None = None
    """Count of full output, with `unit: pwm`: 65535 of 16 bits."""
    low: float | None = None
    """Pulse of no output, with `unit: us`; 1000 if None."""
    high: float | None = None
    """Pulse of full output, with `unit: us`; 2000 if None."""

    @model_validator(mode="after")
    def _says_what_it_needs(self) -> "Motors":
        if (self.unit == "pwm") != (self.full is not None):
            raise ValueError("needs `unit: pwm` and `full` (65535 of 16 bits) together")
        if self.unit != "us" and (self.low is not None or self.high is not None):
            raise ValueError("has `low` or `high`, expected them with `unit: us` only")
        if not self.ends[0] < self.ends[1]:
            raise ValueError(f"has pulses from {self.ends[0]:g} to {self.ends[1]:g}, expected `low` below `high`")
        return self

    @property
    def ends(self) -> tuple[float, float]:
        """Values of no and of full output, of counts and pulses."""
        low, high = PULSES_US
        if self.full is not None:
            return 0.0, self.full
        return low if self.low is None else self.low, high if self.high is None else self.high


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
        for field, clock in self.clocks():
            yield f"{field}.column", clock.column
        for name, group in self.groups():
            for field, columns in group.names.items():
                yield from ((f"{name}.{field}", unsigned(column)) for column in columns)

    def clocks(self) -> Iterator[tuple[str, Clock]]:
        """(field of the map, clock) of all that the map names."""
        yield "time", self.time
        for name, group in self.groups():
            if group.time is not None:
                yield f"{name}.time", group.time

    def groups(self) -> Iterator[tuple[str, Several | Single]]:
        """All groups that the map holds, by their names."""
        for name in type(self).model_fields:
            group = getattr(self, name)
            if isinstance(group, Several | Single):
                yield name, group


def unsigned(column: str) -> str:
    """Name of a column of the table, without the sign that makes it its negative."""
    return column.removeprefix("-")


def load_map(path: Path) -> TableMap:
    """Read a map.

    Raises
    ------
    SettingsError
        The file cannot be read, or is no map.
    """
    return load(path, TableMap)


def maps_of_folder(path: Path) -> list[Path]:
    """Maps beside the table at `path` that belong to no one table there, and so to all that have none of their own."""
    owned = {file.stem for file in path.parent.iterdir() if file.suffix not in (".yaml", ".yml")}
    return sorted(
        file for file in path.parent.glob(f"*{MAP_SUFFIX}") if file.name.removesuffix(MAP_SUFFIX) not in owned
    )
