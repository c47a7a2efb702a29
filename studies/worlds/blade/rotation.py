"""Quaternions (w, x, y, z), Hamilton, body to world, for arrays of any leading shape."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


def multiply(p: Array, q: Array) -> Array:
    """Product p q: the rotation q, then p."""
    pw, px, py, pz = np.moveaxis(p, -1, 0)
    qw, qx, qy, qz = np.moveaxis(q, -1, 0)
    return np.stack(
        [
            pw * qw - px * qx - py * qy - pz * qz,
            pw * qx + px * qw + py * qz - pz * qy,
            pw * qy - px * qz + py * qw + pz * qx,
            pw * qz + px * qy - py * qx + pz * qw,
        ],
        axis=-1,
    )


def conjugate(q: Array) -> Array:
    """Inverse of unit quaternions."""
    inverse: Array = q * np.array([1.0, -1.0, -1.0, -1.0])
    return inverse


def from_vector(v: Array) -> Array:
    """Rotation by the vector v: its direction is the axis, its length the angle in radians."""
    half = 0.5 * np.sqrt((v * v).sum(-1, keepdims=True))
    return np.concatenate([np.cos(half), 0.5 * np.sinc(half / np.pi) * v], axis=-1)


def to_vector(q: Array) -> Array:
    """Rotation vector of at most half a turn."""
    q = np.where(q[..., :1] < 0, -q, q)
    length = np.sqrt((q[..., 1:] ** 2).sum(-1, keepdims=True))
    angle = 2.0 * np.arctan2(length, q[..., :1])
    return np.where(length > 1e-9, angle / np.maximum(length, 1e-9), 2.0) * q[..., 1:]


def matrix(q: Array) -> Array:
    """Rotation matrices, body to world."""
    w, x, y, z = np.moveaxis(q, -1, 0)
    out = np.empty((*q.shape[:-1], 3, 3))
    out[..., 0, 0] = 1 - 2 * (y * y + z * z)
    out[..., 0, 1] = 2 * (x * y - w * z)
    out[..., 0, 2] = 2 * (x * z + w * y)
    out[..., 1, 0] = 2 * (x * y + w * z)
    out[..., 1, 1] = 1 - 2 * (x * x + z * z)
    out[..., 1, 2] = 2 * (y * z - w * x)
    out[..., 2, 0] = 2 * (x * z - w * y)
    out[..., 2, 1] = 2 * (y * z + w * x)
    out[..., 2, 2] = 1 - 2 * (x * x + y * y)
    return out


def rotate(m: Array, v: Array) -> Array:
    """Vectors v in the frame that the matrices m lead to."""
    return (m @ v[..., None])[..., 0]


def rotate_back(m: Array, v: Array) -> Array:
    """Vectors v by the transposed matrices."""
    return (v[..., None, :] @ m)[..., 0, :]


def cross(a: Array, b: Array) -> Array:
    """Cross product, leaner than numpy's."""
    ax, ay, az = np.moveaxis(a, -1, 0)
    bx, by, bz = np.moveaxis(b, -1, 0)
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


def skew(v: Array) -> Array:
    """Matrices of the cross product with v."""
    out = np.zeros((*v.shape, 3))
    out[..., 0, 1], out[..., 0, 2] = -v[..., 2], v[..., 1]
    out[..., 1, 0], out[..., 1, 2] = v[..., 2], -v[..., 0]
    out[..., 2, 0], out[..., 2, 1] = -v[..., 1], v[..., 0]
    return out


def euler(q: Array) -> Array:
    """Roll, pitch, yaw in radians (ZYX)."""
    w, x, y, z = np.moveaxis(q, -1, 0)
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2 * (w * y - z * x), -1.0, 1.0))
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return np.stack([roll, pitch, yaw], axis=-1)


def from_axes(z_body: Array, yaw: Array) -> Array:
    """Attitude whose third body axis is z_body and whose heading is yaw (Faessler et al. 2018, section III)."""
    y_course = np.stack([-np.sin(yaw), np.cos(yaw), np.zeros_like(yaw)], axis=-1)
    x_body = cross(y_course, z_body)
    x_body = x_body / np.sqrt((x_body**2).sum(-1, keepdims=True))
    y_body = cross(z_body, x_body)
    return from_matrix(np.stack([x_body, y_body, z_body], axis=-1))


def from_matrix(m: Array) -> Array:
    """Quaternion of rotation matrices that are less than half a turn about one axis from upright."""
    trace = m[..., 0, 0] + m[..., 1, 1] + m[..., 2, 2]
    diagonal = np.stack([trace, m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]], axis=-1)
    size = np.sqrt(np.maximum(1 + 2 * diagonal - trace[..., None], 0.0)) / 2  # |w|, |x|, |y|, |z|
    size[..., 0] = np.sqrt(np.maximum(1 + trace, 0.0)) / 2
    x = np.copysign(size[..., 1], m[..., 2, 1] - m[..., 1, 2])
    y = np.copysign(size[..., 2], m[..., 0, 2] - m[..., 2, 0])
    z = np.copysign(size[..., 3], m[..., 1, 0] - m[..., 0, 1])
    q = np.stack([size[..., 0], x, y, z], axis=-1)
    # Half a turn about the vertical leaves the signs of x and y open to rounding; the sums settle them.
    flat = size[..., 0] < 1e-3
    if np.any(flat):
        q[flat, 1] = (m[flat, 0, 2] + m[flat, 2, 0]) / (4 * q[flat, 3])
        q[flat, 2] = (m[flat, 1, 2] + m[flat, 2, 1]) / (4 * q[flat, 3])
    unit: Array = q / np.sqrt((q * q).sum(-1, keepdims=True))
    return unit
