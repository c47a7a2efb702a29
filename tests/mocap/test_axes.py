"""Axes of any motion capture become NED/FRD, and axes that contradict the autopilot are told."""

import math
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from quadctl.frames import euler_from_quaternion, quaternion_from_euler, rotate
from quadctl.mocap.agreement import Motion, tilt_problem, yaw_problem
from quadctl.mocap.axes import FRAMES, to_ned
from quadctl.mocap.findings import Kind
from quadctl.state import Quat, Vec3
from quadctl.words import Fact, fact

SAME: Quat = (1.0, 0.0, 0.0, 0.0)
H = math.sqrt(0.5)


# A vehicle 1 m north, 2 m east and 3 m up, its nose to the east, its right side down by 90 degrees: where each of its
# axes (forward, right, down) points, north, east, down, is known without any formula.
FORWARD_RIGHT_DOWN = ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))


NORTH_EAST_DOWN = (1.0, 2.0, -3.0)


# What each system measures of the directions north, east and down, and calls the body's forward, right and down.
WORLD: dict[str, Callable[[Vec3], Vec3]] = {
    "nwu": lambda v: (v[0], -v[1], -v[2]),
    "enu": lambda v: (v[1], v[0], -v[2]),
    "y_up": lambda v: (v[0], -v[2], v[1]),
    "ned": lambda v: v,
}


BODY: dict[str, Callable[[Vec3], Vec3]] = {**WORLD, "enu": WORLD["nwu"]}


def quaternion_of(columns: tuple[Vec3, Vec3, Vec3]) -> Quat:
    """Quaternion of the rotation that brings x, y, z to `columns`, by Shepperd's method where w is the largest."""
    (a, b, c), (d, e, f), (g, h, i) = columns
    values = [1 + a + e + i, 1 + a - e - i, 1 - a + e - i, 1 - a - e + i]
    largest = max(range(4), key=lambda n: values[n])
    s = 2.0 * math.sqrt(values[largest])
    rows: list[Quat] = [
        (s / 4, (f - h) / s, (g - c) / s, (b - d) / s),
        ((f - h) / s, s / 4, (b + d) / s, (g + c) / s),
        ((g - c) / s, (b + d) / s, s / 4, (f + h) / s),
        ((b - d) / s, (g + c) / s, (f + h) / s, s / 4),
    ]
    return rows[largest]


def as_measured(frame: str, axes: tuple[Vec3, Vec3, Vec3]) -> Quat:
    """The quaternion that a system with such axes gives a vehicle whose forward, right, down point so in NED."""
    basis: list[Vec3] = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
    places = [BODY[frame](unit) for unit in basis]  # of forward, right, down among the system's body axes
    columns = []
    for axis in range(3):
        column = (0.0, 0.0, 0.0)
        for place, world in zip(places, axes, strict=True):
            seen = WORLD[frame](world)
            column = tuple(c + place[axis] * s for c, s in zip(column, seen, strict=True))
        columns.append(column)
    return quaternion_of((columns[0], columns[1], columns[2]))


@pytest.mark.parametrize("frame", FRAMES)
def test_a_known_place_and_attitude_comes_out_of_every_frame(frame: str) -> None:
    position, attitude = to_ned(WORLD[frame](NORTH_EAST_DOWN), as_measured(frame, FORWARD_RIGHT_DOWN), FRAMES[frame])
    assert position == pytest.approx(NORTH_EAST_DOWN)
    for unit, points_to in zip(((1, 0, 0), (0, 1, 0), (0, 0, 1)), FORWARD_RIGHT_DOWN, strict=True):
        assert rotate(attitude, unit) == pytest.approx(points_to, abs=1e-12)


ANGLE = st.floats(-1.4, 1.4)


@given(ANGLE, ANGLE, ANGLE, st.sampled_from(sorted(FRAMES)))
def test_any_attitude_comes_out_of_every_frame(roll: float, pitch: float, yaw: float, frame: str) -> None:
    wanted = quaternion_from_euler(roll, pitch, yaw)
    axes = (rotate(wanted, (1, 0, 0)), rotate(wanted, (0, 1, 0)), rotate(wanted, (0, 0, 1)))
    _, attitude = to_ned((0.0, 0.0, 0.0), as_measured(frame, axes), FRAMES[frame])
    assert euler_from_quaternion(attitude) == pytest.approx((roll, pitch, yaw), abs=1e-6)


def test_the_yaw_option_turns_place_and_heading() -> None:
    position, attitude = to_ned((1.0, 0.0, 0.0), SAME, FRAMES["nwu"], math.radians(90.0))
    assert position == pytest.approx((0.0, 1.0, 0.0))
    assert euler_from_quaternion(attitude) == pytest.approx((0.0, 0.0, math.radians(90.0)))


def tilted_off(told: Fact | None) -> tuple[int, str | None]:
    """Angle, degrees, between the verticals, and the frame that would fit."""
    assert told is not None
    assert told.kind is Kind.TILTED
    return round(told.facts["off_deg"]), told.facts["best"]


def test_swapped_axes_are_named_with_the_frame_that_would_fit() -> None:
    tilted = quaternion_from_euler(math.radians(5.0), 0.0, 2.0)
    assert tilt_problem(as_measured("nwu", ((1, 0, 0), (0, 1, 0), (0, 0, 1))), "nwu", tilted) is None
    level_y_up = (H, H, 0.0, 0.0)  # z-up axes turned so that y is up: what nwu reads as a vehicle on its side
    assert tilted_off(tilt_problem(level_y_up, "nwu", SAME)) == (90, None)
    upside_down = as_measured("ned", ((1, 0, 0), (0, -1, 0), (0, 0, -1)))
    assert tilted_off(tilt_problem(upside_down, "ned", SAME)) == (180, None)


def test_a_rolled_vehicle_tells_swapped_body_axes() -> None:
    rolled, pitched = quaternion_from_euler(0.5, 0.0, 0.0), quaternion_from_euler(0.0, 0.5, 0.0)
    assert tilt_problem(rolled, "ned", rolled) is None
    assert tilted_off(tilt_problem(pitched, "ned", rolled)) == (pytest.approx(40, abs=5), None)


def test_a_heading_that_is_far_off_is_told_with_the_option_that_mends_it() -> None:
    ours, theirs = quaternion_from_euler(0.0, 0.0, 3.0), quaternion_from_euler(0.0, 0.0, -1.5)
    assert yaw_problem(ours, quaternion_from_euler(0.0, 0.0, -3.0)) is None
    off_deg = math.degrees(-4.5 + 2 * math.pi)
    assert yaw_problem(ours, theirs) == fact(Kind.HEADING_OFF, off_deg=pytest.approx(off_deg))


def test_motion_in_another_direction_than_the_autopilots_is_told_once_per_half_metre() -> None:
    motion = Motion()
    origin = (0.0, 0.0, 0.0)
    assert motion.problem(origin, origin) is None
    assert motion.problem((0.4, 0.0, 0.0), (0.0, 0.4, 0.0)) is None
    told = motion.problem((0.6, 0, 0), (0, -0.6, 0))
    assert told == fact(Kind.MOVES_OTHERWISE, by_poses=(0, False), by_autopilot=(1, True))
    assert motion.problem((0.7, 0, 0), (0, -0.7, 0)) is None
    assert motion.problem((1.4, 0, 0), (0.7, -0.5, 0)) is None
