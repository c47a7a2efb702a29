"""Small bags of ROS for the tests of their reader: the odometry of a hover."""

import functools
import io
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_typestore

ODOMETRY = "nav_msgs/msg/Odometry"
INTERVAL_NS = 20_000_000
CHUNK_BYTES = 8000
STORAGES = {".mcap": rosbag2.StoragePlugin.MCAP, ".db3": rosbag2.StoragePlugin.SQLITE3}


@functools.cache
def small_bag(suffix: str = ".mcap", messages: int = 40, packing: str = "") -> bytes:
    """One file of a bag, ROS 1's (.bag) or a storage file of ROS 2's; `packing` is lz4, zstd or bz2."""
    with tempfile.TemporaryDirectory() as folder:
        return written_bag(Path(folder) / "bag", suffix, messages, packing).read_bytes()


def written_bag(path: Path, suffix: str, messages: int = 40, packing: str = "") -> Path:
    """Write a bag: the file that holds its messages."""
    if suffix == ".bag":
        store, ros1 = get_typestore(Stores.ROS1_NOETIC), rosbag1.Writer(path)
        if packing:
            ros1.set_compression(rosbag1.Writer.CompressionFormat[packing.upper()])
        ros1.chunk_threshold = CHUNK_BYTES
        with ros1:
            connection = ros1.add_connection("/odom", ODOMETRY, typestore=store)
            for i in range(messages):
                ros1.write(
                    connection, 10**9 + INTERVAL_NS * i, store.serialize_ros1(odometry(store.types, i, seq=i), ODOMETRY)
                )
        return path
    store, ros2 = get_typestore(Stores.LATEST), rosbag2.Writer(path, version=9, storage_plugin=STORAGES[suffix])
    with ros2:
        connection = ros2.add_connection("/odom", ODOMETRY, typestore=store)
        for i in range(messages):
            ros2.write(connection, 10**9 + INTERVAL_NS * i, store.serialize_cdr(odometry(store.types, i), ODOMETRY))
    file = next(path.glob(f"*{suffix}"))
    if packing:
        file.write_bytes(_packed(file.read_bytes(), CompressionType[packing.upper()]))
    return file


def _packed(data: bytes, packing: CompressionType) -> bytes:
    """An MCAP in packed chunks."""
    out = io.BytesIO()
    writer = Writer(out, chunk_size=CHUNK_BYTES, compression=packing)
    writer.start(profile="ros2")
    number = None
    for schema, channel, message in make_reader(io.BytesIO(data)).iter_messages():
        assert schema is not None
        if number is None:
            kind = writer.register_schema(schema.name, schema.encoding, schema.data)
            number = writer.register_channel(channel.topic, channel.message_encoding, kind, channel.metadata)
        writer.add_message(number, message.log_time, message.data, message.publish_time)
    writer.finish()
    return out.getvalue()


def odometry(types: Mapping[str, Any], number: int, **of_header: Any) -> Any:
    """Message of a hover 1 m above the ground."""
    zero, none = types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0), np.zeros(36)
    stamp = types["builtin_interfaces/msg/Time"](*divmod(10**9 + INTERVAL_NS * number, 10**9))
    pose = types["geometry_msgs/msg/Pose"](
        position=types["geometry_msgs/msg/Point"](0.0, 0.0, 1.0),
        orientation=types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0),
    )
    return types[ODOMETRY](
        header=types["std_msgs/msg/Header"](stamp=stamp, frame_id="map", **of_header),
        child_frame_id="base_link",
        pose=types["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=none),
        twist=types["geometry_msgs/msg/TwistWithCovariance"](
            twist=types["geometry_msgs/msg/Twist"](linear=zero, angular=zero), covariance=none
        ),
    )
