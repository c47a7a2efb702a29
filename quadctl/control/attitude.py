"""Attitude and thrust from the wanted force: pure functions."""

import math

from quadctl.allocation import Allocation
from quadctl.frames import rotate, rotate_inverse
from quadctl.state import Quat, Vec3

UPRIGHT: Quat = (1.0, 0.0, 0.0, 0.0)


def attitude_for_force(force_ned: Vec3, yaw_rad: float) -> Quat:
    """Attitude whose thrust axis (-z body) points along `force_ned`, heading `yaw_rad`.

    The body z axis is fixed by the force; of the rotations that leave it there, the one is taken whose x axis lies in
    the vertical plane of the heading (PX4's bodyzToAttitude, Faessler et al. 2018 eq. 8-12). A force of zero length
    gives the level attitude.
    """
    fx, fy, fz = force_ned
    length = math.sqrt(fx * fx + fy * fy + fz * fz)
    if length < 1e-9:
        return (math.cos(0.5 * yaw_rad), 0.0, 0.0, math.sin(0.5 * yaw_rad))
    zx, zy, zz = -fx / length, -fy / length, -fz / length
    # x body is perpendicular to z body and to the horizontal vector that points right of the heading
    rx, ry = -math.sin(yaw_rad), math.cos(yaw_rad)
    xx, xy, xz = ry * zz, -rx * zz, rx * zy - ry * zx
    norm = math.sqrt(xx * xx + xy * xy + xz * xz)
    if norm < 1e-9:  # thrust points straight to the side: the heading is undefined, any x will do
        xx, xy, xz, norm = math.cos(yaw_rad), math.sin(yaw_rad), 0.0, 1.0
    if zz < 0.0:  # upside down: keep the nose to the front
        norm = -norm
    xx, xy, xz = xx / norm, xy / norm, xz / norm
    yx, yy, yz = zy * xz - zz * xy, zz * xx - zx * xz, zx * xy - zy * xx
    return _quaternion_from_axes((xx, xy, xz), (yx, yy, yz), (zx, zy, zz))


def limit_tilt(force_ned: Vec3, max_tilt_rad: float) -> Vec3:
    """`force_ned` with its horizontal part shortened to lean at most `max_tilt_rad` from up; never pointing down."""
    fx, fy, fz = force_ned
    up = max(0.0, -fz)
    length, longest = math.hypot(fx, fy), math.tan(max_tilt_rad) * up
    shrink = longest / length if length > longest else 1.0
    return shrink * fx, shrink * fy, -up


def thrust_along_body(force_ned: Vec3, attitude: Quat) -> float:
    """Thrust, N, >= 0, along the present body axis for the wanted force, to which the vehicle has not yet turned.

    Projection on the present body axis (Faessler et al. 2018, eq. 13): while the attitude lags, thrust that would push
    the wrong way is not given.
    """
    axis = rotate(attitude, (0.0, 0.0, -1.0))
    along: float = force_ned[0] * axis[0] + force_ned[1] * axis[1] + force_ned[2] * axis[2]
    return max(0.0, along)


def upright_axis(force_ned: Vec3, allocation: Allocation) -> Vec3:
    """Direction of the thrust axis, NED, closest to up, from which the rotors hold `force_ned` without a moment.

    Straight up while the lateral part of the force is within their reach; what is beyond makes it lean, continuously.
    """
    fx, fy, fz = force_ned
    side = math.hypot(fx, fy)
    lean = math.atan2(side, -fz) - allocation.widest_angle_rad(math.hypot(side, fz))
    if lean <= 0.0:
        return 0.0, 0.0, -1.0
    return math.sin(lean) * fx / side, math.sin(lean) * fy / side, -math.cos(lean)


def lateral_in_body(force_ned: Vec3, attitude: Quat, allocation: Allocation) -> tuple[float, float]:
    """Lateral force, N, forward and right in the present body, as far as the rotors reach beside the thrust."""
    forward, right, down = rotate_inverse(attitude, force_ned)
    length, longest = math.hypot(forward, right), allocation.lateral_reach_n(max(0.0, -down))
    shrink = longest / length if length > longest else 1.0
    return shrink * forward, shrink * right


def _quaternion_from_axes(x: Vec3, y: Vec3, z: Vec3) -> Quat:
    """Quaternion of the rotation whose columns are the body axes in world coordinates (Shepperd's method)."""
    trace = x[0] + y[1] + z[2]
    if trace > 0.0:
        s = 2.0 * math.sqrt(1.0 + trace)
        return 0.25 * s, (y[2] - z[1]) / s, (z[0] - x[2]) / s, (x[1] - y[0]) / s
    if x[0] >= y[1] and x[0] >= z[2]:
        s = 2.0 * math.sqrt(1.0 + x[0] - y[1] - z[2])
        return (y[2] - z[1]) / s, 0.25 * s, (y[0] + x[1]) / s, (z[0] + x[2]) / s
    if y[1] >= z[2]:
        s = 2.0 * math.sqrt(1.0 + y[1] - x[0] - z[2])
        return (z[0] - x[2]) / s, (y[0] + x[1]) / s, 0.25 * s, (z[1] + y[2]) / s
    s = 2.0 * math.sqrt(1.0 + z[2] - x[0] - y[1])
    return (x[1] - y[0]) / s, (z[0] + x[2]) / s, (z[1] + y[2]) / s, 0.25 * s
