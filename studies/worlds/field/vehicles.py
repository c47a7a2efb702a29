"""Multirotors from 30 g to 10 kg: true masses, rotors and motors, and the vehicle files that describe them."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from studies.worlds.field.arrays import GRAVITY_M_S2, Floats


@dataclass(frozen=True)
class Vehicle:
    """True properties of one multirotor; lengths in the body frame (FRD), rotor speeds in rpm."""

    name: str
    mass_kg: float
    inertia_kg_m2: Floats
    radius_m: float
    positions_m: Floats
    """Rotor hubs from the geometric centre, shape (rotors, 3)."""
    yaw_signs: Floats
    """Sign of each rotor's reaction torque about body z (down): +1 for a rotor turning counter-clockwise from above."""
    thrust_n_per_rpm2: float
    rotor_spread: Floats
    """Relative deviation of each rotor's thrust coefficient, zero on average."""
    torque_to_thrust_m: float
    motor_time_s: float
    max_thrust_n: float
    """Largest thrust of one rotor."""
    rotor_height_m: float
    air_density_kg_m3: float
    throttle_offset: float
    throttle_per_newton: float
    centre_of_mass_m: Floats
    """Centre of mass from the geometric centre."""
    lift_slope_solidity: float
    """Product of blade lift slope and rotor solidity, for the blade-element effects."""
    cells: int
    battery_c_rate: float
    """Hover current in units of the pack's capacity per hour."""

    @property
    def rotors(self) -> int:
        """Number of rotors."""
        return len(self.yaw_signs)

    @property
    def hover_rpm(self) -> float:
        """Rotor speed in hover without any effect."""
        return float(np.sqrt(self.mass_kg * GRAVITY_M_S2 / self.rotors / self.thrust_n_per_rpm2))

    @property
    def induced_m_s(self) -> float:
        """Induced velocity in hover by momentum theory."""
        thrust = self.mass_kg * GRAVITY_M_S2 / self.rotors
        return float(np.sqrt(thrust / (2.0 * self.air_density_kg_m3 * np.pi * self.radius_m**2)))


def draw_vehicle(
    rng: np.random.Generator, name: str, mass_kg: float, rotors: int, motor_time_s: float | None = None
) -> Vehicle:
    """Draw a vehicle of a given mass and number of rotors: sizes follow the trend of built multirotors."""
    trend = np.log(mass_kg / 0.03) / np.log(10.0 / 0.03)
    per_rotor = mass_kg * (4.0 / rotors) ** 0.5
    radius = float(np.clip(0.023 * (per_rotor / 0.03) ** 0.392 * rng.uniform(0.92, 1.1), 0.023, 0.25))
    clearance = rng.uniform(1.06, 1.3)
    arm = radius * clearance / np.sin(np.pi / rotors)
    angles = np.pi / rotors + 2.0 * np.pi * np.arange(rotors) / rotors
    stretch = rng.uniform(0.86, 1.0) if rotors == 4 else 1.0
    positions = np.stack([arm * np.cos(angles) * stretch, arm * np.sin(angles), np.zeros(rotors)], axis=1)
    signs = np.where(np.arange(rotors) % 2 == 0, 1.0, -1.0)
    order = rng.permutation(rotors)
    along = mass_kg * arm**2 * rng.uniform(0.2, 0.28)
    inertia = np.array([along, along * rng.uniform(1.0, 1.25), along * rng.uniform(1.65, 1.95)])
    tip_speed = (38.0 + 40.0 * trend) * rng.uniform(0.9, 1.1)
    hover_thrust = mass_kg * GRAVITY_M_S2 / rotors
    hover_rpm = tip_speed / radius * 60.0 / (2.0 * np.pi)
    spread = rng.normal(0.0, rng.uniform(0.005, 0.015), rotors)
    max_thrust = hover_thrust * rng.uniform(1.9, 2.9)
    offset = rng.uniform(0.03, 0.16)
    centre = np.append(rng.normal(0.0, 0.006, 2) * arm, 0.0)
    return Vehicle(
        name=name,
        mass_kg=mass_kg,
        inertia_kg_m2=inertia,
        radius_m=radius,
        positions_m=positions[order],
        yaw_signs=signs[order],
        thrust_n_per_rpm2=hover_thrust / hover_rpm**2,
        rotor_spread=np.clip(spread - spread.mean(), -0.02, 0.02),
        torque_to_thrust_m=radius * rng.uniform(0.11, 0.16),
        motor_time_s=motor_time_s or (0.016 + 0.03 * trend) * rng.uniform(0.85, 1.25),
        max_thrust_n=max_thrust,
        rotor_height_m=round(float(rng.choice([0.0, 0.15, 0.3]) * radius * rng.uniform(0.8, 1.2)), 4),
        air_density_kg_m3=round(float(rng.uniform(1.13, 1.23)), 3),
        throttle_offset=offset,
        throttle_per_newton=(1.0 - offset) / (rotors * max_thrust),
        centre_of_mass_m=centre,
        lift_slope_solidity=rng.uniform(0.5, 0.75),
        cells=1 if mass_kg < 0.1 else (3 if mass_kg < 0.8 else (4 if mass_kg < 3.0 else 6)),
        battery_c_rate=rng.uniform(5.0, 9.0),
    )


@dataclass(frozen=True)
class Beliefs:
    """Values that the vehicle file states and that the autopilot uses; each differs from the truth."""

    mass_kg: float
    thrust_n_per_rpm2: float
    inertia_kg_m2: Floats


def draw_beliefs(rng: np.random.Generator, vehicle: Vehicle) -> Beliefs:
    """Draw what a careful person would have measured: mass and thrust coefficient within 0.5 %, inertia within 20 %."""
    return Beliefs(
        mass_kg=vehicle.mass_kg * (1.0 + float(np.clip(rng.normal(0.0, 0.002), -0.005, 0.005))),
        thrust_n_per_rpm2=vehicle.thrust_n_per_rpm2 * (1.0 + float(np.clip(rng.normal(0.0, 0.0025), -0.005, 0.005))),
        inertia_kg_m2=vehicle.inertia_kg_m2 * (1.0 + rng.uniform(-0.18, 0.18, 3)),
    )


def vehicle_document(
    vehicle: Vehicle, beliefs: Beliefs, states_motor_time: bool, ceiling_m: float | None
) -> dict[str, Any]:
    """Content of the vehicle file, in the layout of the data contracts."""
    rotor: dict[str, float] = {
        "radius_m": round(float(vehicle.radius_m), 4),
        "thrust_n_per_rpm2": float(f"{beliefs.thrust_n_per_rpm2:.5g}"),
        "torque_to_thrust_m": round(float(vehicle.torque_to_thrust_m), 5),
    }
    if states_motor_time:
        rotor["time_constant_s"] = round(float(vehicle.motor_time_s), 3)
    document: dict[str, Any] = {
        "name": vehicle.name,
        "mass_kg": float(f"{beliefs.mass_kg:.4g}"),
        "inertia_kg_m2": [float(f"{value:.4g}") for value in beliefs.inertia_kg_m2],
        "rotor": rotor,
        "rotors": [
            {"position_m": [round(float(value), 5) for value in position], "spin": "ccw" if sign > 0 else "cw"}
            for position, sign in zip(vehicle.positions_m, vehicle.yaw_signs, strict=True)
        ],
        "rotor_height_m": vehicle.rotor_height_m,
        "throttle": {
            "per_newton": float(f"{vehicle.throttle_per_newton:.5g}"),
            "offset": round(float(vehicle.throttle_offset), 4),
            "max_thrust_per_rotor_n": float(f"{vehicle.max_thrust_n:.4g}"),
        },
        "air_density_kg_m3": vehicle.air_density_kg_m3,
    }
    if ceiling_m is not None:
        document["ceiling_m"] = round(ceiling_m, 3)
    return document
