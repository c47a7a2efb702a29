"""A barometer that errs with the air speed leaves its error in the estimated height: it is told, and taken away."""

from dataclasses import replace

import numpy as np
import pytest

from quadctl.frames import quaternion_from_euler, rotate_inverse
from quadctl.logs.findings import Kind, of_kind, worded
from quadctl.logs.flight_log import ATTITUDE, IMU, VELOCITY, FlightLog, Floats
from quadctl.logs.record.record import examine
from tests.support.flights import flown_once

COEFFICIENTS = (1.1, 0.8, -0.7, 1.3)
"""Forward, backward, right, left; the flight reaches 1.5 m/s."""
LEANING = {"autopilot": "PX4", "parameters": {"EKF2_HGT_REF": 1.0, "EKF2_BARO_CTRL": 1.0}}


def pressure_error(log: FlightLog) -> Floats:
    attitude = quaternion_from_euler(*(np.radians(log[name]) for name in ATTITUDE))
    north, east, up = (log[name] for name in VELOCITY)
    forward, right, _ = rotate_inverse(attitude, (north, east, -up))
    ahead, astern, starboard, port = COEFFICIENTS
    along = np.where(forward > 0.0, ahead, astern) * forward**2
    return np.asarray(-(along + np.where(right > 0.0, starboard, port) * right**2) / 19.6)


def misled(log: FlightLog, frequency_rad_s: float, share: float = 1.0, read: Floats | None = None) -> FlightLog:
    """The log of an estimator that follows a barometer wrong by `read` with a lag: its height, and its climb rate."""
    read, x, v = share * pressure_error(log) if read is None else read, 0.0, 0.0
    height, climb = np.zeros((2, len(log)))
    for i, step_s in enumerate(np.diff(log.time_s), start=1):
        apart = read[i] - x
        v += step_s * frequency_rad_s**2 * apart
        x += step_s * (v + 1.4 * frequency_rad_s * apart)
        height[i], climb[i] = x, v
    columns = {**log.columns, "z_m": log["z_m"] + height, "vz_m_s": log["vz_m_s"] + climb}
    return replace(log, columns=columns, meta={**log.meta, **LEANING})


@pytest.mark.parametrize(("frequency_rad_s", "share"), [(2.5, 1.0), (8.0, 0.5)])
def test_the_accelerometer_tells_the_error_by_its_sides(
    excited: FlightLog, frequency_rad_s: float, share: float
) -> None:
    wrong = misled(excited, frequency_rad_s, share)
    record = examine(wrong)
    (told,) = of_kind(record.findings, Kind.HEIGHT_ERROR)
    assert told.figures["witness"] == "imu"
    for value, std, true in zip(told.figures["coefficients"], told.figures["std"], COEFFICIENTS, strict=True):
        assert value == pytest.approx(share * true, abs=3.0 * std + 0.1)
    before, after = (np.nanstd(log["vz_m_s"] - excited["vz_m_s"]) for log in (wrong, record.log))
    assert after < 0.5 * before
    assert "barometer" in worded(told) and "accelerometer" in worded(told)


def test_without_an_accelerometer_the_thrust_tells_it(excited: FlightLog) -> None:
    wrong = misled(excited, 8.0)
    wrong = replace(wrong, columns={name: own for name, own in wrong.columns.items() if name not in IMU})
    (told,) = of_kind(examine(wrong).findings, Kind.HEIGHT_ERROR)
    assert told.figures["witness"] == "thrust"
    assert np.sign(told.figures["coefficients"]).tolist() == np.sign(COEFFICIENTS).tolist()


def test_a_right_barometer_and_another_reference_of_the_height_are_left_as_they_are(excited: FlightLog) -> None:
    assert not of_kind(examine(replace(excited, meta={**excited.meta, **LEANING})).findings, Kind.HEIGHT_ERROR)
    by_vision = {"autopilot": "PX4", "parameters": {"EKF2_HGT_REF": 3.0, "EKF2_BARO_CTRL": 0.0}}
    elsewhere = replace(misled(excited, 2.5), meta={**excited.meta, **by_vision})
    assert not of_kind(examine(elsewhere).findings, Kind.HEIGHT_ERROR)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory, testrun_uid: str) -> FlightLog:
    where = tmp_path_factory.getbasetemp().parent / f"height-error-{testrun_uid}"
    drag = ("rotor_drag.linear", {"d_x": 0.7, "d_y": 0.7, "d_z": 0.0})
    return flown_once("barometer_runs", [drag], 11, where)


def near_ground(log: FlightLog, at_ground_m: float) -> FlightLog:
    """The log with a range finder, and with a barometer and an estimated height that err near the ground."""
    random = np.random.default_rng(5)
    read = at_ground_m * np.exp(-np.maximum(log["z_m"], 0.0) / 0.4)
    lean = np.cos(np.radians(log["roll_deg"])) * np.cos(np.radians(log["pitch_deg"]))
    wrong = misled(log, 1.0, read=read)
    baro = 31.0 + log["z_m"] + read + 0.08 * random.standard_normal(len(log))
    seen = log["z_m"] / lean + 0.02 * random.standard_normal(len(log))
    return replace(wrong, columns={**wrong.columns, "baro_m": baro, "range_m": seen})


@pytest.mark.parametrize("at_ground_m", [0.4, -0.4])
def test_a_range_finder_tells_the_error_near_the_ground(runs: FlightLog, at_ground_m: float) -> None:
    wrong = near_ground(runs, at_ground_m)
    record = examine(wrong)
    (told,) = of_kind(record.findings, Kind.HEIGHT_ERROR)
    assert told.figures["witness"] == "range finder" and "near the ground" in worded(told)
    before, after = (np.nanstd((log["z_m"] - runs["z_m"])[runs["z_m"] > 0.1]) for log in (wrong, record.log))
    assert after < 0.5 * before


def test_a_height_that_wanders_by_itself_is_no_error_of_the_barometer(runs: FlightLog) -> None:
    """Beside a range finder and a barometer that are right."""
    right = near_ground(runs, 0.0)
    apart = near_ground(runs, 0.4)["z_m"] - runs["z_m"]
    assert not of_kind(examine(right).findings, Kind.HEIGHT_ERROR)
    wandering = replace(right, columns={**right.columns, "z_m": right["z_m"] + apart})
    assert not of_kind(examine(wandering).findings, Kind.HEIGHT_ERROR)


def test_drag_of_a_vehicle_that_leans_is_no_error_of_the_height(runs: FlightLog) -> None:
    """Drag along the body's axes has a part along up, which goes with the speed times the lean."""
    assert not any(runs.has(name) for name in IMU)
    assert not of_kind(examine(misled(runs, 1.0, read=np.zeros(len(runs)))).findings, Kind.HEIGHT_ERROR)
