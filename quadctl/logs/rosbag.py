"""Bags of ROS 2 (a folder with `metadata.yaml`, `.mcap`, `.db3`) and of ROS 1 (`.bag`), read with rosbags, without ROS.

Two families of messages are understood: `px4_msgs`, which are PX4's own topics, read as those of a ULog; and the
standard messages that MAVROS and others publish, in east, north, up and forward, left, up (REP 103, REP 147).
"""

import re
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from quadctl.errors import LogError
from quadctl.frames import Quaternion
from quadctl.logs.axes import Vectors, attitude, body_to_world, euler_deg, forward_right_down, north_east_up
from quadctl.logs.findings import Finding, Kind, finding
from quadctl.logs.flight_log import ATTITUDE, IMU, POSITION, RATES, VELOCITY, FlightLog, Floats
from quadctl.logs.merge import Channel, Origin, merge
from quadctl.logs.ulog import TOPICS, log_of_topics

MAGICS = {b"\x89MCAP": ".mcap", b"SQLite format 3": ".db3", b"#ROSBAG V2": ".bag"}
"""Beginnings of the files of a bag, with the suffixes by which the library knows them."""
LINK = "bag"
"""Name, without its suffix, under which the library is shown a file."""
PX4 = "px4_msgs/msg/"
NEEDED = "nav_msgs/Odometry, or px4_msgs VehicleLocalPosition and VehicleAttitude"

_Topic: TypeAlias = dict[str, Floats]
"""Arrays of shape (n,) by the names of fields: `pose.pose.position.x`, `q[0]`."""
RPM_PER_RAD_S = 30.0 / np.pi


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
    """The messages of a bag that are understood, by their type; of several topics of a type the one with the most."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    try:
        with _named(path) as named, AnyReader([named], default_typestore=get_typestore(Stores.LATEST)) as bag:
            chosen: dict[str, Any] = {}
            for connection in sorted(bag.connections, key=lambda c: -c.msgcount):
                kind = connection.msgtype
                if kind not in STANDARD and px4_topic(kind) not in TOPICS:
                    continue
                if kind in chosen:
                    if connection.topic != chosen[kind].topic:
                        read = chosen[kind].topic
                        findings.append(finding(Kind.TOPIC_LEFT_OUT, topic=connection.topic, read=read))
                else:
                    chosen[kind] = connection
            if not chosen:
                raise LogError(f"{path}: holds no messages that say how a vehicle moves, expected {NEEDED}")
            rows: dict[str, list[dict[str, float]]] = {kind: [] for kind in chosen}
            for connection, stamp_ns, data in bag.messages(list(chosen.values())):
                row = dict(_fields(bag.deserialize(data, connection.msgtype), ""))
                rows[connection.msgtype].append({"bag_s": 1e-9 * stamp_ns, **row})
    except LogError:
        raise
    except Exception as error:  # the libraries below stumble over damage in any way that Python can
        reason = str(error).splitlines()[0].rstrip(".") if str(error) else type(error).__name__
        reason = re.sub(rf"\S*/{LINK}\.\w+", path.name, reason)
        raise LogError(f"{path}: cannot be read as a ROS bag ({reason}), expected a whole one") from None
    return {kind: _columns(found) for kind, found in rows.items() if found}


@contextmanager
def _named(path: Path) -> Iterator[Path]:
    """The bag under a name with the suffix of its content."""
    if path.is_dir():
        yield path
        return
    with path.open("rb") as file:
        head = file.read(16)
    suffix = next((suffix for magic, suffix in MAGICS.items() if head.startswith(magic)), None)
    if suffix is None:
        raise LogError(f"{path}: does not begin as a ROS bag does, expected a {path.suffix} file")
    with tempfile.TemporaryDirectory() as folder:
        link = Path(folder) / f"{LINK}{suffix}"
        link.symlink_to(path.resolve())
        yield link


def _fields(value: Any, name: str) -> Iterator[tuple[str, float]]:
    """Numbers of a message by their path in it."""
    if isinstance(value, bool | int | float | np.number):
        yield name, float(value)
    elif isinstance(value, np.ndarray | list | tuple):
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
