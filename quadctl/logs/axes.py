"""Vectors and attitudes in the frames of other programs, turned into those of a flight log.

World frames: NED, ENU, NWU and NEU (north, east, up, as in our files). Body frames: FRD and FLU.
"""

import math
from typing import Literal, TypeAlias

import numpy as np

from quadctl.frames import Quaternion, euler_from_quaternion, multiply, quaternion_from_euler, rotate
from quadctl.logs.flight_log import Floats

World: TypeAlias = Literal["NED", "ENU", "NWU", "NEU"]
AttitudeWorld: TypeAlias = Literal["NED", "ENU", "NWU"]
Body: TypeAlias = Literal["FRD", "FLU"]
Vectors: TypeAlias = tuple[Floats, Floats, Floats]
"""Three components, each of shape (n,)."""

MAX_DETERMINANT_ERROR = 0.1
"""Largest distance of a rotation matrix's determinant from 1."""
_HALF_TURN_ABOUT_X: Quaternion = (0.0, 1.0, 0.0, 0.0)
_TO_NED: dict[str, Quaternion] = {
    "NED": (1.0, 0.0, 0.0, 0.0),
    "ENU": (0.0, math.sqrt(0.5), math.sqrt(0.5), 0.0),
    "NWU": _HALF_TURN_ABOUT_X,
}


def north_east_up(vector: Vectors, frame: World) -> Vectors:
    """Vectors of a world frame in the axes of a log's file."""
    a, b, c = vector
    return {"NED": (a, b, -c), "ENU": (b, a, c), "NWU": (a, -b, c), "NEU": (a, b, c)}[frame]


def forward_right_down(vector: Vectors, frame: Body) -> Vectors:
    """Vectors of a body frame in FRD."""
    a, b, c = vector
    return (a, b, c) if frame == "FRD" else (a, -b, -c)


def attitude(quaternion: Quaternion, world: AttitudeWorld, body: Body, inverse: bool = False) -> Quaternion:
    """Attitude FRD to NED, of a quaternion (w, x, y, z) that rotates `body` to `world`, or back if `inverse`.

    A quaternion whose length is not one is scaled; one of length zero is NaN.
    """
    w, x, y, z = (np.asarray(part, dtype=np.float64) for part in quaternion)
    with np.errstate(over="ignore"):  # of damaged values
        length = np.sqrt(w * w + x * x + y * y + z * z)
    length = np.where(length > 0.1, length, np.nan)
    sign = -1.0 if inverse else 1.0
    unit = (w / length, sign * x / length, sign * y / length, sign * z / length)
    turned = multiply(_TO_NED[world], unit)
    return turned if body == "FRD" else multiply(turned, _HALF_TURN_ABOUT_X)


def euler_deg(quaternion: Quaternion) -> Vectors:
    """Roll, pitch and yaw of an attitude FRD to NED, degrees."""
    roll, pitch, yaw = euler_from_quaternion(quaternion)
    return np.degrees(roll), np.degrees(pitch), np.degrees(yaw)


def quaternion_of(angles_rad: Vectors) -> Quaternion:
    """Quaternion of roll, pitch and yaw in the frames in which these are given."""
    return quaternion_from_euler(*angles_rad)


def quaternion_of_matrix(rows: tuple[Vectors, Vectors, Vectors]) -> Quaternion:
    """Quaternion of rotation matrices, given by their rows; NaN where a matrix is far from a rotation."""
    from scipy.spatial.transform import Rotation  # heavy, and few tables need it

    matrices = np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
    sound = np.abs(np.linalg.det(matrices) - 1.0) < MAX_DETERMINANT_ERROR
    found = Rotation.from_matrix(np.where(sound[:, None, None], matrices, np.eye(3))).as_quat().T
    x, y, z, w = np.where(sound, found, np.nan)
    return w, x, y, z


def body_to_world(quaternion: Quaternion, velocity: Vectors) -> Vectors:
    """(north, east, up) of body vectors FRD at an attitude FRD to NED."""
    north, east, down = rotate(quaternion, velocity)
    return north, east, -down
