"""Multirotors of this world: what they are, and what their user believes of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

GRAVITY_M_S2 = 9.81
DENSITY_KG_M3 = 1.2


@dataclass(frozen=True)
class Kind:
    """Class of vehicle: nominal numbers, from which one specimen is drawn."""

    mass_kg: float
    arm_m: float
    radius_m: float
    rotors: int
    cells: int
    plus: bool = False


KINDS = {
    "nano": Kind(0.032, 0.046, 0.0235, 4, 1),
    "micro": Kind(0.25, 0.08, 0.038, 4, 2),
    "racer": Kind(0.75, 0.115, 0.0635, 4, 4),
    "quad": Kind(1.5, 0.18, 0.12, 4, 4),
    "plus": Kind(1.2, 0.21, 0.125, 4, 3, plus=True),
    "mapper": Kind(2.3, 0.24, 0.14, 4, 6),
    "carrier": Kind(4.6, 0.34, 0.19, 4, 6),
    "hexa": Kind(3.6, 0.29, 0.13, 6, 6),
    "heavy": Kind(9.6, 0.5, 0.23, 6, 12),
}


@dataclass(frozen=True)
class Craft:
    """Specimen of a vehicle, as it is; `believed` tells how far the user's numbers are off."""

    name: str
    mass_kg: float
    inertia_kg_m2: Array
    radius_m: float
    thrust_n_per_rpm2: float
    rotor_gains: Array
    torque_to_thrust_m: float
    time_constant_s: float
    positions_m: Array
    spins: Array
    rotor_height_m: float
    max_thrust_n: float
    throttle_offset: float
    cells: int
    believed_mass: float
    believed_thrust: float
    believed_inertia: Array

    @property
    def count(self) -> int:
        """Number of rotors."""
        return len(self.spins)

    @property
    def arm_m(self) -> float:
        """Distance of the rotors from the centre of mass."""
        return float(np.linalg.norm(self.positions_m[0]))

    @property
    def hover_rpm(self) -> float:
        """Rotor speed in hover."""
        return float(np.sqrt(self.mass_kg * GRAVITY_M_S2 / self.count / self.thrust_n_per_rpm2))

    @property
    def throttle_per_newton(self) -> float:
        """Slope of the throttle line: full throttle is the full thrust of all rotors."""
        return (1.0 - self.throttle_offset) / (self.count * self.max_thrust_n)

    def allocation(self) -> Array:
        """Matrix from rotor thrusts to total thrust and the moments about the three body axes."""
        x, y = self.positions_m[:, 0], self.positions_m[:, 1]
        return np.stack([np.ones(self.count), -y, x, self.spins * self.torque_to_thrust_m])


def draw_craft(kind_name: str, rng: np.random.Generator) -> Craft:
    """Specimen of a class, each number a little off its nominal value."""
    kind = KINDS[kind_name]
    n = kind.rotors
    mass = kind.mass_kg * rng.uniform(0.93, 1.07)
    radius = kind.radius_m * rng.uniform(0.97, 1.03)
    arm = kind.arm_m * rng.uniform(0.97, 1.03)
    # Static thrust coefficient of T = c rho n^2 D^4, as in the propeller data of UIUC.
    thrust = rng.uniform(0.1, 0.125) * DENSITY_KG_M3 * (2.0 * radius) ** 4 / 3600.0
    if n == 4 and not kind.plus:
        angles, spins = np.radians([45.0, 225.0, -45.0, 135.0]), np.array([1.0, 1.0, -1.0, -1.0])
    elif n == 4:
        angles, spins = np.radians([90.0, -90.0, 0.0, 180.0]), np.array([1.0, 1.0, -1.0, -1.0])
    else:
        angles, spins = np.radians(30.0 + 60.0 * np.arange(n)), np.where(np.arange(n) % 2 == 0, 1.0, -1.0)
    positions = arm * np.stack([np.cos(angles), np.sin(angles), np.zeros(n)], axis=1)
    gains = rng.normal(0.0, rng.uniform(0.005, 0.01), n)
    share = rng.uniform(0.24, 0.32)
    inertia = mass * arm**2 * np.array([share, share * rng.uniform(1.0, 1.12), 1.8 * share])
    return Craft(
        name=kind_name,
        mass_kg=mass,
        inertia_kg_m2=inertia,
        radius_m=radius,
        thrust_n_per_rpm2=thrust,
        rotor_gains=1.0 + gains - gains.mean(),
        torque_to_thrust_m=rng.uniform(0.12, 0.15) * radius,
        time_constant_s=rng.uniform(0.02, 0.035) if radius < 0.1 else rng.uniform(0.03, 0.05),
        positions_m=positions,
        spins=spins,
        rotor_height_m=round(rng.uniform(0.15, 0.4) * radius, 3),
        max_thrust_n=mass * GRAVITY_M_S2 / n * rng.uniform(2.0, 2.7),
        throttle_offset=rng.uniform(0.04, 0.15),
        cells=kind.cells,
        believed_mass=1.0 + rng.uniform(-0.0025, 0.0025),
        believed_thrust=1.0 + rng.uniform(-0.003, 0.003),
        believed_inertia=1.0 + rng.uniform(-0.05, 0.05, 3),
    )


def vehicle_file(craft: Craft, time_constant_s: float | None, ceiling_m: float | None) -> dict[str, Any]:
    """Content of the vehicle file: what the user believes."""
    rotor: dict[str, float] = {
        "radius_m": round(craft.radius_m, 4),
        "thrust_n_per_rpm2": float(f"{craft.thrust_n_per_rpm2 * craft.believed_thrust:.7g}"),
        "torque_to_thrust_m": float(f"{craft.torque_to_thrust_m:.4g}"),
    }
    if time_constant_s is not None:
        rotor["time_constant_s"] = round(time_constant_s, 4)
    content: dict[str, Any] = {
        "name": craft.name,
        "mass_kg": float(f"{craft.mass_kg * craft.believed_mass:.5g}"),
        "inertia_kg_m2": [float(f"{value:.4g}") for value in craft.inertia_kg_m2 * craft.believed_inertia],
        "rotor": rotor,
        "rotors": [
            {"position_m": [round(float(p), 5) for p in position], "spin": "ccw" if spin > 0 else "cw"}
            for position, spin in zip(craft.positions_m, craft.spins, strict=True)
        ],
        "rotor_height_m": craft.rotor_height_m,
        "throttle": {
            "per_newton": float(f"{craft.throttle_per_newton / craft.believed_thrust:.6g}"),
            "offset": round(craft.throttle_offset, 5),
            "max_thrust_per_rotor_n": float(f"{craft.max_thrust_n * craft.believed_thrust:.6g}"),
        },
        "air_density_kg_m3": DENSITY_KG_M3,
    }
    if ceiling_m is not None:
        content["ceiling_m"] = ceiling_m
    return content
