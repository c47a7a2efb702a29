"""Tables of other programs: what a map says becomes the log's columns, a wrong map is named, and a map is proposed."""

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
import yaml
from typer.testing import CliRunner

from quadctl.cli import app
from quadctl.errors import LogError, QuadctlError, SettingsError
from quadctl.frames import multiply, quaternion_from_euler, rotate
from quadctl.logs.contradictions import contradictions
from quadctl.logs.flight_log import ATTITUDE, IMU, POSITION, RATES, VELOCITY, FlightLog, Floats
from quadctl.logs.map_guess import guess_map
from quadctl.logs.table_map import FROM_FRD, NORTH_EAST_DOWN, TableMap, load_map, read_mapped
from quadctl.settings import validate
from tests.support.flights import simulated


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> FlightLog:
    """Waves in all axes, so that every frame matters."""
    return simulated("excitation", [], 1, tmp_path_factory.mktemp("flown"))


def three(log: FlightLog, names: tuple[str, ...]) -> list[Floats]:
    return [log[name] for name in names]


def ros_table(log: FlightLog) -> dict[str, Floats]:
    """The flight as ROS would say it: ENU, FLU, x y z w, nanoseconds."""
    roll, pitch, yaw = (np.radians(angle) for angle in three(log, ATTITUDE))
    # The rotations between these frames are their own inverses.
    w, x, y, z = multiply(NORTH_EAST_DOWN["ENU"], multiply(quaternion_from_euler(roll, pitch, yaw), FROM_FRD["FLU"]))
    north, east, up = three(log, POSITION)
    vn, ve, vu = three(log, VELOCITY)
    p, q, r = three(log, RATES)
    table = {"timestamp": 1.7e18 + np.round(1e9 * log.time_s)}
    table |= {"pose.position.x": east, "pose.position.y": north, "pose.position.z": up}
    table |= {f"pose.orientation.{part}": value for part, value in zip("xyzw", (x, y, z, w), strict=True)}
    table |= {"twist.linear_velocity.x": ve, "twist.linear_velocity.y": vn, "twist.linear_velocity.z": vu}
    table |= {"imu.angular_velocity.x": p, "imu.angular_velocity.y": -q, "imu.angular_velocity.z": -r}
    return table | {f"rotor_{i}": log[f"motor{i + 1}_rpm"] for i in range(4)}


ROS: dict[str, Any] = {
    "time": {"column": "timestamp", "unit": "ns"},
    "position": {"columns": [f"pose.position.{a}" for a in "xyz"], "frame": "ENU"},
    "velocity": {"columns": [f"twist.linear_velocity.{a}" for a in "xyz"], "frame": "ENU"},
    "attitude": {
        "columns": [f"pose.orientation.{a}" for a in "xyzw"],
        "order": "xyzw",
        "world": "ENU",
        "body": "FLU",
    },
    "rates": {"columns": [f"imu.angular_velocity.{a}" for a in "xyz"], "frame": "FLU"},
    "motors": {"columns": [f"rotor_{i}" for i in range(4)], "unit": "rpm"},
}


def read(table: dict[str, Floats], said: dict[str, Any], where: Path, suffix: str = "csv") -> FlightLog:
    path = where / f"table.{suffix}"
    frame = pl.DataFrame(table)
    frame.write_parquet(path) if suffix == "parquet" else frame.write_csv(path)
    return read_mapped(path, validate(said, TableMap, "map.yaml"), "map.yaml")


def changed(group: str, **keys: Any) -> dict[str, Any]:
    return {**ROS, group: {**ROS[group], **keys}}


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_a_table_in_the_frames_of_ros_is_the_same_flight(flight: FlightLog, suffix: str, tmp_path: Path) -> None:
    log = read(ros_table(flight), ROS, tmp_path, suffix)
    for name in (*POSITION, *VELOCITY, *RATES, "roll_deg", "pitch_deg", "motor3_rpm"):
        assert log[name] == pytest.approx(flight[name], abs=1e-6), name
    assert np.cos(np.radians(log["yaw_deg"] - flight["yaw_deg"])) == pytest.approx(1.0)
    assert log.time_s == pytest.approx(flight.time_s - flight.time_s[0], abs=1e-6)
    assert contradictions(log) == []


def test_units_and_angles_are_turned_into_those_of_the_log(flight: FlightLog, tmp_path: Path) -> None:
    table = {"ms": 1000.0 * flight.time_s}
    table |= {f"p{a}": 100.0 * v for a, v in zip("ned", ned(flight, POSITION), strict=True)}
    table |= {f"v{a}": 3.6 * v for a, v in zip("ned", ned(flight, VELOCITY), strict=True)}
    table |= {name: flight[name] for name in (*ATTITUDE,)}
    table |= {f"w{a}": np.degrees(v) for a, v in zip("xyz", three(flight, RATES), strict=True)}
    table |= (
        {f"a{a}": v / 9.80665 for a, v in zip("xyz", three(flight, IMU), strict=True)} if flight.has(IMU[0]) else {}
    )
    table |= {f"m{i}": flight[f"motor{i}_rpm"] * np.pi / 30.0 for i in range(1, 5)}
    table |= {"mv": 1000.0 * flight["battery_v"], "thr": 100.0 * flight["throttle_cmd"]}
    said = {
        "time": {"column": "ms", "unit": "ms"},
        "position": {"columns": ["pn", "pe", "pd"], "frame": "NED", "unit": "cm"},
        "velocity": {"columns": ["vn", "ve", "vd"], "frame": "NED", "unit": "km/h"},
        "attitude": {
            "columns": list(ATTITUDE),
            "order": "roll pitch yaw",
            "unit": "deg",
            "world": "NED",
            "body": "FRD",
        },
        "rates": {"columns": ["wx", "wy", "wz"], "frame": "FRD", "unit": "deg/s"},
        "motors": {"columns": ["m1", "m2", "m3", "m4"], "unit": "rad/s"},
        "battery": {"column": "mv", "unit": "mV"},
        "throttle": {"column": "thr", "unit": "percent"},
    }
    log = read(table, said, tmp_path)
    for name in (*POSITION, *VELOCITY, *RATES, "roll_deg", "motor2_rpm", "battery_v", "throttle_cmd"):
        assert log[name] == pytest.approx(flight[name], abs=1e-6, nan_ok=True), name


def ned(log: FlightLog, names: tuple[str, ...]) -> list[Floats]:
    north, east, up = three(log, names)
    return [north, east, -up]


def test_a_velocity_of_the_body_is_turned_into_the_world(flight: FlightLog, tmp_path: Path) -> None:
    table = ros_table(flight)
    roll, pitch, yaw = (np.radians(angle) for angle in three(flight, ATTITUDE))
    w, x, y, z = quaternion_from_euler(roll, pitch, yaw)
    body = rotate((w, -x, -y, -z), tuple(ned(flight, VELOCITY)))
    table |= {f"u{a}": v for a, v in zip("xyz", body, strict=True)}
    log = read(table, {**ROS, "velocity": {"columns": ["ux", "uy", "uz"], "frame": "FRD"}}, tmp_path)
    for name in VELOCITY:
        assert log[name] == pytest.approx(flight[name], abs=1e-6)


def test_what_a_table_lacks_is_the_slope_of_what_it_has_and_said(flight: FlightLog, tmp_path: Path) -> None:
    said = {key: value for key, value in ROS.items() if key not in ("velocity", "rates")}
    log = read(ros_table(flight), said, tmp_path)
    for name in ("vx_m_s", "vz_m_s", "roll_rate_rad_s", "pitch_rate_rad_s"):
        assert np.corrcoef(log[name], flight[name])[0, 1] > 0.8, name
    assert sum("slope" in note for note in log.notes) == 2


@pytest.mark.parametrize(
    ("said", "word"),
    [
        (changed("velocity", frame="NED"), "vz_m_s says, expected once: does one of them point down"),
        (changed("position", unit="mm"), "x_m changes 0.000999 times as much as vx_m_s says"),
        (changed("time", unit="us"), "time_s"),
        (changed("attitude", order="wxyz"), "its quaternion in another order"),
        (changed("attitude", body="FRD"), "is the attitude in another frame"),
        (changed("rates", frame="FRD"), "rate"),
        (changed("rates", unit="deg/s"), "rate"),
    ],
    ids=["frame of velocity", "unit of position", "unit of time", "order", "body", "frame of rates", "unit of rates"],
)
def test_a_wrong_frame_unit_or_order_is_contradicted_by_the_values(
    said: dict[str, Any], word: str, flight: FlightLog, tmp_path: Path
) -> None:
    (found, *_) = contradictions(read(ros_table(flight), said, tmp_path))
    assert word in found


def refused(said: Any, where: Path, table: dict[str, Any]) -> str:
    with pytest.raises(QuadctlError) as problem:
        read(table, said, where)
    assert "\n" not in str(problem.value)
    return str(problem.value)


def test_a_map_that_cannot_be_used_is_one_sentence(flight: FlightLog, tmp_path: Path) -> None:
    table: dict[str, Any] = dict(ros_table(flight))
    missing = refused(changed("time", column="timestmap"), tmp_path, table)
    assert missing.startswith("map.yaml: time names the column 'timestmap', which ")
    assert "did you mean 'timestamp'" in missing
    assert "unit" in refused(changed("position", unit="inch"), tmp_path, table)
    assert "columns has 4 names, expected 3" in refused(changed("attitude", order="roll pitch yaw"), tmp_path, table)
    assert "NEU" in refused(changed("attitude", world="NEU"), tmp_path, table)
    empty = table | {"rotor_2": [None] * len(flight)}
    assert "column 'rotor_2' (motors) holds no number" in refused(ROS, tmp_path, empty)
    assert "attitude" in refused({key: ROS[key] for key in ("time", "position")}, tmp_path, table)


def test_a_file_that_is_no_table_is_one_sentence(tmp_path: Path) -> None:
    path = tmp_path / "no.parquet"
    path.write_bytes(b"PAR1 but not really")
    with pytest.raises(LogError, match="cannot be read as a table"):
        read_mapped(path, validate(ROS, TableMap, "map.yaml"), "map.yaml")


class TestGuess:
    def table(self, table: dict[str, Any], where: Path) -> Path:
        path = where / "table.csv"
        pl.DataFrame(table).write_csv(path)
        return path

    def test_a_table_of_ros_gets_the_right_map(self, flight: FlightLog, tmp_path: Path) -> None:
        path = self.table(ros_table(flight), tmp_path)
        guess = guess_map(path)
        assert not guess.doubts
        assert guess.map.attitude.order == "wxyz", "w is found by its name, wherever it stands"
        log = read_mapped(path, guess.map, "guess")
        for name in ("x_m", "vz_m_s", "roll_deg", "pitch_rate_rad_s", "motor4_rpm"):
            assert log[name] == pytest.approx(flight[name], abs=1e-6), name

    def test_short_names_in_ned_get_the_right_map(self, flight: FlightLog, tmp_path: Path) -> None:
        table = {"t": flight.time_s}
        table |= dict(zip("xyz", ned(flight, POSITION), strict=True))
        table |= {f"v{a}": v for a, v in zip("xyz", ned(flight, VELOCITY), strict=True)}
        table |= {a: np.radians(flight[f"{a}_deg"]) for a in ("roll", "pitch", "yaw")}
        table |= dict(zip("pqr", three(flight, RATES), strict=True))
        table |= {"z_ref": -flight["z_ref_m"], "x_ref": flight["x_ref_m"], "y_ref": flight["y_ref_m"]}
        log = read_mapped(self.table(table, tmp_path), guess_map(self.table(table, tmp_path)).map, "guess")
        for name in (*POSITION, *VELOCITY, "roll_deg", "yaw_rate_rad_s"):
            assert log[name] == pytest.approx(flight[name], abs=1e-6), name

    @pytest.mark.parametrize(("drop", "said"), [("timestamp", "like a time"), ("pose.orientation", "an attitude")])
    def test_what_is_not_found_by_its_name_is_said(
        self, drop: str, said: str, flight: FlightLog, tmp_path: Path
    ) -> None:
        table = {name: values for name, values in ros_table(flight).items() if not name.startswith(drop)}
        with pytest.raises(LogError, match=said):
            guess_map(self.table(table, tmp_path))


class TestCommand:
    def test_the_proposed_map_is_read_back_and_written_as_a_log(self, flight: FlightLog, tmp_path: Path) -> None:
        path, layout = tmp_path / "theirs.csv", tmp_path / "map.yaml"
        pl.DataFrame(ros_table(flight)).write_csv(path)
        guessed = CliRunner().invoke(app, ["logs", str(path), "--guess"])
        assert guessed.exit_code == 0, guessed.output
        layout.write_text(guessed.output)
        assert load_map(layout) == guess_map(path).map
        out = tmp_path / "out"
        words = ["logs", str(path), "--map", str(layout), "--to", "csv", "-o", str(out)]
        shown = CliRunner().invoke(app, words)
        assert shown.exit_code == 0, (shown.output, shown.exception)
        assert (out / "theirs.csv").read_text().startswith("time_s,x_m,y_m,z_m,")

    def test_a_wrong_map_is_contradicted_on_the_terminal(self, flight: FlightLog, tmp_path: Path) -> None:
        path, layout = tmp_path / "theirs.csv", tmp_path / "map.yaml"
        pl.DataFrame(ros_table(flight)).write_csv(path)
        layout.write_text(yaml.safe_dump(changed("velocity", frame="NED")))
        shown = CliRunner().invoke(app, ["logs", str(path), "--map", str(layout)])
        said_so = " ".join(shown.output.split())
        assert "Cannot be analysed: - z_m changes" in said_so

    def test_a_map_that_is_not_there_is_one_sentence(self, tmp_path: Path) -> None:
        with pytest.raises(SettingsError, match=r"map\.yaml"):
            load_map(tmp_path / "map.yaml")
