"""Hidden effects at sizes as found in the field, one draw per family; `strength` scales each of them."""

from collections.abc import Callable

import numpy as np

from studies.worlds.field.cases import Hidden
from studies.worlds.field.missions import Arena
from studies.worlds.field.vehicles import Vehicle

Draw = Callable[[np.random.Generator, Vehicle, Arena, float, int], tuple[Hidden, ...]]
LEAST_TILT_DEG = 0.9
"""A smaller tilt is a trim that every vehicle has, and no hidden effect."""


def _one(family: str, kind: str, **parameters: float) -> tuple[Hidden, ...]:
    return (Hidden((family,), f"{family}.{kind}", {name: float(value) for name, value in parameters.items()}),)


def _sign(rng: np.random.Generator) -> float:
    return float(rng.choice([-1.0, 1.0]))


def ground_effect(
    rng: np.random.Generator, vehicle: Vehicle, arena: Arena, strength: float, index: int
) -> tuple[Hidden, ...]:
    """Ground effect by one of five published forms."""
    choice = index % 5
    if choice == 0:
        return _one("ground_effect", "exponential", size=strength, a=rng.uniform(0.25, 0.5), b=rng.uniform(0.9, 1.6))
    if choice == 1:
        return _one("ground_effect", "sanchez", size=strength, body_lift=rng.uniform(0.5, 2.0))
    if choice == 2:
        return _one("ground_effect", "cheeseman_forward", size=strength, rho=rng.uniform(2.0, 4.0))
    if choice == 3:
        return _one("ground_effect", "hayden", size=strength * rng.uniform(1.2, 2.0))
    return _one("ground_effect", "kan", size=strength * rng.uniform(0.8, 1.5))


def rotor_drag(
    rng: np.random.Generator, vehicle: Vehicle, arena: Arena, strength: float, index: int
) -> tuple[Hidden, ...]:
    """Rotor drag: by a matrix, by rotor speed or by thrust."""
    per_s = strength * rng.uniform(0.16, 0.36) * (0.1 / vehicle.radius_m) ** 0.3
    if index % 3 == 0:
        return _one("rotor_drag", "speed", per_s=per_s)
    if index % 3 == 1:
        across = per_s * rng.uniform(0.75, 1.25)
        return _one("rotor_drag", "matrix", x=per_s, y=across, z=per_s * rng.uniform(0.1, 0.6))
    return _one("rotor_drag", "thrust", per_s=per_s)


def body_drag(
    rng: np.random.Generator, vehicle: Vehicle, arena: Arena, strength: float, index: int
) -> tuple[Hidden, ...]:
    """Drag of the body: frontal areas in proportion to the rotor disk, the plan area larger."""
    area = strength * rng.uniform(2.4, 4.2) * vehicle.radius_m**2 * (vehicle.rotors / 4.0)
    kind = "area" if index % 2 == 0 else "axes"
    side = area * rng.uniform(0.9, 1.5)
    return _one("body_drag", kind, area_x_m2=area, area_y_m2=side, area_z_m2=area * rng.uniform(1.5, 2.5))


def inflow(rng: np.random.Generator, vehicle: Vehicle, arena: Arena, strength: float, index: int) -> tuple[Hidden, ...]:
    """Change of thrust with climb rate."""
    if index % 2 == 0:
        return _one("inflow", "blade_element", size=strength * rng.uniform(0.85, 1.2))
    return _one("inflow", "linear", per_induced=strength * rng.uniform(0.22, 0.38))


def translational_lift(
    rng: np.random.Generator, vehicle: Vehicle, arena: Arena, strength: float, index: int
) -> tuple[Hidden, ...]:
    """Change of thrust with horizontal airspeed."""
    if index % 2 == 0:
        return _one("translational_lift", "glauert", size=strength * rng.uniform(0.85, 1.2))
    return _one("translational_lift", "quadratic", per_m=strength * rng.uniform(0.4, 0.8) / vehicle.induced_m_s**2)


def wind(rng: np.random.Generator, vehicle: Vehicle, arena: Arena, strength: float, index: int) -> tuple[Hidden, ...]:
    """Mean wind with the drag that makes it felt; only the wind is scaled."""
    strong = rng.uniform(5.0, 11.0)
    speed = strength * strong
    towards = rng.uniform(-np.pi, np.pi)
    parameters = {"north_m_s": float(speed * np.cos(towards)), "east_m_s": float(speed * np.sin(towards))}
    parameters["sheared"] = float(index % 2)
    if index % 3 == 1:
        drag = body_drag(rng, vehicle, arena, 1.0, index)[0]
    else:
        drag = rotor_drag(rng, vehicle, arena, min(1.0, 2.5 / strong / 0.36), index)[0]
    return (Hidden(("wind",), "wind.mean", parameters), Hidden(("wind",), drag.variant, drag.parameters))


def thrust_scale(
    rng: np.random.Generator, vehicle: Vehicle, arena: Arena, strength: float, index: int
) -> tuple[Hidden, ...]:
    """Thrust coefficient (even index) or mass (odd index) of the vehicle file wrong by a factor."""
    factor = 1.0 + strength * _sign(rng) * rng.uniform(0.05, 0.15)
    return _one("thrust_scale", "coefficient" if index % 2 == 0 else "mass", factor=factor)


def payload(
    rng: np.random.Generator, vehicle: Vehicle, arena: Arena, strength: float, index: int
) -> tuple[Hidden, ...]:
    """Mass picked up or dropped in one flight; the vehicle file holds the mass before."""
    sign = -1.0 if index % 2 == 0 else 1.0
    change = sign * strength * rng.uniform(0.08, 0.18)
    return _one("payload", "change", relative=change, mass_kg=change * vehicle.mass_kg)


def battery_sag(
    rng: np.random.Generator, vehicle: Vehicle, arena: Arena, strength: float, index: int
) -> tuple[Hidden, ...]:
    """Thrust at a given throttle by a power of the voltage, right at the voltage of the throttle calibration."""
    reference = vehicle.cells * rng.uniform(3.85, 3.98)
    return _one("battery_sag", "power", exponent=strength * rng.uniform(1.5, 2.0), reference_v=reference)


def motor_lag(
    rng: np.random.Generator, vehicle: Vehicle, arena: Arena, strength: float, index: int
) -> tuple[Hidden, ...]:
    """Commanded rotor speeds in the log, ahead of the true ones by the lag of the motors."""
    return _one("motor_lag", "first_order", time_constant_s=vehicle.motor_time_s)


def thrust_tilt(
    rng: np.random.Generator, vehicle: Vehicle, arena: Arena, strength: float, index: int
) -> tuple[Hidden, ...]:
    """Thrust axis tilted against the body by a constant angle."""
    angle = max(strength * rng.uniform(1.8, 3.2), LEAST_TILT_DEG)
    towards = rng.uniform(-np.pi, np.pi)
    return _one("thrust_tilt", "constant", roll_deg=angle * np.cos(towards), pitch_deg=angle * np.sin(towards))


def tether(rng: np.random.Generator, vehicle: Vehicle, arena: Arena, strength: float, index: int) -> tuple[Hidden, ...]:
    """Hanging cable (even index) or elastic line (odd index)."""
    share = strength * rng.uniform(0.06, 0.13)
    north, east = rng.uniform(-0.3, 0.3, 2) * min(arena.half_width_m, 3.0)
    if index % 2 == 0:
        per_m = share * vehicle.mass_kg / arena.high_m
        return _one(
            "tether", "hanging", kg_per_m=per_m, slack_m=rng.uniform(0.0, 0.4), lateral=rng.uniform(0.03, 0.25),
            north_m=north, east_m=east,
        )  # fmt: skip
    free = rng.uniform(0.2, 0.45) * arena.high_m
    stiffness = share * vehicle.mass_kg * 9.81 / (arena.high_m - free)
    return _one("tether", "elastic", n_per_m=stiffness, free_m=free, north_m=north, east_m=east)


def rotor_fault(
    rng: np.random.Generator, vehicle: Vehicle, arena: Arena, strength: float, index: int
) -> tuple[Hidden, ...]:
    """One rotor that gives less thrust."""
    rotor = int(rng.integers(1, vehicle.rotors + 1))
    return _one("rotor_fault", "loss", rotor=rotor, loss=strength * rng.uniform(0.08, 0.2))


def imu_bias(
    rng: np.random.Generator, vehicle: Vehicle, arena: Arena, strength: float, index: int
) -> tuple[Hidden, ...]:
    """Constant error of the accelerometer."""
    direction = rng.normal(0.0, 1.0, 3)
    bias = strength * rng.uniform(0.3, 0.6) * direction / np.linalg.norm(direction)
    return _one("imu_bias", "constant", x_m_s2=bias[0], y_m_s2=bias[1], z_m_s2=bias[2])


def thrust_curve(
    rng: np.random.Generator, vehicle: Vehicle, arena: Arena, strength: float, index: int
) -> tuple[Hidden, ...]:
    """Exponent of thrust over rotor speed."""
    exponent = 2.0 + strength * _sign(rng) * rng.uniform(0.07, 0.1)
    return _one("thrust_curve", "power", exponent=exponent, calibrated_over_hover=rng.uniform(0.9, 1.2))


def rotor_interaction(
    rng: np.random.Generator, vehicle: Vehicle, arena: Arena, strength: float, index: int
) -> tuple[Hidden, ...]:
    """Loss of the rear rotors in forward flight."""
    return _one("rotor_interaction", "wake", loss=strength * rng.uniform(0.2, 0.35), speed_ratio=rng.uniform(0.7, 1.3))


def ceiling_effect(
    rng: np.random.Generator, vehicle: Vehicle, arena: Arena, strength: float, index: int
) -> tuple[Hidden, ...]:
    """Gain of thrust under a ceiling by one of two published forms."""
    if index % 2 == 0:
        return _one("ceiling_effect", "sanchez", size=strength, a1=rng.uniform(10.0, 16.0), a2=rng.uniform(0.1, 0.4))
    return _one("ceiling_effect", "hsiao", size=strength * rng.uniform(1.2, 1.8))


def inflow_translational_lift(
    rng: np.random.Generator, vehicle: Vehicle, arena: Arena, strength: float, index: int
) -> tuple[Hidden, ...]:
    """Inflow and translational lift of one blade-element rotor."""
    families = ("translational_lift", "inflow")
    return (
        Hidden(families, "inflow+translational_lift.blade_element", {"size": strength * float(rng.uniform(0.85, 1.2))}),
    )


_ALL: tuple[Draw, ...] = (
    ground_effect,
    rotor_drag,
    body_drag,
    inflow,
    translational_lift,
    wind,
    thrust_scale,
    payload,
    battery_sag,
    motor_lag,
    thrust_tilt,
    tether,
    rotor_fault,
    imu_bias,
    thrust_curve,
    rotor_interaction,
    ceiling_effect,
)
FAMILIES = tuple(draw.__name__ for draw in _ALL)
DRAWS: dict[str, Draw] = dict(zip(FAMILIES, _ALL, strict=True)) | {
    "inflow+translational_lift": inflow_translational_lift
}
