"""Bags of ROS 2 (a folder with `metadata.yaml`, `.mcap`, `.db3`) and of ROS 1 (`.bag`), read with rosbags, without ROS.

Two families of messages are understood: `px4_msgs`, which are PX4's own topics, read as those of a ULog; and the
standard messages that MAVROS and others publish, in east, north, up and forward, left, up (REP 103, REP 147).
"""

import re
import shutil
import tempfile
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from quadctl.errors import LogError
from quadctl.frames import Quaternion
from quadctl.logs.axes import Vectors, attitude, body_to_world, euler_deg, forward_right_down, north_east_up
from quadctl.logs.bag_recovery import recover
from quadctl.logs.findings import Finding, Kind, finding
from quadctl.logs.flight_log import ATTITUDE, IMU, POSITION, RATES, VELOCITY, FlightLog, Floats
from quadctl.logs.merge import Channel, Origin, merge
from quadctl.logs.ulog import TOPICS, log_of_topics
from quadctl.thrust_chain.atmosphere import pressure_altitude_m

MAGICS = {b"\x89MCAP": ".mcap", b"SQLite format 3": ".db3", b"#ROSBAG V2": ".bag"}
"""Beginnings of the files of a bag, with the suffixes by which the library knows them."""
REMEDIES = {".mcap": "mcap recover", ".db3": "sqlite3 FILE .recover", ".bag": "rosbag reindex", "": "ros2 bag reindex"}
"""Programs that may get more out of a damaged bag, by the suffix of its content; "" of a folder."""
METADATA = "metadata.yaml"
"""File that a recorder of ROS 2 writes when it ends."""
LINK = "bag"
"""Name, without its suffix, under which the library is shown a file."""
PX4 = "px4_msgs/msg/"
NEEDED = "nav_msgs/Odometry, or px4_msgs VehicleLocalPosition and VehicleAttitude"

_Topic: TypeAlias = dict[str, Floats]
"""Arrays of shape (n,) by the names of fields: `pose.pose.position.x`, `q[0]`."""
RPM_PER_RAD_S = 30.0 / np.pi
DIFFERENTIAL = "diff_pressure"
"""Part of the names of topics with an air speed sensor's pressure, which has the type of a barometer's."""


def is_rosbag(head: bytes) -> bool:
    """True for a file that begins with `head` as a bag does."""
    return head.startswith(tuple(MAGICS))


def read_rosbag(path: Path) -> FlightLog:
    """Read a bag.

    Raises
    ------
    LogError
        It cannot be read, or holds no position, velocity or attitude.
    """
    findings: list[Finding] = []
    by_type = _messages(path, findings)
    px4 = {name: topic for kind, topic in by_type.items() if (name := px4_topic(kind)) in TOPICS}
    if "vehicle_local_position" in px4:
        return log_of_topics(path, px4, {"autopilot": "PX4"}, findings)
    found = chain.from_iterable(read(by_type[kind]) for kind, read in STANDARD.items() if kind in by_type)
    channels = list(_once(found))
    return merge(channels, Origin(path, NEEDED, {}, findings, []))


def px4_topic(kind: str) -> str:
    """Name in a ULog of a message type of px4_msgs: vehicle_attitude for px4_msgs/msg/VehicleAttitude; "" of others."""
    return re.sub(r"(?<!^)(?=[A-Z])", "_", kind.removeprefix(PX4)).lower() if kind.startswith(PX4) else ""


def _messages(path: Path, findings: list[Finding]) -> dict[str, _Topic]:
    """The messages of a bag that are understood, by their type; of several topics of a type the one with the most.

    Of one that has no end, or is damaged, those that are whole.
    """
    suffix = _suffix(path)
    try:
        with _named(path, suffix) as named:
            return _understood(path, [named], findings)
    except LogError:
        raise
    except Exception as error:  # the libraries below stumble over damage in any way that Python can
        problem = error
    with tempfile.TemporaryDirectory() as folder:
        try:
            found = recover(_storage_files(path), suffix or _suffix(_storage_files(path)[0]), Path(folder))
            topics = _understood(path, found.files, findings, leave_out_damaged=True)
        except Exception:
            reason = str(problem).splitlines()[0].rstrip(".") if str(problem) else type(problem).__name__
            reason = re.sub(rf"\S*/{LINK}\.\w+", path.name, reason)
            raise LogError(
                f"{path}: cannot be read as a ROS bag ({reason}), expected a whole one, or one of which "
                f"`{REMEDIES[suffix]}` makes one"
            ) from None
    has_end = not found.is_cut_short and (path.is_file() or (path / METADATA).is_file())
    findings.append(finding(Kind.DAMAGED) if has_end else finding(Kind.CUT_SHORT, of="file"))
    return topics


def _understood(
    path: Path, files: list[Path], findings: list[Finding], leave_out_damaged: bool = False
) -> dict[str, _Topic]:
    """The messages of the files of one bag that are understood; `path` is named in messages."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    with AnyReader(files, default_typestore=get_typestore(Stores.LATEST)) as bag:
        counts: dict[tuple[str, str], int] = defaultdict(int)
        for connection in bag.connections:
            if DIFFERENTIAL in connection.topic:
                continue
            if connection.msgtype in STANDARD or px4_topic(connection.msgtype) in TOPICS:
                counts[connection.msgtype, connection.topic] += connection.msgcount
        chosen: dict[str, str] = {}
        left_out: list[Finding] = []
        for kind, topic in sorted(counts, key=lambda key: -counts[key]):
            if topic != chosen.setdefault(kind, topic):
                left_out.append(finding(Kind.TOPIC_LEFT_OUT, topic=topic, read=chosen[kind]))
        if not chosen:
            raise LogError(f"{path}: holds no messages that say how a vehicle moves, expected {NEEDED}")
        rows: dict[str, list[dict[str, float]]] = {kind: [] for kind in chosen}
        of_chosen = [connection for connection in bag.connections if chosen.get(connection.msgtype) == connection.topic]
        for connection, stamp_ns, data in bag.messages(of_chosen):
            try:
                row = dict(_fields(bag.deserialize(data, connection.msgtype), ""))
            except Exception:  # of any kind: the library takes the data for whole
                if not leave_out_damaged:
                    raise
                continue
            rows[connection.msgtype].append({"bag_s": 1e-9 * stamp_ns, **row})
    findings += left_out
    return {kind: _columns(found) for kind, found in rows.items() if found}


def _storage_files(path: Path) -> list[Path]:
    """The files of a bag that hold its messages, in their order."""
    return sorted(file for file in path.iterdir() if file.suffix in MAGICS.values()) if path.is_dir() else [path]


def _suffix(path: Path) -> str:
    """Suffix by which the library knows the content of a file; "" of a folder."""
    if path.is_dir():
        return ""
    with path.open("rb") as file:
        head = file.read(16)
    suffix = next((suffix for magic, suffix in MAGICS.items() if head.startswith(magic)), None)
    if suffix is None:
        raise LogError(f"{path}: does not begin as a ROS bag does, expected a {path.suffix} file")
    return suffix


@contextmanager
def _named(path: Path, suffix: str) -> Iterator[Path]:
    """The bag under a name with the suffix of its content."""
    if path.is_dir():
        yield path
        return
    with tempfile.TemporaryDirectory() as folder:
        link = Path(folder) / f"{LINK}{suffix}"
        try:
            link.symlink_to(path.resolve())
        except OSError:  # Windows lets few users make one
            shutil.copyfile(path, link)
        yield link


def _fields(value: Any, name: str) -> Iterator[tuple[str, float]]:
    """Numbers of a message by their path in it."""
    if isinstance(value, bool | int | float | np.number):
        yield name, float(value)
    elif isinstance(value, np.ndarray):  # of numbers, in one dimension
        yield from ((f"{name}[{i}]", float(part)) for i, part in enumerate(value.tolist()))
    elif isinstance(value, list | tuple):
        for i, part in enumerate(value):
            yield from _fields(part, f"{name}[{i}]")
    elif hasattr(value, "__dataclass_fields__"):
        for field in value.__dataclass_fields__:
            if field != "__msgtype__":
                yield from _fields(getattr(value, field), f"{name}.{field}" if name else field)


def _columns(rows: list[dict[str, float]]) -> _Topic:
    return {name: np.array([row.get(name, np.nan) for row in rows]) for name in rows[0]}


def _time(topic: _Topic) -> Floats:
    """Time of the measurement where the header says it, else that of the record."""
    if "header.stamp.sec" in topic:
        stamp = topic["header.stamp.sec"] + 1e-9 * topic["header.stamp.nanosec"]
        if np.any(stamp > 0.0):
            return stamp
    return topic["bag_s"]


def _xyz(topic: _Topic, name: str) -> Vectors:
    return topic[f"{name}.x"], topic[f"{name}.y"], topic[f"{name}.z"]


def _turn(topic: _Topic, name: str) -> Quaternion:
    """Attitude as a rotation from forward, right, down to north, east, down."""
    return attitude((topic[f"{name}.w"], *_xyz(topic, name)), "ENU", "FLU")


def _angles(turn: Quaternion) -> dict[str, Floats]:
    return dict(zip(ATTITUDE, euler_deg(turn), strict=True))


def _up(names: tuple[str, ...], vector: Vectors) -> dict[str, Floats]:
    return dict(zip(names, north_east_up(vector, "ENU"), strict=True))


def _body(names: tuple[str, ...], vector: Vectors) -> dict[str, Floats]:
    return dict(zip(names, forward_right_down(vector, "FLU"), strict=True))


def _odometry(topic: _Topic) -> Iterator[Channel]:
    turn = _turn(topic, "pose.pose.orientation")
    columns = _up(POSITION, _xyz(topic, "pose.pose.position")) | _angles(turn)
    speed = body_to_world(turn, forward_right_down(_xyz(topic, "twist.twist.linear"), "FLU"))
    columns |= dict(zip(VELOCITY, speed, strict=True))
    yield Channel("nav_msgs/Odometry", _time(topic), columns)
    yield Channel("nav_msgs/Odometry rates", _time(topic), _body(RATES, _xyz(topic, "twist.twist.angular")))


def _pose(topic: _Topic) -> Iterator[Channel]:
    columns = _up(POSITION, _xyz(topic, "pose.position")) | _angles(_turn(topic, "pose.orientation"))
    yield Channel("geometry_msgs/PoseStamped", _time(topic), columns)


def _twist(topic: _Topic) -> Iterator[Channel]:
    yield Channel("geometry_msgs/TwistStamped", _time(topic), _up(VELOCITY, _xyz(topic, "twist.linear")))


def _imu(topic: _Topic) -> Iterator[Channel]:
    yield Channel("sensor_msgs/Imu gyro", _time(topic), _body(RATES, _xyz(topic, "angular_velocity")))
    force = _body(IMU, _xyz(topic, "linear_acceleration"))
    yield Channel("sensor_msgs/Imu", _time(topic), force, makes_rows=False, averaged=True)


def _battery(topic: _Topic) -> Iterator[Channel]:
    yield Channel("sensor_msgs/BatteryState", _time(topic), {"battery_v": topic["voltage"]}, makes_rows=False)


def _altitude(topic: _Topic) -> Iterator[Channel]:
    """Height of the barometer alone, as PX4 tells it."""
    yield Channel("mavros_msgs/Altitude", _time(topic), {"baro_m": topic["monotonic"]}, makes_rows=False, averaged=True)


def _pressure(topic: _Topic) -> Iterator[Channel]:
    columns = {"baro_m": np.asarray(pressure_altitude_m(topic["fluid_pressure"]))}
    yield Channel("sensor_msgs/FluidPressure", _time(topic), columns, makes_rows=False, averaged=True)


def _range(topic: _Topic) -> Iterator[Channel]:
    distance = topic["range"]
    good = (distance > topic["min_range"]) & (distance < topic["max_range"])
    columns = {"range_m": np.where(good, distance, np.nan)}
    yield Channel("sensor_msgs/Range", _time(topic), columns, makes_rows=False)


def _rotors(field: str, factor: float) -> Callable[[_Topic], Iterator[Channel]]:
    """Reader of rotor speeds; `field` with a place for the number of the rotor, from 0."""

    def read(topic: _Topic) -> Iterator[Channel]:
        columns: dict[str, Floats] = {}
        while (name := field.format(len(columns))) in topic:
            columns[f"motor{len(columns) + 1}_rpm"] = factor * topic[name]
        yield Channel(field.partition("[")[0], _time(topic), columns)

    return read


def _thrust(topic: _Topic) -> Iterator[Channel]:
    yield Channel("mavros_msgs/AttitudeTarget", _time(topic), {"throttle_cmd": topic["thrust"]})


STANDARD: dict[str, Callable[[_Topic], Iterator[Channel]]] = {
    "sensor_msgs/msg/Imu": _imu,
    "nav_msgs/msg/Odometry": _odometry,
    "geometry_msgs/msg/TwistStamped": _twist,
    "geometry_msgs/msg/PoseStamped": _pose,
    "sensor_msgs/msg/BatteryState": _battery,
    "mavros_msgs/msg/ESCStatus": _rotors("esc_status[{}].rpm", 1.0),
    "mavros_msgs/msg/ESCTelemetry": _rotors("esc_telemetry[{}].rpm", 1.0),
    "mav_msgs/msg/Actuators": _rotors("angular_velocities[{}]", RPM_PER_RAD_S),
    "actuator_msgs/msg/Actuators": _rotors("velocity[{}]", RPM_PER_RAD_S),
    "mavros_msgs/msg/AttitudeTarget": _thrust,
    "mavros_msgs/msg/Altitude": _altitude,
    "sensor_msgs/msg/FluidPressure": _pressure,
    "sensor_msgs/msg/Range": _range,
}
"""Standard messages and their readers; where several hold the same column, the first in this order does."""


def _once(channels: Iterator[Channel]) -> Iterator[Channel]:
    """The channels without columns that an earlier one holds."""
    seen: set[str] = set()
    for channel in channels:
        columns = {name: values for name, values in channel.columns.items() if name not in seen}
        seen |= columns.keys()
        if columns:
            yield Channel(channel.source, channel.time_s, columns, channel.makes_rows, channel.averaged)
