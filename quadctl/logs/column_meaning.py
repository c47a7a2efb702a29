"""Meaning of a column of another program's table, by its name."""

import difflib
import re
from typing import NamedTuple


class Meaning(NamedTuple):
    """Quantity that a column holds a part of."""

    kind: str
    """time, position, velocity, attitude, rates, imu, place (latitude, longitude and height), motor or battery."""
    part: str
    """Axis (x, y, z, w), direction (north, east, down, up), angle (roll, pitch, yaw), number, or what of a place."""
    group: str
    """Text that the columns of one group share."""
    unit: str
    """As maps have it; "" where the name does not tell."""


UNITS = {
    "m_s2": "m/s2", "m_s_2": "m/s2", "mps2": "m/s2", "g": "g", "gs": "g",
    "m_s": "m/s", "m_s_1": "m/s", "mps": "m/s", "cm_s": "cm/s", "mm_s": "mm/s", "km_h": "km/h", "kmh": "km/h",
    "ft_s": "ft/s", "fps": "ft/s", "mph": "mph", "kn": "kn", "kt": "kn", "knots": "kn",
    "rad_s": "rad/s", "rad_s_1": "rad/s", "radps": "rad/s", "deg_s": "deg/s", "degps": "deg/s", "dps": "deg/s",
    "rev_s": "rev/s", "hz": "rev/s", "rpm": "rpm", "pwm": "pwm", "percent": "percent", "pct": "percent",
    "m": "m", "meters": "m", "metres": "m", "cm": "cm", "mm": "mm", "ft": "ft", "feet": "ft",
    "deg": "deg", "degrees": "deg", "rad": "rad", "radians": "rad",
    "v": "V", "mv": "mV", "s": "s", "sec": "s", "secs": "s", "seconds": "s", "ms": "ms", "us": "us", "ns": "ns",
    "millisecond": "ms", "milliseconds": "ms", "microseconds": "us", "nanoseconds": "ns",
}  # fmt: skip
"""Units of maps, by the ends of names."""
_UNIT = re.compile(rf"_({'|'.join(sorted(UNITS, key=len, reverse=True))})$")
_FRAME = re.compile(r"_(ned|enu|neu|nwu|frd|flu|body|world|local|inertial|vicon|mocap|optitrack|qualisys)$")
_OTHER = re.compile(
    r"(^|_)(sp|set|setpoint|targets?|ctrltarget|ref|reference|cmd|command|commanded|des|desired|err|error|std|var|"
    r"variance|cov|covariance|bias|integral)(_|$)|(^|_)des(?=roll|pitch|yaw)"
)
"""Names of what was wanted, or is known about the error, and not of what was measured."""
_CLOCK = re.compile(r"^(t|time|timestamp|stamp|secs?|seconds|date|datetime|utc|epoch)(_|$)|.*(_time|_stamp|timestamp)$")
_PLACE = re.compile(
    r"^(?P<group>.*?)_?(?P<part>lat|latitude|lon|lng|long|longitude|(?:\w+_)?(?:alt|altitude|height)(?:_\w+)?)$"
)
_PLACES = {"lat": "latitude", "lon": "longitude", "lng": "longitude", "long": "longitude"}
_ANGLE = re.compile(r"^(?P<group>.*?)_?(?P<part>roll|pitch|yaw|heading)_?(?P<rest>angle|rate|speed|vel|velocity|dot|)$")
_RATE_BEFORE = re.compile(r"rate|gyro|omega|ang(ular)?_?vel")
_QUATERNION = re.compile(r"^(?P<group>(?:.*_)?(?:q|quat|quaternion|orientation))_?(?P<part>[0-4])$")
_DIRECTION = re.compile(
    r"^(?P<group>.*?)_?(?P<part>north|east|down|up)$|"
    r"^(?P<stem>(?:.*_)?(?:v|vel|velocity|speed|p|pos|position))_?(?P<letter>[nedu])$"
)
_DIRECTIONS = {"n": "north", "e": "east", "d": "down", "u": "up"}
_AXIS = re.compile(r"^(?P<group>.*?)_?(?P<part>[xyzw])$")
_AXIS_FIRST = re.compile(r"^(?P<part>[xyz])_?(?P<group>speed|vel|velocity|acc|accel|gyro|pos|position)$")
_MOTOR = re.compile(r"^(?!d)(?:.*_)?(?:(?:mot|motor|rotor|rpm|esc|pwm|rcou|thrust)[a-z_]*?|u_?)(?P<part>\d+)(?:_.*)?$")
_NO_MOTOR = re.compile(r"volt|curr|temp|amp|power|status|_v$|_a$")
_KINDS = (
    ("rates", r"gyro|ang(ular)?_?(vel|rate)|omega|body_?rate|twist_angular|rates?\b|_rate_|(^|_)w$|^w_"),
    ("imu", r"(?<!ang_)(?<!angular_)acc|imu|specific_force|^a$"),
    ("velocity", r"vel|speed|twist_linear|(^|_)v$|^v_"),
    ("attitude", r"quat|orientation|(^|_)q$|^q_"),
    ("position", r"pos|(^|_)p$|^p_|loc|^$|estimate$|odom|pose|drone|uav|quad"),
)
"""Words in what the axes of a quantity share; the first that fits."""
_KIND_OF_UNIT = {
    **dict.fromkeys(("m", "cm", "mm", "ft"), "position"),
    **dict.fromkeys(("m/s", "cm/s", "mm/s", "km/h", "ft/s", "mph", "kn"), "velocity"),
    **dict.fromkeys(("rad/s", "deg/s"), "rates"),
    "m/s2": "imu",
}

MAX_LENGTH = 80
"""Length of a text above which it is no name."""
MIN_LIKENESS = 0.8
"""Likeness of two names from which on one may be the other, mistyped."""


def plain(name: str) -> str:
    """The name in lower case, with one `_` for all that is neither a letter nor a digit."""
    return re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")


def meaning(name: str) -> Meaning | None:
    """Meaning of a column's name; None where it tells none."""
    if len(name) > MAX_LENGTH:
        return None
    text = plain(name)
    if _CLOCK.match(text):
        found = _UNIT.search(text)
        return Meaning("time", "", "", UNITS[found[1]] if found else "")
    if (motor := _MOTOR.match(text)) and not _NO_MOTOR.search(text):
        found = _UNIT.search(text) or re.search(r"(rpm|pwm|hz|percent)", text)
        group = text[: motor.start("part")] + "#" + text[motor.end("part") :]
        return Meaning("motor", motor["part"], group, UNITS[found[1]] if found else "")
    if _OTHER.search(text):
        return None
    if re.search(r"bat|volt", text) and not re.search(r"motor|esc|curr|percent|remain|temp", text):
        found = _UNIT.search(text)
        return Meaning("battery", "", "", UNITS[found[1]] if found else "")
    base, unit = text, ""
    if found := _UNIT.search(text):
        base, unit = text[: found.start()], UNITS[found[1]]
    base = _FRAME.sub("", base)
    return _of_base(base, unit)


def _of_base(base: str, unit: str) -> Meaning | None:
    """Meaning of a name without its unit and frame."""
    if base in ("p", "q", "r") and unit in ("", "rad/s", "deg/s"):
        return Meaning("rates", {"p": "roll", "q": "pitch", "r": "yaw"}[base], "pqr", unit)
    if found := _ANGLE.match(base):
        is_rate = found["rest"] not in ("", "angle") or unit in ("rad/s", "deg/s") or _RATE_BEFORE.search(base)
        part = "yaw" if found["part"] == "heading" else found["part"]
        return Meaning("rates" if is_rate else "attitude", part, found["group"], unit)
    if found := _PLACE.match(base):
        part = found["part"]
        return Meaning("place", _PLACES.get(part, part), found["group"], unit)
    if found := _QUATERNION.match(base):
        return Meaning("attitude", found["part"], found["group"], "")
    if found := _DIRECTION.match(base):
        group = found["group"] if found["part"] else found["stem"]
        part = found["part"] or _DIRECTIONS[found["letter"]]
    elif found := _AXIS_FIRST.match(base) or _AXIS.match(base):
        group, part = found["group"], found["part"]
    else:
        return None
    by_words = next((kind for kind, words in _KINDS if group and re.search(words, group)), None)
    kind = by_words or _KIND_OF_UNIT.get(unit) or ("position" if not group else None)
    return None if kind is None else Meaning(kind, part, group, unit)


_OF_COLUMNS = {
    "time_s": ("time", ("",), "s"),
    **{f"{a}_m": ("position", (a, d), "m") for a, d in zip("xyz", ("north", "east", "up"), strict=True)},
    **{f"v{a}_m_s": ("velocity", (a, d), "m/s") for a, d in zip("xyz", ("north", "east", "up"), strict=True)},
    **{f"{angle}_deg": ("attitude", (angle,), "deg") for angle in ("roll", "pitch", "yaw")},
    **{f"{angle}_rate_rad_s": ("rates", (angle,), "rad/s") for angle in ("roll", "pitch", "yaw")},
}
"""Kind, parts and unit that a flight log's columns mean."""


def is_it(column: str, names: list[str]) -> str:
    """ " (is it 'timestamp'?)" of a flight log's column that is missing, "" where no name means it or is near."""
    alike = difflib.get_close_matches(
        column, [name for name in names if meaning(name) is None], n=1, cutoff=MIN_LIKENESS
    )
    found = next((name for name in names if _means(name, column)), alike[0] if alike else None)
    return f" (is it '{found}'?)" if found else ""


def _means(name: str, column: str) -> bool:
    """Tell whether a name means what a flight log's column means, as far as names and units tell."""
    found = meaning(name)
    if found is None or column not in _OF_COLUMNS:
        return False
    kind, parts, unit = _OF_COLUMNS[column]
    return found.kind == kind and found.part in parts and found.unit in ("", unit)
