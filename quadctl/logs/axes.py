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
EQUATOR_M, ECCENTRICITY2 = 6_378_137.0, 6.694379990e-3
"""Radius of the equator, and square of the eccentricity of the meridians, by WGS84."""
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


def local_position(latitude_deg: Floats, longitude_deg: Floats, height: Floats) -> Vectors:
    """(north, east, up) from the first position, m, on the plane that touches WGS84's ellipsoid there; height as given.

    A thousandth of the distance is right within 10 km: the radii of curvature are those of the first latitude (Farrell
    2008, Aided Navigation, eq. 2.7 and 2.8).
    """
    if not len(latitude_deg):
        return latitude_deg, longitude_deg, height
    latitude = math.radians(latitude_deg[0])
    squeezed = 1.0 - ECCENTRICITY2 * math.sin(latitude) ** 2
    east_radius_m = EQUATOR_M / math.sqrt(squeezed)
    north_radius_m = east_radius_m * (1.0 - ECCENTRICITY2) / squeezed
    turned_deg = (longitude_deg - longitude_deg[0] + 180.0) % 360.0 - 180.0  # across the line of 180 degrees, too
    north = np.radians(latitude_deg - latitude_deg[0]) * north_radius_m
    return north, np.radians(turned_deg) * east_radius_m * math.cos(latitude), height


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
