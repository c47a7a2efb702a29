"""Cases of the single effects and of the clean flights: vehicle, place, missions, sensors and sizes of each."""

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


def _one(
    family: str, number: int, kind: str, place: str, missions: tuple[Mission, ...], size: Any, **more: Any
) -> Case:
    return Case(f"{family}_{number}", kind, place, missions, {family: size}, **more)


GROUND = [
    _one("ground_effect", 1, "nano", "room", (near_ground(75), near_ground(60, turn="slow")), {"form": "images"}),
    _one(
        "ground_effect",
        2,
        "quad",
        "hall",
        (near_ground(80), M(60, SWAY, wander(0.8, 7.0, 0.9), "steps", "radii")),
        {"form": "li", "rho": 6.0},
    ),
    _one(
        "ground_effect",
        3,
        "hexa",
        "hall",
        (M(70, spline(1.0, 1.5), stairs(0.8, 10.0, 6, 3.0), "slow", "radii"), near_ground(60)),
        {"form": "hayden"},
    ),
    _one(
        "ceiling_effect",
        1,
        "mapper",
        "room",
        (near_ceiling(70), near_ceiling(60, "slow")),
        {"form": "sanchez"},
        ceiling_m=2.8,
        styles=("geometric", "cascaded"),
    ),
    _one(
        "ceiling_effect",
        2,
        "carrier",
        "hall",
        (near_ceiling(70), M(60, SWAY, wander(1.0, 4.0, 1.4), "steps", "below")),
        {"form": "throttled"},
        ceiling_m=4.5,
        styles=("geometric", "cascaded"),
    ),
    _one(
        "ground_torque",
        1,
        "quad",
        "hall",
        (
            M(60, shake(1.9, 2.2), stairs(1.0, 6.0, 4, 6.0), "fixed", "radii"),
            M(50, shake(1.7, 1.9), hold(1.1), "slow", "radii"),
        ),
        {"stiffness": 60.0},
        quick=True,
        styles=("geometric", "cascaded"),
    ),
    _one(
        "ground_torque",
        2,
        "mapper",
        "hall",
        (
            M(70, shake(1.8, 2.4), stairs(1.0, 7.0, 4, 6.0), "slow", "radii"),
            M(50, shake(2.0, 2.2), hold(1.0), "fixed", "radii"),
        ),
        {"stiffness": 50.0},
        quick=True,
        styles=("geometric", "cascaded"),
    ),
]

SPEED = [
    _one(
        "rotor_drag",
        1,
        "nano",
        "room",
        (M(70, eight(1.3, 6.0), hold(1.2), "slow"), M(60, spline(1.8, 0.8), wander(0.8, 1.6, 1.5))),
        {"rate": [0.42, 0.38]},
    ),
    _one(
        "rotor_drag",
        2,
        "racer",
        "hall",
        (M(60, runs(5.0, 1.2, 3.5), hold(1.8), "fixed"), M(70, eight(4.0, 9.0), hold(2.0), "nose")),
        {"rate": [0.3, 0.22], "by_speed": 0.0},
    ),
    _one(
        "rotor_drag",
        3,
        "hexa",
        "field",
        (M(80, runs(8.0, 3.0), hold(12.0), "slow"), M(70, sticks(7.0, 25.0), hold(10.0), "sticks")),
        {"rate": [0.13, 0.13]},
    ),
    _one(
        "body_drag",
        1,
        "mapper",
        "field",
        (M(90, runs(11.0, 4.0, 3.0), hold(20.0), "fixed"), M(70, runs(9.0, 3.0, 3.0), hold(15.0), "slow")),
        {"area": [0.03, 0.034, 0.05]},
    ),
    _one(
        "body_drag",
        2,
        "racer",
        "field",
        (M(80, eight(24.0, 20.0), hold(8.0), "nose"), M(70, runs(12.0, 2.5, 4.5), hold(8.0), "fixed")),
        {"area": [0.0085, 0.0095, 0.016]},
    ),
    _one(
        "translational_lift",
        1,
        "quad",
        "field",
        (M(80, runs(7.0, 3.0), hold(6.0), "slow"), M(70, spline(6.5, 1.6), hold(8.0), "fixed")),
        {"blade": 6.0},
    ),
    _one(
        "translational_lift",
        2,
        "carrier",
        "field",
        (M(90, runs(8.5, 4.0), hold(15.0), "nose"), M(60, eight(16.0, 17.0), hold(12.0), "slow")),
        {"blade": 5.0},
    ),
    _one(
        "rotor_interaction",
        1,
        "quad",
        "field",
        (M(80, runs(7.0, 3.0), hold(8.0), "fixed"), M(60, eight(10.0, 13.5), hold(8.0), "slow")),
        {"loss_per_m_s": 0.045},
        quick=True,
        styles=("geometric", "cascaded"),
    ),
    _one(
        "rotor_interaction",
        2,
        "hexa",
        "field",
        (M(80, runs(8.0, 3.5), hold(12.0), "slow"), M(70, sticks(7.5, 25.0), hold(12.0), "nose")),
        {"loss_per_m_s": 0.035},
        quick=True,
        styles=("geometric", "cascaded"),
    ),
    _one(
        "wind",
        1,
        "quad",
        "field",
        (M(80, spline(0.8, 2.5), hold(6.0), "slow"), M(60, sticks(1.0, 4.0), wander(3.0, 6.0, 3.0), "steps")),
        {"speed": 5.5, "toward_deg": 70.0, "rate": 0.13},
        notes="The wind is felt by a linear drag of its own.",
    ),
    _one(
        "wind",
        2,
        "nano",
        "room",
        (M(60, SWAY, hold(1.2), "slow"), M(60, spline(0.5, 1.5), wander(0.7, 1.6, 2.0), "steps")),
        {"speed": 1.9, "toward_deg": -20.0, "rate": 0.36},
        notes="The fan's wind is felt by a linear drag of its own.",
    ),
    _one(
        "wind",
        3,
        "carrier",
        "field",
        (M(90, spline(1.2, 3.0), hold(12.0), "steps"), M(60, runs(1.5, 4.0, 1.0), hold(10.0), "slow")),
        {"speed": 7.0, "toward_deg": 200.0, "area": 0.1},
        notes="The wind is felt by a quadratic drag of its own.",
        slow_speeds=True,
    ),
]

VERTICAL = [
    _one(
        "inflow",
        1,
        "quad",
        "field",
        (M(70, SWAY, climbs(4.0, 14.0, 3.0), "slow"), M(60, SWAY, wander(3.0, 13.0, 1.6), "fixed")),
        {"blade": 6.0},
    ),
    _one(
        "inflow",
        2,
        "racer",
        "hall",
        (M(60, SWAY, swings(3.0, 3.5, 3.4), "fixed"), M(60, spline(0.6, 2.0), wander(1.0, 5.5, 1.0), "slow")),
        {"blade": 8.0},
        quick=True,
    ),
    _one(
        "inflow",
        3,
        "heavy",
        "field",
        (M(90, SWAY, climbs(6.0, 22.0, 3.5), "slow"), M(70, SWAY, climbs(5.0, 14.0, 2.5), "fixed")),
        {"blade": 5.0},
    ),
    _one(
        "tether",
        1,
        "carrier",
        "field",
        (M(90, SWAY, stairs(2.0, 16.0, 6, 4.0, 3.0), "slow"), M(70, SWAY, wander(2.0, 14.0, 3.0), "fixed")),
        {"share": 0.009},
        notes="The cable hangs below the vehicle.",
        slow_speeds=True,
    ),
    _one(
        "tether",
        2,
        "micro",
        "hall",
        (M(70, SWAY, stairs(0.7, 3.6, 6, 4.0, 1.5), "fixed"), M(60, spline(0.5, 2.0), wander(0.6, 3.8, 1.5), "slow")),
        {"share": 0.035},
        notes="The cable hangs below the vehicle.",
    ),
    _one(
        "thrust_curve",
        1,
        "quad",
        "hall",
        (M(60, SWAY, swings(2.5, 4.2, 2.0), "fixed"), M(60, SWAY, swings(2.5, 4.4, 2.3), "slow")),
        {"change": 0.35},
        quick=True,
    ),
    _one(
        "thrust_curve",
        2,
        "micro",
        "hall",
        (M(60, SWAY, swings(2.0, 4.5, 1.9), "slow"), M(50, spline(0.8, 1.5), swings(2.2, 4.3, 2.2), "fixed")),
        {"change": -0.35},
        quick=True,
    ),
    _one(
        "thrust_curve",
        3,
        "hexa",
        "field",
        (M(70, SWAY, swings(8.0, 4.3, 2.4), "fixed"), M(60, SWAY, swings(8.0, 4.3, 2.2), "steps")),
        {"change": -0.3},
        styles=("geometric", "cascaded"),
        quick=True,
    ),
    _one(
        "motor_lag",
        1,
        "quad",
        "hall",
        (M(60, SWAY, swings(2.5, 3.2, 1.9), "fixed"), M(60, spline(1.5, 0.9), swings(2.5, 3.4, 2.2), "slow")),
        {"extra": 0.13},
        source="outputs",
        styles=("geometric",),
    ),
    _one(
        "motor_lag",
        2,
        "carrier",
        "field",
        (M(70, SWAY, swings(8.0, 3.2, 2.4), "slow"), M(60, spline(1.5, 1.5), swings(8.0, 3.0, 2.2), "fixed")),
        {"extra": 0.14},
        source="throttle",
        lag_known=False,
        styles=("geometric",),
        notes="The vehicle file states no lag.",
    ),
    _one(
        "motor_lag",
        3,
        "mapper",
        "hall",
        (M(60, SWAY, swings(2.5, 3.2, 2.0), "steps"), M(60, spline(1.5, 1.0), swings(2.5, 3.0, 2.3), "fixed")),
        {"extra": 0.11},
        source="setpoints",
        styles=("geometric",),
        notes="The rotor speed columns hold what was asked of the motors.",
    ),
]

CONSTANT = [
    _one(
        "thrust_scale",
        1,
        "quad",
        "hall",
        (M(60, spline(2.0, 1.0), wander(1.0, 4.0, 1.5), "slow"), M(60, eight(2.5, 8.0), hold(2.0), "fixed")),
        {"error": -0.08},
    ),
    _one(
        "thrust_scale",
        2,
        "nano",
        "room",
        (M(60, sticks(1.0, 1.3), wander(0.6, 1.9, 1.5), "sticks"), M(50, SWAY, stairs(0.5, 1.9, 4), "slow")),
        {"error": 0.07},
        imu=True,
    ),
    _one(
        "thrust_scale",
        3,
        "heavy",
        "field",
        (M(80, runs(4.0, 2.5, 2.0), wander(6.0, 14.0, 3.0), "slow"),),
        {"error": -0.055},
        slow_speeds=True,
    ),
    _one(
        "payload",
        1,
        "hexa",
        "field",
        (M(90, spline(2.0, 2.0), wander(5.0, 10.0, 3.0), "slow"),),
        {"share": -0.13, "time": 48.0},
        notes="Load dropped in flight.",
    ),
    _one(
        "payload",
        2,
        "quad",
        "hall",
        (M(80, SWAY, stairs(1.0, 3.5, 5), "steps"),),
        {"share": 0.09, "time": 36.0},
        notes="Load picked up in flight.",
    ),
    _one(
        "payload",
        3,
        "micro",
        "room",
        (M(70, sticks(0.8, 1.3), wander(0.8, 1.8, 2.0), "sticks"),),
        {"share": -0.09, "time": 31.0},
        imu=True,
        notes="Load dropped in flight.",
    ),
    _one(
        "battery_sag",
        1,
        "racer",
        "hall",
        (
            M(110, spline(2.0, 1.0), wander(1.0, 3.5, 1.5), "slow"),
            M(70, eight(2.0, 7.0), wander(1.0, 3.0, 1.0), "fixed"),
        ),
        {"exponent": 1.6},
        source="outputs",
        endurance_s=240.0,
    ),
    _one(
        "battery_sag",
        2,
        "nano",
        "room",
        (M(110, spline(1.0, 1.0), wander(0.6, 1.9, 1.2), "slow"), M(80, SWAY, swings(1.2, 2.5, 2.5), "fixed")),
        {"exponent": 1.4},
        source="outputs",
        endurance_s=270.0,
    ),
    _one(
        "battery_sag",
        3,
        "carrier",
        "field",
        (
            M(115, spline(2.5, 2.0), wander(5.0, 15.0, 3.0), "slow"),
            M(90, runs(3.0, 2.0), wander(5.0, 9.0, 2.0), "fixed"),
        ),
        {"exponent": 2.0},
        source="throttle",
        endurance_s=330.0,
    ),
    _one(
        "thrust_tilt",
        1,
        "quad",
        "hall",
        (M(60, spline(1.0, 1.5), hold(1.5), "slow"), M(60, SWAY, stairs(1.0, 3.0, 4), "steps")),
        {"deg": [2.6, -1.5]},
        imu=True,
    ),
    _one(
        "thrust_tilt",
        2,
        "nano",
        "room",
        (M(60, sticks(0.9, 1.3), hold(1.2), "sticks"), M(60, SWAY, hold(1.4), "slow")),
        {"deg": [-2.0, 2.4]},
    ),
    _one(
        "thrust_tilt",
        3,
        "hexa",
        "field",
        (M(80, eight(6.0, 14.0), wander(6.0, 9.0, 2.0), "slow"), M(50, SWAY, hold(6.0), "steps")),
        {"deg": [0.6, 3.3]},
        slow_speeds=True,
    ),
    _one(
        "rotor_fault",
        1,
        "quad",
        "hall",
        (M(70, spline(1.5, 1.2), wander(1.0, 3.0, 1.5), "slow"), M(50, eight(1.5, 7.0), hold(2.0), "fixed")),
        {"rotor": 2, "loss": 0.16},
        quick=True,
    ),
    _one(
        "rotor_fault",
        2,
        "hexa",
        "field",
        (M(70, spline(2.0, 2.0), wander(5.0, 9.0, 2.0), "slow"), M(60, sticks(2.0, 8.0), hold(6.0), "sticks")),
        {"rotor": 5, "loss": 0.24},
        quick=True,
    ),
    _one(
        "rotor_fault",
        3,
        "plus",
        "hall",
        (M(70, spline(1.2, 1.2), stairs(1.0, 3.0, 4), "steps"), M(50, SWAY, swings(2.0, 2.5, 2.5), "fixed")),
        {"rotor": 3, "loss": 0.18},
        quick=True,
    ),
    _one(
        "imu_bias",
        1,
        "quad",
        "hall",
        (M(60, spline(1.5, 1.2), wander(1.0, 3.0, 1.5), "slow"), M(50, eight(2.0, 7.0), hold(2.0), "fixed")),
        {"bias": [0.45, -0.3, 0.35]},
        imu=True,
    ),
    _one(
        "imu_bias",
        2,
        "mapper",
        "field",
        (M(70, runs(4.0, 2.0), hold(8.0), "slow"), M(60, SWAY, stairs(3.0, 9.0, 4, 4.0, 2.0), "steps")),
        {"bias": [-0.3, 0.4, -0.5]},
        imu=True,
    ),
    _one(
        "thrust_map",
        1,
        "quad",
        "hall",
        (M(70, SWAY, swings(2.5, 3.6, 2.2), "fixed"), M(60, spline(1.5, 1.2), swings(2.5, 3.4, 2.6), "slow")),
        {"slope": -0.22, "offset": 0.16},
        source="throttle",
    ),
    _one(
        "thrust_map",
        2,
        "racer",
        "hall",
        (M(60, sticks(1.5, 3.0), swings(3.0, 4.0, 2.2), "sticks"), M(60, SWAY, swings(2.5, 3.8, 2.4), "slow")),
        {"slope": 0.28, "offset": -0.2},
        source="throttle",
    ),
    _one(
        "thrust_map",
        3,
        "mapper",
        "field",
        (M(80, spline(2.0, 1.8), swings(8.0, 3.6, 2.8), "slow"), M(60, SWAY, swings(8.0, 3.8, 2.4), "fixed")),
        {"slope": 0.12, "offset": -0.2},
        source="throttle",
    ),
]

SINGLE = GROUND + SPEED + VERTICAL + CONSTANT
