"""A table of another program, read by a map: the same flight, whatever the frames, units and clocks of the table."""

import json
import math
import re
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
import yaml
from scipy.signal import butter, sosfiltfilt

from quadctl.errors import LogError, SettingsError
from quadctl.frames import quaternion_from_euler, rotate_inverse
from quadctl.logs.columns import STATE_COLUMNS
from quadctl.logs.consistency import complaints, misfit
from quadctl.logs.convert import write_parquet
from quadctl.logs.csv_log import write_csv
from quadctl.logs.findings import Kind, of_kind
from quadctl.logs.flight_log import ATTITUDE, IMU, POSITION, RATES, VELOCITY, FlightLog, Floats
from quadctl.logs.map_guess import as_yaml, better_reading, proposed
from quadctl.logs.read import read_log
from quadctl.logs.table import read_by_map
from quadctl.logs.table_map import Clock, load_map
from tests.support.commands import Result
from tests.support.log_files import G, small_dataflash
from tests.support.places import DATA, ROOT

MAPS = ROOT / "config" / "maps"
NANOBENCH = DATA / "nanobench"
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


def nanobench(log: FlightLog) -> pl.DataFrame:
    """The flight in the columns of the NanoBench data set that its map names: accelerometer in g, PWM of 16 bits."""
    table = foreign(log)
    cells: dict[str, Any] = {"t": 1.77e9 + log.time_s}
    for theirs, ours in (("p{}", "pos {}"), ("v{}", "vel {}"), ("imu_gyro_{}", "gyro {}")):
        cells |= {theirs.format(axis): table[ours.format(axis)] for axis in "xyz"}
    cells |= {f"imu_acc_{axis}": table[f"acc {axis}"] / G for axis in "xyz"}
    cells |= {f"q{part}": table[f"q {part}"] for part in "xyzw"}
    cells |= {f"motor_motor_m{i}": 65535.0 * (log[f"motor{i}_rpm"] / 10_000.0) ** 2 for i in range(1, 5)}
    return pl.DataFrame(cells | {"pwr_pm_vbat": table["vbat"]})


def nanodrone(log: FlightLog) -> pl.DataFrame:
    """The flight in the columns of IDSIA's nano-drone benchmark that its map names: 100 Hz, motor speeds in rad/s."""
    table = foreign(log)
    cells: dict[str, Any] = {"t": log.time_s}
    for theirs, ours in (("{}", "pos {}"), ("v{}", "vel {}"), ("w{}", "gyro {}"), ("a{}", "acc {}")):
        cells |= {theirs.format(axis): table[ours.format(axis)] for axis in "xyz"}
    cells |= {f"q{part}": table[f"q {part}"] for part in "xyzw"}
    cells |= {f"m{i}_rads": table[f"mot {i}"] for i in range(1, 5)}
    return pl.DataFrame(cells | {"Vbat": table["vbat"]})


LAYOUTS = {"neurobem": neurobem, "tii_ratm": tii_ratm, "nanobench": nanobench, "nanodrone": nanodrone}
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
        assert np.max(np.abs(np.interp(own.time_s, log.time_s, log[name])[5:-5] - own[name][5:-5])) < 2e-3, name


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
            assert np.max(np.abs(log[column][5:-5] - own[column][5:-5])) < 2e-3, column
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


@pytest.mark.skipif(not NANOBENCH.is_dir(), reason="the flights of NanoBench are not here")
class TestNanoBench:
    CORRUPT = ("B2_circle_medium_rep3", "B9_trefoil_fast_rep2")
    """Flights whose onboard channels are no measurements, as published."""
    FLIGHTS = sorted(path for path in NANOBENCH.glob("*.csv"))

    def test_all_flights_are_read_as_published_by_one_map(self) -> None:
        by = MAPS / "nanobench.yaml"
        assert len(self.FLIGHTS) > 20
        for path in self.FLIGHTS:
            log = read_by_map(path, by)
            assert len(log) > 2600
            flying = log["z_m"] > 0.5
            thrust = np.mean([log[f"motor{i}_output"][flying] for i in range(1, 5)], axis=0)
            assert bool(complaints(log)) == (path.stem in self.CORRUPT)
            if path.stem not in self.CORRUPT:
                assert better_reading(path, by, log) is None
                assert 0.75 < np.nanmedian(thrust) < 0.92
                assert np.nanmedian(log["imu_z_m_s2"][flying]) == pytest.approx(-G, abs=0.5)

    def test_the_motors_are_those_of_the_vehicle_file(self) -> None:
        """More thrust on a side lifts that side, 40 ms later."""
        log = read_by_map(NANOBENCH / "B3_figure8_fast_rep1.csv", MAPS / "nanobench.yaml")
        band = butter(2, (1.0, 10.0), "bandpass", fs=100.0, output="sos")
        flying = (log.time_s > 6.0) & (log.time_s < 20.0)

        def filtered(values: Floats) -> Floats:
            return np.asarray(sosfiltfilt(band, np.nan_to_num(values)))

        m1, m2, m3, m4 = (filtered(log[f"motor{i}_output"]) for i in range(1, 5))
        for rate, lift in (("roll_rate_rad_s", m3 + m4 - m1 - m2), ("pitch_rate_rad_s", m1 + m4 - m2 - m3)):
            turning = np.gradient(filtered(log[rate]), log.time_s)
            assert np.corrcoef(turning[flying], np.roll(lift, 4)[flying])[0, 1] > 0.7, rate

    def test_guess_knows_its_names(self) -> None:
        path = NANOBENCH / "B5_helix_fast_rep1.csv"
        guessed, shipped = proposed(path)[1], read_by_map(path, MAPS / "nanobench.yaml")
        assert guessed.columns.keys() == shipped.columns.keys()
        for name in shipped.columns:
            np.testing.assert_array_equal(guessed[name], shipped[name])


class TestMotors:
    @pytest.mark.parametrize(
        ("scale", "unit"),
        [
            ((0.0, 65535.0), {"unit": "pwm", "full": 65535}),
            ((0.0, 255.0), {"unit": "pwm", "full": 255}),
            ((1000.0, 1000.0), {"unit": "us"}),
            ((1100.0, 840.0), {"unit": "us", "low": 1100, "high": 1940}),
            ((0.0, 100.0), {"unit": "percent"}),
        ],
    )
    def test_counts_and_pulses_are_shares(
        self, own: FlightLog, tmp_path: Path, scale: tuple[float, float], unit: dict[str, Any]
    ) -> None:
        share = 0.5 + 0.1 * np.sin(own.time_s)
        foreign(own).with_columns(**{f"mot {i}": scale[0] + scale[1] * share for i in range(1, 5)}).write_csv(
            tmp_path / "a.csv"
        )
        by = written(tmp_path, {"motors": {"columns": MAP["motors"]["columns"]} | unit})
        log = read_by_map(tmp_path / "a.csv", by)
        assert log["motor2_output"][5:] == pytest.approx(share[5:])
        assert "motor2_rpm" not in log.columns

    def test_pulses_of_a_motor_that_is_off_are_no_output(self, own: FlightLog, tmp_path: Path) -> None:
        foreign(own).with_columns(**{f"mot {i}": pl.lit(900.0) for i in range(1, 5)}).write_csv(tmp_path / "a.csv")
        by = written(tmp_path, {"motors": MAP["motors"] | {"unit": "us"}})
        assert np.all(read_by_map(tmp_path / "a.csv", by)["motor1_output"] == 0.0)

    def test_what_no_motor_can_get_is_missing_and_said(self, own: FlightLog, tmp_path: Path) -> None:
        counts = np.where(own.time_s > 10.0, 2e6, 3e4)
        foreign(own).with_columns(**{"mot 3": counts}).write_csv(tmp_path / "a.csv")
        by = written(tmp_path, {"motors": MAP["motors"] | {"unit": "pwm", "full": 65535}})
        log = read_by_map(tmp_path / "a.csv", by)
        assert np.isnan(log["motor3_output"][-1]) and log["motor3_output"][10] == pytest.approx(3e4 / 65535)
        (found,) = of_kind(log.findings, Kind.IMPOSSIBLE_VALUES)
        assert found.figures["column"] == "motor3_output"

    @pytest.mark.parametrize(
        ("motors", "words"),
        [
            ({"unit": "pwm"}, "needs `unit: pwm` and `full` (65535 of 16 bits) together"),
            ({"unit": "us", "full": 2000}, "needs `unit: pwm` and `full` (65535 of 16 bits) together"),
            ({"unit": "share", "low": 0.1}, "has `low` or `high`, expected them with `unit: us` only"),
            ({"unit": "us", "low": 2000, "high": 1000}, "has pulses from 2000 to 1000, expected `low` below `high`"),
        ],
    )
    def test_a_scale_that_is_none_is_one_sentence(
        self, table: Path, tmp_path: Path, motors: dict[str, Any], words: str
    ) -> None:
        with pytest.raises(SettingsError, match=re.escape(words)):
            read_by_map(table, written(tmp_path, {"motors": {"columns": MAP["motors"]["columns"]} | motors}))


class TestSigns:
    def test_a_column_with_a_sign_is_its_negative(self, own: FlightLog, tmp_path: Path) -> None:
        """As the pitch of a Crazyflie, which is positive nose up while its other angles are those of FLU."""
        angles = dict(zip(("roll", "pitch", "yaw"), (own[name] for name in ATTITUDE), strict=True))
        cells = {"roll": angles["roll"], "pitch": angles["pitch"], "yaw": 90.0 - angles["yaw"]}
        foreign(own).with_columns(**cells).write_csv(tmp_path / "a.csv")
        attitude = {"columns": ["roll", "-pitch", "yaw"], "unit": "deg", "body": "FLU", "world": "ENU"}
        assert_same_flight(read_by_map(tmp_path / "a.csv", written(tmp_path, {"attitude": attitude})), own)

    def test_accelerations_in_g(self, own: FlightLog, tmp_path: Path) -> None:
        foreign(own).with_columns([pl.col(f"acc {axis}") / G for axis in "xyz"]).write_csv(tmp_path / "a.csv")
        by = written(tmp_path, {"imu": MAP["imu"] | {"unit": "g"}})
        assert_same_flight(read_by_map(tmp_path / "a.csv", by), own)


BEGIN = datetime(2026, 5, 4, 9, 30, tzinfo=UTC)


class TestDates:
    @pytest.mark.parametrize(
        "written_as",
        [
            lambda date: date.isoformat(timespec="milliseconds").replace("+00:00", "Z"),
            lambda date: date.isoformat(timespec="microseconds"),
            lambda date: date.astimezone(timezone(timedelta(hours=2))).isoformat(),
            lambda date: date.astimezone(timezone(timedelta(hours=-3, minutes=-30))).isoformat(sep=" "),
            lambda date: date.replace(tzinfo=None).isoformat(sep=" "),
            lambda date: date.strftime("%Y-%m-%dT%H:%M:%S.%f") + "000Z",
            lambda date: date.strftime("%Y/%m/%d %H:%M:%S.%f"),
            lambda date: date.strftime("%Y%m%dT%H%M%S.%fZ"),
            lambda date: date.isoformat().replace(".", ","),
            lambda date: (date + timedelta(hours=14.4999)).time().isoformat(),  # beyond midnight
        ],
    )
    def test_as_time(self, own: FlightLog, tmp_path: Path, written_as: Callable[[datetime], str]) -> None:
        dates = [written_as(BEGIN + timedelta(seconds=float(t))) for t in own.time_s]
        foreign(own).with_columns(timestamp=pl.Series(dates)).write_csv(tmp_path / "a.csv", quote_style="non_numeric")
        by = written(tmp_path, {"time": {"column": "timestamp", "unit": "date"}})
        log = read_by_map(tmp_path / "a.csv", by)
        assert_same_flight(log, own)
        is_of_a_day = log.meta["time_zero_s"] < 1e6
        assert is_of_a_day or log.meta["time_zero_s"] == pytest.approx(BEGIN.timestamp(), abs=1e-3)
        assert proposed(tmp_path / "a.csv")[0].time == by_time(by)

    def test_dates_of_parquet(self, own: FlightLog, tmp_path: Path) -> None:
        dates = [BEGIN + timedelta(seconds=float(t)) for t in own.time_s]
        foreign(own).with_columns(timestamp=pl.Series(dates)).write_parquet(tmp_path / "a.parquet")
        by = written(tmp_path, {"time": {"column": "timestamp", "unit": "date"}})
        assert_same_flight(read_by_map(tmp_path / "a.parquet", by), own)

    @pytest.mark.parametrize(("unit", "factor"), [("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
    @pytest.mark.parametrize("since_s", [0.0, 1.7777e9])
    def test_numbers_of_any_unit_are_told_by_guess(
        self, own: FlightLog, tmp_path: Path, unit: str, factor: float, since_s: float
    ) -> None:
        foreign(own).with_columns(timestamp=factor * (since_s + own.time_s)).write_csv(tmp_path / "a.csv")
        by, log = proposed(tmp_path / "a.csv")
        assert by.time.unit == unit
        assert log.time_s[-1] == pytest.approx(own.time_s[-1], abs=1e-3)

    def test_a_map_that_takes_them_for_numbers_is_told_so(self, own: FlightLog, tmp_path: Path) -> None:
        dates = [(BEGIN + timedelta(seconds=float(t))).isoformat() for t in own.time_s]
        foreign(own).with_columns(timestamp=pl.Series(dates)).write_csv(tmp_path / "a.csv")
        said = (
            r"column 'timestamp' holds dates \('2026-05-04T09:30:00\+00:00'\), expected numbers of ns, or `unit: date`"
        )
        with pytest.raises(LogError, match=said):
            read_by_map(tmp_path / "a.csv", written(tmp_path))

    def test_words_are_no_dates(self, own: FlightLog, tmp_path: Path) -> None:
        foreign(own).with_columns(timestamp=pl.lit("noon")).write_csv(tmp_path / "a.csv")
        by = written(tmp_path, {"time": {"column": "timestamp", "unit": "date"}})
        with pytest.raises(LogError, match="column 'timestamp' holds 'noon', expected dates"):
            read_by_map(tmp_path / "a.csv", by)


def by_time(path: Path) -> Clock:
    return load_map(path).time


def geodetic(log: FlightLog, latitude_deg: float, longitude_deg: float) -> tuple[Floats, Floats]:
    """Latitude and longitude, degrees, of a flight that begins there; by way of earth-centred coordinates."""
    a, e2 = 6_378_137.0, 0.00669437999014
    lat, lon = math.radians(latitude_deg), math.radians(longitude_deg)
    n = a / math.sqrt(1.0 - e2 * math.sin(lat) ** 2)
    north, east = log["x_m"] - log["x_m"][0], log["y_m"] - log["y_m"][0]
    x = n * math.cos(lat) * math.cos(lon) - math.sin(lat) * math.cos(lon) * north - math.sin(lon) * east
    y = n * math.cos(lat) * math.sin(lon) - math.sin(lat) * math.sin(lon) * north + math.cos(lon) * east
    z = n * (1.0 - e2) * math.sin(lat) + math.cos(lat) * north
    # the plane is some micrometres above the ellipsoid here: latitude by one step of Bowring's
    return np.degrees(np.arctan2(z, (1.0 - e2) * np.hypot(x, y))), np.degrees(np.arctan2(y, x))


class TestDegrees:
    @pytest.mark.parametrize("place", [(47.0, 8.0), (-33.9, 151.2), (64.1, -21.9), (-16.8, 179.99998), (0.0, 0.001)])
    @pytest.mark.parametrize("unit", ["deg", "degE7"])
    def test_latitude_and_longitude_are_metres_north_and_east(
        self, own: FlightLog, tmp_path: Path, place: tuple[float, float], unit: str
    ) -> None:
        lat, lon = geodetic(own, *place)
        factor = 1e7 if unit == "degE7" else 1.0
        cells = {"lat": factor * lat, "lon": factor * lon, "alt": 1e3 * own["z_m"]}
        foreign(own).with_columns(**cells).write_csv(tmp_path / "a.csv")
        position = {"columns": ["lat", "lon", "alt"], "frame": "LLA", "unit": unit, "height_unit": "mm"}
        log = read_by_map(tmp_path / "a.csv", written(tmp_path, {"position": position}))
        for name, begin in (("x_m", own["x_m"][0]), ("y_m", own["y_m"][0]), ("z_m", 0.0)):
            assert np.max(np.abs(log[name][5:-5] - own[name][5:-5] + begin)) < 2e-3, name
        assert log.meta["origin_deg"] == pytest.approx([lat[0], lon[0]])
        assert complaints(log) == []

    def test_the_nought_before_a_fix_is_no_position(self, own: FlightLog, tmp_path: Path) -> None:
        lat, lon = geodetic(own, 47.0, 8.0)
        lat[:50] = lon[:50] = 0.0
        foreign(own).with_columns(lat=lat, lon=lon, alt=own["z_m"]).write_csv(tmp_path / "a.csv")
        position = {"columns": ["lat", "lon", "alt"], "frame": "LLA", "unit": "deg"}
        log = read_by_map(tmp_path / "a.csv", written(tmp_path, {"position": position}))
        assert np.nanmax(np.abs(log["x_m"])) < 10.0

    @pytest.mark.parametrize(
        ("position", "words"),
        [
            ({"frame": "LLA"}, "has `frame: LLA` and `unit: m`, expected `unit: deg` or `unit: degE7`"),
            ({"frame": "NED", "unit": "deg"}, "has `frame: NED`, expected `frame: LLA` with degrees"),
        ],
    )
    def test_degrees_and_their_frame_go_together(
        self, table: Path, tmp_path: Path, position: dict[str, str], words: str
    ) -> None:
        by = written(tmp_path, {"position": {"columns": MAP["position"]["columns"]} | position})
        with pytest.raises(SettingsError, match=re.escape(words)):
            read_by_map(table, by)


class TestFolder:
    """One map for all tables of a folder: any `*.map.yaml` there that is not a table's own."""

    def test_each_table_without_a_map_of_its_own_is_read_by_it(self, own: FlightLog, tmp_path: Path) -> None:
        for name in ("monday.csv", "tuesday.1.csv"):
            foreign(own).write_csv(tmp_path / name)
        foreign(own).write_parquet(tmp_path / "wednesday.parquet")
        written(tmp_path, name="quadctl.map.yaml")
        for name in ("monday.csv", "tuesday.1.csv", "wednesday.parquet"):
            log = read_log(tmp_path / name)
            assert_same_flight(log, own)
            assert "read by the map quadctl.map.yaml" in log.notes

    def test_a_table_s_own_map_comes_first(self, own: FlightLog, tmp_path: Path) -> None:
        foreign(own).write_csv(tmp_path / "a.csv")
        written(tmp_path, name="all.map.yaml")
        written(tmp_path, name="a.map.yaml")
        assert "read by the map a.map.yaml" in read_log(tmp_path / "a.csv").notes

    def test_the_own_map_of_another_table_is_none_for_all(self, own: FlightLog, tmp_path: Path) -> None:
        for name in ("a.csv", "b.csv"):
            foreign(own).write_csv(tmp_path / name)
        written(tmp_path, name="a.map.yaml")
        with pytest.raises(LogError, match="the header lacks time_s"):
            read_log(tmp_path / "b.csv")

    def test_logs_that_need_no_map_are_read_as_ever(self, own: FlightLog, tmp_path: Path) -> None:
        written(tmp_path, name="all.map.yaml")
        write_csv(own, tmp_path / "own.csv")
        (tmp_path / "a.bin").write_bytes(small_dataflash())
        headerless = read_log(tmp_path / "own.csv")
        rows = [",".join(str(headerless[name][i]) for name in STATE_COLUMNS) + ",0,0,0,0.5" for i in range(300)]
        (tmp_path / "bare.csv").write_text("\n".join(rows) + "\n")
        for name in ("own.csv", "a.bin", "bare.csv"):
            assert not of_kind(read_log(tmp_path / name).findings, Kind.READ_BY_MAP)

    def test_two_that_suit_are_one_sentence(self, own: FlightLog, tmp_path: Path) -> None:
        foreign(own).write_csv(tmp_path / "a.csv")
        for name in ("one.map.yaml", "two.map.yaml"):
            written(tmp_path, name=name)
        said = "can be read by one.map.yaml, two.map.yaml, expected one map, or its own named a.map.yaml"
        with pytest.raises(LogError, match=said):
            read_log(tmp_path / "a.csv")

    def test_of_several_the_one_whose_columns_the_table_has(self, own: FlightLog, tmp_path: Path) -> None:
        foreign(own).write_csv(tmp_path / "a.csv")
        written(tmp_path, {"battery": {"column": "volts"}}, name="older.map.yaml")
        written(tmp_path, name="newer.map.yaml")
        assert "read by the map newer.map.yaml" in read_log(tmp_path / "a.csv").notes

    def test_a_name_in_it_that_the_table_does_not_have_is_told(self, own: FlightLog, tmp_path: Path) -> None:
        foreign(own).write_csv(tmp_path / "a.csv")
        written(tmp_path, {"battery": {"column": "vbatt"}}, name="all.map.yaml")
        with pytest.raises(SettingsError, match=r"battery.column names 'vbatt', expected a column of a.csv"):
            read_log(tmp_path / "a.csv")


class TestEndOfTable:
    def test_a_last_line_without_an_end_is_left_out_and_said(self, own: FlightLog, tmp_path: Path) -> None:
        whole = foreign(own).write_csv()
        (tmp_path / "a.csv").write_text(whole[:-30])
        log = read_by_map(tmp_path / "a.csv", written(tmp_path))
        assert len(log) == len(own) - 1
        (found,) = of_kind(log.findings, Kind.LAST_LINE_CUT)
        assert found.figures["line"] == len(own) + 1

    def test_parquet_needs_its_end(self, own: FlightLog, tmp_path: Path) -> None:
        foreign(own).write_parquet(tmp_path / "a.parquet")
        data = (tmp_path / "a.parquet").read_bytes()
        (tmp_path / "a.parquet").write_bytes(data[: len(data) // 2])
        with pytest.raises(LogError, match="ends in the middle, and Parquet has its index at the end"):
            read_log(tmp_path / "a.parquet")


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
        assert better_reading(tmp_path / "a.csv", wrong, log) == f"attitude.order: {order}"

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
        assert better_reading(tmp_path / "a.csv", by, log) == "attitude.unit: rad"

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
        assert better_reading(table, by, log) == mended


class TestNothingToCompare:
    @pytest.mark.parametrize("factor", [1e-3, 1e-6, 1e-9])
    def test_a_reading_in_which_the_flight_takes_no_time_agrees_with_nothing(
        self, own: FlightLog, factor: float
    ) -> None:
        """It has no stretch of a second in which two channels could differ."""
        shrunk = replace(own, columns=own.columns | {"time_s": factor * own.time_s})
        assert misfit(shrunk) > misfit(own) + 1.0

    def test_no_unit_of_time_is_advised_where_something_else_is_off(self, tmp_path: Path) -> None:
        """A gyro that measures nothing is no reason for another clock."""
        own = flight(60.0)
        random = np.random.default_rng(1)
        noise = {f"gyro {axis}": random.normal(size=len(own)) for axis in "xyz"}
        foreign(own).with_columns(**noise, timestamp=own.time_s).write_csv(tmp_path / "a.csv")
        by = written(tmp_path, {"time": {"column": "timestamp", "unit": "s"}})
        log = read_by_map(tmp_path / "a.csv", by)
        assert misfit(log) > 0.5
        assert better_reading(tmp_path / "a.csv", by, log) is None


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
        with pytest.raises(
            LogError,
            match=r"has no column time_s, expected .* a map of its columns beside it \(`quadctl logs --guess` proposes",
        ):
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

    @pytest.mark.parametrize(
        ("name", "values", "scale", "is_told"),
        [
            ("motor.m{}", (0.0, 41000.0), {"unit": "pwm", "full": 65535.0}, True),
            ("motor_pwm_{}", (0.0, 180.0), {"unit": "pwm", "full": 255.0}, True),
            ("motor_{}", (900.0, 1900.0), {"unit": "us"}, False),
            ("rotor_{}", (0.0, 60000.0), {"unit": "pwm", "full": 65535.0}, False),
            ("motor_{}_rpm", (0.0, 800.0), {"unit": "rpm"}, True),
            ("rpm[{}]", (1100.0, 1900.0), {"unit": "rpm"}, True),
            ("motor_speed_{}_rad_s", (0.0, 4000.0), {"unit": "rad/s"}, True),
            ("mot {}", (0.0, 800.0), {"unit": "rad/s"}, False),
            ("esc_{}", (0.0, 9000.0), {"unit": "rpm"}, False),
            ("u{}", (0.0, 1.0), {"unit": "share"}, False),
        ],
    )
    def test_motors_by_their_names_and_then_by_their_size(
        self,
        own: FlightLog,
        tmp_path: Path,
        name: str,
        values: tuple[float, float],
        scale: dict[str, Any],
        is_told: bool,
    ) -> None:
        low, high = values
        turning = low + (high - low) * (0.75 + 0.25 * np.sin(own.time_s))
        cells = {name.format(i): np.where(own.time_s < 1.0, low, turning) for i in range(1, 5)}
        plain = foreign(own).drop([f"mot {i}" for i in range(1, 5)])
        plain.with_columns(**cells).write_csv(tmp_path / "a.csv")
        by, _ = proposed(tmp_path / "a.csv")
        assert by.motors is not None
        assert by.motors.columns == tuple(cells)
        assert by.motors.model_dump(exclude_none=True, exclude={"columns"}) == scale
        assert is_told == ("size of the numbers alone" not in as_yaml(by, "a guess"))

    def test_speeds_rather_than_outputs(self, own: FlightLog, tmp_path: Path) -> None:
        outputs = {f"motor{i}_pwm": np.full(len(own), 1500.0) for i in range(1, 5)}
        speeds = {f"motor{i}_rpm": own[f"motor{i}_rpm"] for i in range(1, 5)}
        foreign(own).drop([f"mot {i}" for i in range(1, 5)]).with_columns(**outputs, **speeds).write_csv(
            tmp_path / "a.csv"
        )
        by, _ = proposed(tmp_path / "a.csv")
        assert by.motors is not None and by.motors.unit == "rpm"

    def test_names_of_a_crazyflie(self, own: FlightLog, tmp_path: Path) -> None:
        """As its client and library write them: angles and rates in degrees, the pitch nose up, g, milliseconds."""
        table = foreign(own)
        cells: dict[str, Any] = {"timestamp": 1000.0 * own.time_s + 5e4}
        cells |= {f"stateEstimate.{axis}": table[f"pos {axis}"] for axis in "xyz"}
        cells |= {f"stateEstimate.v{axis}": table[f"vel {axis}"] for axis in "xyz"}
        cells |= {f"stateEstimate.a{axis}": table[f"acc {axis}"] / G for axis in "xyz"}
        cells |= {"stabilizer.roll": own["roll_deg"], "stabilizer.pitch": own["pitch_deg"]}
        cells |= {"stabilizer.yaw": 90.0 - own["yaw_deg"], "controller.cmd_roll": own["roll_deg"]}
        cells |= {f"gyro.{axis}": np.degrees(table[f"gyro {axis}"].to_numpy()) for axis in "xyz"}
        cells |= {f"acc.{axis}": table[f"acc {axis}"] / G for axis in "xyz"}
        cells |= {f"motor.m{i}": np.rint(4e4 + 5.0 * own[f"motor{i}_rpm"] / 3.0) for i in range(1, 5)}
        cells |= {f"ctrltarget.{axis}": table[f"pos {axis}"] for axis in "xyz"}
        pl.DataFrame(cells | {"pm.vbat": table["vbat"]}).write_csv(tmp_path / "a.csv")
        by, log = proposed(tmp_path / "a.csv")
        assert by.attitude.columns == ("stabilizer.roll", "-stabilizer.pitch", "stabilizer.yaw")
        assert by.rates is not None and by.rates.unit == "deg/s"
        for name in (*POSITION, *VELOCITY, *ATTITUDE, *RATES, *IMU, "battery_v"):
            assert np.max(np.abs(log[name][5:-5] - own[name][5:-5])) < 2e-3, name
        assert log["motor1_output"][-1] == pytest.approx(cells["motor.m1"][-1] / 65535.0)

    def test_names_of_directions_and_places(self, own: FlightLog, tmp_path: Path) -> None:
        """As tables of MAVSDK's telemetry."""
        lat, lon = geodetic(own, 47.0, 8.0)
        dates = [(BEGIN + timedelta(seconds=float(t))).isoformat() for t in own.time_s]
        cells: dict[str, Any] = {"timestamp": dates, "latitude_deg": lat, "longitude_deg": lon}
        cells |= {"absolute_altitude_m": 450.0 + own["z_m"], "relative_altitude_m": own["z_m"]}
        cells |= {"north_m_s": own["vx_m_s"], "east_m_s": own["vy_m_s"], "down_m_s": -own["vz_m_s"]}
        cells |= {name: own[name] for name in ATTITUDE}
        pl.DataFrame(cells | {"voltage_v": own["battery_v"]}).write_csv(tmp_path / "a.csv")
        by, log = proposed(tmp_path / "a.csv")
        assert (by.time.unit, by.position.frame, by.velocity.frame) == ("date", "LLA", "NED")
        for name in (*VELOCITY, *ATTITUDE, "z_m"):
            assert np.max(np.abs(log[name][5:-5] - own[name][5:-5])) < 2e-3, name
        assert np.max(np.abs(np.diff(log["x_m"] - own["x_m"]))) < 1e-3
        assert complaints(log) == []

    def test_a_date_without_the_time_of_the_day_is_no_clock(self, own: FlightLog, tmp_path: Path) -> None:
        times = [(BEGIN + timedelta(seconds=float(t))).time().isoformat() for t in own.time_s]
        cells = {"date": ["2026-05-04"] * len(own), "time": times}
        pl.DataFrame(cells).hstack(foreign(own).drop("timestamp")).write_csv(tmp_path / "a.csv")
        by, log = proposed(tmp_path / "a.csv")
        assert by.time == Clock(column="time", unit="date")
        assert_same_flight(log, own)

    def test_names_of_other_programs(self, own: FlightLog, tmp_path: Path) -> None:
        """A topic of ROS as `rostopic echo -p` writes it, and a flight record in other units with a compass."""
        table = foreign(own)
        cells: dict[str, Any] = {"%time": table["timestamp"], "field.header.seq": np.arange(len(own))}
        for theirs, ours in (
            ("field.pose.pose.position", "pos"),
            ("field.twist.twist.linear", "vel"),
            ("field.twist.twist.angular", "gyro"),
        ):
            cells |= {f"{theirs}.{axis}": table[f"{ours} {axis}"] for axis in "xyz"}
        cells |= {f"field.pose.pose.orientation.{part}": table[f"q {part}"] for part in "xyzw"}
        pl.DataFrame(cells).write_csv(tmp_path / "ros.csv")
        lat, lon = geodetic(own, 47.0, 8.0)
        cells = {"time(millisecond)": 1e3 * own.time_s, "latitude": lat, "longitude": lon}
        cells |= {"height_above_takeoff(feet)": own["z_m"] / 0.3048}
        speeds = (own["vx_m_s"], own["vy_m_s"], -own["vz_m_s"])
        cells |= {f"{axis}Speed(mph)": speed / 0.44704 for axis, speed in zip("xyz", speeds, strict=True)}
        cells |= {"compass_heading(degrees)": own["yaw_deg"] % 360.0, "pitch(degrees)": own["pitch_deg"]}
        pl.DataFrame(cells | {"roll(degrees)": own["roll_deg"]}).write_csv(tmp_path / "record.csv")
        for name in ("ros.csv", "record.csv"):
            _, log = proposed(tmp_path / name)
            assert complaints(log) == []
            for column in (*VELOCITY, *ATTITUDE, "z_m"):
                assert np.max(np.abs(log[column][5:-5] - own[column][5:-5])) < 2e-3, (name, column)

    @pytest.mark.parametrize("unit", ["rad/s", "deg/s"])
    def test_rates_of_a_quiet_flight(self, own: FlightLog, tmp_path: Path, unit: str) -> None:
        """By their size alone these may be either."""
        factor = 0.2 if unit == "rad/s" else np.degrees(0.2)
        quiet = {name: 0.2 * own[name] for name in ("roll_deg", "pitch_deg")}
        own = replace(own, columns=own.columns | quiet | {name: 0.2 * own[name] for name in VELOCITY + POSITION})
        foreign(own).with_columns([pl.col(f"gyro {axis}") * factor for axis in "xyz"]).write_csv(tmp_path / "a.csv")
        by, _ = proposed(tmp_path / "a.csv")
        assert by.rates is not None and by.rates.unit == unit

    def test_a_time_that_holds_words(self, tmp_path: Path) -> None:
        path = tmp_path / "a.csv"
        path.write_text("timestamp,x\nnoon,1\nlater,2\n")
        with pytest.raises(LogError, match="column 'timestamp' holds 'noon', expected numbers or dates as the time"):
            proposed(path)

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
