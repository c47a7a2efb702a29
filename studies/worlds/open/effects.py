"""Hidden effects: published forms and sizes, turned into the numbers that the simulator needs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from studies.worlds.open.vehicles import GRAVITY_M_S2, Array, Craft

MAX_ROTORS = 6
TABLE_STEP = 0.05  # of the clearance of a rotor over its radius
TABLE = np.arange(240) * TABLE_STEP


@dataclass
class Hidden:
    """Physics beyond the rigid body of one vehicle; the values that stand here hide nothing."""

    ground: Array = field(default_factory=lambda: np.zeros(len(TABLE)))  # gain of thrust by clearance of the centre
    ceiling: Array = field(default_factory=lambda: np.zeros(len(TABLE)))
    drag_n_s_m: Array = field(default_factory=lambda: np.zeros(3))
    drag_by_speed: float = 0.0  # 1: proportional to the rotor speed, 0: constant
    area_m2: Array = field(default_factory=lambda: np.zeros(3))  # drag coefficient times area
    wind_m_s: Array = field(default_factory=lambda: np.zeros(3))
    blade: float = 0.0  # loss of thrust by inflow over tip speed
    blade_climb: float = 0.0
    blade_forward: float = 0.0
    scale: float = 1.0
    load_kg: float = 0.0
    load_time_s: float = 1e9
    sag: float = 0.0  # exponent of thrust on voltage
    lag_s: float = 0.0  # lag of the motors beyond what the file says
    tilt_rad: Array = field(default_factory=lambda: np.zeros(2))  # of the thrust axis, forward and right
    tether_n_m: float = 0.0
    tether_from_m: float = 0.0
    rotors: Array = field(default_factory=lambda: np.ones(MAX_ROTORS))
    imu_bias_m_s2: Array = field(default_factory=lambda: np.zeros(3))
    exponent: float = 2.0
    wake_s_m: float = 0.0  # loss of a rotor right behind, for each m/s
    level_1_s2: float = 0.0  # levelling stiffness on the ground, over the inertia
    map_slope: float = 1.0
    map_offset: float = 0.0  # of the weight
    map_power: float = 1.0


Builder = Callable[[Hidden, Craft, float, Mapping[str, Any]], dict[str, Any]]


def _ground(hidden: Hidden, craft: Craft, strength: float, size: Mapping[str, Any]) -> dict[str, Any]:
    """Ground effect: images of all rotors (Cheeseman and Bennett), Li's quadrotor factor, or Hayden's measured fit."""
    clearance = np.maximum(TABLE, 0.3)
    if size["form"] == "images":
        gaps = np.linalg.norm(craft.positions_m - craft.positions_m[0], axis=1) / craft.radius_m
        wash = sum(0.5 * clearance / (gap**2 + 4.0 * clearance**2) ** 1.5 for gap in gaps)
        gain = 1.0 / (1.0 - np.minimum(wash, 0.45)) - 1.0
    elif size["form"] == "li":
        gain = 1.0 / (1.0 - np.minimum(size["rho"] / (16.0 * clearance**2), 0.4)) - 1.0
    else:
        gain = (0.9926 + 0.03794 * (2.0 / clearance) ** 2) ** (2.0 / 3.0) - 1.0
        gain = np.clip(gain, 0.0, 0.6)
    hidden.ground = strength * gain
    return {"form": size["form"], "gain_at_1_radius": float(np.interp(1.0, TABLE, hidden.ground))}


def _ceiling(hidden: Hidden, craft: Craft, strength: float, size: Mapping[str, Any]) -> dict[str, Any]:
    """Ceiling effect in the form of Sanchez-Cuevas, or of momentum theory with a throttled inlet (Hsiao)."""
    clearance = np.maximum(TABLE, 0.15)
    if size["form"] == "sanchez":
        gain = 1.0 / (1.0 - 1.0 / 6.924 / (clearance + 0.35) ** 2) - 1.0
    else:
        gain = (0.5 + 0.5 * np.sqrt(1.0 + 1.0 / (3.0 * clearance**2))) ** (4.0 / 3.0) - 1.0
    hidden.ceiling = strength * np.clip(gain, 0.0, 1.0) * size.get("size", 1.0)
    return {"form": size["form"], "gain_at_1_radius": float(np.interp(1.0, TABLE, hidden.ceiling))}


def _rotor_drag(hidden: Hidden, craft: Craft, strength: float, size: Mapping[str, Any]) -> dict[str, Any]:
    """Hub force of flapping blades, linear in the velocity: coefficients over mass as Faessler measured."""
    hidden.drag_n_s_m = strength * np.array([*size["rate"], 0.0]) * craft.mass_kg
    hidden.drag_by_speed = float(size.get("by_speed", 1.0))
    return {"drag_over_mass_1_s": list(strength * np.array(size["rate"]))}


def _body_drag(hidden: Hidden, craft: Craft, strength: float, size: Mapping[str, Any]) -> dict[str, Any]:
    """Drag of the airframe by coefficient times area."""
    hidden.area_m2 = strength * np.array(size["area"])
    return {"drag_area_m2": list(hidden.area_m2)}


def _inflow(hidden: Hidden, craft: Craft, strength: float, size: Mapping[str, Any]) -> dict[str, Any]:
    """Blade element and momentum theory in axial flight: climb raises the inflow and lowers the thrust."""
    hidden.blade, hidden.blade_climb = strength * size["blade"], 1.0
    return {"blade": hidden.blade}


def _translational(hidden: Hidden, craft: Craft, strength: float, size: Mapping[str, Any]) -> dict[str, Any]:
    """Glauert's momentum theory in edgewise flight: the induced inflow falls and the thrust rises."""
    hidden.blade, hidden.blade_forward = strength * size["blade"], 1.0
    return {"blade": hidden.blade}


def _wind(hidden: Hidden, craft: Craft, strength: float, size: Mapping[str, Any]) -> dict[str, Any]:
    """Steady wind, felt by a drag of its own unless the case has one."""
    course = np.radians(size["toward_deg"])
    hidden.wind_m_s = strength * size["speed"] * np.array([np.cos(course), np.sin(course), 0.0])
    if "rate" in size:
        hidden.drag_n_s_m = np.array([size["rate"]] * 2 + [0.0]) * craft.mass_kg
    if "area" in size:
        hidden.area_m2 = np.full(3, size["area"])
    drag = {"drag_over_mass_1_s": size.get("rate"), "drag_area_m2": size.get("area")}
    felt = {name: value for name, value in drag.items() if value is not None}
    return {"wind_north_m_s": hidden.wind_m_s[0], "wind_east_m_s": hidden.wind_m_s[1], **felt}


def _scale(hidden: Hidden, craft: Craft, strength: float, size: Mapping[str, Any]) -> dict[str, Any]:
    """Thrust coefficient wrong by a factor."""
    hidden.scale = 1.0 + strength * size["error"]
    return {"thrust_factor": hidden.scale}


def _payload(hidden: Hidden, craft: Craft, strength: float, size: Mapping[str, Any]) -> dict[str, Any]:
    """Load picked up or dropped in flight."""
    hidden.load_kg, hidden.load_time_s = strength * size["share"] * craft.mass_kg, float(size["time"])
    return {"mass_change_kg": hidden.load_kg, "time_s": hidden.load_time_s}


def _sag(hidden: Hidden, craft: Craft, strength: float, size: Mapping[str, Any]) -> dict[str, Any]:
    """Thrust at a given command as a power of the loaded voltage."""
    hidden.sag = strength * size["exponent"]
    return {"exponent": hidden.sag}


def _lag(hidden: Hidden, craft: Craft, strength: float, size: Mapping[str, Any]) -> dict[str, Any]:
    """Motors slower than the file says."""
    hidden.lag_s = strength * size["extra"]
    return {"extra_lag_s": hidden.lag_s}


def _tilt(hidden: Hidden, craft: Craft, strength: float, size: Mapping[str, Any]) -> dict[str, Any]:
    """Thrust axis that is not the axis of the frame."""
    hidden.tilt_rad = strength * np.radians(size["deg"])
    return {"tilt_forward_right_deg": list(strength * np.array(size["deg"]))}


def _tether(hidden: Hidden, craft: Craft, strength: float, size: Mapping[str, Any]) -> dict[str, Any]:
    """Weight of the cable that hangs below, share of the vehicle's weight for each metre."""
    hidden.tether_n_m = strength * size["share"] * craft.mass_kg * GRAVITY_M_S2
    hidden.tether_from_m = float(size.get("start", 0.0))
    return {"newton_per_m": hidden.tether_n_m, "from_m": hidden.tether_from_m}


def _fault(hidden: Hidden, craft: Craft, strength: float, size: Mapping[str, Any]) -> dict[str, Any]:
    """Chipped or worn propeller: one rotor gives less at the same speed."""
    hidden.rotors = np.ones(MAX_ROTORS)
    hidden.rotors[size["rotor"] - 1] -= strength * size["loss"]
    return {"rotor": size["rotor"], "loss": strength * size["loss"]}


def _imu(hidden: Hidden, craft: Craft, strength: float, size: Mapping[str, Any]) -> dict[str, Any]:
    """Offset of the accelerometers, body axes."""
    hidden.imu_bias_m_s2 = strength * np.array(size["bias"])
    return {"bias_m_s2": list(hidden.imu_bias_m_s2)}


def _curve(hidden: Hidden, craft: Craft, strength: float, size: Mapping[str, Any]) -> dict[str, Any]:
    """Another exponent of thrust on rotor speed; it meets the square at hover."""
    hidden.exponent = 2.0 + strength * size["change"]
    return {"exponent": hidden.exponent, "equal_at_rpm": craft.hover_rpm}


def _wake(hidden: Hidden, craft: Craft, strength: float, size: Mapping[str, Any]) -> dict[str, Any]:
    """Rear rotors in the wake of the front ones."""
    hidden.wake_s_m = strength * size["loss_per_m_s"]
    return {"loss_per_m_s": hidden.wake_s_m}


def _level(hidden: Hidden, craft: Craft, strength: float, size: Mapping[str, Any]) -> dict[str, Any]:
    """Levelling moment near the ground, exponential in the height of the rotor plane over 1.5 radii."""
    hidden.level_1_s2 = strength * size["stiffness"]
    return {"stiffness_1_s2": hidden.level_1_s2, "decay_height_m": 1.5 * craft.radius_m}


def _map(hidden: Hidden, craft: Craft, strength: float, size: Mapping[str, Any]) -> dict[str, Any]:
    """Thrust by command with another slope, offset (of the weight) and power than the file's line."""
    hidden.map_slope = 1.0 + strength * size["slope"]
    hidden.map_offset = strength * size["offset"]
    hidden.map_power = 1.0 + strength * size.get("power", 0.0)
    return {"slope": hidden.map_slope, "offset_of_weight": hidden.map_offset, "power": hidden.map_power}


BUILDERS: dict[str, Builder] = {
    "ground_effect": _ground,
    "ceiling_effect": _ceiling,
    "rotor_drag": _rotor_drag,
    "body_drag": _body_drag,
    "inflow": _inflow,
    "translational_lift": _translational,
    "wind": _wind,
    "thrust_scale": _scale,
    "payload": _payload,
    "battery_sag": _sag,
    "motor_lag": _lag,
    "thrust_tilt": _tilt,
    "tether": _tether,
    "rotor_fault": _fault,
    "imu_bias": _imu,
    "thrust_curve": _curve,
    "rotor_interaction": _wake,
    "ground_torque": _level,
    "thrust_map": _map,
}


def hide(effects: Mapping[str, Mapping[str, Any]], craft: Craft, strength: float) -> tuple[Hidden, dict[str, Any]]:
    """Physics with the given effects in it, and their parameters for the truth file."""
    hidden = Hidden()
    parameters = {name: BUILDERS[name](hidden, craft, strength, size) for name, size in effects.items()}
    return hidden, parameters
