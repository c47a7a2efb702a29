"""Each part of a log is converted with the parameters that held then, and a change of one is told with its time."""

from pathlib import Path

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from quadctl.logs.ardupilot import motor_of_servo, motors_of_frame
from quadctl.logs.findings import Kind, of_kind
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.parameter_history import ParameterHistory
from quadctl.logs.read import read_log
from quadctl.logs.ulog import log_of_instances
from tests.support.log_files import small_dataflash, telemetry, tlog_bytes

US = [5_000_000 + 20_000 * i for i in range(100)]


def changes(log: FlightLog) -> dict[str, tuple[float, float, float]]:
    """Time, value before and after of each change that is told."""
    found = of_kind(log.findings, Kind.PARAMETER_CHANGED)
    return {f.figures["name"]: (f.times_s[0][0], f.figures["before"], f.figures["after"]) for f in found}


def test_the_first_value_holds_from_the_begin_and_each_change_from_its_time() -> None:
    history = ParameterHistory([(3.0, "A", 1.0), (5.0, "B", 7.0), (8.0, "A", 2.0), (9.0, "A", 2.0)], {"B": 6.0})
    assert [history.at(time) for time in (0.0, 5.0, 8.5)] == [
        {"B": 6.0, "A": 1.0},
        {"B": 7.0, "A": 1.0},
        {"B": 7.0, "A": 2.0},
    ]
    assert history.last == {"A": 2.0, "B": 7.0}
    assert [tuple(change) for change in history.changes()] == [(5.0, "B", 6.0, 7.0), (8.0, "A", 1.0, 2.0)]
    assert [(p.begin_s, p.end_s) for p in history.periods(["A"])] == [(-np.inf, 8.0), (8.0, np.inf)]


def test_outputs_of_ardupilot_before_and_after_a_change(tmp_path: Path) -> None:
    """1300 us of 1100 to 1900 are a quarter; of 1000 to 2000 from 6 s on, three tenths."""
    values = [(US[0], b"MOT_PWM_MIN", 1100.0), (US[0], b"MOT_PWM_MAX", 1900.0), (US[0], b"SERVO2_FUNCTION", 33.0)]
    values += [(US[0], b"SERVO1_FUNCTION", 34.0), (US[0], b"SERVO3_FUNCTION", 0.0)]
    values += [(6_000_000, b"MOT_PWM_MIN", 1000.0), (6_000_000, b"MOT_PWM_MAX", 2000.0)]
    path = tmp_path / "a.bin"
    path.write_bytes(small_dataflash(("PARM", "QNf", "TimeUS,Name,Value", values), without="PARM"))
    log = read_log(path)
    before = log.time_s < 0.99
    assert log["motor1_output"][before] == pytest.approx(0.25)
    assert log["motor1_output"][~before][1:] == pytest.approx(0.3)
    assert changes(log) == {
        "MOT_PWM_MIN": (pytest.approx(1.0), 1100.0, 1000.0),
        "MOT_PWM_MAX": (pytest.approx(1.0), 1900.0, 2000.0),
    }


def test_outputs_of_px4_before_and_after_a_change() -> None:
    """Half of the range is half of the thrust, and with THR_MDL_FAC 0.8 three tenths."""
    stamp = np.arange(1_000_000, 3_000_000, 20_000)
    still = {name: np.zeros(len(stamp)) for name in ("x", "y", "z", "vx", "vy", "vz")}
    turn = {"q[0]": np.ones(len(stamp)), **{f"q[{i}]": np.zeros(len(stamp)) for i in (1, 2, 3)}}
    pulses = {f"output[{i}]": 1500.0 + 1e-3 * (np.arange(len(stamp)) % 2) for i in range(4)}
    pulses |= {f"output[{i}]": np.zeros(len(stamp)) for i in range(4, 12)}
    known = {"MAV_TYPE": 2.0, "PWM_MAIN_MIN": 1000.0, "PWM_MAIN_MAX": 2000.0, "THR_MDL_FAC": 0.0}
    instances = [
        (name, {"timestamp": stamp, **fields})
        for name, fields in (
            ("vehicle_local_position", still),
            ("vehicle_attitude", turn),
            ("actuator_outputs", pulses),
        )
    ]
    history = ParameterHistory([(2.0, "THR_MDL_FAC", 0.8)], known)
    log = log_of_instances(Path("a.ulg"), instances, history, None, [], [])
    assert log["motor2_output"][log.time_s < 0.99] == pytest.approx(0.5, abs=1e-4)
    assert log["motor2_output"][log.time_s > 1.01] == pytest.approx(0.2 * 0.5 + 0.8 * 0.25, abs=1e-4)
    assert changes(log) == {"THR_MDL_FAC": (pytest.approx(1.0), 0.0, 0.8)}


def test_a_telemetry_log_tells_a_change_too(tmp_path: Path) -> None:
    records = telemetry()
    middle = len(records) // 2
    values = [(0, 0.0), (middle, 0.15)]
    for place, value in reversed(values):
        message = mavlink.MAVLink_param_value_message(b"MOT_SPIN_MIN", value, 9, 1, 0)
        records.insert(place, (records[place][0], message))
    path = tmp_path / "a.tlog"
    path.write_bytes(tlog_bytes(records))
    assert changes(read_log(path))["MOT_SPIN_MIN"][1:] == (0.0, pytest.approx(0.15))


@pytest.mark.parametrize(
    ("parameters", "texts", "motors"),
    [
        ({"FRAME_CLASS": 2.0}, [], 6),
        ({"FRAME_CLASS": 5.0}, ["Frame: QUAD"], 6),
        ({"FRAME": 1.0}, ["APM:Copter V3.4.4", "Frame: QUAD"], 4),
        ({}, ["Frame: OCTA_QUAD/X"], 8),
        ({}, ["EKF2 IMU0 initial yaw alignment"], None),
    ],
)
def test_the_frame_says_how_many_motors_there_are(
    parameters: dict[str, float], texts: list[str], motors: int | None
) -> None:
    assert motors_of_frame(parameters, texts) == motors


@pytest.mark.parametrize(
    ("servo", "parameters", "n_motors", "motor"),
    [
        (8, {"RC8_FUNCTION": 7.0}, None, None),  # a camera mount
        (3, {"RC3_FUNCTION": 0.0}, 4, 3),
        (5, {}, 4, None),
        (5, {}, None, 5),
        (9, {"SERVO9_FUNCTION": 33.0}, 4, 1),
        (2, {"SERVO2_FUNCTION": 7.0}, 4, None),
    ],
)
def test_a_channel_is_a_motor_by_its_function_or_its_place(
    servo: int, parameters: dict[str, float], n_motors: int | None, motor: int | None
) -> None:
    assert motor_of_servo(servo, parameters, n_motors) == motor


def test_a_channel_that_never_changes_is_no_motor(tmp_path: Path) -> None:
    """Without a word on the functions of the outputs: a servo that holds its middle beside motors that work."""

    def rcou(c4: int) -> bytes:
        rows = [(t, 1500 + i % 7, 1400 + i % 5, 1450 + i % 3, c4) for i, t in enumerate(US)]
        parameters = [(US[0], b"MOT_PWM_MIN", 1000.0), (US[0], b"MOT_PWM_MAX", 2000.0)]
        return small_dataflash(
            ("RCOU", "QHHHH", "TimeUS,C1,C2,C3,C4", rows),
            ("PARM", "QNf", "TimeUS,Name,Value", parameters),
            without="RCOU",
        )

    path = tmp_path / "a.bin"
    path.write_bytes(rcou(1500).replace(b"SERVO", b"XERVO"))
    assert [name for name in read_log(path).columns if name.endswith("_output")] == [
        f"motor{i}_output" for i in (1, 2, 3)
    ]
