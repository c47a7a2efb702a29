"""A table of another program, read by a map: the same flight, whatever the frames, units and clocks of the table."""

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
import yaml

from quadctl.errors import LogError, SettingsError
from quadctl.frames import quaternion_from_euler, rotate_inverse
from quadctl.logs.consistency import complaints
from quadctl.logs.convert import write_parquet
from quadctl.logs.flight_log import ATTITUDE, IMU, POSITION, RATES, VELOCITY, FlightLog, Floats
from quadctl.logs.map_guess import as_yaml, better_reading, proposed
from quadctl.logs.read import read_log
from quadctl.logs.table import read_by_map
from tests.support.commands import Result
from tests.support.log_files import G
from tests.support.places import ROOT

MAPS = ROOT / "config" / "maps"
MAP: dict[str, Any] = {
    "time": {"column": "timestamp", "unit": "ns"},
    "position": {"columns": ["pos x", "pos y", "pos z"], "frame": "ENU"},
    "velocity": {"columns": ["vel x", "vel y", "vel z"], "frame": "ENU"},
    "attitude": {"columns": ["q x", "q y", "q z", "q w"], "order": "xyzw", "body": "FLU", "world": "ENU"},
    "rates": {"columns": ["gyro x", "gyro y", "gyro z"], "frame": "FLU", "unit": "rad/s"},
    "imu": {"columns": ["acc x", "acc y", "acc z"], "frame": "FLU"},
    "motors": {"columns": ["mot 1", "mot 2", "mot 3", "mot 4"], "unit": "rad/s"},
    "battery": {"column": "vbat"},
}


def flight(duration_s: float = 30.0) -> FlightLog:
    """A flight in circles with changing heading, in our own frames: it leans where it accelerates to."""
    t = np.arange(0.0, duration_s, 0.01)
    north, east, up = 4.0 * np.sin(0.9 * t), 3.0 * np.sin(1.3 * t), 5.0 + np.sin(0.5 * t)
    v_north, v_east, v_up = 3.6 * np.cos(0.9 * t), 3.9 * np.cos(1.3 * t), 0.5 * np.cos(0.5 * t)
    a_north, a_east, a_up = -3.24 * np.sin(0.9 * t), -5.07 * np.sin(1.3 * t), -0.25 * np.sin(0.5 * t)
    yaw = 0.3 + 0.8 * np.sin(0.4 * t)
    forward, right = a_north * np.cos(yaw) + a_east * np.sin(yaw), a_east * np.cos(yaw) - a_north * np.sin(yaw)
    pitch = np.arctan2(-forward, G + a_up)
    roll = np.arctan2(right * np.cos(pitch), G + a_up)
    d_roll, d_pitch, d_yaw = (np.gradient(angle, t) for angle in (roll, pitch, yaw))
    rates = (
        d_roll - d_yaw * np.sin(pitch),
        d_pitch * np.cos(roll) + d_yaw * np.sin(roll) * np.cos(pitch),
        d_yaw * np.cos(roll) * np.cos(pitch) - d_pitch * np.sin(roll),
    )
    force = rotate_inverse(quaternion_from_euler(roll, pitch, yaw), (a_north, a_east, -a_up - G))
    columns = {"time_s": t}
    for names, values in (
        (POSITION, (north, east, up)),
        (VELOCITY, (v_north, v_east, v_up)),
        (ATTITUDE, np.degrees([roll, pitch, yaw])),
        (RATES, rates),
        (IMU, force),
    ):
        columns |= dict(zip(names, values, strict=True))
    columns |= {f"motor{i}_rpm": np.full(len(t), 5000.0 + 10 * i) + np.sin(t) for i in range(1, 5)}
    columns["battery_v"] = 16.0 - 0.01 * t
    return FlightLog("own.csv", None, columns)


def foreign(log: FlightLog) -> pl.DataFrame:
    """The flight as a program of ROS writes it: ENU, FLU, nanoseconds since 1970."""
    roll, pitch, yaw = (np.radians(log[name]) for name in ATTITUDE)
    w, x, y, z = quaternion_from_euler(roll, -pitch, 0.5 * math.pi - yaw)
    north, east, up = (log[name] for name in POSITION)
    v_north, v_east, v_up = (log[name] for name in VELOCITY)
    (p, q, r), (a, b, c) = ([log[name] for name in names] for names in (RATES, IMU))
    cells: dict[str, Any] = {"timestamp": (1_700_000_000_000_000_000 + np.rint(1e9 * log.time_s).astype(np.int64))}
    for stem, values in (
        ("pos", (east, north, up)),
        ("vel", (v_east, v_north, v_up)),
        ("gyro", (p, -q, -r)),
        ("acc", (a, -b, -c)),
    ):
        cells |= {f"{stem} {axis}": value for axis, value in zip("xyz", values, strict=True)}
    cells |= {"q x": x, "q y": y, "q z": z, "q w": w}
    cells |= {f"mot {i}": log[f"motor{i}_rpm"] * 2.0 * math.pi / 60.0 for i in range(1, 5)}
    return pl.DataFrame(cells | {"vbat": log["battery_v"]})


def rotation_matrix(w: Floats, x: Floats, y: Floats, z: Floats) -> Floats:
    """Rows and columns of the rotation that a unit quaternion is, shape (3, 3, n)."""
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def neurobem(log: FlightLog) -> pl.DataFrame:
    """The flight in the columns of the NeuroBEM data set: velocity in the body, acceleration with gravity."""
    table = foreign(log)
    quaternion = [table[f"q {part}"].to_numpy() for part in "wxyz"]
    of_world = tuple(table[f"vel {axis}"].to_numpy() for axis in "xyz")
    cells: dict[str, Any] = {"t": log.time_s}
    cells |= {f"ang acc {axis}": np.zeros(len(log)) for axis in "xyz"}
    cells |= {f"ang vel {axis}": table[f"gyro {axis}"] for axis in "xyz"}
    cells |= {f"quat {part}": table[f"q {part}"] for part in "xyzw"}
    cells |= {f"acc {axis}": table[f"acc {axis}"] for axis in "xyz"}
    cells |= {f"vel {axis}": v for axis, v in zip("xyz", rotate_inverse(tuple(quaternion), of_world), strict=True)}
    cells |= {f"pos {axis}": table[f"pos {axis}"] for axis in "xyz"}
    cells |= {f"mot {i}": table[f"mot {i}"] for i in range(1, 5)}
    cells |= {f"dmot {i}": np.zeros(len(log)) for i in range(1, 5)}
    return pl.DataFrame(cells | {"vbat": table["vbat"]})


def tii_ratm(log: FlightLog) -> pl.DataFrame:
    """The flight in the columns of TII's data set of drone races that describe the vehicle: attitude as a matrix."""
    table = foreign(log)
    turn = rotation_matrix(*(table[f"q {part}"].to_numpy() for part in "wxyz"))
    cells: dict[str, Any] = {"elapsed_time": log.time_s, "timestamp": table["timestamp"] // 1000}
    cells["img_filename"] = [f"{i:05d}.jpg" for i in range(len(log))]
    cells |= {f"accel_{axis}": table[f"acc {axis}"] for axis in "xyz"}
    cells |= {f"gyro_{axis}": table[f"gyro {axis}"] for axis in "xyz"}
    cells |= {f"thrust[{i}]": (log[f"motor{i + 1}_rpm"] / 10_000.0) ** 2 for i in range(4)}
    cells |= {"vbat": table["vbat"]}
    cells |= {f"drone_{axis}": table[f"pos {axis}"] for axis in "xyz"}
    cells |= {f"drone_velocity_linear_{axis}": table[f"vel {axis}"] for axis in "xyz"}
    cells |= {f"drone_rot[{i}]": turn[i % 3, i // 3] for i in range(9)}
    return pl.DataFrame(cells)


LAYOUTS = {"neurobem": neurobem, "tii_ratm": tii_ratm}
"""A flight in the columns of each public data set whose map ships with quadctl."""


@pytest.fixture(scope="module")
def own() -> FlightLog:
    return flight()


@pytest.fixture
def table(own: FlightLog, tmp_path: Path) -> Path:
    path = tmp_path / "foreign.csv"
    foreign(own).write_csv(path)
    return path


def written(directory: Path, change: dict[str, Any] | None = None, name: str = "a.map.yaml") -> Path:
    path = directory / name
    path.write_text(yaml.safe_dump(MAP | (change or {})))
    return path


def assert_same_flight(log: FlightLog, own: FlightLog) -> None:
    for name in (*POSITION, *VELOCITY, *ATTITUDE, *RATES, *IMU, "motor3_rpm", "battery_v"):
        assert np.interp(own.time_s, log.time_s, log[name])[5:-5] == pytest.approx(own[name][5:-5], abs=2e-3), name


class TestRead:
    def test_frames_units_and_clock(self, own: FlightLog, table: Path, tmp_path: Path) -> None:
        log = read_by_map(table, written(tmp_path))
        assert_same_flight(log, own)
        assert complaints(log) == []

    def test_a_map_beside_the_table_serves_every_command(self, own: FlightLog, table: Path, tmp_path: Path) -> None:
        written(tmp_path, name="foreign.map.yaml")
        assert_same_flight(read_log(table), own)

    def test_parquet_and_other_separators(self, own: FlightLog, tmp_path: Path) -> None:
        by = written(tmp_path)
        foreign(own).write_parquet(tmp_path / "a.parquet")
        foreign(own).write_csv(tmp_path / "a.txt", separator=";")
        assert_same_flight(read_by_map(tmp_path / "a.parquet", by), own)
        assert_same_flight(read_by_map(tmp_path / "a.txt", by), own)

    def test_blanks_between_columns_and_a_sign_before_the_header(self, own: FlightLog, tmp_path: Path) -> None:
        """As trajectories of mocap and SLAM are written."""
        rows = foreign(own).rename(lambda name: name.replace(" ", "_")).write_csv(separator=" ")
        (tmp_path / "a.txt").write_text("# " + rows.replace("\n", " \n"))
        names = yaml.safe_dump(MAP)
        for column in foreign(own).columns:
            names = names.replace(column, column.replace(" ", "_"))
        (tmp_path / "a.yaml").write_text(names)
        assert_same_flight(read_by_map(tmp_path / "a.txt", tmp_path / "a.yaml"), own)

    def test_own_parquet_needs_no_map(self, own: FlightLog, tmp_path: Path) -> None:
        write_parquet(own, tmp_path / "own.parquet")
        assert_same_flight(read_log(tmp_path / "own.parquet"), own)

    def test_velocity_in_the_body(self, own: FlightLog, tmp_path: Path) -> None:
        q = quaternion_from_euler(*(np.radians(own[name]) for name in ATTITUDE))
        u, v, w = rotate_inverse(q, (own["vx_m_s"], own["vy_m_s"], -own["vz_m_s"]))
        cells = {"vel x": u, "vel y": -v, "vel z": -w}
        foreign(own).with_columns(**cells).write_csv(tmp_path / "a.csv")
        by = written(tmp_path, {"velocity": {"columns": list(cells), "frame": "FLU"}})
        assert_same_flight(read_by_map(tmp_path / "a.csv", by), own)

    def test_channels_of_their_own_clocks_and_rates(self, own: FlightLog, tmp_path: Path) -> None:
        """A table as PlotJuggler exports it: most cells are empty."""
        cells = foreign(own).to_dict(as_series=False)
        for i in range(len(own)):
            if i % 5:
                for axis in "xyz":
                    cells[f"pos {axis}"][i] = None
        cells["pos_ms"] = [None if i % 5 else 1.7e12 + 1e3 * t for i, t in enumerate(own.time_s)]
        pl.DataFrame(cells).write_csv(tmp_path / "a.csv")
        by = written(tmp_path, {"position": MAP["position"] | {"time": {"column": "pos_ms", "unit": "ms"}}})
        log = read_by_map(tmp_path / "a.csv", by)
        assert len(log.updates(*POSITION)) == pytest.approx(len(own) / 5, abs=2)
        assert complaints(log) == []


class TestShippedMaps:
    def test_each_is_tested_here(self) -> None:
        assert LAYOUTS.keys() == {path.stem for path in MAPS.glob("*.yaml")}

    @pytest.mark.parametrize("name", LAYOUTS)
    def test_reads_the_layout_of_its_data_set(self, own: FlightLog, tmp_path: Path, name: str) -> None:
        path, by = tmp_path / "flight.csv", MAPS / f"{name}.yaml"
        LAYOUTS[name](own).write_csv(path)
        log = read_by_map(path, by)
        for column in (*POSITION, *VELOCITY, *ATTITUDE, *RATES, *IMU, "battery_v"):
            assert log[column][5:-5] == pytest.approx(own[column][5:-5], abs=2e-3), column
        driven = [column for column in log.columns if column.startswith("motor")]
        assert len(driven) == 4 and all(np.ptp(log[column]) > 0.0 for column in driven)
        assert complaints(log) == []
        assert better_reading(path, by, log) is None

    def test_it_is_found_wherever_the_user_is(
        self, quadctl: Callable[..., Result], own: FlightLog, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.chdir(tmp_path)
        neurobem(own).write_csv(tmp_path / "flight.csv")
        shown = quadctl("logs", "flight.csv", "--map", "config/maps/neurobem.yaml")
        assert shown.status == 0, shown.err
        assert "read by the map neurobem.yaml" in shown.out


class TestMatrix:
    @pytest.mark.parametrize("order", ["rows", "columns"])
    def test_attitude_as_a_matrix(self, own: FlightLog, tmp_path: Path, order: str) -> None:
        table = foreign(own)
        turn = rotation_matrix(*(table[f"q {part}"].to_numpy() for part in "wxyz"))
        flat = (turn if order == "rows" else turn.swapaxes(0, 1)).reshape(9, -1)
        table.with_columns(**{f"r{i}": flat[i] for i in range(9)}).write_csv(tmp_path / "a.csv")
        attitude = {"columns": [f"r{i}" for i in range(9)], "order": order, "body": "FLU", "world": "ENU"}
        by = written(tmp_path, {"attitude": attitude})
        assert_same_flight(read_by_map(tmp_path / "a.csv", by), own)
        other = "columns" if order == "rows" else "rows"
        wrong = written(tmp_path, {"attitude": attitude | {"order": other}})
        log = read_by_map(tmp_path / "a.csv", wrong)
        assert (
            better_reading(tmp_path / "a.csv", wrong, log)
            == f"the channels agree with `attitude.order: {order}` in the map"
        )

    def test_what_is_no_rotation_is_no_attitude(self, own: FlightLog, tmp_path: Path) -> None:
        foreign(own).with_columns(**{f"r{i}": pl.lit(0.0) for i in range(9)}).write_csv(tmp_path / "a.csv")
        attitude = {"columns": [f"r{i}" for i in range(9)], "order": "rows", "body": "FLU", "world": "ENU"}
        with pytest.raises(LogError, match="holds no values of roll_deg"):
            read_by_map(tmp_path / "a.csv", written(tmp_path, {"attitude": attitude}))


class TestComplaints:
    def test_a_wrong_map_of_roll_pitch_and_yaw_is_answered_too(self, own: FlightLog, tmp_path: Path) -> None:
        """No other order or direction is tried of these, as there is none."""
        angles = {name: np.radians(own[name]) for name in ATTITUDE}
        foreign(own).with_columns(**angles).write_csv(tmp_path / "a.csv")
        attitude = {"columns": list(ATTITUDE), "unit": "deg", "body": "FRD", "world": "NED"}
        by = written(tmp_path, {"attitude": attitude})
        log = read_by_map(tmp_path / "a.csv", by)
        assert better_reading(tmp_path / "a.csv", by, log) == "the channels agree with `attitude.unit: rad` in the map"

    @pytest.mark.parametrize(
        ("change", "mended"),
        [
            ({"time": {"column": "timestamp", "unit": "us"}}, "time.unit: ns"),
            ({"position": MAP["position"] | {"unit": "mm"}}, "position.unit: m"),
            ({"velocity": MAP["velocity"] | {"frame": "NED"}}, "velocity.frame: ENU"),
            ({"attitude": MAP["attitude"] | {"order": "wxyz"}}, "attitude.order: xyzw"),
            ({"attitude": MAP["attitude"] | {"body": "FRD"}}, "attitude.body: FLU"),
            ({"attitude": MAP["attitude"] | {"inverse": True}}, "attitude.inverse: false"),
            ({"rates": MAP["rates"] | {"unit": "deg/s"}}, "rates.unit: rad/s"),
            ({"rates": MAP["rates"] | {"frame": "FRD"}}, "rates.frame: FLU"),
            ({"imu": MAP["imu"] | {"frame": "FRD"}}, "imu.frame: FLU"),
        ],
    )
    def test_a_wrong_field_is_seen_and_the_right_one_named(
        self, change: dict[str, Any], mended: str, table: Path, tmp_path: Path
    ) -> None:
        by = written(tmp_path, change)
        log = read_by_map(table, by)
        assert complaints(log) or "inverse" in mended  # with changing heading nothing goes together: no clear factor
        assert better_reading(table, by, log) == f"the channels agree with `{mended}` in the map"


class TestBadInput:
    @pytest.mark.parametrize(
        ("change", "words"),
        [
            (
                {"imu": MAP["imu"] | {"columns": ["acc x", "acc y", "ac z"]}},
                "imu.columns names 'ac z', expected a column",
            ),
            ({"velocity": MAP["velocity"] | {"frame": "XYZ"}}, "velocity.frame"),
            ({"attitude": MAP["attitude"] | {"order": None}}, "expected `order: wxyz` or `order: xyzw`"),
            ({"attitude": MAP["attitude"] | {"columns": ["q x"] * 9}}, "expected `order: rows` or `order: columns`"),
            ({"position": {"columns": ["pos x", "pos y"], "frame": "NED"}}, "position.columns"),
        ],
    )
    def test_a_bad_map_gets_one_sentence(self, change: dict[str, Any], words: str, table: Path, tmp_path: Path) -> None:
        by = written(tmp_path, change)
        with pytest.raises(SettingsError) as caught:
            read_by_map(table, by)
        assert str(by) in str(caught.value) and words in str(caught.value) and "\n" not in str(caught.value)

    def test_text_for_numbers(self, own: FlightLog, tmp_path: Path) -> None:
        foreign(own).with_columns(pl.lit("high").alias("vbat")).write_csv(tmp_path / "a.csv")
        with pytest.raises(LogError, match="column 'vbat' holds 'high', expected a number"):
            read_by_map(tmp_path / "a.csv", written(tmp_path))

    def test_a_header_that_does_not_suit_the_rows(self, tmp_path: Path) -> None:
        (tmp_path / "a.csv").write_text("some words here\n1\n2\n")
        with pytest.raises(LogError, match="its header names 3 columns and its rows have 1"):
            read_by_map(tmp_path / "a.csv", written(tmp_path))

    def test_parquet_of_others_needs_a_map(self, own: FlightLog, tmp_path: Path) -> None:
        foreign(own).write_parquet(tmp_path / "a.parquet")
        with pytest.raises(LogError, match=r"has no column time_s, expected .* a map a.map.yaml beside it"):
            read_log(tmp_path / "a.parquet")


class TestGuess:
    def test_the_frames_are_those_in_which_the_channels_agree(
        self, own: FlightLog, table: Path, tmp_path: Path
    ) -> None:
        by, log = proposed(table)
        assert_same_flight(log, own)
        assert complaints(log) == []
        path = tmp_path / "guessed.yaml"
        path.write_text(as_yaml(by, "a guess"))
        assert_same_flight(read_by_map(table, path), own)

    def test_an_angular_acceleration_is_no_accelerometer(self, own: FlightLog, tmp_path: Path) -> None:
        neurobem(own).write_csv(tmp_path / "a.csv")
        by, log = proposed(tmp_path / "a.csv")
        assert by.imu is not None and by.imu.columns == ("acc x", "acc y", "acc z")
        assert_same_flight(log, own)

    def test_columns_without_telling_names(self, tmp_path: Path) -> None:
        path = tmp_path / "a.csv"
        path.write_text("time,foo,bar\n0,1,2\n1,2,3\n")
        with pytest.raises(LogError, match="do not tell position, velocity, attitude"):
            proposed(path)


class TestCommand:
    def test_shows_converts_and_draws(self, quadctl: Callable[..., Result], table: Path, tmp_path: Path) -> None:
        by, plot, out = written(tmp_path), tmp_path / "p.png", tmp_path / "out"
        shown = quadctl("logs", table, "--map", by, "--plot", plot, "--to", "csv", "-o", out, "--json", tmp_path / "j")
        assert shown.status == 0, shown.err
        assert plot.stat().st_size > 10_000
        assert json.loads((tmp_path / "j").read_text())["logs"][0]["name"] == "foreign.csv"
        assert read_log(out / "foreign.csv").has("imu_z_m_s2")

    def test_says_what_is_wrong(self, quadctl: Callable[..., Result], table: Path, tmp_path: Path) -> None:
        by = written(tmp_path, {"velocity": MAP["velocity"] | {"frame": "NED"}})
        shown = quadctl("logs", table, "--map", by)
        assert "the channels agree with `velocity.frame: ENU` in the map" in shown.out

    def test_prints_a_guess(self, quadctl: Callable[..., Result], table: Path) -> None:
        shown = quadctl("logs", table, "--guess")
        assert shown.status == 0, shown.err
        assert yaml.safe_load(shown.out)["position"]["frame"] == "ENU"
