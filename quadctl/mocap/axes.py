"""From the axes of a motion-capture system to MAVLink's: world NED, body FRD. Quaternions are Hamilton's, scalar first.

A frame is two rotations: the system's world axes to NED, and FRD to the axes that the system gives the rigid body.
"""

import math
from dataclasses import dataclass

from quadctl.frames import euler_from_quaternion, multiply, rotate, rotate_inverse
from quadctl.state import Quat, Vec3

_HALF = math.sqrt(0.5)
_ABOUT_X: Quat = (0.0, 1.0, 0.0, 0.0)
"""Half a turn about x: z up to z down, left to right."""
_EAST_TO_NORTH: Quat = (0.0, _HALF, _HALF, 0.0)
"""Half a turn about the line between x and y: changes those two, and up to down."""
_Y_UP: Quat = (_HALF, -_HALF, 0.0, 0.0)
"""A quarter turn about x: y up to z down, z right to y right."""
_SAME: Quat = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Frame:
    """Axes of a motion-capture system."""

    world_to_ned: Quat
    frd_to_body: Quat
    meaning: str


FRAMES = {
    "nwu": Frame(_ABOUT_X, _ABOUT_X, "z up, x north (or wherever north shall be), y to its left; body x forward, z up"),
    "enu": Frame(_EAST_TO_NORTH, _ABOUT_X, "z up, x east, y north; body x forward, y left, z up, as in ROS"),
    "y_up": Frame(_Y_UP, (_HALF, _HALF, 0.0, 0.0), "y up, x north, z east, Motive's default; body x forward, y up"),
    "ned": Frame(_SAME, _SAME, "x north, y east, z down; body x forward, y right, z down"),
}
"""By the word of the command line. With Vicon, Qualisys and VRPN it is nearly always `nwu`."""


def to_ned(position: Vec3, attitude: Quat, frame: Frame, yaw_rad: float = 0.0) -> tuple[Vec3, Quat]:
    """Position NED in metres and attitude FRD to NED of a rigid body.

    `yaw_rad`: heading of the system's north axis, where that is not the north that the autopilot shall have.
    """
    turn: Quat = (math.cos(0.5 * yaw_rad), 0.0, 0.0, math.sin(0.5 * yaw_rad))
    world = multiply(turn, frame.world_to_ned)
    return rotate(world, position), multiply(multiply(world, attitude), frame.frd_to_body)


def angle_between_verticals(one: Quat, other: Quat) -> float:
    """Angle in radians between what two attitudes call down, seen from the body: free of heading."""
    a, b = (rotate_inverse(q, (0.0, 0.0, 1.0)) for q in (one, other))
    return math.acos(min(max(sum(x * y for x, y in zip(a, b, strict=True)), -1.0), 1.0))


def yaw(attitude: Quat) -> float:
    """Heading in radians."""
    heading: float = euler_from_quaternion(attitude)[2]
    return heading
