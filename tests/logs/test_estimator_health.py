"""An estimator's findings about its sensors and itself are read from both firmwares' logs."""

from pathlib import Path

import numpy as np
import pytest

from quadctl.logs.estimator_health import lane_switches, lost_fixes, rejections
from quadctl.logs.findings import Kind, of_kind
from quadctl.logs.read import read_log
from tests.support.log_files import Topic, small_dataflash, small_ulog

US = [5_000_000 + 20_000 * i for i in range(100)]
T = np.arange(0.0, 30.0, 0.1)


def test_a_sensor_that_is_rejected_for_long_is_told_and_one_outlier_is_not() -> None:
    height = np.where((T > 10.0) & (T < 14.0), 1.4, 0.2)
    velocity = np.where(np.abs(T - 20.0) < 0.3, 9.0, 0.2)
    (found,) = rejections(T, {"height": height, "velocity": velocity})
    assert (found.kind, found.figures["of"]) == (Kind.REJECTED, "height")
    assert found.times_s[0] == pytest.approx((10.1, 14.0), abs=0.11)


def test_a_gps_without_a_fix_is_lost_only_where_it_had_one() -> None:
    (lost,) = lost_fixes(T, np.where((T > 12.0) & (T < 17.0), 1.0, 4.0))
    assert lost.times_s[0] == pytest.approx((12.1, 17.0), abs=0.11)
    assert lost_fixes(T, np.zeros(len(T))) == []
    assert lost_fixes(T, np.where(T < 5.0, 0.0, 3.0)) == []


def test_the_core_that_flies_may_change() -> None:
    (switched,) = lane_switches(T, np.where(T < 9.0, 0.0, 2.0))
    assert switched.times_s[0][0] == pytest.approx(9.0, abs=0.11)


def test_ardupilot_tells_by_xkf4_gps_events_and_messages(tmp_path: Path) -> None:
    ratios = [(t, 1, 63, 1, 0.2, 0.1, 1.3 if i > 40 else 0.3) for i, t in enumerate(US)]
    path = tmp_path / "a.bin"
    path.write_bytes(
        small_dataflash(
            ("XKF4", "QBHbfff", "TimeUS,C,SS,PI,SV,SP,SH", ratios),
            ("GPS", "QBB", "TimeUS,I,Status", [(t, 0, 3 if i < 30 else 1) for i, t in enumerate(US)]),
            ("EV", "QB", "TimeUS,Id", [(US[20], 60), (US[50], 62)]),
            ("MSG", "QZ", "TimeUS,Message", [(US[70], b"EKF3 IMU0 MAG0 in-flight yaw alignment complete")]),
            without="XKF4",
        )
    )
    found = read_log(path).findings
    (rejected,), (lost,) = of_kind(found, Kind.REJECTED), of_kind(found, Kind.GPS_LOST)
    assert rejected.figures["of"] == "height" and rejected.times_s[0][0] == pytest.approx(0.82)
    assert lost.times_s[0][0] == pytest.approx(0.6)
    assert [(reset.figures["of"], [t for t, _ in reset.times_s]) for reset in of_kind(found, Kind.RESET)] == [
        ("height", [pytest.approx(0.4)]),
        ("heading", [pytest.approx(1.0), pytest.approx(1.4)]),
    ]


def test_the_state_is_that_of_the_core_that_flew_at_each_time(tmp_path: Path) -> None:
    """Core 0 up to 6 s, core 1, which stands 10 m further north, afterwards."""
    primary = [(t, c, 63, 0 if t < 6_000_000 else 1) for t in US for c in (0, 1)]
    path = tmp_path / "a.bin"
    path.write_bytes(small_dataflash(("XKF4", "QBHb", "TimeUS,C,SS,PI", primary), without="XKF4"))
    log = read_log(path)
    assert log["x_m"][10] == pytest.approx(0.01) and log["x_m"][-1] == pytest.approx(10.099)
    (switched,) = of_kind(log.findings, Kind.LANE_SWITCH)
    assert switched.times_s[0][0] == pytest.approx(1.0)


def test_px4_tells_by_estimator_status_gps_and_counters(tmp_path: Path) -> None:
    us = [1_000_000 + 20_000 * i for i in range(100)]
    path = tmp_path / "a.ulg"
    path.write_bytes(
        small_ulog(
            Topic(
                "estimator_status",
                "uint64_t timestamp;float pos_test_ratio;float vel_test_ratio;float hgt_test_ratio",
                [(t, 0.1, 2.0 if i < 60 else 0.1, 0.2) for i, t in enumerate(us)],
            ),
            Topic(
                "vehicle_gps_position",
                "uint64_t timestamp;uint8_t fix_type",
                [(t, 3 if i < 10 or i > 80 else 0) for i, t in enumerate(us)],
            ),
            Topic(
                "estimator_selector_status",
                "uint64_t timestamp;uint8_t primary_instance",
                [(t, int(i > 50)) for i, t in enumerate(us)],
            ),
        )
    )
    found = read_log(path).findings
    assert [one.figures["of"] for one in of_kind(found, Kind.REJECTED)] == ["velocity"]
    assert len(of_kind(found, Kind.GPS_LOST)) == len(of_kind(found, Kind.LANE_SWITCH)) == 1
    assert [reset.figures["of"] for reset in of_kind(found, Kind.RESET)] == ["height"]
