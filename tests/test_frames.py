"""Frames and signs: NED, FRD, Hamilton quaternions body to world, ZYX Euler angles, roll right and nose up positive."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from quadctl.frames import (
    body_rates,
    euler_from_quaternion,
    euler_rates,
    multiply,
    ned_from_neu,
    quaternion_from_euler,
    rotate,
    rotate_inverse,
    tilt,
    wrap_pi,
)
from quadctl.numeric import clip, maximum

FORWARD, RIGHT, DOWN = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
NORTH, EAST, UP, SOUTH = FORWARD, RIGHT, (0.0, 0.0, -1.0), (-1.0, 0.0, 0.0)
QUARTER = math.pi / 2.0

angles = st.floats(-math.pi, math.pi)
pitches = st.floats(-1.55, 1.55)  # gimbal lock at +-pi/2 leaves roll and yaw undefined
components = st.floats(-100.0, 100.0)
vectors = st.tuples(components, components, components)


def test_level_and_heading_north_is_the_unit_quaternion() -> None:
    assert quaternion_from_euler(0.0, 0.0, 0.0) == (1.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("euler", "body", "world"),
    [
        ((QUARTER, 0.0, 0.0), RIGHT, DOWN),  # rolled right, the right arm points at the ground
        ((QUARTER, 0.0, 0.0), FORWARD, NORTH),
        ((0.0, QUARTER, 0.0), FORWARD, UP),  # nose up, the nose points at the sky
        ((0.0, QUARTER, 0.0), RIGHT, EAST),
        ((0.0, 0.0, QUARTER), FORWARD, EAST),  # yaw is clockwise seen from above
        ((0.0, 0.0, QUARTER), RIGHT, SOUTH),
        # ZYX: yaw first, then pitch about the new right axis: nose up, belly to where the nose pointed
        ((0.0, QUARTER, QUARTER), FORWARD, UP),
        ((0.0, QUARTER, QUARTER), DOWN, EAST),
        # yaw first, then roll about the new nose
        ((QUARTER, 0.0, QUARTER), FORWARD, EAST),
        ((QUARTER, 0.0, QUARTER), RIGHT, DOWN),
        ((QUARTER, 0.0, QUARTER), DOWN, NORTH),
    ],
)
def test_quarter_turns(
    euler: tuple[float, float, float], body: tuple[float, float, float], world: tuple[float, float, float]
) -> None:
    q = quaternion_from_euler(*euler)
    assert rotate(q, body) == pytest.approx(world, abs=1e-12)
    assert rotate_inverse(q, world) == pytest.approx(body, abs=1e-12)


def test_a_quaternion_by_hand() -> None:
    # Roll 90 deg: (cos 45, sin 45, 0, 0). Then a yaw of 90 deg, (cos 45, 0, 0, sin 45), in front of it:
    # (c, 0, 0, s)(c, s, 0, 0) = (cc, cs, s s, s c) = (1/2, 1/2, 1/2, 1/2).
    assert quaternion_from_euler(QUARTER, 0.0, 0.0) == pytest.approx((math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0))
    assert quaternion_from_euler(QUARTER, 0.0, QUARTER) == pytest.approx((0.5, 0.5, 0.5, 0.5))


def test_hamilton_product() -> None:
    i, j, k = (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0)
    assert multiply(i, j) == k
    assert multiply(j, i) == (0.0, 0.0, 0.0, -1.0)
    assert multiply(j, k) == i
    assert multiply(k, i) == j
    assert multiply(i, i) == (-1.0, 0.0, 0.0, 0.0)


@given(angles, pitches, angles)
def test_euler_angles_come_back(roll: float, pitch: float, yaw: float) -> None:
    back = euler_from_quaternion(quaternion_from_euler(roll, pitch, yaw))
    for wanted, got in zip((roll, pitch, yaw), back, strict=True):
        assert math.remainder(got - wanted, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)


@given(angles, angles, angles)
def test_the_negated_quaternion_is_the_same_attitude(roll: float, pitch: float, yaw: float) -> None:
    w, x, y, z = quaternion_from_euler(roll, pitch, yaw)
    assert rotate((-w, -x, -y, -z), (1.0, 2.0, 3.0)) == pytest.approx(rotate((w, x, y, z), (1.0, 2.0, 3.0)))


def test_pitch_of_a_rounded_quaternion_stays_a_number() -> None:
    _, pitch, _ = euler_from_quaternion((0.7071068, 0.0, 0.7071068, 0.0))  # 2(wy - zx) = 1.00000005
    assert pitch == pytest.approx(QUARTER)


@given(angles, angles, angles, vectors)
def test_rotation_keeps_length_and_its_inverse_undoes_it(
    roll: float, pitch: float, yaw: float, v: tuple[float, float, float]
) -> None:
    q = quaternion_from_euler(roll, pitch, yaw)
    world = rotate(q, v)
    assert math.hypot(*world) == pytest.approx(math.hypot(*v), abs=1e-9)
    assert rotate_inverse(q, world) == pytest.approx(v, abs=1e-9)


@given(st.tuples(angles, angles, angles), st.tuples(angles, angles, angles), vectors)
def test_product_rotates_by_the_right_factor_first(
    first: tuple[float, float, float], second: tuple[float, float, float], v: tuple[float, float, float]
) -> None:
    p, q = quaternion_from_euler(*second), quaternion_from_euler(*first)
    assert rotate(multiply(p, q), v) == pytest.approx(rotate(p, rotate(q, v)), abs=1e-9)


@given(angles, angles, angles, components)
def test_a_force_along_body_z_is_rotated_as_any_other(roll: float, pitch: float, yaw: float, fz: float) -> None:
    """It has a shorter way of its own, which arrays of zeros do not take."""
    q = quaternion_from_euler(roll, pitch, yaw)
    none = np.zeros(1)
    assert rotate(q, (0.0, 0.0, fz)) == pytest.approx([float(c[0]) for c in rotate(q, (none, none, fz))], abs=1e-10)


@given(angles, angles, angles, vectors)
def test_arrays_and_numbers_agree(roll: float, pitch: float, yaw: float, v: tuple[float, float, float]) -> None:
    q = quaternion_from_euler(roll, pitch, yaw)
    q_array = quaternion_from_euler(np.array([roll, 0.1]), np.array([pitch, 0.2]), np.array([yaw, 0.3]))
    v_array = tuple(np.array([component, 1.0]) for component in v)
    assert [c[0] for c in q_array] == pytest.approx(q, abs=1e-12)
    assert [c[0] for c in rotate(q_array, v_array)] == pytest.approx(rotate(q, v), abs=1e-9)  # type: ignore[arg-type]
    assert [c[1] for c in euler_from_quaternion(q_array)] == pytest.approx((0.1, 0.2, 0.3))


@pytest.mark.parametrize(
    ("roll_deg", "pitch_deg", "tilt_deg"),
    # cos(tilt) = cos(roll) cos(pitch): 60 and 60 deg give acos(1/4) = 75.5225 deg
    [(0.0, 0.0, 0.0), (30.0, 0.0, 30.0), (0.0, -30.0, 30.0), (60.0, 60.0, 75.5225), (180.0, 0.0, 180.0)],
)
def test_tilt_is_the_angle_between_body_down_and_down(roll_deg: float, pitch_deg: float, tilt_deg: float) -> None:
    q = quaternion_from_euler(math.radians(roll_deg), math.radians(pitch_deg), 1.0)
    assert math.degrees(tilt(q)) == pytest.approx(tilt_deg, abs=1e-4)


@given(st.floats(-1000.0, 1000.0))
def test_wrapped_angle_is_the_same_direction_within_half_a_turn(angle: float) -> None:
    wrapped = wrap_pi(angle)
    assert abs(wrapped) <= math.pi
    assert math.cos(wrapped - angle) == pytest.approx(1.0)


def test_altitude_in_files_is_up_and_down_inside() -> None:
    assert ned_from_neu((1.0, 2.0, 3.0)) == (1.0, 2.0, -3.0)


def test_limits_do_not_hide_a_missing_value() -> None:
    assert math.isnan(clip(math.nan, 0.0, 1.0))
    assert math.isnan(maximum(math.nan, 0.06))
    np.testing.assert_array_equal(clip(np.array([math.nan, 2.0, -2.0]), 0.0, 1.0), [math.nan, 1.0, 0.0])


def test_rates_of_the_body_and_of_its_angles_are_each_others_inverse() -> None:
    roll, pitch, rates = 0.4, -0.7, (0.3, -1.1, 2.0)
    assert body_rates(roll, pitch, *euler_rates(roll, pitch, *rates)) == pytest.approx(rates)
    # Nose up by 60 deg, turning about the vertical at 1 rad/s: -sin 60 about the body's x axis, cos 60 about its z.
    slopes = euler_rates(0.0, math.pi / 3.0, -math.sin(math.pi / 3.0), 0.0, math.cos(math.pi / 3.0))
    assert slopes == pytest.approx((0.0, 0.0, 1.0))
