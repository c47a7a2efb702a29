"""Bags of ROS 2: the same flight as from PX4's own log, and the same verdict."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pyulog import ULog
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from quadctl.errors import LogError
from quadctl.frames import rotate_inverse
from quadctl.lab.interface import diagnose
from quadctl.logs.csv_log import write_csv
from quadctl.logs.flight_log import ATTITUDE, IMU, POSITION, RATES, VELOCITY, FlightLog
from quadctl.logs.read import read_log
from quadctl.logs.ulog import TOPICS
from quadctl.model import load_model
from tests.logs.test_table_map import flight, foreign
from tests.support.log_files import PX4, needs_px4
from tests.support.places import DATA

REAL = DATA / "real" / "px4"
KINDS = {"bool": "bool", "float": "float32", "double": "float64"} | {
    f"{sign}int{n}_t": f"{sign}int{n}" for sign in ("", "u") for n in (8, 16, 32, 64)
}
Storage = pytest.mark.parametrize("storage", [StoragePlugin.SQLITE3, StoragePlugin.MCAP])


def bag_of_ulog(ulog: Path, bag: Path, storage: StoragePlugin, without: Iterable[str] = ()) -> None:
    """The topics of PX4's log as its bridge to ROS 2 publishes them."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    with Writer(bag, version=9, storage_plugin=storage) as writer:
        for data in ULog(str(ulog)).data_list:
            if data.name not in TOPICS or data.name in without or data.multi_id:
                continue
            arrays: dict[str, int] = {}
            kinds: dict[str, str] = {}
            for field in data.field_data:
                name, bracket, index = field.field_name.partition("[")
                kinds[name] = KINDS[field.type_str]
                if bracket:
                    arrays[name] = int(index.rstrip("]")) + 1
            text = "\n".join(f"{kind}{f'[{arrays[n]}]' if n in arrays else ''} {n}" for n, kind in kinds.items())
            camel = "".join(part.title() for part in data.name.split("_"))
            kind = f"px4_msgs/msg/{camel}"
            store.register(get_types_from_msg(text, kind))
            connection = writer.add_connection(f"/fmu/out/{data.name}", kind, typestore=store)
            columns = {
                name: np.column_stack([data.data[f"{name}[{i}]"] for i in range(arrays[name])])
                if name in arrays
                else data.data[name].tolist()
                for name in kinds
            }
            for i, us in enumerate(data.data["timestamp"].tolist()):
                cells = {name: column[i] for name, column in columns.items()}
                cells = {n: bool(v) if kinds[n] == "bool" and n not in arrays else v for n, v in cells.items()}
                writer.write(connection, 1000 * us, store.serialize_cdr(store.types[kind](**cells), kind))


def bag_of_ros(log: FlightLog, bag: Path, storage: StoragePlugin, odometry: bool = True, attitude: bool = True) -> None:
    """The flight as mavros, or a program with odometry, publishes it."""
    store = get_typestore(Stores.LATEST)
    types: Any = store.types
    stamp_of, header_of = types["builtin_interfaces/msg/Time"], types["std_msgs/msg/Header"]
    vector, point = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Point"]
    turn, twist_of = types["geometry_msgs/msg/Quaternion"], types["geometry_msgs/msg/Twist"]
    pose_of = types["geometry_msgs/msg/Pose"]
    table = foreign(log).to_dict(as_series=False)
    with Writer(bag, version=9, storage_plugin=storage) as writer:
        imu_kind, twist_kind = "sensor_msgs/msg/Imu", "geometry_msgs/msg/TwistStamped"
        kind = "nav_msgs/msg/Odometry" if odometry else "geometry_msgs/msg/PoseStamped"
        names = {kind: "/odom" if odometry else "/mavros/local_position/pose", imu_kind: "/mavros/imu/data"}
        names |= {} if odometry else {twist_kind: "/mavros/local_position/velocity_local"}
        if not attitude:
            names = {imu_kind: names[imu_kind]}
        connections = {k: writer.add_connection(name, k, typestore=store) for k, name in names.items()}

        def write(time_ns: int, of: str, message: Any) -> None:
            if of in connections:
                writer.write(connections[of], time_ns, store.serialize_cdr(message, of))

        for i, ns in enumerate(table["timestamp"]):
            cell = {name: float(values[i]) for name, values in table.items()}
            header = header_of(stamp=stamp_of(sec=ns // 10**9, nanosec=ns % 10**9), frame_id="map")
            xyz = {stem: [cell[f"{stem} {axis}"] for axis in "xyz"] for stem in ("pos", "vel", "gyro", "acc", "q")}
            pose = pose_of(position=point(*xyz["pos"]), orientation=turn(*xyz["q"], w=cell["q w"]))
            angular = vector(*xyz["gyro"])
            if odometry:
                u, v, w = rotate_inverse((cell["q w"], *xyz["q"]), tuple(xyz["vel"]))
                message = types[kind](
                    header=header,
                    child_frame_id="base_link",
                    pose=types["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=np.zeros(36)),
                    twist=types["geometry_msgs/msg/TwistWithCovariance"](
                        twist=twist_of(linear=vector(float(u), float(v), float(w)), angular=angular),
                        covariance=np.zeros(36),
                    ),
                )
            else:
                message = types[kind](header=header, pose=pose)
                moving = twist_of(linear=vector(*xyz["vel"]), angular=angular)
                write(ns, twist_kind, types[twist_kind](header=header, twist=moving))
            write(ns, kind, message)
            unknown = np.full(9, -1.0)
            imu = types[imu_kind](
                header=header,
                orientation=turn(0.0, 0.0, 0.0, 1.0),
                orientation_covariance=unknown,
                angular_velocity=angular,
                angular_velocity_covariance=unknown,
                linear_acceleration=vector(*xyz["acc"]),
                linear_acceleration_covariance=unknown,
            )
            write(ns, imu_kind, imu)


class TestRos:
    @Storage
    @pytest.mark.parametrize("odometry", [True, False])
    def test_frames_and_units(self, storage: StoragePlugin, odometry: bool, tmp_path: Path) -> None:
        own = flight(10.0)
        bag_of_ros(own, tmp_path / "bag", storage, odometry)
        log = read_log(tmp_path / "bag")
        for name in (*POSITION, *VELOCITY, *ATTITUDE, *RATES, *IMU):
            assert np.interp(own.time_s, log.time_s, log[name])[5:-5] == pytest.approx(own[name][5:-5], abs=2e-3), name

    @Storage
    def test_a_bag_without_attitude_gets_its_sentence(self, storage: StoragePlugin, tmp_path: Path) -> None:
        bag_of_ros(flight(2.0), tmp_path / "bag", storage, attitude=False)
        with pytest.raises(
            LogError, match=r"bag\.\w+: holds no values of x_m, .* roll_deg, .*expected messages nav_msgs"
        ):
            read_log(tmp_path / "bag")


@needs_px4
class TestPx4:
    @Storage
    def test_a_bag_of_px4_msgs_is_px4s_own_log(self, storage: StoragePlugin, tmp_path: Path) -> None:
        bag_of_ulog(PX4 / "B_forward.ulg", tmp_path / "bag", storage)
        own, log = read_log(PX4 / "B_forward.ulg"), read_log(tmp_path / "bag")
        assert log.columns.keys() == own.columns.keys()
        for name, values in own.columns.items():
            np.testing.assert_array_equal(log[name], values, err_msg=name)

    def test_without_attitude(self, tmp_path: Path) -> None:
        bag_of_ulog(PX4 / "B_forward.ulg", tmp_path / "bag", StoragePlugin.MCAP, without=["vehicle_attitude"])
        with pytest.raises(LogError, match="holds no values of roll_deg, pitch_deg, yaw_deg, expected"):
            read_log(tmp_path / "bag")


@pytest.mark.skipif(not REAL.is_dir(), reason="the logs of real PX4 are not here")
def test_ulog_bag_and_csv_of_one_flight_have_one_verdict(tmp_path: Path) -> None:
    ulog = REAL / "forward_runs.ulg"
    bag_of_ulog(ulog, tmp_path / "bag", StoragePlugin.MCAP)
    write_csv(read_log(ulog), tmp_path / "flight.csv")
    model = load_model(REAL / "vehicle.yaml")
    tried = ["thrust_scale", "rotor_drag"]
    found = [diagnose(model, path, tried) for path in (ulog, tmp_path / "bag", tmp_path / "flight.csv")]
    assert found[0].missing == found[1].missing == found[2].missing == ["rotor_drag"]
    assert found[0].verdict == found[1].verdict == found[2].verdict
