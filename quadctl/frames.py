"""Frames: world NED (north, east, down), body FRD (forward, right, down), as in MAVLink.

Quaternions are Hamilton's, scalar first, and rotate body to world. Euler angles are ZYX: yaw, then pitch, then roll, in
radians; roll right and nose up are positive. Components are floats or arrays of shape (n,).
"""

import math
from typing import Any

from quadctl.numeric import Number, Vector, asin, atan2, clip, cos, sin

GRAVITY_M_S2 = 9.80665
"""Standard gravity, m/s^2."""

Quaternion = tuple[Number, Number, Number, Number]


def quaternion_from_euler(roll: Any, pitch: Any, yaw: Any) -> Quaternion:
    """Quaternion of ZYX Euler angles in radians."""
    cr, sr = cos(0.5 * roll), sin(0.5 * roll)
    cp, sp = cos(0.5 * pitch), sin(0.5 * pitch)
    cy, sy = cos(0.5 * yaw), sin(0.5 * yaw)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def euler_from_quaternion(q: Quaternion) -> Vector:
    """(roll, pitch, yaw) in radians; pitch in [-pi/2, pi/2]."""
    w, x, y, z = q
    roll = atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = asin(clip(2.0 * (w * y - z * x), -1.0, 1.0))
    yaw = atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return roll, pitch, yaw


def body_rates(roll: Any, pitch: Any, roll_slope: Any, pitch_slope: Any, yaw_slope: Any) -> Vector:
    """Body rates p, q, r (FRD) of ZYX Euler angles and their derivatives, radians and rad/s."""
    cr, sr, cp, sp = cos(roll), sin(roll), cos(pitch), sin(pitch)
    return (
        roll_slope - yaw_slope * sp,
        pitch_slope * cr + yaw_slope * sr * cp,
        -pitch_slope * sr + yaw_slope * cr * cp,
    )


def euler_rates(roll: Any, pitch: Any, p: Any, q: Any, r: Any) -> Vector:
    """Derivatives of ZYX Euler angles of body rates, radians and rad/s: the inverse of `body_rates`."""
    cr, sr, cp, sp = cos(roll), sin(roll), cos(pitch), sin(pitch)
    yaw_slope = (q * sr + r * cr) / cp
    return p + yaw_slope * sp, q * cr - r * sr, yaw_slope


def rotate(q: Quaternion, v: Vector) -> Vector:
    """Body vector `v` in world axes."""
    w, x, y, z = q
    vx, vy, vz = v
    if isinstance(vx, float) and vx == 0.0 and isinstance(vy, float) and vy == 0.0:  # along body z: half the work
        twice = 2.0 * vz
        return twice * (x * z + w * y), twice * (y * z - w * x), vz - twice * (x * x + y * y)
    # v + 2 w (r x v) + 2 r x (r x v), with r the vector part
    tx = 2.0 * (y * vz - z * vy)
    ty = 2.0 * (z * vx - x * vz)
    tz = 2.0 * (x * vy - y * vx)
    return (
        vx + w * tx + y * tz - z * ty,
        vy + w * ty + z * tx - x * tz,
        vz + w * tz + x * ty - y * tx,
    )


def rotate_inverse(q: Quaternion, v: Vector) -> Vector:
    """World vector `v` in body axes."""
    w, x, y, z = q
    return rotate((w, -x, -y, -z), v)


def multiply(p: Quaternion, q: Quaternion) -> Quaternion:
    """Hamilton product: first `q`, then `p`."""
    pw, px, py, pz = p
    qw, qx, qy, qz = q
    return (
        pw * qw - px * qx - py * qy - pz * qz,
        pw * qx + px * qw + py * qz - pz * qy,
        pw * qy - px * qz + py * qw + pz * qx,
        pw * qz + px * qy - py * qx + pz * qw,
    )


def tilt(q: Quaternion) -> float:
    """Angle between body z and the vertical, radians in [0, pi]. Scalars only."""
    return math.acos(min(max(cos_tilt(q), -1.0), 1.0))


def cos_tilt(q: Quaternion) -> Number:
    """Cosine of the angle between body z and the vertical."""
    _, x, y, _ = q
    return 1.0 - 2.0 * (x * x + y * y)


def wrap_pi(angle: float) -> float:
    """`angle` in [-pi, pi)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


def ned_from_neu(v: Vector) -> Vector:
    """(north, east, up), as in files, to (north, east, down). Its own inverse."""
    return v[0], v[1], -v[2]
