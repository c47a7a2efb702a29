"""Sizes of hidden effects at strength 1, as measurements in the literature have them."""

from collections.abc import Callable

import numpy as np

from studies.worlds.blade.effects import Effect
from studies.worlds.blade.missions import Demand
from studies.worlds.blade.vehicles import GRAVITY, Vehicle

Draw = Callable[[np.random.Generator, str, Vehicle, Demand], Effect]


def _sign(rng: np.random.Generator) -> float:
    return float(rng.choice([-1.0, 1.0]))


def ground_effect(rng: np.random.Generator, form: str, vehicle: Vehicle, demand: Demand) -> Effect:
    """10 to 30 % more thrust at one radius above the ground (Sanchez-Cuevas et al. 2017; Danjun et al. 2015)."""
    if form == "danjun":
        return Effect("ground_effect", form, {"rho": float(rng.uniform(1.6, 2.6))}, {"rho": 1})
    span = {"images": (1.8, 2.8), "hayden": (1.1, 1.6)}[form]
    return Effect("ground_effect", form, {"gain": float(rng.uniform(*span))}, {"gain": 1})


def ceiling_effect(rng: np.random.Generator, form: str, vehicle: Vehicle, demand: Demand) -> Effect:
    """15 to 20 % more thrust at one radius below the ceiling (Jimenez-Cano et al. 2019)."""
    if form == "contact":
        return Effect("ceiling_effect", form, {"gain": float(rng.uniform(0.9, 1.2))}, {"gain": 1})
    if form == "images":
        return Effect("ceiling_effect", form, {"gain": float(rng.uniform(2.0, 2.6))}, {"gain": 1})
    values: dict[str, float | list[float]] = {
        "gain": float(rng.uniform(0.36, 0.46)),
        "decay": float(rng.uniform(0.9, 1.2)),
    }
    return Effect("ceiling_effect", form, values, {"gain": 1})


def rotor_drag(rng: np.random.Generator, form: str, vehicle: Vehicle, demand: Demand) -> Effect:
    """Drag of 0.2 to 0.5 of the mass per second (Faessler et al. 2018: 0.39 to 0.54; Kai et al. 2017: 0.2 to 0.3)."""
    if form == "axes":
        along = rng.uniform(0.25, 0.45)
        rates = [float(along), float(along * rng.uniform(0.75, 1.0)), float(along * rng.uniform(0.0, 0.3))]
        return Effect("rotor_drag", form, {"rates": rates}, {"rates": 1})
    return Effect("rotor_drag", form, {"rate": float(rng.uniform(0.22, 0.42))}, {"rate": 1})


def body_drag(rng: np.random.Generator, form: str, vehicle: Vehicle, demand: Demand) -> Effect:
    """Flat-plate areas of about a tenth of the span squared, C_D near 1: 0.014 to 0.026 of the mass per metre."""
    size = float(rng.uniform(0.014, 0.026))
    if form == "bluff":
        return Effect("body_drag", form, {"per_metre": size}, {"per_metre": 1})
    shares = [size, size * float(rng.uniform(0.9, 1.3)), size * float(rng.uniform(1.3, 2.0))]
    return Effect("body_drag", form, {"per_metre": shares}, {"per_metre": 1})


def wind(rng: np.random.Generator, form: str, vehicle: Vehicle, demand: Demand) -> Effect:
    """Mean wind with Dryden turbulence of a tenth to a seventh of it, and the drag that makes it felt."""
    speed, course = rng.uniform(5.0, 9.0), rng.uniform(0, 2 * np.pi)
    mean = [float(speed * np.cos(course)), float(speed * np.sin(course))]
    values: dict[str, float | list[float]] = {"mean_m_s": mean, "gust_m_s": float(speed * rng.uniform(0.08, 0.14))}
    root = {"mean_m_s": 0.5, "gust_m_s": 0.5}
    if form == "rotor":
        return Effect("wind", form, {**values, "rate": float(rng.uniform(0.2, 0.35))}, {**root, "rate": 0.5})
    if form == "body":
        # Drag goes with the square of the wind: together they grow with the strength.
        quarter = {"mean_m_s": 0.25, "gust_m_s": 0.25, "per_metre": 0.5}
        return Effect("wind", form, {**values, "per_metre": float(rng.uniform(0.02, 0.035))}, quarter)
    return Effect("wind", form, values, root)


def thrust_scale(rng: np.random.Generator, form: str, vehicle: Vehicle, demand: Demand) -> Effect:
    """7 to 17 % of thrust: 700 to 1800 m of altitude, or another propeller of the same size."""
    share = float(_sign(rng) * rng.uniform(0.07, 0.17))
    return Effect("thrust_scale", form, {"share": share}, {"share": 1})


def payload(rng: np.random.Generator, form: str, vehicle: Vehicle, demand: Demand) -> Effect:
    """Mass of 12 to 28 % that is taken up or dropped; its moment is set for each flight."""
    share = float(rng.uniform(0.14, 0.28) if form == "taken" else -rng.uniform(0.12, 0.22))
    return Effect("payload", "step", {"share": share, "moment_s": 0.0}, {"share": 1})


def battery_sag(rng: np.random.Generator, form: str, vehicle: Vehicle, demand: Demand) -> Effect:
    """Open-loop ESCs on a small battery; the voltage follows from the pack."""
    return Effect("battery_sag", "open_loop", {"share": 1.0}, {"share": 1})


def motor_lag(rng: np.random.Generator, form: str, vehicle: Vehicle, demand: Demand) -> Effect:
    """Time constants of 70 to 110 ms: propellers that are heavy for their motors."""
    return Effect(
        "motor_lag", "first_order", {"time_constant_s": float(rng.uniform(0.07, 0.11))}, {"time_constant_s": 1}
    )


def thrust_tilt(rng: np.random.Generator, form: str, vehicle: Vehicle, demand: Demand) -> Effect:
    """Rotor axes, or the autopilot's board, askew by 2 to 4.5 degrees."""
    size, course = np.radians(rng.uniform(2.0, 4.5)), rng.uniform(0, 2 * np.pi)
    angles = [float(size * np.cos(course)), float(size * np.sin(course))]
    return Effect("thrust_tilt", form, {"angles_rad": angles}, {"angles_rad": 1})


def tether(rng: np.random.Generator, form: str, vehicle: Vehicle, demand: Demand) -> Effect:
    """Cable whose weight at the greatest height is 12 to 24 % of the vehicle's."""
    weight = GRAVITY * rng.uniform(0.14, 0.24) / demand.high
    values: dict[str, float | list[float]] = {"weight_per_metre": float(weight), "free_m": 0.0, "anchor_m": [0.0, 0.0]}
    return Effect("tether", form, values, {"weight_per_metre": 1})


def rotor_fault(rng: np.random.Generator, form: str, vehicle: Vehicle, demand: Demand) -> Effect:
    """Rotor that gives 14 to 24 % less, more of it the more rotors there are."""
    loss = float(rng.uniform(0.14, 0.22) * (1.0 + 0.1 * (vehicle.count - 4)))
    rotor = float(rng.integers(vehicle.count))
    return Effect("rotor_fault", "loss", {"rotor": rotor, "loss": loss, "moment_s": -100.0}, {"loss": 1})


def thrust_curve(rng: np.random.Generator, form: str, vehicle: Vehicle, demand: Demand) -> Effect:
    """Exponents of 2.3 to 2.6 or 1.4 to 1.7, or a linear part of a third to a half of the thrust."""
    if form == "mixed":
        return Effect("thrust_curve", form, {"linear": float(rng.uniform(0.35, 0.55))}, {"linear": 1})
    excess = float(rng.uniform(0.3, 0.6) * _sign(rng))
    return Effect("thrust_curve", form, {"excess": excess}, {"excess": 1})


def by_blades(family: str) -> Draw:
    """Effects that follow from the blades alone."""

    def draw(rng: np.random.Generator, form: str, vehicle: Vehicle, demand: Demand) -> Effect:
        return Effect(family, "blades", {"share": 1.0}, {"share": 1})

    return draw


def imu_bias(rng: np.random.Generator, form: str, vehicle: Vehicle, demand: Demand) -> Effect:
    """Bias of 0.25 to 0.6 m/s^2 of an accelerometer that was not calibrated, along all axes."""
    way = rng.normal(size=3)
    bias = way / np.linalg.norm(way) * rng.uniform(0.3, 0.6)
    return Effect("imu_bias", "constant", {"bias_m_s2": bias.tolist()}, {"bias_m_s2": 1})


def ground_torque(rng: np.random.Generator, form: str, vehicle: Vehicle, demand: Demand) -> Effect:
    """Levelling moment of two to three fifths of weight times arm times tilt, extrapolated to the ground."""
    values: dict[str, float | list[float]] = {
        "gain": float(rng.uniform(0.4, 0.7)),
        "decay": float(rng.uniform(1.2, 2.0)),
    }
    return Effect("ground_torque", "levelling", values, {"gain": 1})


def rotor_interaction(rng: np.random.Generator, form: str, vehicle: Vehicle, demand: Demand) -> Effect:
    """Rear rotors that lose up to 12 to 22 % of their thrust at speed."""
    return Effect("rotor_interaction", "wake", {"loss": float(rng.uniform(0.14, 0.24))}, {"loss": 1})


def thrust_map(rng: np.random.Generator, form: str, vehicle: Vehicle, demand: Demand) -> Effect:
    """Line from command to thrust whose slope is off by 15 to 30 % and whose thrust in hover is off by up to 8 %."""
    slope = float(1.0 + _sign(rng) * rng.uniform(0.15, 0.3))
    offset = float(1.0 - slope + _sign(rng) * rng.uniform(0.03, 0.08))
    return Effect("thrust_map", "line", {"slope_error": slope - 1.0, "offset": offset}, {"slope_error": 1, "offset": 1})


DRAWS: dict[str, Draw] = {
    "ground_effect": ground_effect,
    "ceiling_effect": ceiling_effect,
    "rotor_drag": rotor_drag,
    "body_drag": body_drag,
    "wind": wind,
    "thrust_scale": thrust_scale,
    "payload": payload,
    "battery_sag": battery_sag,
    "motor_lag": motor_lag,
    "thrust_tilt": thrust_tilt,
    "tether": tether,
    "rotor_fault": rotor_fault,
    "thrust_curve": thrust_curve,
    "inflow": by_blades("inflow"),
    "translational_lift": by_blades("translational_lift"),
    "imu_bias": imu_bias,
    "ground_torque": ground_torque,
    "rotor_interaction": rotor_interaction,
    "thrust_map": thrust_map,
}
