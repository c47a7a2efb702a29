"""Do the motion-capture system and the autopilot mean the same axes? Gravity tells for tilt, the compass for heading,
and the autopilot's own motion for the rest."""

import math

from quadctl.frames import wrap_pi
from quadctl.mocap.axes import FRAMES, Frame, angle_between_verticals, to_ned, yaw
from quadctl.mocap.findings import Kind
from quadctl.numeric import minus
from quadctl.state import Quat, Vec3
from quadctl.words import Fact, fact

MAX_TILT_DEG = 15.0
"""Between the two verticals; a rigid body that was defined on a vehicle that stood level is a few degrees off."""
MAX_YAW_DEG = 30.0
MOVED_M = 0.5
"""By both, before their directions are compared."""
MAX_DIRECTION_DEG = 45.0


def tilt_problem(raw: Quat, frame: str, autopilot: Quat) -> Fact | None:
    """Difference of the rigid body's vertical from the autopilot's, which gravity gives; None where they agree.

    `raw`: attitude as the motion-capture system has it.
    """
    off_deg = _tilt_off_deg(raw, FRAMES[frame], autopilot)
    if off_deg <= MAX_TILT_DEG:
        return None
    others = {name: _tilt_off_deg(raw, other, autopilot) for name, other in FRAMES.items()}
    best = min(others, key=lambda name: others[name])
    agrees = others[best] <= MAX_TILT_DEG
    return fact(Kind.TILTED, off_deg=off_deg, frame=frame, best=best if agrees else None)


def yaw_problem(attitude: Quat, autopilot: Quat) -> Fact | None:
    """Difference of the headings where it is a large angle, or None. Attitudes FRD to NED."""
    off_deg = math.degrees(wrap_pi(yaw(autopilot) - yaw(attitude)))
    return fact(Kind.HEADING_OFF, off_deg=off_deg) if abs(off_deg) > MAX_YAW_DEG else None


class Motion:
    """Compares the directions in which both say that the vehicle moves."""

    def __init__(self) -> None:
        self._start: tuple[Vec3, Vec3] | None = None

    def problem(self, position: Vec3, autopilot: Vec3) -> Fact | None:
        """Directions of both, once they have moved far enough in different ones; else None. Positions NED."""
        if not all(map(math.isfinite, (*position, *autopilot))):
            return None
        if self._start is None:
            self._start = position, autopilot
        moves = [minus(now, was) for now, was in zip((position, autopilot), self._start, strict=True)]
        lengths = [math.hypot(*move) for move in moves]
        if min(lengths) < MOVED_M:
            return None
        self._start = position, autopilot
        cosine = sum(a * b for a, b in zip(*moves, strict=True)) / (lengths[0] * lengths[1])
        off_deg = math.degrees(math.acos(min(max(cosine, -1.0), 1.0)))
        if off_deg <= MAX_DIRECTION_DEG:
            return None
        ours, theirs = (_direction(move) for move in moves)
        return fact(Kind.MOVES_OTHERWISE, by_poses=ours, by_autopilot=theirs)


def _tilt_off_deg(raw: Quat, frame: Frame, autopilot: Quat) -> float:
    _, attitude = to_ned((0.0, 0.0, 0.0), raw, frame)
    return math.degrees(angle_between_verticals(attitude, autopilot))


def _direction(move: Vec3) -> tuple[int, bool]:
    """Axis along which a move mostly goes, NED, and whether it goes against it."""
    axis = max(range(3), key=lambda i: abs(move[i]))
    return axis, move[axis] < 0.0
