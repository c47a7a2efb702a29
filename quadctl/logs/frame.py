"""The frame of an ArduPilot in the parameters of today's firmware, whatever its own firmware says it by."""

import re
from collections.abc import Iterable, Mapping

CLASS, TYPE, OLDER = "FRAME_CLASS", "FRAME_TYPE", "FRAME"
"""Parameters of the frame; up to Copter 3.4 there was one, and the class was that of the firmware."""
CLASSES = {"QUAD": 1.0, "HEXA": 2.0, "OCTA": 3.0, "OCTAQUAD": 4.0, "Y6": 5.0, "HELI": 6.0, "TRI": 7.0, "DECA": 14.0}
"""FRAME_CLASS by its name in the messages of the start."""
TYPES = {"PLUS": 0.0, "X": 1.0, "V": 2.0, "H": 3.0}
"""FRAME_TYPE by its name in the messages, and FRAME likewise."""
_MESSAGE = re.compile(r"Frame: (?P<kind>[A-Z_]*[A-Z]\d?)(?:/(?P<shape>\w+))?")


def with_frame(parameters: Mapping[str, float], texts: Iterable[str]) -> dict[str, float]:
    """The parameters with FRAME_CLASS and FRAME_TYPE, where they or FRAME and the messages of a log tell them."""
    found = next((match for text in texts if (match := _MESSAGE.search(text))), None)
    kind, shape = (found["kind"].replace("_", ""), found["shape"]) if found is not None else ("", None)
    told = {CLASS: parameters.get(CLASS) or CLASSES.get(kind)}
    told[TYPE] = parameters.get(TYPE, parameters.get(OLDER, TYPES.get(shape or "")))
    return {**parameters, **{name: value for name, value in told.items() if value is not None}}
