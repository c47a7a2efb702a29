"""Do the motion-capture system and the autopilot mean the same axes? Gravity tells for tilt, the compass for heading,
and the autopilot's own motion for the rest."""

import math

from quadctl.frames import wrap_pi
from quadctl.mocap.axes import FRAMES, Frame, angle_between_verticals, to_ned, yaw
from quadctl.numeric import minus
from quadctl.state import Quat, Vec3

MAX_TILT_DEG = 15.0
"""Between the two verticals; a rigid body that was defined on a vehicle that stood level is a few degrees off."""
MAX_YAW_DEG = 30.0
MOVED_M = 0.5
"""By both, before their directions are compared."""
MAX_DIRECTION_DEG = 45.0


def tilt_problem(raw: Quat, frame: str, autopilot: Quat) -> str:
    """A sentence where the rigid body's vertical is not the autopilot's, which gravity gives; else empty.

    `raw`: attitude as the motion-capture system has it.
    """
    off_deg = _tilt_off_deg(raw, FRAMES[frame], autopilot)
    if off_deg <= MAX_TILT_DEG:
        return ""
    others = {name: _tilt_off_deg(raw, other, autopilot) for name, other in FRAMES.items()}
    best = min(others, key=lambda name: others[name])
    agrees = others[best] <= MAX_TILT_DEG
    advice = f"with --frame {best} they agree" if agrees else "define the rigid body anew on the level vehicle"
    return f"the rigid body is tilted {off_deg:.0f} deg away from the autopilot's attitude (--frame {frame}): {advice}"


def yaw_problem(attitude: Quat, autopilot: Quat) -> str:
    """A sentence where the headings differ by a large angle; else empty. Attitudes FRD to NED."""
    off_deg = math.degrees(wrap_pi(yaw(autopilot) - yaw(attitude)))
    if abs(off_deg) <= MAX_YAW_DEG:
        return ""
    return (
        f"the rigid body's heading is {off_deg:+.0f} deg from the autopilot's: turn its x axis forward, or say "
        f"--yaw {off_deg:.0f}, unless the autopilot has no compass and takes its heading from here"
    )


class Motion:
    """Compares the directions in which both say that the vehicle moves."""

    def __init__(self) -> None:
        self._start: tuple[Vec3, Vec3] | None = None

    def problem(self, position: Vec3, autopilot: Vec3) -> str:
        """A sentence once both have moved far enough, in different directions; else empty. Positions NED."""
        if not all(map(math.isfinite, (*position, *autopilot))):
            return ""
        if self._start is None:
            self._start = position, autopilot
        moves = [minus(now, was) for now, was in zip((position, autopilot), self._start, strict=True)]
        lengths = [math.hypot(*move) for move in moves]
        if min(lengths) < MOVED_M:
            return ""
        self._start = position, autopilot
        cosine = sum(a * b for a, b in zip(*moves, strict=True)) / (lengths[0] * lengths[1])
        off_deg = math.degrees(math.acos(min(max(cosine, -1.0), 1.0)))
        if off_deg <= MAX_DIRECTION_DEG:
            return ""
        ours, theirs = (_direction(move) for move in moves)
        return f"the vehicle moves {ours} by motion capture and {theirs} by the autopilot: check --frame and --yaw"


def _tilt_off_deg(raw: Quat, frame: Frame, autopilot: Quat) -> float:
    _, attitude = to_ned((0.0, 0.0, 0.0), raw, frame)
    return math.degrees(angle_between_verticals(attitude, autopilot))


def _direction(move: Vec3) -> str:
    axis = max(range(3), key=lambda i: abs(move[i]))
    return (("north", "south"), ("east", "west"), ("down", "up"))[axis][move[axis] < 0.0]
