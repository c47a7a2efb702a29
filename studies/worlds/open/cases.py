"""Statement of a case, and short names for the parts of its missions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from studies.worlds.open.missions import Mission, Part


@dataclass(frozen=True)
class Case:
    """Case: what is hidden in which vehicle, and how it is flown and logged."""

    name: str
    kind: str
    place: str
    missions: tuple[Mission, ...]
    effects: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    source: str = "speeds"
    imu: bool = False
    quick: bool = False  # telemetry fast enough for moments
    slow_speeds: bool = False  # telemetry of the rotors at a few Hz
    styles: tuple[str, ...] = ("geometric", "cascaded", "pilot")
    ceiling_m: float | None = None
    lag_known: bool = True
    endurance_s: float = 700.0
    indistinguishable: tuple[tuple[str, str], ...] = ()
    notes: str = ""


def runs(speed: float, cruise: float, pull: float = 3.0, star: bool = True) -> Part:
    """Out-and-back runs."""
    return "runs", {"speed": speed, "cruise": cruise, "pull": pull, "star": star}


def eight(size: float, period: float) -> Part:
    """Figure-eights."""
    return "eight", {"size": size, "period": period}


def spline(speed: float, smooth: float) -> Part:
    """Smooth random paths."""
    return "spline", {"speed": speed, "smooth": smooth}


def sticks(speed: float, room: float) -> Part:
    """Sticks of a person."""
    return "sticks", {"speed": speed, "room": room}


def shake(pull: float, period: float) -> Part:
    """Lateral oscillations."""
    return "shake", {"pull": pull, "period": period}


def hold(height: float) -> Part:
    """One height."""
    return "hold", {"height": height}


def stairs(low: float, high: float, steps: int, dwell: float = 3.5, ramp: float = 1.2) -> Part:
    """Staircase of heights."""
    return "stairs", {"low": low, "high": high, "steps": steps, "dwell": dwell, "ramp": ramp}


def swings(middle: float, pull: float, period: float) -> Part:
    """Vertical oscillations."""
    return "swings", {"middle": middle, "pull": pull, "period": period}


def wander(low: float, high: float, smooth: float) -> Part:
    """Smooth random heights."""
    return "wander", {"low": low, "high": high, "smooth": smooth}


def climbs(low: float, high: float, speed: float) -> Part:
    """Climbs and descents of constant speed."""
    return "climbs", {"low": low, "high": high, "speed": speed}


SWAY: Part = ("sway", {})
M = Mission


def near_ground(seconds: float, across: Part = SWAY, turn: str = "fixed", low: float = 0.75) -> Mission:
    """Staircase of hovers between the ground and free air."""
    return M(seconds, across, stairs(low, 8.0, 6, 3.0), turn, "radii")


def near_ceiling(seconds: float, turn: str = "fixed", low: float = 1.0) -> Mission:
    """Staircase of hovers under the ceiling."""
    return M(seconds, SWAY, stairs(low, 7.0, 6, 3.0, 2.6), turn, "below")
