"""Attitude and heading as people write them: angles of another order, a course, a drift, a board that slips."""

from functools import reduce

import numpy as np
import pytest

from quadctl.frames import Quaternion, euler_from_quaternion, multiply, quaternion_from_euler
from quadctl.logs.findings import Kind, of_kind
from quadctl.logs.flight_log import ATTITUDE, RATES, VELOCITY, FlightLog
from quadctl.logs.record.record import examine
from tests.logs.record.conftest import having


def attitude_of(log: FlightLog) -> Quaternion:
    return quaternion_from_euler(*(np.radians(log[name]) for name in ATTITUDE))


def conjugate(q: Quaternion) -> Quaternion:
    return q[0], -q[1], -q[2], -q[3]


def angles_in_order(q: Quaternion, order: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angles about x, y and z whose turns in this intrinsic order make the attitude, by Newton's method."""
    angles = np.array(euler_from_quaternion(q))
    for _ in range(30):
        made = composed(angles, order)
        w, *vector = multiply(conjugate(made), q)
        left = 2.0 * np.sign(w) * np.array(vector)
        slope = np.empty((3, 3, angles.shape[1]))
        for axis in range(3):
            nudged = angles.copy()
            nudged[axis] += 1e-5
            _, *turned = multiply(conjugate(made), composed(nudged, order))
            slope[:, axis] = 2.0 * np.array(turned) / 1e-5
        angles += np.linalg.solve(slope.transpose(2, 0, 1), left.T[..., None])[..., 0].T
    x, y, z = angles
    return x, y, z


def composed(angles: np.ndarray, order: str) -> Quaternion:
    zero = np.zeros(angles.shape[1])
    each = {
        axis: quaternion_from_euler(*(angles[i] if i == j else zero for j in range(3))) for i, axis in enumerate("xyz")
    }
    return reduce(multiply, (each[axis] for axis in order.split("-")))


def with_angles(log: FlightLog, angles: tuple[np.ndarray, ...]) -> FlightLog:
    return having(log, **{name: np.degrees(values) for name, values in zip(ATTITUDE, angles, strict=True)})


def largest_difference_deg(log: FlightLog, other: FlightLog) -> float:
    w, *_ = multiply(attitude_of(log), conjugate(attitude_of(other)))
    return float(np.degrees(2.0 * np.arccos(np.clip(np.abs(w), 0.0, 1.0))).max())


@pytest.mark.parametrize("order", ["y-x-z", "x-y-z"])
def test_angles_in_another_order_are_read_in_it(excited: FlightLog, order: str) -> None:
    written = with_angles(excited, angles_in_order(attitude_of(excited), order))
    record = examine(written)
    (told,) = of_kind(record.findings, Kind.ATTITUDE_READ)
    assert told.figures["order"] == order
    assert largest_difference_deg(record.log, excited) < 0.5


def test_a_quaternion_from_the_world_to_the_body_is_turned_round(excited: FlightLog) -> None:
    record = examine(with_angles(excited, euler_from_quaternion(conjugate(attitude_of(excited)))))
    (told,) = of_kind(record.findings, Kind.ATTITUDE_READ)
    assert told.figures["order"] == "inverse"
    assert largest_difference_deg(record.log, excited) < 0.5


def course(log: FlightLog, least_m_s: float) -> np.ndarray:
    """Direction of the velocity, held while it is slow."""
    north, east = log[VELOCITY[0]], log[VELOCITY[1]]
    known = np.hypot(north, east) > least_m_s
    last = np.maximum.accumulate(np.where(known, np.arange(len(log)), np.argmax(known)))
    return np.degrees(np.arctan2(east, north))[last]


def test_a_course_over_the_ground_is_no_heading(excited: FlightLog) -> None:
    record = examine(having(excited, yaw_deg=course(excited, 0.2)))
    (told,) = of_kind(record.findings, Kind.NO_HEADING)
    assert told.figures["course"]
    flown = np.concatenate([(record.log.time_s > begin) & (record.log.time_s < end) for begin, end in record.usable])
    off = ((record.log["yaw_deg"] - excited["yaw_deg"] + 180.0) % 360.0 - 180.0)[flown[: len(excited)]]
    assert np.abs(off).max() < 4.0


def test_a_gyro_that_disagrees_on_every_axis_says_nothing_of_the_heading(excited: FlightLog) -> None:
    degrees_in_rad_s = {name: np.degrees(excited[name]) for name in RATES}
    assert not of_kind(examine(having(excited, **degrees_in_rad_s)).findings, Kind.NO_HEADING)


@pytest.mark.parametrize("deg_s", [-0.35, 0.12])
def test_a_heading_that_drifts_is_turned_back(runs: FlightLog, deg_s: float) -> None:
    heading = (runs["yaw_deg"] + deg_s * runs.time_s + 180.0) % 360.0 - 180.0
    rate = runs["yaw_rate_rad_s"] + np.radians(deg_s)
    record = examine(having(runs, yaw_deg=heading, yaw_rate_rad_s=rate))
    (told,) = of_kind(record.findings, Kind.HEADING_DRIFTS)
    assert told.figures["by_deg_s"] == pytest.approx(deg_s, abs=0.05)
    off = (record.log["yaw_deg"] - runs["yaw_deg"] + 180.0) % 360.0 - 180.0
    assert np.abs(off).max() < 3.0


@pytest.mark.parametrize(("roll_deg", "pitch_deg", "at_s"), [(3.0, -2.0, 110.0), (-1.0, 4.0, 75.0)])
def test_a_board_that_slips_costs_the_shorter_side(
    runs: FlightLog, roll_deg: float, pitch_deg: float, at_s: float
) -> None:
    after = runs.time_s > at_s
    slip = quaternion_from_euler(np.radians(roll_deg) * after, np.radians(pitch_deg) * after, 0.0 * after)
    record = examine(with_angles(runs, euler_from_quaternion(multiply(attitude_of(runs), slip))))
    (told,) = of_kind(record.findings, Kind.LEVEL_STEP)
    assert told.times_s[0][0] == pytest.approx(at_s, abs=1.0)
    assert (told.figures["roll_deg"], told.figures["pitch_deg"]) == (
        pytest.approx(roll_deg, abs=1.0),
        pytest.approx(pitch_deg, abs=1.0),
    )
    kept = 0.0 if at_s > 0.5 * runs.time_s[-1] else at_s
    assert all(end < at_s if kept == 0.0 else begin > at_s for begin, end in record.usable)
