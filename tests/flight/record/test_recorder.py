"""The recorder: what is in a row, and that neither a full disk nor a killed process costs more than it must."""

import errno
import math
import os
import shutil
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pytest
import yaml

import quadctl.flight.record.recorder as recorder_module
from quadctl.compensator import Compensation
from quadctl.control import ControlOutput, Memory
from quadctl.errors import FlightError
from quadctl.flight.model_watch.watch import ModelError
from quadctl.flight.pilot.tick import Event, Stage, Tick
from quadctl.flight.preflight.preparation import prepare_flight
from quadctl.flight.record.recorder import Recorder, header, row
from quadctl.frames import quaternion_from_euler
from quadctl.logs.read import read_log
from quadctl.sitl.run import simulate
from quadctl.state import AttitudeTarget, Setpoint, VehicleState
from tests.support.places import ROOT

HEADER = (
    "time_s,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s,roll_deg,pitch_deg,yaw_deg,"
    "roll_rate_rad_s,pitch_rate_rad_s,yaw_rate_rad_s,motor1_rpm,motor2_rpm,motor3_rpm,motor4_rpm,"
    "motor1_voltage_v,motor2_voltage_v,motor3_voltage_v,motor4_voltage_v,"
    "motor1_current_a,motor2_current_a,motor3_current_a,motor4_current_a,"
    "motor1_output,motor2_output,motor3_output,motor4_output,battery_v,"
    "thrust_cmd_n,throttle_cmd,roll_cmd_deg,pitch_cmd_deg,yaw_cmd_deg,thrust_ratio,compensator_trust,"
    "x_ref_m,y_ref_m,z_ref_m,vx_ref_m_s,vy_ref_m_s,vz_ref_m_s,telemetry_age_s,tick_late_s,"
    "residual_x_m_s2,residual_y_m_s2,residual_z_m_s2,residual_north_m_s2,residual_east_m_s2,residual_up_m_s2,phase"
)


def attitude(roll_deg: float, pitch_deg: float, yaw_deg: float) -> Any:
    return quaternion_from_euler(*map(math.radians, (roll_deg, pitch_deg, yaw_deg)))


def tick(i: int = 0, **state: Any) -> Tick:
    """Numbers that are all different; the ground is 0.1 m below the frame's origin."""
    values: dict[str, Any] = {
        "time_s": 1000.0 + 0.02 * i,
        "position_ned_m": (1.0, -2.0, -3.0),
        "velocity_ned_m_s": (0.1, -0.2, 0.3),
        "attitude": attitude(10.0, -20.0, 30.0),
        "rates_rad_s": (0.4, -0.5, 0.6),
        "rotor_rpm": (5001.0, 5002.0, 5003.0, 5004.0),
        "motor_voltage_v": (15.1, 15.2, 15.3, 15.4),
        "motor_current_a": (4.1, 4.2, 4.3, 4.4),
        "motor_output": (0.51, 0.52, 0.53, 0.54),
        "battery_v": 16.25,
        "received_s": {"position": 999.99 + 0.02 * i, "attitude": 1000.0 + 0.02 * i},
    }
    target = AttitudeTarget(attitude(-1.0, 2.0, -3.0), 0.5)
    output = ControlOutput(target, 14.5, Compensation(1.05, (0, 0, 0)), (0, 0, 0), (0, 0, 0), Memory())
    return Tick(
        time_s=0.02 * i,
        stage=Stage.FLY,
        phase="hover",
        target=target,
        requests=(),
        state=VehicleState(**{**values, **state}),
        setpoint=Setpoint((7.0, 8.0, -9.0), (0.7, 0.8, -0.9)),
        output=output,
        ground_down_m=0.1,
        late_s=0.001,
        model_error=ModelError((0.11, -0.12, 0.13), (0.14, -0.15, 0.16)),
    )


def recorder(where: Path, n_rotors: int = 4) -> Recorder:
    return Recorder(where, "hop", n_rotors, {"mission": "hop", "autopilot": "none"})


def meta_of(path: Path) -> dict[str, Any]:
    loaded: dict[str, Any] = yaml.safe_load(path.with_suffix(".meta.yaml").read_text())
    return loaded


def until(condition: Callable[[], bool], what: str) -> None:
    """Another thread or process makes it true."""
    end_s = time.monotonic() + 20.0
    while not condition():
        assert time.monotonic() < end_s, what
        time.sleep(0.01)


# --- a row -----------------------------------------------------------------------------------------------------------


def test_the_columns_are_those_of_the_data_contracts() -> None:
    assert ",".join(header(4)) == HEADER


def test_six_rotors_have_six_columns_of_each_kind() -> None:
    names = header(6)
    assert [n for n in names if n.endswith("_rpm")] == [f"motor{i}_rpm" for i in range(1, 7)]
    assert len(names) == len(header(4)) + 8
    assert len(row(tick(), 6)) == len(names)


def test_a_row_is_north_east_up_and_degrees() -> None:
    values = dict(zip(header(4), row(tick(5), 4), strict=True))
    expected = {
        "time_s": 0.1,
        "x_m": 1.0,
        "y_m": -2.0,
        "z_m": 3.1,
        "vx_m_s": 0.1,
        "vy_m_s": -0.2,
        "vz_m_s": -0.3,
        "roll_deg": 10.0,
        "pitch_deg": -20.0,
        "yaw_deg": 30.0,
        "roll_rate_rad_s": 0.4,
        "pitch_rate_rad_s": -0.5,
        "yaw_rate_rad_s": 0.6,
        **{f"motor{i}_rpm": 5000.0 + i for i in range(1, 5)},
        **{f"motor{i}_voltage_v": 15.0 + 0.1 * i for i in range(1, 5)},
        **{f"motor{i}_current_a": 4.0 + 0.1 * i for i in range(1, 5)},
        **{f"motor{i}_output": 0.5 + 0.01 * i for i in range(1, 5)},
        "battery_v": 16.25,
        "thrust_cmd_n": 14.5,
        "throttle_cmd": 0.5,
        "roll_cmd_deg": -1.0,
        "pitch_cmd_deg": 2.0,
        "yaw_cmd_deg": -3.0,
        "thrust_ratio": 1.05,
        "compensator_trust": 1.0,
        "x_ref_m": 7.0,
        "y_ref_m": 8.0,
        "z_ref_m": 9.1,
        "vx_ref_m_s": 0.7,
        "vy_ref_m_s": 0.8,
        "vz_ref_m_s": 0.9,
        "telemetry_age_s": 0.01,
        "tick_late_s": 0.001,
        "residual_x_m_s2": 0.11,
        "residual_y_m_s2": -0.12,
        "residual_z_m_s2": 0.13,
        "residual_north_m_s2": 0.14,
        "residual_east_m_s2": -0.15,
        "residual_up_m_s2": -0.16,
    }
    assert values.pop("phase") == "hover"
    assert values == pytest.approx(expected)


def test_what_is_missing_is_nan_and_what_is_there_is_kept(tmp_path: Path) -> None:
    lost = tick(0, position_ned_m=(math.nan,) * 3, rotor_rpm=(), received_s={}, battery_v=math.inf)
    silent = lost._replace(target=None, output=None, setpoint=None)
    record = recorder(tmp_path)
    record(silent)
    record.close("completed")
    line = record.path.read_text().splitlines()[1]
    values = dict(zip(HEADER.split(","), line.split(","), strict=True))
    missing = {name for name, value in values.items() if value == "nan"}
    assert missing == {
        *("x_m", "y_m", "z_m", "battery_v", "telemetry_age_s"),
        *(f"motor{i}_rpm" for i in range(1, 5)),
        *(
            "thrust_cmd_n",
            "throttle_cmd",
            "roll_cmd_deg",
            "pitch_cmd_deg",
            "yaw_cmd_deg",
            "thrust_ratio",
            "compensator_trust",
        ),
        *("x_ref_m", "y_ref_m", "z_ref_m", "vx_ref_m_s", "vy_ref_m_s", "vz_ref_m_s"),
    }
    assert float(values["roll_deg"]) == pytest.approx(10.0)  # known although the position is not


# --- a file ----------------------------------------------------------------------------------------------------------


def test_every_tick_is_one_row_and_reads_back_with_its_values(tmp_path: Path) -> None:
    record = recorder(tmp_path)
    ticks = [
        tick(i, position_ned_m=(0.001 * i, -1.0 / (i + 1), -1.23456 * i))._replace(phase="up" if i < 60 else "a b")
        for i in range(100)
    ]
    for t in ticks:
        record(t)
    record.close("completed")
    assert record.problem is None
    log = read_log(record.path)
    assert log.notes == []
    assert list(log.columns) == HEADER.split(",")[:-1]
    for i, name in enumerate(HEADER.split(",")[:-1]):
        written = [float(row(t, 4)[i]) for t in ticks]
        np.testing.assert_allclose(log[name], written, rtol=1e-6, atol=1e-9, err_msg=name)
    assert log.phase is not None
    assert log.phase.tolist() == ["up"] * 60 + ["a b"] * 40
    assert log.meta["ended"] == "completed"


def test_a_simulated_flight_is_recorded_tick_by_tick(tmp_path: Path) -> None:
    plan = prepare_flight(ROOT / "missions" / "short_hop.yaml", ROOT / "config" / "flight.yaml", None, None)
    outcome = simulate(plan, tmp_path, None, seed=3)
    log = read_log(outcome.log)
    assert len(log) == outcome.ticks
    np.testing.assert_allclose(np.diff(log.time_s), 0.02, atol=1e-6)
    assert log.phase is not None
    flown = np.isin(log.phase, outcome.phases)
    assert outcome.phases == ["takeoff", "hover", "down"]
    error = np.sqrt(np.mean((log["z_m"] - log["z_ref_m"])[flown] ** 2))
    assert error == pytest.approx(outcome.tracking_rmse_m["up"], rel=1e-3)
    assert np.isfinite(log["motor4_rpm"]).all()
    meta = meta_of(Path(outcome.log))
    assert {"vehicle", "mission", "controller", "compensator", "model", "autopilot", "software", "started"} <= set(meta)
    assert (meta["mission"], meta["compensator"], meta["ended"]) == ("short_hop", "none", "completed")
    assert meta["vehicle"]["mass_kg"] == 1.5
    assert meta["controller"]["position_p"] == 0.8


class OneSecond(datetime):
    """A clock that stands still."""

    @classmethod
    def now(cls, tz: Any = None) -> "OneSecond":
        return cls(2024, 5, 6, 7, 8, 9, tzinfo=UTC)


def test_two_flights_of_the_same_second_do_not_write_over_each_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder_module, "datetime", OneSecond)
    records = [recorder(tmp_path) for _ in range(3)]
    for n, record in enumerate(records, 1):
        for i in range(n):
            record(tick(i))
    for n, record in enumerate(records, 1):
        record.close(f"flight {n}")
    names = ["20240506_070809_hop", "20240506_070809_hop_2", "20240506_070809_hop_3"]
    assert [r.path.stem for r in records] == names
    assert [len(r.path.read_text().splitlines()) for r in records] == [2, 3, 4]
    assert [meta_of(r.path)["ended"] for r in records] == ["flight 1", "flight 2", "flight 3"]
    assert len(list(tmp_path.iterdir())) == 6  # nothing else is left behind


def test_the_meta_file_says_that_a_flight_is_under_way_and_then_how_it_ended(tmp_path: Path) -> None:
    record = recorder(tmp_path)
    assert meta_of(record.path)["ended"] == "in flight"
    record.close("the battery is at 13.0 V: landed")
    meta = meta_of(record.path)
    assert meta["ended"] == "the battery is at 13.0 V: landed"
    assert (meta["mission"], meta["autopilot"]) == ("hop", "none")
    assert datetime.fromisoformat(meta["started"]).tzinfo is not None


# --- disks -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("below", ["file", "file/logs"])
def test_a_directory_that_cannot_be_written_is_said_before_the_flight(tmp_path: Path, below: str) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(FlightError, match=r"file(/logs)?: cannot be written for the flight log \(.+\)"):
        recorder(tmp_path / below)


def full(*_: object) -> NoReturn:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_disk_that_is_full_from_the_beginning_is_said_before_the_flight(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(FlightError, match=r"cannot be written for the flight log \(No space left on device\)"):
        recorder(tmp_path)


class FillingDisk:
    """A file on a disk that is full after some lines."""

    def __init__(self, file: Any, lines: int) -> None:
        self._file, self._lines = file, lines

    def write(self, text: str) -> int:
        self._lines -= text.count("\n")
        if self._lines < 0:
            full()
        written: int = self._file.write(text)
        return written

    def __enter__(self) -> "FillingDisk":
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)


@pytest.fixture
def filling(monkeypatch: pytest.MonkeyPatch) -> None:
    """The header and 99 rows still fit."""
    make = recorder_module._new_file

    def new_file(directory: Path, mission: str) -> tuple[Path, Any]:
        path, file = make(directory, mission)
        return path, FillingDisk(file, 100)

    monkeypatch.setattr(recorder_module, "_new_file", new_file)


@pytest.mark.usefixtures("filling")
def test_a_disk_that_fills_up_costs_the_rest_of_the_log_and_not_the_flight(tmp_path: Path) -> None:
    plan = prepare_flight(ROOT / "missions" / "short_hop.yaml", ROOT / "config" / "flight.yaml", None, None)
    outcome = simulate(plan, tmp_path, None, seed=0)
    assert outcome.completed
    assert outcome.ticks > 500
    assert outcome.problem == f"{outcome.log}: the log is incomplete (No space left on device)"
    assert outcome.problem in outcome.lines()
    assert [e["answer"] for e in meta_of(Path(outcome.log))["events"]] == ["land"]
    assert len(read_log(outcome.log)) == 99  # what was written is kept
    assert meta_of(Path(outcome.log))["ended"] == "completed"


@pytest.mark.usefixtures("filling")
def test_the_row_that_finds_the_disk_full_keeps_its_event(tmp_path: Path) -> None:
    record = recorder(tmp_path)
    for i in range(120):
        events = (Event(0.02 * i, "the tilt is 60 deg", "hand over"),) if i == 99 else ()
        record(tick(i)._replace(events=events))
    record.close("the tilt is 60 deg")
    assert [event["what"] for event in meta_of(record.path)["events"]] == ["the tilt is 60 deg"]


def test_a_row_that_cannot_be_written_costs_the_rest_of_the_log_and_not_the_flight(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A defect of ours must not end the thread with the queue filling up."""
    record = recorder(tmp_path)
    record(tick(0))
    monkeypatch.setattr(recorder_module, "row", lambda *_: 1 / 0)
    for i in range(1, 50):
        record(tick(i))
    record.close("completed")
    assert record.problem is not None
    assert "the log is incomplete (ZeroDivisionError" in record.problem
    assert record._queue.empty()


def test_a_disk_that_is_full_at_the_end_keeps_the_meta_file_of_the_beginning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    record = recorder(tmp_path)
    record(tick())
    monkeypatch.setattr(os, "fsync", full)
    record.close("completed")
    assert record.problem is not None
    assert "No space left on device" in record.problem
    assert meta_of(record.path)["ended"] == "in flight"
    assert {p.suffix for p in tmp_path.iterdir()} == {".csv", ".yaml"}


SMALL_DISK = """
import sys
from pathlib import Path
from tests.flight.record.test_recorder import Event, FlightError, recorder, tick, until

disk = Path(sys.argv[1])
record = recorder(disk)
filler = (disk / "filler").open("wb", buffering=0)
try:
    while filler.write(bytes(4096)):
        pass
except OSError:
    pass
for i in range(3000):
    record(tick(i)._replace(events=(Event(5.0, "the height is 9 m", "land"),) if i == 2990 else ()))
record.close("the height is 9 m")
print(record.problem)
print(record.meta_path.read_text())
print(sorted(path.suffix for path in disk.iterdir()))
"""


def test_on_a_disk_that_is_really_full_the_end_and_its_reason_are_written(tmp_path: Path) -> None:
    """Not by a limit of a file's size: no new file can be written there at all."""
    disk = f"mount -t tmpfs -o size=1m tmpfs {tmp_path}"
    if shutil.which("unshare") is None or subprocess.run(["unshare", "-rm", "sh", "-c", disk], check=False).returncode:
        pytest.skip("no file system can be mounted here")
    command = f'{disk} && exec {sys.executable} -c "$1" {tmp_path}'
    done = subprocess.run(
        ["unshare", "-rm", "sh", "-c", command, "sh", SMALL_DISK], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    problem, _, rest = done.stdout.partition("\n")
    meta, _, files = rest.strip().rpartition("\n")
    assert "the log is incomplete (No space left on device)" in problem
    assert yaml.safe_load(meta)["ended"] == "the height is 9 m"
    assert [event["answer"] for event in yaml.safe_load(meta)["events"]] == ["land"]
    assert files == "['', '.csv', '.yaml']"


def test_what_a_guard_answered_is_on_the_disk_before_the_flight_ends(tmp_path: Path) -> None:
    record = recorder(tmp_path)
    record(tick(0)._replace(events=(Event(1.23456, "the tilt is 60 deg", "hand over", "tilt", "tilt"),)))
    said = {"time_s": 1.235, "what": "the tilt is 60 deg", "answer": "hand over", "guard": "tilt", "kind": "tilt"}
    until(lambda: meta_of(record.path)["events"] == [said], "the event does not reach the disk")
    assert meta_of(record.path)["ended"] == "in flight"
    record.close("the tilt is 60 deg")
    assert meta_of(record.path)["events"] == [said]


# --- a process that is killed ----------------------------------------------------------------------------------------

KILLED = textwrap.dedent(
    """
    import os, signal, sys, time
    from pathlib import Path
    from tests.flight.record.test_recorder import recorder, tick
    record = recorder(Path({where!r}))
    began = time.monotonic()
    for i in range(100):
        time.sleep(0.02)
        record(tick()._replace(time_s=time.monotonic() - began))
    print(time.monotonic() - began, flush=True)
    {die}
    """
)


@pytest.mark.parametrize(("die", "status"), [("os._exit(3)", 3), ("os.kill(os.getpid(), signal.SIGKILL)", -9)])
def test_a_killed_process_loses_a_second_at_most(tmp_path: Path, die: str, status: int) -> None:
    code = KILLED.format(where=str(tmp_path), die=die)
    killed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=False)
    assert killed.returncode == status, killed.stderr
    (path,) = tmp_path.glob("*.csv")
    log = read_log(path)
    assert log.time_s[-1] > float(killed.stdout) - 1.0
    assert meta_of(path)["ended"] == "in flight"


def test_rows_reach_the_disk_although_no_more_follow(tmp_path: Path) -> None:
    record = recorder(tmp_path)
    for i in range(3):
        record(tick(i))
    until(lambda: len(record.path.read_text().splitlines()) == 4, "the rows stay in the buffer")
    record.close("completed")
