"""Bags of ROS 2 (rosbag2 in SQLite or MCAP), read with rosbags: no ROS is needed.

A bag with messages of px4_msgs is read as PX4's own log is. Any other: messages of nav_msgs, geometry_msgs, sensor_msgs
and mavros_msgs, in ROS's frames (world ENU, body FLU) unless the name of the frame says NED or FRD.
"""

import re
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from quadctl.errors import LogError
from quadctl.frames import Quaternion
from quadctl.logs.axes import (
    AttitudeWorld,
    Body,
    Vectors,
    attitude,
    body_to_world,
    euler_deg,
    forward_right_down,
    north_east_up,
)
from quadctl.logs.columns import motor_columns
from quadctl.logs.flight_log import ATTITUDE, IMU, POSITION, RATES, VELOCITY, FlightLog, Floats
from quadctl.logs.merge import Channel, Origin, held, merge
from quadctl.logs.ulog import TOPICS, Topic, log_of_topics

MCAP_MAGIC, SQLITE_MAGIC = b"\x89MCAP0\r\n", b"SQLite format 3\0"
PX4 = "px4_msgs/msg/"
ODOMETRY, POSE, POSE_COV = (
    "nav_msgs/msg/Odometry",
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
)
TWIST, IMU_MESSAGE, BATTERY = "geometry_msgs/msg/TwistStamped", "sensor_msgs/msg/Imu", "sensor_msgs/msg/BatteryState"
RC_OUT, TARGET = "mavros_msgs/msg/RCOut", "mavros_msgs/msg/AttitudeTarget"
ROS = (ODOMETRY, POSE, POSE_COV, TWIST, IMU_MESSAGE, BATTERY, RC_OUT, TARGET)
NEEDED = "nav_msgs/Odometry, or geometry_msgs/PoseStamped and TwistStamped, or px4_msgs"
PULSE_US = (1000.0, 2000.0)
"""Range of the outputs in mavros_msgs/RCOut, which does not tell it."""
_NO_MEASUREMENT = re.compile(r"setpoint|target|goal|cmd|command|reference|desired|/in/|groundtruth|ground_truth")
"""Names of topics that do not tell where the vehicle is, or tell a simulator's truth."""

_Messages: TypeAlias = list[tuple[int, Any]]
"""Time of recording, ns, and message."""


def is_mcap(head: bytes) -> bool:
    """True for a file that begins with `head` as MCAP does."""
    return head.startswith(MCAP_MAGIC)


def is_sqlite(head: bytes) -> bool:
    """True for a file that begins with `head` as a database of SQLite does."""
    return head.startswith(SQLITE_MAGIC)


def read_rosbag(path: Path) -> FlightLog:
    """Read the bag that `path` is a file of; of a folder with a metadata.yaml, all its files.

    Raises
    ------
    LogError
        The bag cannot be read, or holds no position, velocity or attitude.
    """
    notes: list[str] = []
    try:
        messages = _messages(path, notes)
    except OSError as error:
        raise LogError(f"{path}: cannot be read ({error.strerror or error})") from None
    except LogError:
        raise
    except Exception as error:  # the parser stumbles over damage in any way that Python can
        reason = " ".join(str(error).split())[:200]
        raise LogError(
            f"{path}: cannot be read as a rosbag2 ({type(error).__name__}: {reason}), expected one"
        ) from None
    if any(kind.startswith(PX4) for kind, _ in messages):
        return _px4_log(path, messages, notes)
    return merge(_channels(messages, notes), Origin(path, NEEDED, {"autopilot": "ROS"}, notes, []))


def _messages(path: Path, notes: list[str]) -> dict[tuple[str, str], _Messages]:
    """Messages by (type, topic), of the types that are read."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    found: dict[tuple[str, str], _Messages] = {}
    suffix = ".mcap" if path.open("rb").read(len(MCAP_MAGIC)) == MCAP_MAGIC else ".db3"
    with tempfile.TemporaryDirectory() as folder:
        bag = path.parent if (path.parent / "metadata.yaml").is_file() else path
        if bag is path and path.suffix != suffix:  # rosbags goes by the suffix
            bag = Path(folder) / f"bag{suffix}"
            bag.symlink_to(path.resolve())
        with AnyReader([bag], default_typestore=get_typestore(Stores.LATEST)) as reader:
            wanted = [c for c in reader.connections if c.msgtype in ROS or c.msgtype.startswith(PX4)]
            unknown = sorted({c.msgtype for c in wanted if c.msgtype not in reader.typestore.fielddefs})
            if unknown:
                notes.append(
                    f"the bag does not hold the definition of {', '.join(unknown)}, which is left out: expected MCAP, "
                    "or SQLite of ROS 2 Iron or later"
                )
            wanted = [c for c in wanted if c.msgtype not in unknown]
            for connection, time_ns, raw in reader.messages(connections=wanted) if wanted else ():
                message = reader.deserialize(raw, connection.msgtype)
                found.setdefault((connection.msgtype, connection.topic), []).append((time_ns, message))
    if not found:
        missing = f" ({notes[-1]})" if notes else ""
        raise LogError(f"{path}: holds no messages that tell a flight{missing}, expected {NEEDED}")
    return found


# --- px4_msgs ---------------------------------------------------------------------------------------------------------


def _px4_log(path: Path, messages: dict[tuple[str, str], _Messages], notes: list[str]) -> FlightLog:
    topics: dict[str, Topic] = {}
    outputs: list[Topic] = []
    for (kind, _), content in sorted(messages.items(), key=lambda item: "/in/" in item[0][1]):
        name = re.sub(r"(?<!^)(?=[A-Z])", "_", kind.removeprefix(PX4)).lower()
        if name not in TOPICS:
            continue
        if name == "actuator_outputs":
            outputs.append(_table(message for _, message in content))
        elif name not in topics:
            topics[name] = _table(message for _, message in content)
    meta = {"autopilot": "PX4", "software": "PX4, by px4_msgs", "parameters": {}}
    return log_of_topics(path, topics, outputs, meta, notes)


def _table(messages: Iterable[Any]) -> Topic:
    """Fields of messages as PX4's own log names them, `xyz[0]` and `esc[0].esc_rpm`, by shape (n,)."""
    rows = [dict(_fields("", message)) for message in messages]
    return {name: np.array([row.get(name, np.nan) for row in rows]) for name in rows[0]}


def _fields(prefix: str, value: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(value, str):
        return
    if isinstance(value, np.ndarray | list | tuple):
        for i, part in enumerate(value):
            yield from _fields(f"{prefix}[{i}]", part)
    elif hasattr(value, "__dataclass_fields__"):
        for name in value.__dataclass_fields__:
            if not name.startswith("_") and not name.isupper():
                yield from _fields(f"{prefix}.{name}" if prefix else name, getattr(value, name))
    else:
        yield prefix, value


# --- messages of ROS and of mavros ------------------------------------------------------------------------------------


def _channels(messages: dict[tuple[str, str], _Messages], notes: list[str]) -> Iterator[Channel]:
    odometry = _longest(messages, ODOMETRY, notes)
    pose = _longest(messages, POSE, notes) or _longest(messages, POSE_COV, notes)
    twist, imu = _longest(messages, TWIST, notes), _longest(messages, IMU_MESSAGE, notes)
    turned: tuple[Floats, Quaternion] | None = None
    if (source := odometry or pose) is not None:
        topic, content = source
        world, body = _frames(content[0][1])
        time_s, poses = _times(content), [getattr(m.pose, "pose", m.pose) for _, m in content]
        place = north_east_up(_xyz(poses, "position"), world)
        yield Channel(topic, time_s, dict(zip(POSITION, place, strict=True)))
        turned = time_s, attitude(_wxyz(poses), world, body)
        yield Channel(f"{topic} attitude", time_s, dict(zip(ATTITUDE, euler_deg(turned[1]), strict=True)))
    if odometry is not None and turned is not None:
        topic, content = odometry
        _, body = _frames(content[0][1])
        twists = [m.twist.twist for _, m in content]
        velocity = body_to_world(turned[1], forward_right_down(_xyz(twists, "linear"), body))
        yield Channel(f"{topic} velocity", turned[0], dict(zip(VELOCITY, velocity, strict=True)))
        if imu is None:
            rates = forward_right_down(_xyz(twists, "angular"), body)
            yield Channel(f"{topic} rates", turned[0], dict(zip(RATES, rates, strict=True)))
    elif twist is not None:
        topic, content = twist
        time_s, linear = _times(content), _xyz([m.twist for _, m in content], "linear")
        world, body = _frames(content[0][1])
        if "body" not in topic and "base_link" not in content[0][1].header.frame_id:
            yield Channel(topic, time_s, dict(zip(VELOCITY, north_east_up(linear, world), strict=True)))
        elif turned is not None:
            w, x, y, z = (held(time_s, turned[0], part) for part in turned[1])
            velocity = body_to_world((w, x, y, z), forward_right_down(linear, body))
            yield Channel(topic, time_s, dict(zip(VELOCITY, velocity, strict=True)))
    if imu is not None:
        yield from _imu(*imu, with_attitude=turned is None)
    yield from _others(messages, notes)


def _imu(topic: str, content: _Messages, with_attitude: bool) -> Iterator[Channel]:
    time_s, all_of = _times(content), [m for _, m in content]
    _, body = _frames(all_of[0])
    rates = forward_right_down(_xyz(all_of, "angular_velocity"), body)
    yield Channel(f"{topic} rates", time_s, dict(zip(RATES, rates, strict=True)))
    force = forward_right_down(_xyz(all_of, "linear_acceleration"), body)
    yield Channel(topic, time_s, dict(zip(IMU, force, strict=True)), makes_rows=False, averaged=True)
    if with_attitude and all_of[0].orientation_covariance[0] >= 0.0:  # -1: it holds no orientation
        angles = euler_deg(attitude(_wxyz(all_of), "ENU" if body == "FLU" else "NED", body))
        yield Channel(f"{topic} attitude", time_s, dict(zip(ATTITUDE, angles, strict=True)))


def _others(messages: dict[tuple[str, str], _Messages], notes: list[str]) -> Iterator[Channel]:
    if battery := _longest(messages, BATTERY, notes):
        topic, content = battery
        volts = np.array([m.voltage for _, m in content])
        yield Channel(topic, _times(content), {"battery_v": volts}, makes_rows=False)
    if outputs := _longest(messages, RC_OUT, notes):
        topic, content = outputs
        n = min(len(m.channels) for _, m in content)
        pulses = np.array([m.channels[:n] for _, m in content], dtype=np.float64)
        moves = np.ptp(pulses, axis=0) > 0.0
        n_motors = int(np.argmin(np.append(moves, False)))
        low, high = PULSE_US
        share = np.clip((pulses[:, :n_motors] - low) / (high - low), 0.0, 1.0)
        columns = dict(zip(motor_columns(n_motors, "output"), share.T, strict=True))
        notes.append(
            f"motor outputs are the pulses of {topic} as shares of {low:g} to {high:g} us, no curve is removed"
        )
        yield Channel(topic, _times(content), columns)
    target = next((item for (kind, _), item in messages.items() if kind == TARGET), None)
    if target is not None:
        yield Channel(TARGET, _times(target), {"throttle_cmd": np.array([m.thrust for _, m in target])})


def _longest(messages: dict[tuple[str, str], _Messages], kind: str, notes: list[str]) -> tuple[str, _Messages] | None:
    """The topic of this type with the most messages, of those that tell a measurement or an estimate."""
    found = [(topic, content) for (of, topic), content in messages.items() if of == kind]
    found = [(topic, content) for topic, content in found if not _NO_MEASUREMENT.search(topic.lower())]
    if not found:
        return None
    best = max(found, key=lambda item: len(item[1]))
    if len(found) > 1 and (note := f"of several topics of {kind} {best[0]} is read") not in notes:
        notes.append(note)
    return best


def _times(content: _Messages) -> Floats:
    """Time of the measurement; that of the recording where the header holds none."""
    stamps = [getattr(getattr(m, "header", None), "stamp", None) for _, m in content]
    if all(stamp is not None and stamp.sec > 0 for stamp in stamps):
        return np.array([stamp.sec + 1e-9 * stamp.nanosec for stamp in stamps if stamp is not None])
    return 1e-9 * np.array([time_ns for time_ns, _ in content], dtype=np.float64)


def _frames(message: Any) -> tuple[AttitudeWorld, Body]:
    frame, child = message.header.frame_id.lower(), getattr(message, "child_frame_id", "").lower()
    world: AttitudeWorld = "NED" if "ned" in frame else "ENU"
    return world, "FRD" if "frd" in f"{frame} {child}" else "FLU"


def _xyz(messages: list[Any], field: str) -> Vectors:
    vectors = [getattr(message, field) for message in messages]
    x, y, z = np.array([(v.x, v.y, v.z) for v in vectors], dtype=np.float64).T
    return x, y, z


def _wxyz(messages: list[Any]) -> Quaternion:
    turns = [message.orientation for message in messages]
    w, x, y, z = np.array([(q.w, q.x, q.y, q.z) for q in turns], dtype=np.float64).T
    return w, x, y, z
