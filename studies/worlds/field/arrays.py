"""Array types and the small vector algebra that all modules of the field world use (NED world, FRD body)."""

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Rows = npt.NDArray[np.intp]
GRAVITY_M_S2 = 9.80665


def cross(a: Floats, b: Floats) -> Floats:
    """Cross product of vectors in the last axis, without the overhead of numpy's general one."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    out[..., 0] = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    out[..., 1] = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    out[..., 2] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return out


def rotate(matrix: Floats, vector: Floats) -> Floats:
    """Product of (..., 3, 3) matrices with (..., 3) vectors."""
    product: Floats = np.matmul(matrix, vector[..., None])[..., 0]
    return product


def rotate_back(matrix: Floats, vector: Floats) -> Floats:
    """Product of the transposed (..., 3, 3) matrices with (..., 3) vectors."""
    product: Floats = np.matmul(vector[..., None, :], matrix)[..., 0, :]
    return product


def rotation_from_vector(vector: Floats) -> Floats:
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3), by Rodrigues' formula."""
    angle = np.sqrt(np.sum(vector * vector, axis=-1))
    small = angle < 1e-9
    safe = np.where(small, 1.0, angle)
    first = np.where(small, 1.0, np.sin(safe) / safe)[..., None, None]
    second = np.where(small, 0.5, (1.0 - np.cos(safe)) / (safe * safe))[..., None, None]
    skew = np.zeros((*vector.shape[:-1], 3, 3))
    skew[..., 0, 1], skew[..., 0, 2] = -vector[..., 2], vector[..., 1]
    skew[..., 1, 0], skew[..., 1, 2] = vector[..., 2], -vector[..., 0]
    skew[..., 2, 0], skew[..., 2, 1] = -vector[..., 1], vector[..., 0]
    matrix: Floats = np.eye(3) + first * skew + second * np.matmul(skew, skew)
    return matrix


def orthonormal(matrix: Floats) -> Floats:
    """Rotation matrices nearest to almost orthonormal ones: one Newton step of the polar decomposition."""
    result: Floats = 0.5 * np.matmul(matrix, 3.0 * np.eye(3) - np.matmul(np.swapaxes(matrix, -1, -2), matrix))
    return result


def euler_deg(matrix: Floats) -> tuple[Floats, Floats, Floats]:
    """Roll, pitch, yaw in degrees (ZYX) of rotation matrices from body to world."""
    roll = np.degrees(np.arctan2(matrix[..., 2, 1], matrix[..., 2, 2]))
    pitch = np.degrees(np.arcsin(np.clip(-matrix[..., 2, 0], -1.0, 1.0)))
    yaw = np.degrees(np.arctan2(matrix[..., 1, 0], matrix[..., 0, 0]))
    return roll, pitch, yaw
