"""Unit quaternions (w, x, y, z), Hamilton, body to world, one in each row of an array."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[Any]


# The scalar's place is changed here: SciPy's `scalar_first` takes several times as long for few rows.
def _of(q: Array) -> Rotation:
    return Rotation.from_quat(q[..., [1, 2, 3, 0]])


def _quaternion(rotation: Rotation) -> Array:
    q: Array = rotation.as_quat()[..., [3, 0, 1, 2]]
    return q


def multiply(p: Array, q: Array) -> Array:
    """Product p q: the rotation q, then p."""
    return _quaternion(_of(p) * _of(q))


def conjugate(q: Array) -> Array:
    """Inverse of unit quaternions."""
    inverse: Array = q * np.array([1.0, -1.0, -1.0, -1.0])
    return inverse


def from_vector(v: Array) -> Array:
    """Rotation by the vector v: its direction is the axis, its length the angle in radians."""
    return _quaternion(Rotation.from_rotvec(v))


def to_vector(q: Array) -> Array:
    """Rotation vector of at most half a turn."""
    vector: Array = _of(q).as_rotvec()
    return vector


def matrix(q: Array) -> Array:
    """Rotation matrices, body to world."""
    rows: Array = _of(q).as_matrix()
    return rows


def rotate(m: Array, v: Array) -> Array:
    """Vectors v in the frame that the matrices m lead to."""
    return (m @ v[..., None])[..., 0]


def rotate_back(m: Array, v: Array) -> Array:
    """Vectors v by the transposed matrices."""
    return (v[..., None, :] @ m)[..., 0, :]


def skew(v: Array) -> Array:
    """Matrices of the cross product with v."""
    columns: Array = np.cross(v[..., None, :], np.eye(3))
    return np.swapaxes(columns, -1, -2)


def euler(q: Array) -> Array:
    """Roll, pitch, yaw in radians (ZYX)."""
    angles: Array = _of(q).as_euler("ZYX")[..., ::-1]
    return angles


def from_axes(z_body: Array, yaw: Array) -> Array:
    """Attitude whose third body axis is z_body and whose heading is yaw (Faessler et al. 2018, section III)."""
    y_course = np.stack([-np.sin(yaw), np.cos(yaw), np.zeros_like(yaw)], axis=-1)
    x_body = np.cross(y_course, z_body)
    x_body = x_body / np.sqrt((x_body**2).sum(-1, keepdims=True))
    return from_matrix(np.stack([x_body, np.cross(z_body, x_body), z_body], axis=-1))


def from_matrix(m: Array) -> Array:
    """Quaternions of rotation matrices."""
    return _quaternion(Rotation.from_matrix(m))
