"""Poses as a motion-capture system sends them."""

import json

from quadctl.state import Quat, Vec3


def datagram(position: Vec3, quaternion: Quat, time_s: float | None = None, name: str = "raptor") -> str:
    fields = {"name": name, "position": position, "quaternion": quaternion}
    return json.dumps(fields if time_s is None else {**fields, "time": time_s})
