"""A sound flight, to which the tests of the record do what happens to records."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from quadctl.frames import GRAVITY_M_S2, quaternion_from_euler, rotate_inverse
from quadctl.logs.flight_log import ATTITUDE, IMU, VELOCITY, FlightLog
from tests.support.flights import flown_once

Change = Callable[[FlightLog], FlightLog]
AIR = {"d_x": 0.25, "d_y": 0.25, "d_z": 0.25}
DRAG = ("rotor_drag.linear", {"d_x": 0.4, "d_y": 0.3, "d_z": 0.0})


@pytest.fixture(scope="session")
def excited(tmp_path_factory: pytest.TempPathFactory, testrun_uid: str) -> FlightLog:
    """Everything moves, with an accelerometer of 0.3 m/s^2 noise per row, at a heading of 40 degrees."""
    where = tmp_path_factory.getbasetemp().parent / f"records-{testrun_uid}"
    return turned(with_imu(flown_once("excitation", [DRAG], 4, where)), 40.0)


@pytest.fixture(scope="session")
def in_wind(tmp_path_factory: pytest.TempPathFactory, testrun_uid: str) -> FlightLog:
    """Everything moves, in a wind of 5 m/s from north-east."""
    where = tmp_path_factory.getbasetemp().parent / f"records-{testrun_uid}"
    wind = ("wind.steady", {"north_m_s": -4.0, "east_m_s": -3.0, "drag": 0.0})
    frame = ("body_drag.quadratic", {"area_x_m2": 0.06, "area_y_m2": 0.06, "area_z_m2": 0.06})
    return turned(flown_once("excitation", [("rotor_drag.linear", AIR), frame, wind], 7, where), 40.0)


@pytest.fixture(scope="session")
def hovering(tmp_path_factory: pytest.TempPathFactory, testrun_uid: str) -> FlightLog:
    """A staircase of hovers, which tells nothing of the heading."""
    where = tmp_path_factory.getbasetemp().parent / f"records-{testrun_uid}"
    return flown_once("hover_staircase", [DRAG], 5, where)


@pytest.fixture(scope="session")
def runs(tmp_path_factory: pytest.TempPathFactory, testrun_uid: str) -> FlightLog:
    """Runs along one line at several headings, for longer than a heading needs to drift."""
    where = tmp_path_factory.getbasetemp().parent / f"records-{testrun_uid}"
    return turned(flown_once("headings", [DRAG], 6, where), 40.0)


def with_imu(log: FlightLog, noise_m_s2: float = 0.3) -> FlightLog:
    """The log with an accelerometer that measures what the velocity says."""
    t = log.time_s
    north, east, up = (np.gradient(np.interp(t, t[log.updates(n)], log[n][log.updates(n)]), t) for n in VELOCITY)
    attitude = quaternion_from_euler(*(np.radians(log[name]) for name in ATTITUDE))
    body = rotate_inverse(attitude, (north, east, -(up + GRAVITY_M_S2)))
    random = np.random.default_rng(7)
    imu = {name: np.asarray(v) + noise_m_s2 * random.standard_normal(len(t)) for name, v in zip(IMU, body, strict=True)}
    return replace(log, columns={**log.columns, **imu})


def turned(log: FlightLog, degrees: float) -> FlightLog:
    """The same flight in a world that is turned about the vertical."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    columns = dict(log.columns)
    pairs = (("x_m", "y_m"), ("vx_m_s", "vy_m_s"), ("x_ref_m", "y_ref_m"), ("vx_ref_m_s", "vy_ref_m_s"))
    for north, east in (pair for pair in pairs if pair[0] in columns):
        columns[north], columns[east] = c * log[north] - s * log[east], s * log[north] + c * log[east]
    for name in ("yaw_deg", "yaw_cmd_deg"):
        columns[name] = (log[name] + degrees + 180.0) % 360.0 - 180.0
    return replace(log, columns=columns)


def having(log: FlightLog, **columns: np.ndarray) -> FlightLog:
    return replace(log, columns={**log.columns, **columns})


def added(log: FlightLog, name: str, what: np.ndarray | float) -> FlightLog:
    return having(log, **{name: log[name] + what})
