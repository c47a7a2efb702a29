"""Bags of ROS: the same flight as the ULog or the CSV that they were written from, and bad bags in a sentence."""

import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from quadctl.errors import LogError
from quadctl.frames import multiply, quaternion_from_euler, rotate
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.selection.diagnosis import diagnose
from quadctl.logs.flight_log import ATTITUDE, IMU, POSITION, RATES, VELOCITY, FlightLog
from quadctl.logs.read import read_log
from quadctl.logs.rosbag import px4_topic, read_rosbag
from quadctl.logs.ulog import MAGIC
from quadctl.model import Model
from quadctl.settings import validate
from quadctl.vehicle import Vehicle
from tests.support.flights import simulated
from tests.support.places import ROOT

ULOG = ROOT.parent / "shared" / "data" / "real" / "px4" / "forward_runs.ulg"
ENU_TO_NED = (0.0, 0.5**0.5, 0.5**0.5, 0.0)
FRD_TO_FLU = (0.0, 1.0, 0.0, 0.0)
"""Each is its own inverse."""
PX4_FIELDS = {
    "vehicle_local_position": ("x", "y", "z", "vx", "vy", "vz", "ax", "ay", "az"),
    "vehicle_attitude": ("q[4]",),
    "vehicle_angular_velocity": ("xyz[3]",),
    "actuator_motors": ("control[12]",),
}
FLAGS = ("xy_valid", "z_valid", "v_xy_valid", "v_z_valid")


def px4_bag(ulog: Path, bag: Path, storage: StoragePlugin) -> None:
    """The topics of a ULog as PX4's bridge would publish them."""
    from pyulog import ULog

    store = get_typestore(Stores.LATEST)
    with Writer(bag, version=9, storage_plugin=storage) as writer:
        for data in ULog(str(ulog), list(PX4_FIELDS)).data_list:
            if data.multi_id:
                continue
            kind = "px4_msgs/msg/" + "".join(word.capitalize() for word in data.name.split("_"))
            fields = [name for name in PX4_FIELDS[data.name] if name in data.data or f"{name[:-3]}[0]" in data.data]
            fields += [name for name in PX4_FIELDS[data.name] if "[12]" in name]
            lines = ["uint64 timestamp", "uint64 timestamp_sample"]
            for name in dict.fromkeys(fields):
                stem, _, size = name.partition("[")
                lines.append(f"float32[{size} {stem}" if size else f"float32 {stem}")
            flags = [flag for flag in FLAGS if flag in data.data]
            lines += [f"bool {flag}" for flag in flags]
            store.register(get_types_from_msg("\n".join(lines), kind))
            made = store.types[kind]
            connection = writer.add_connection(f"/fmu/out/{data.name}", kind, typestore=store)
            for i, stamp in enumerate(data.data["timestamp"]):
                values: dict[str, Any] = {"timestamp": int(stamp)}
                values["timestamp_sample"] = int(data.data.get("timestamp_sample", data.data["timestamp"])[i])
                for name in dict.fromkeys(fields):
                    stem, _, size = name.partition("[")
                    if size:
                        parts = [data.data[f"{stem}[{j}]"][i] for j in range(int(size[:-1]))]
                        values[stem] = np.array(parts, dtype=np.float32)
                    else:
                        values[stem] = float(data.data[stem][i])
                values |= {flag: bool(data.data[flag][i]) for flag in flags}
                writer.write(connection, 1000 * int(stamp), store.serialize_cdr(made(**values), kind))


@pytest.mark.skipif(not ULOG.is_file(), reason="the recordings of real autopilots are not here")
def test_a_bag_of_px4_is_the_same_flight_as_its_ulog(tmp_path: Path) -> None:
    px4_bag(ULOG, tmp_path / "bag", StoragePlugin.MCAP)
    ulog, bag = read_log(ULOG), read_log(tmp_path / "bag")
    for name in (*POSITION, *VELOCITY, *ATTITUDE, *RATES, "motor1_output", "motor4_output"):
        at_rows = np.interp(ulog.time_s, bag.time_s + bag.meta["time_zero_s"] - ulog.meta["time_zero_s"], bag[name])
        known = np.isfinite(ulog[name]) & np.isfinite(at_rows)
        assert known.mean() > 0.9, name
        assert np.median(np.abs(at_rows[known] - ulog[name][known])) < 1e-3, name


@pytest.mark.long
@pytest.mark.skipif(not ULOG.is_file(), reason="the recordings of real autopilots are not here")
def test_a_bag_of_px4_its_ulog_and_our_csv_have_one_verdict(tmp_path: Path) -> None:
    px4_bag(ULOG, tmp_path / "bag", StoragePlugin.SQLITE3)
    csv = ULOG.with_suffix(".csv")
    vehicle = validate(read_log(csv).meta["vehicle"], Vehicle, str(csv))
    for path in (ULOG, tmp_path / "bag", csv):
        assert diagnose(Model(vehicle), load_dataset([read_log(path)], vehicle)).missing == ["rotor_drag"], path


def standard_bag(
    log: FlightLog, bag: Path, leave_out: str = "", storage: StoragePlugin = StoragePlugin.SQLITE3
) -> None:
    """The flight as MAVROS would publish it: odometry, IMU, battery, rotor speeds."""
    store = get_typestore(Stores.LATEST)
    esc = "std_msgs/Header header\nmavros_msgs/ESCStatusItem[] esc_status"
    item = "std_msgs/Header header\nint32 rpm\nfloat32 voltage\nfloat32 current"
    store.register(get_types_from_msg(item, "mavros_msgs/msg/ESCStatusItem"))
    store.register(get_types_from_msg(esc, "mavros_msgs/msg/ESCStatus"))
    with Writer(bag, version=9, storage_plugin=storage) as writer:
        for stamp_ns, topic, message in messages(log, store.types):
            if message.__msgtype__ == leave_out:
                continue
            known = [c for c in writer.connections if c.topic == topic]
            connection = known[0] if known else writer.add_connection(topic, message.__msgtype__, typestore=store)
            writer.write(connection, stamp_ns, store.serialize_cdr(message, message.__msgtype__))


def messages(log: FlightLog, types: Mapping[str, Any]) -> Iterator[tuple[int, str, Any]]:
    point, quaternion = types["geometry_msgs/msg/Point"], types["geometry_msgs/msg/Quaternion"]
    vector, none9, none36 = types["geometry_msgs/msg/Vector3"], np.zeros(9), np.zeros(36)
    for i in range(len(log)):
        stamp_ns = 1_700_000_000_000_000_000 + round(1e9 * log.time_s[i])
        stamp = types["builtin_interfaces/msg/Time"](sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
        header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="map")
        north, east, up = (float(log[name][i]) for name in POSITION)
        turn = quaternion_from_euler(*(float(np.radians(log[name][i])) for name in ATTITUDE))
        w, x, y, z = multiply(ENU_TO_NED, multiply(turn, FRD_TO_FLU))
        vn, ve, vu = (float(log[name][i]) for name in VELOCITY)
        forward, right, down = rotate((turn[0], -turn[1], -turn[2], -turn[3]), (vn, ve, -vu))
        p, q, r = (float(log[name][i]) for name in RATES)
        pose = types["geometry_msgs/msg/Pose"](position=point(east, north, up), orientation=quaternion(x, y, z, w))
        twist = types["geometry_msgs/msg/Twist"](linear=vector(forward, -right, -down), angular=vector(p, -q, -r))
        yield (
            stamp_ns,
            "/mavros/local_position/odom",
            types["nav_msgs/msg/Odometry"](
                header=header,
                child_frame_id="base_link",
                pose=types["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=none36),
                twist=types["geometry_msgs/msg/TwistWithCovariance"](twist=twist, covariance=none36),
            ),
        )
        ax, ay, az = (float(log[name][i]) for name in IMU) if log.has(IMU[0]) else (0.0, 0.0, -9.81)
        imu = types["sensor_msgs/msg/Imu"](
            header=header,
            orientation=quaternion(x, y, z, w),
            orientation_covariance=none9,
            angular_velocity=vector(p, -q, -r),
            angular_velocity_covariance=none9,
            linear_acceleration=vector(ax, -ay, -az),
            linear_acceleration_covariance=none9,
        )
        yield stamp_ns, "/mavros/imu/data", imu
        items = [
            types["mavros_msgs/msg/ESCStatusItem"](
                header=header, rpm=round(float(log[f"motor{j}_rpm"][i])), voltage=0.0, current=0.0
            )
            for j in range(1, 5)
        ]
        yield stamp_ns, "/mavros/esc_status", types["mavros_msgs/msg/ESCStatus"](header=header, esc_status=items)
        pascal = 101325.0 * (1.0 - 0.0065 * (100.0 + up) / 288.15) ** (9.80665 / (0.0065 * 287.053))
        pressure, laser = types["sensor_msgs/msg/FluidPressure"], types["sensor_msgs/msg/Range"]
        yield stamp_ns, "/mavros/imu/diff_pressure", pressure(header=header, fluid_pressure=12.0, variance=0.0)
        yield stamp_ns, "/mavros/imu/static_pressure", pressure(header=header, fluid_pressure=pascal, variance=0.0)
        seen = {"radiation_type": 1, "field_of_view": 0.1, "min_range": 0.1, "max_range": 8.0, "variance": 0.0}
        fields = {name: value for name, value in seen.items() if name in laser.__dataclass_fields__}
        yield stamp_ns, "/mavros/rangefinder/rangefinder", laser(header=header, range=up, **fields)


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> FlightLog:
    return simulated("short_hop", [], 1, tmp_path_factory.mktemp("flown"))


@pytest.mark.parametrize("storage", [StoragePlugin.SQLITE3, StoragePlugin.MCAP])
def test_standard_messages_in_enu_and_flu_are_the_same_flight(
    storage: StoragePlugin, flight: FlightLog, tmp_path: Path
) -> None:
    standard_bag(flight, tmp_path / "bag", storage=storage)
    log = read_log(tmp_path / "bag")
    assert len(log) == len(flight)
    for name in (*POSITION, *VELOCITY, *RATES, "roll_deg", "pitch_deg"):
        assert log[name] == pytest.approx(flight[name], abs=1e-6), name
    assert np.cos(np.radians(log["yaw_deg"] - flight["yaw_deg"])) == pytest.approx(1.0)
    assert log["motor2_rpm"] == pytest.approx(flight["motor2_rpm"], abs=0.51)
    assert log["imu_z_m_s2"] == pytest.approx(np.full(len(log), -9.81))
    assert log["baro_m"] == pytest.approx(100.0 + flight["z_m"], abs=0.01)
    far = flight["z_m"] > 0.1
    assert log["range_m"][far] == pytest.approx(flight["z_m"][far], abs=1e-6)
    assert np.isnan(log["range_m"][flight["z_m"] < 0.1]).all()


@pytest.mark.parametrize(("storage", "suffix"), [(StoragePlugin.MCAP, "mcap"), (StoragePlugin.SQLITE3, "db3")])
def test_a_storage_file_alone_is_read_too(
    storage: StoragePlugin, suffix: str, flight: FlightLog, tmp_path: Path
) -> None:
    standard_bag(flight, tmp_path / "bag", storage=storage)
    (inside,) = (tmp_path / "bag").glob(f"*.{suffix}")
    shutil.copy(inside, tmp_path / f"alone.{suffix}")
    assert len(read_log(tmp_path / f"alone.{suffix}")) == len(flight)


class TestBadBags:
    def test_one_without_attitude_is_one_sentence(self, flight: FlightLog, tmp_path: Path) -> None:
        standard_bag(flight, tmp_path / "bag", leave_out="nav_msgs/msg/Odometry")
        with pytest.raises(LogError, match=r"holds no values of .*roll_deg.*, expected messages nav_msgs/Odometry"):
            read_log(tmp_path / "bag")

    def test_one_without_motion_is_one_sentence(self, tmp_path: Path) -> None:
        store = get_typestore(Stores.LATEST)
        with Writer(tmp_path / "bag", version=9) as writer:
            text = store.types["std_msgs/msg/String"]
            connection = writer.add_connection("/chatter", "std_msgs/msg/String", typestore=store)
            writer.write(connection, 1, store.serialize_cdr(text("hello"), "std_msgs/msg/String"))
        with pytest.raises(LogError, match="holds no messages that say how a vehicle moves"):
            read_log(tmp_path / "bag")

    def test_a_damaged_one_is_one_sentence(self, flight: FlightLog, tmp_path: Path) -> None:
        standard_bag(flight, tmp_path / "bag", storage=StoragePlugin.MCAP)
        (inside,) = (tmp_path / "bag").glob("*.mcap")
        inside.write_bytes(inside.read_bytes()[:300])
        with pytest.raises(LogError, match="cannot be read as a ROS bag") as problem:
            read_log(inside)
        assert "\n" not in str(problem.value)

    def test_a_file_of_another_format_is_not_taken_for_one(self, tmp_path: Path) -> None:
        path = tmp_path / "x.mcap"
        path.write_bytes(MAGIC)
        with pytest.raises(LogError):
            read_rosbag(path)


def test_types_of_px4_are_the_topics_of_its_ulog() -> None:
    assert px4_topic("px4_msgs/msg/VehicleLocalPosition") == "vehicle_local_position"
    assert px4_topic("px4_msgs/msg/EscStatus") == "esc_status"
    assert px4_topic("nav_msgs/msg/Odometry") == ""
