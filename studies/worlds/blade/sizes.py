"""Sizes of hidden effects at strength 1, as measurements in the literature have them."""

from collections.abc import Callable, Mapping

import numpy as np

from studies.worlds.blade.effects import Effect
from studies.worlds.blade.missions import Demand
from studies.worlds.blade.vehicles import GRAVITY, Vehicle

Values = dict[str, float | list[float]]

RANGES: Mapping[tuple[str, str], Mapping[str, tuple[float, float]]] = {
    # 10 to 30 % more thrust at one radius above the ground (Sanchez-Cuevas et al. 2017; Danjun et al. 2015).
    ("ground_effect", "images"): {"gain": (1.8, 2.8)},
    ("ground_effect", "hayden"): {"gain": (1.1, 1.6)},
    ("ground_effect", "danjun"): {"rho": (1.6, 2.6)},
    # 15 to 20 % more thrust at one radius below the ceiling (Jimenez-Cano et al. 2019).
    ("ceiling_effect", "contact"): {"gain": (0.9, 1.2)},
    ("ceiling_effect", "images"): {"gain": (2.0, 2.6)},
    ("ceiling_effect", "decay"): {"gain": (0.36, 0.46), "decay": (0.9, 1.2)},
    # 0.2 to 0.5 of the mass per second (Faessler et al. 2018: 0.39 to 0.54; Kai et al. 2017: 0.2 to 0.3).
    ("rotor_drag", "speed"): {"rate": (0.22, 0.42)},
    ("rotor_drag", "thrust"): {"rate": (0.22, 0.42)},
    # Flat-plate areas of about a tenth of the span squared, C_D near 1: 0.014 to 0.026 of the mass per metre.
    ("body_drag", "bluff"): {"per_metre": (0.014, 0.026)},
    # Propellers that are heavy for their motors.
    ("motor_lag", ""): {"time_constant_s": (0.07, 0.11)},
    # A linear part of a third to a half of the thrust.
    ("thrust_curve", "mixed"): {"linear": (0.35, 0.55)},
    # A levelling moment of two to three fifths of weight times arm times tilt, extrapolated to the ground.
    ("ground_torque", ""): {"gain": (0.4, 0.7), "decay": (1.2, 2.0)},
    # Rear rotors that lose up to 12 to 22 % of their thrust at speed.
    ("rotor_interaction", ""): {"loss": (0.14, 0.24)},
}
"""Values by family and form, each drawn evenly from a range."""
ONLY_FORM = {
    "battery_sag": "open_loop",
    "ground_torque": "levelling",
    "imu_bias": "constant",
    "inflow": "blades",
    "motor_lag": "first_order",
    "payload": "step",
    "rotor_fault": "loss",
    "rotor_interaction": "wake",
    "thrust_map": "line",
    "translational_lift": "blades",
}
"""Form of the families that have one."""
POWERS: Mapping[tuple[str, str], Mapping[str, float]] = {
    ("wind", "rotor"): dict.fromkeys(("mean_m_s", "gust_m_s", "rate"), 0.5),
    # Drag goes with the square of the wind: together they grow with the strength.
    ("wind", "body"): {"mean_m_s": 0.25, "gust_m_s": 0.25, "per_metre": 0.5},
    ("wind", "alone"): dict.fromkeys(("mean_m_s", "gust_m_s"), 0.5),
}
"""Powers of the strength by which values grow, where it is not 1."""


def draw(rng: np.random.Generator, family: str, form: str, vehicle: Vehicle, demand: Demand) -> Effect:
    """Hidden effect of a family, with values drawn at strength 1."""
    values: Values
    if (family, form) in RANGES:
        values = {name: float(rng.uniform(*span)) for name, span in RANGES[family, form].items()}
    else:
        values = DRAWS[family](rng, form, vehicle, demand)
    return Effect(family, ONLY_FORM.get(family, form), values, POWERS.get((family, form), {}))


def _sign(rng: np.random.Generator) -> float:
    return float(rng.choice([-1.0, 1.0]))


def rotor_drag(rng: np.random.Generator, form: str, vehicle: Vehicle, demand: Demand) -> Values:
    """Drag with a value per body axis, of the same sizes as that of the other forms."""
    along = rng.uniform(0.25, 0.45)
    return {"rates": [float(along), float(along * rng.uniform(0.75, 1.0)), float(along * rng.uniform(0.0, 0.3))]}


def body_drag(rng: np.random.Generator, form: str, vehicle: Vehicle, demand: Demand) -> Values:
    """Areas per body axis, of the same size as that of a bluff body."""
    size = float(rng.uniform(0.014, 0.026))
    return {"per_metre": [size, size * float(rng.uniform(0.9, 1.3)), size * float(rng.uniform(1.3, 2.0))]}


def wind(rng: np.random.Generator, form: str, vehicle: Vehicle, demand: Demand) -> Values:
    """Mean wind with Dryden turbulence of a tenth to a seventh of it, and the drag that makes it felt."""
    speed, course = rng.uniform(5.0, 9.0), rng.uniform(0, 2 * np.pi)
    mean = [float(speed * np.cos(course)), float(speed * np.sin(course))]
    values: Values = {"mean_m_s": mean, "gust_m_s": float(speed * rng.uniform(0.08, 0.14))}
    felt = {"rotor": ("rate", (0.2, 0.35)), "body": ("per_metre", (0.02, 0.035))}
    if form in felt:
        name, span = felt[form]
        values[name] = float(rng.uniform(*span))
    return values


def thrust_scale(rng: np.random.Generator, form: str, vehicle: Vehicle, demand: Demand) -> Values:
    """7 to 17 % of thrust: 700 to 1800 m of altitude, or another propeller of the same size."""
    return {"share": float(_sign(rng) * rng.uniform(0.07, 0.17))}


def payload(rng: np.random.Generator, form: str, vehicle: Vehicle, demand: Demand) -> Values:
    """Mass of 12 to 28 % that is taken up or dropped; its moment is set for each flight."""
    share = float(rng.uniform(0.14, 0.28) if form == "taken" else -rng.uniform(0.12, 0.22))
    return {"share": share, "moment_s": 0.0}


def whole(rng: np.random.Generator, form: str, vehicle: Vehicle, demand: Demand) -> Values:
    """Effects that follow from the blades, or from open-loop ESCs on a small battery, alone."""
    return {"share": 1.0}


def thrust_tilt(rng: np.random.Generator, form: str, vehicle: Vehicle, demand: Demand) -> Values:
    """Rotor axes, or the autopilot's board, askew by 2 to 4.5 degrees."""
    size, course = np.radians(rng.uniform(2.0, 4.5)), rng.uniform(0, 2 * np.pi)
    return {"angles_rad": [float(size * np.cos(course)), float(size * np.sin(course))]}


def tether(rng: np.random.Generator, form: str, vehicle: Vehicle, demand: Demand) -> Values:
    """Cable whose weight at the greatest height is 12 to 24 % of the vehicle's."""
    weight = GRAVITY * rng.uniform(0.14, 0.24) / demand.high
    return {"weight_per_metre": float(weight), "free_m": 0.0, "anchor_m": [0.0, 0.0]}


def rotor_fault(rng: np.random.Generator, form: str, vehicle: Vehicle, demand: Demand) -> Values:
    """Rotor that gives 14 to 24 % less, more of it the more rotors there are."""
    loss = float(rng.uniform(0.14, 0.22) * (1.0 + 0.1 * (vehicle.count - 4)))
    return {"rotor": float(rng.integers(vehicle.count)), "loss": loss, "moment_s": -100.0}


def thrust_curve(rng: np.random.Generator, form: str, vehicle: Vehicle, demand: Demand) -> Values:
    """Exponents of 2.3 to 2.6 or 1.4 to 1.7."""
    return {"excess": float(rng.uniform(0.3, 0.6) * _sign(rng))}


def imu_bias(rng: np.random.Generator, form: str, vehicle: Vehicle, demand: Demand) -> Values:
    """Bias of 0.25 to 0.6 m/s^2 of an accelerometer that was not calibrated, along all axes."""
    way = rng.normal(size=3)
    return {"bias_m_s2": (way / np.linalg.norm(way) * rng.uniform(0.3, 0.6)).tolist()}


def thrust_map(rng: np.random.Generator, form: str, vehicle: Vehicle, demand: Demand) -> Values:
    """Line from command to thrust whose slope is off by 15 to 30 % and whose thrust in hover is off by up to 8 %."""
    slope = float(1.0 + _sign(rng) * rng.uniform(0.15, 0.3))
    offset = float(1.0 - slope + _sign(rng) * rng.uniform(0.03, 0.08))
    return {"slope_error": slope - 1.0, "offset": offset}


DRAWS: dict[str, Callable[[np.random.Generator, str, Vehicle, Demand], Values]] = {
    **{draw.__name__: draw for draw in (rotor_drag, body_drag, wind, thrust_scale, payload, thrust_tilt, tether)},
    **{draw.__name__: draw for draw in (rotor_fault, thrust_curve, imu_bias, thrust_map)},
    **dict.fromkeys(("battery_sag", "inflow", "translational_lift"), whole),
}
"""Values of the families, or forms, that have none in `RANGES`."""
