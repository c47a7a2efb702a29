"""Vehicles: specimens of those that a simulator publishes, and what their user believes of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

GRAVITY_M_S2 = 9.81
DENSITY_KG_M3 = 1.2
RPM = 30.0 / np.pi
FLIP = np.array([1.0, -1.0, -1.0])
"""Between north, west, up and north, east, down; forward, left, up and forward, right, down."""


@dataclass(frozen=True)
class Kind:
    """Vehicle as its simulator publishes it."""

    mass_kg: float
    inertia_kg_m2: Array
    radius_m: float
    thrust: float
    """N/(rad/s)^2 of one rotor."""
    torque_m: float
    """Drag torque over thrust."""
    positions_m: Array
    clockwise: Array
    """1 for a rotor that turns clockwise seen from above, -1 for the others."""
    max_thrust_n: float
    lag_s: tuple[float, float]
    cells: int


@dataclass(frozen=True)
class Craft:
    """Specimen of a vehicle, and by which factors the user's numbers are off."""

    name: str
    kind: Kind
    mass_kg: float
    inertia_kg_m2: Array
    thrust: float
    rotor_gains: Array
    lag_s: float
    rotor_height_m: float
    throttle_offset: float
    believed_mass: float
    believed_thrust: float
    believed_inertia: Array

    @property
    def count(self) -> int:
        """Number of rotors."""
        return len(self.kind.clockwise)

    @property
    def arm_m(self) -> float:
        """Distance of the rotors from the centre of mass."""
        return float(np.linalg.norm(self.kind.positions_m[0]))

    @property
    def hover_rad_s(self) -> float:
        """Rotor speed in hover."""
        return float(np.sqrt(self.mass_kg * GRAVITY_M_S2 / self.count / self.thrust))

    @property
    def throttle_per_newton(self) -> float:
        """Slope of the throttle line: full throttle is the full thrust of all rotors."""
        return (1.0 - self.throttle_offset) / (self.count * self.kind.max_thrust_n)

    def allocation(self) -> Array:
        """Matrix from rotor thrusts to total thrust and the moments about the three body axes."""
        x, y = self.kind.positions_m[:, 0], self.kind.positions_m[:, 1]
        return np.stack([np.ones(self.count), y, -x, self.kind.clockwise * self.kind.torque_m])


def draw_craft(name: str, kind: Kind, rng: np.random.Generator) -> Craft:
    """Specimen of a vehicle, each number a little off the published one."""
    gains = rng.normal(0.0, rng.uniform(0.005, 0.01), len(kind.clockwise))
    return Craft(
        name=name,
        kind=kind,
        mass_kg=kind.mass_kg * rng.uniform(0.96, 1.04),
        inertia_kg_m2=kind.inertia_kg_m2 * rng.uniform(0.95, 1.05, 3),
        thrust=kind.thrust * rng.uniform(0.96, 1.04),
        rotor_gains=1.0 + gains - gains.mean(),
        lag_s=rng.uniform(*kind.lag_s),
        rotor_height_m=round(rng.uniform(0.15, 0.4) * kind.radius_m, 4),
        throttle_offset=rng.uniform(0.04, 0.15),
        believed_mass=1.0 + rng.uniform(-0.0025, 0.0025),
        believed_thrust=1.0 + rng.uniform(-0.003, 0.003),
        believed_inertia=1.0 + rng.uniform(-0.05, 0.05, 3),
    )


def vehicle_file(craft: Craft, states_lag: bool, ceiling_m: float | None) -> dict[str, Any]:
    """Content of the vehicle file: what the user believes."""

    def digits(value: float) -> float:
        return float(f"{value:.5g}")

    kind, thrust = craft.kind, craft.believed_thrust
    content: dict[str, Any] = {
        "name": craft.name,
        "mass_kg": digits(craft.mass_kg * craft.believed_mass),
        "inertia_kg_m2": [digits(value) for value in craft.inertia_kg_m2 * craft.believed_inertia],
        "rotor": {
            "radius_m": digits(kind.radius_m),
            "thrust_n_per_rpm2": float(f"{craft.thrust / RPM**2 * thrust:.7g}"),
            "torque_to_thrust_m": digits(kind.torque_m),
            **({"time_constant_s": digits(craft.lag_s)} if states_lag else {}),
        },
        "rotors": [
            {"position_m": [digits(p) + 0.0 for p in place * FLIP], "spin": "cw" if spin > 0 else "ccw"}
            for place, spin in zip(kind.positions_m, kind.clockwise, strict=True)
        ],
        "rotor_height_m": craft.rotor_height_m,
        "throttle": {
            "per_newton": digits(craft.throttle_per_newton / thrust),
            "offset": digits(craft.throttle_offset),
            "max_thrust_per_rotor_n": digits(kind.max_thrust_n * thrust),
        },
        "air_density_kg_m3": DENSITY_KG_M3,
    }
    return content | ({} if ceiling_m is None else {"ceiling_m": ceiling_m})
