"""Places of the rotors: of the frames that both autopilots number alike, and as an autopilot's parameters say."""

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple

from quadctl.errors import SettingsError
from quadctl.words import Fact, Kinds, fact

Parameters = Mapping[str, float]
Spin = Literal["cw", "ccw"]


class Touching(Kinds):
    PROPELLERS = (
        "The propellers would touch: their axes are {apart_m:.3g} m apart, less than the diameter of {propeller_m:.3g} "
        "m. On this frame they turn free from a diagonal of {free_m:.4g} m on."
    )


class Place(NamedTuple):
    """Place of one rotor: position, FRD, m; its sense of rotation seen from above; and its tilt."""

    position_m: tuple[float, float, float]
    spin: Spin
    cant_deg: float = 0.0
    dihedral_deg: float = 0.0


_QUAD_X: tuple[tuple[float, Spin], ...] = ((45, "ccw"), (-135, "ccw"), (-45, "cw"), (135, "cw"))
_QUAD_PLUS: tuple[tuple[float, Spin], ...] = ((90, "ccw"), (-90, "ccw"), (0, "cw"), (180, "cw"))
_HEXA_X: tuple[tuple[float, Spin], ...] = (
    (90, "cw"),
    (-90, "ccw"),
    (-30, "cw"),
    (150, "ccw"),
    (30, "ccw"),
    (-150, "cw"),
)
_HEXA_PLUS: tuple[tuple[float, Spin], ...] = (
    (0, "cw"),
    (180, "ccw"),
    (-120, "cw"),
    (60, "ccw"),
    (-60, "ccw"),
    (120, "cw"),
)
ROUNDED = 1e-3
"""Largest rounding of a rotor's place in parameters, m."""
_OCTA_X: tuple[tuple[float, Spin], ...] = (
    (22.5, "cw"),
    (-157.5, "cw"),
    (67.5, "ccw"),
    (157.5, "ccw"),
    (-22.5, "ccw"),
    (-112.5, "ccw"),
    (-67.5, "cw"),
    (112.5, "cw"),
)
_OCTA_PLUS: tuple[tuple[float, Spin], ...] = (
    (0, "cw"),
    (180, "cw"),
    (45, "ccw"),
    (135, "ccw"),
    (-45, "ccw"),
    (-135, "ccw"),
    (-90, "cw"),
    (90, "cw"),
)
FRAMES = {
    "quad-x": _QUAD_X,
    "quad-plus": _QUAD_PLUS,
    "hexa-x": _HEXA_X,
    "hexa-plus": _HEXA_PLUS,
    "octa-x": _OCTA_X,
    "octa-plus": _OCTA_PLUS,
}
"""Direction of each rotor from the centre, degrees clockwise from the nose seen from above, and its sense of rotation,
in the order of motor 1, 2, ... of ArduPilot (AP_MotorsMatrix) and PX4 (airframe reference)."""

ARDUPILOT_FRAMES = {
    (1, 0): "quad-plus",
    (1, 1): "quad-x",
    (2, 0): "hexa-plus",
    (2, 1): "hexa-x",
    (3, 0): "octa-plus",
    (3, 1): "octa-x",
}
"""FRAME_CLASS and FRAME_TYPE."""
PX4_FRAMES = {4: "quad-x", 5: "quad-plus", 6: "hexa-x", 7: "hexa-plus", 8: "octa-x", 9: "octa-plus"}
"""Thousands of SYS_AUTOSTART, which alone tells PX4's frame up to 1.12."""
MAV_TYPES = {2: "quad-x", 13: "hexa-x", 14: "octa-x"}
"""MAV_TYPE, which tells the number of rotors alone."""
APART = 1.2
"""Distance between neighbouring rotors over the diameter of a propeller, where nobody has said it: most frames have 1.1
to 1.4."""


def frame_places(frame: str, arm_m: float) -> tuple[Place, ...]:
    """Places on a regular frame whose rotors' axes are `arm_m` from its centre.

    Raises
    ------
    SettingsError
        The frame is none of `FRAMES`.
    """
    if frame not in FRAMES:
        raise SettingsError(f"the frame is '{frame}', expected one of {', '.join(FRAMES)}")
    return tuple(Place((*_direction(azimuth_deg, arm_m), 0.0), spin) for azimuth_deg, spin in FRAMES[frame])


def _direction(azimuth_deg: float, arm_m: float) -> tuple[float, float]:
    azimuth = math.radians(azimuth_deg)
    return arm_m * math.cos(azimuth), arm_m * math.sin(azimuth)


def px4_places(parameters: Parameters) -> tuple[Place, ...] | None:
    """Places as PX4's control allocation has them (CA_ROTOR*); None where the parameters do not say.

    Raises
    ------
    SettingsError
        A rotor's thrust axis is zero or points down.
    """
    count = int(parameters.get("CA_ROTOR_COUNT", 0))
    if count < 1 or not all(f"CA_ROTOR{i}_P{axis}" in parameters for i in range(count) for axis in "XY"):
        return None
    return tuple(_px4_place(i, parameters) for i in range(count))


def _px4_place(i: int, parameters: Parameters) -> Place:
    x, y, z = (parameters.get(f"CA_ROTOR{i}_P{axis}", 0.0) for axis in "XYZ")
    ax, ay, az = (
        parameters.get(f"CA_ROTOR{i}_A{axis}", default) for axis, default in zip("XYZ", (0, 0, -1), strict=True)
    )
    length = math.sqrt(ax * ax + ay * ay + az * az)
    if length == 0.0 or az >= 0.0:
        raise SettingsError(f"CA_ROTOR{i}_AX, AY, AZ are {ax:g}, {ay:g}, {az:g}, expected an axis that points up")
    cant_deg, dihedral_deg = _tilt(x, y, ax / length, ay / length, az / length)
    return Place((x, y, z), "ccw" if parameters.get(f"CA_ROTOR{i}_KM", 0.05) > 0.0 else "cw", cant_deg, dihedral_deg)


def _tilt(x: float, y: float, ax: float, ay: float, az: float) -> tuple[float, float]:
    """Cant and dihedral, degrees, of the unit thrust axis of a rotor at x, y: the inverse of `RotorPlace.axis`."""
    azimuth = math.atan2(y, x)
    outward = ax * math.cos(azimuth) + ay * math.sin(azimuth)
    sideways = -ax * math.sin(azimuth) + ay * math.cos(azimuth)
    return math.degrees(math.asin(sideways)), math.degrees(math.atan2(-outward, -az))


def arm_m_of(places: Sequence[Place]) -> float:
    """Largest distance of a rotor's axis from the centre, m."""
    return max(math.hypot(*place.position_m[:2]) for place in places)


def overlap(positions_m: Sequence[tuple[float, float, float]], propeller_m: float) -> Fact | None:
    """Propellers of this diameter, at these positions, FRD, that reach into each other; None where each
    turns free.

    Rotors at different heights may overlap, as coaxial ones do: only those at one height are looked at.
    """
    nearest_m = _nearest_m(positions_m)
    if nearest_m >= propeller_m:
        return None
    diagonal_m = 2.0 * max(math.hypot(x, y) for x, y, _ in positions_m)
    free_mm = math.ceil(1e3 * diagonal_m * propeller_m / max(nearest_m, ROUNDED) - 1e-6)
    return fact(Touching.PROPELLERS, apart_m=nearest_m, propeller_m=propeller_m, free_m=1e-3 * free_mm)


def _nearest_m(positions_m: Sequence[tuple[float, float, float]]) -> float:
    """Smallest distance between rotors at one height, m."""
    at_one_height = (math.dist(a, b) for a, b in itertools.combinations(positions_m, 2) if abs(a[2] - b[2]) < ROUNDED)
    return min(at_one_height, default=math.inf)


def are_relative(places: Sequence[Place]) -> bool:
    """Tell whether the places are directions rather than distances: the farthest rotor, or its farthest coordinate, is
    at 1, as in airframes of PX4 that state no size, which its control allocation does not need."""
    coordinate = max(abs(value) for place in places for value in place.position_m[:2])
    return any(math.isclose(size, 1.0, abs_tol=ROUNDED) for size in (coordinate, arm_m_of(places)))


def are_alike(some: Sequence[Place], others: Sequence[Place]) -> bool:
    """Tell whether the rotors are in the same order at the same places, to `ROUNDED`, turn and lean alike."""
    return len(some) == len(others) and all(
        math.dist(a.position_m, b.position_m) < ROUNDED
        and (a.spin, a.cant_deg, a.dihedral_deg) == (b.spin, b.cant_deg, b.dihedral_deg)
        for a, b in zip(some, others, strict=True)
    )


def assumed_arm_m(places: Sequence[Place], propeller_m: float) -> float:
    """Distance of the farthest rotor from the centre at which propellers of this diameter turn `APART` free."""
    nearest_m = _nearest_m([place.position_m for place in places])
    return arm_m_of(places) * APART * propeller_m / nearest_m


def scaled_to(places: Sequence[Place], arm_m: float) -> tuple[Place, ...]:
    """The same layout with its farthest rotor `arm_m` from the centre; one whose rotors are all there stays."""
    size_m = arm_m_of(places)
    scale = arm_m / size_m if size_m > 0.0 else 1.0
    x_y_z = [place.position_m for place in places]
    return tuple(
        place._replace(position_m=(scale * x, scale * y, scale * z))
        for place, (x, y, z) in zip(places, x_y_z, strict=True)
    )


def ardupilot_frame(parameters: Parameters) -> str | None:
    """The regular frame that FRAME_CLASS and FRAME_TYPE stand for; None where the parameters do not say.

    Raises
    ------
    SettingsError
        It is a frame for which there is no table here.
    """
    if not parameters.get("FRAME_CLASS"):
        return None
    frame = int(parameters["FRAME_CLASS"]), int(parameters.get("FRAME_TYPE", 1))
    if frame not in ARDUPILOT_FRAMES:
        known = "; ".join(f"{c} with {t} ({name})" for (c, t), name in ARDUPILOT_FRAMES.items())
        raise SettingsError(
            f"FRAME_CLASS is {frame[0]} with FRAME_TYPE {frame[1]}, expected {known}: write the rotors by hand"
        )
    return ARDUPILOT_FRAMES[frame]


def px4_frame(parameters: Parameters) -> tuple[str, str] | None:
    """The regular frame of a PX4 without control allocation, and the parameter that tells it; None where none does."""
    airframe = PX4_FRAMES.get(int(parameters.get("SYS_AUTOSTART", 0)) // 1000)
    if airframe is not None:
        return airframe, "SYS_AUTOSTART"
    by_type = MAV_TYPES.get(int(parameters.get("MAV_TYPE", 0)))
    return (by_type, "MAV_TYPE, taken for an x") if by_type is not None else None
