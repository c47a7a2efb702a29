"""Vehicles drawn at random, from 30 g quadrotors to 10 kg octorotors, and their files."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from studies.worlds.blade.rotation import Array
from studies.worlds.blade.rotors import pitch_for

GRAVITY = 9.80665
RPM = 60.0 / (2.0 * np.pi)
LARGEST_ROTORS = 8


@dataclass(frozen=True)
class Vehicle:
    """Numbers of a vehicle as its owner knows them, and the blades that only the world knows."""

    name: str
    mass: float
    inertia: Array
    radius: float
    k: float
    """Thrust coefficient, N s^2/rad^2, as in the vehicle file."""
    torque_to_thrust: float
    time_constant: float
    positions: Array
    spins: Array
    """+1 for a rotor that turns counter-clockwise seen from above: it yaws the body to the right."""
    rotor_height: float
    largest_thrust: float
    """Thrust of one rotor at full throttle, N."""
    air_density: float
    lift: float
    pitch: float
    throttle: tuple[float, float]
    """Throttle per newton of total thrust, and offset."""
    ceiling: float | None = None

    @property
    def count(self) -> int:
        """Number of rotors."""
        return len(self.spins)

    @property
    def arm(self) -> float:
        """Distance of the rotors from the centre."""
        return float(np.hypot(*self.positions[0, :2]))

    @property
    def hover_speed(self) -> float:
        """Rotor speed in hover, rad/s, by the vehicle file."""
        return float(np.sqrt(self.mass * GRAVITY / (self.count * self.k)))


def rotor_places(layout: str, arm: float) -> tuple[Array, Array]:
    """Positions and spins of the rotors of `x4`, `plus4`, `x6`, `plus6` or `x8`, clockwise from the front."""
    count = int(layout[-1])
    first = 0.0 if layout.startswith("plus") else np.pi / count
    angles = first + 2.0 * np.pi * np.arange(count) / count
    positions = np.stack([arm * np.cos(angles), arm * np.sin(angles), np.zeros(count)], axis=-1)
    return np.round(positions, 4), np.where(np.arange(count) % 2 == 0, 1.0, -1.0)


def draw_vehicle(rng: np.random.Generator, name: str, mass_range: tuple[float, float]) -> Vehicle:
    """Vehicle with a mass in the range; its sizes follow those of vehicles that are flown."""
    mass = float(np.exp(rng.uniform(*np.log(mass_range))))
    layouts = ["x4", "plus4"] if mass < 0.8 else ["x4", "x4", "x6", "plus6"] if mass < 3 else ["x4", "x6", "x6", "x8"]
    layout = str(rng.choice(layouts))
    count = int(layout[-1])
    # 30 g with arms of 46 mm (Crazyflie), 1.5 kg with 0.2 m, 10 kg with 0.55 m.
    arm = 0.046 * (mass / 0.03) ** 0.41 * rng.uniform(0.9, 1.12) * {4: 1.0, 6: 1.08, 8: 1.2}[count]
    gap = 2.0 * arm * np.sin(np.pi / count)
    radius = gap * (rng.uniform(0.34, 0.45) if count == 4 else rng.uniform(0.40, 0.46))
    density = 1.2
    positions, spins = rotor_places(layout, arm)
    c_t = rng.uniform(0.0095, 0.0135)
    k = c_t * density * np.pi * radius**4
    lift = rng.uniform(0.08, 0.13) * rng.uniform(5.2, 5.7)
    gyration = rng.uniform(0.46, 0.55) * arm
    inertia = mass * gyration**2 * np.array([1.0, rng.uniform(1.0, 1.15), rng.uniform(1.7, 1.95)])
    largest = rng.uniform(2.0, 3.5) * mass * GRAVITY / count
    if rng.random() < 0.2:
        largest = rng.uniform(1.6, 2.0) * mass * GRAVITY / count
    offset = rng.uniform(0.0, 0.18)
    return Vehicle(
        name=name,
        mass=round(mass, 4),
        inertia=inertia,
        radius=round(float(radius), 4),
        k=float(k),
        torque_to_thrust=round(float(radius * rng.uniform(0.11, 0.15)), 5),
        time_constant=round(float(np.clip(0.02 + 0.04 * (mass / 10) ** 0.45 + rng.uniform(0, 0.02), 0.02, 0.08)), 3),
        positions=positions,
        spins=spins,
        rotor_height=round(float(arm * rng.uniform(0.05, 0.3)), 3),
        largest_thrust=float(largest),
        air_density=density,
        lift=float(lift),
        pitch=float(pitch_for(c_t, lift)),
        throttle=((1.0 - offset) / (largest * count), offset),
    )


def vehicle_file(vehicle: Vehicle, with_lag: bool) -> dict[str, Any]:
    """Contents of the vehicle file; `with_lag` says whether the owner knows the time constant of the motors."""
    rotor: dict[str, float] = {
        "radius_m": vehicle.radius,
        "thrust_n_per_rpm2": float(f"{vehicle.k / RPM**2:.7g}"),
        "torque_to_thrust_m": vehicle.torque_to_thrust,
    }
    if with_lag:
        rotor["time_constant_s"] = vehicle.time_constant
    content: dict[str, Any] = {
        "name": vehicle.name,
        "mass_kg": vehicle.mass,
        "inertia_kg_m2": [float(f"{i:.4g}") for i in vehicle.inertia],
        "rotor": rotor,
        "rotors": [
            {"position_m": [float(x) for x in position], "spin": "ccw" if spin > 0 else "cw"}
            for position, spin in zip(vehicle.positions, vehicle.spins, strict=True)
        ],
        "rotor_height_m": vehicle.rotor_height,
        "throttle": {
            "per_newton": float(f"{vehicle.throttle[0]:.6g}"),
            "offset": float(f"{vehicle.throttle[1]:.6g}"),
            "max_thrust_per_rotor_n": float(f"{vehicle.largest_thrust:.5g}"),
        },
        "air_density_kg_m3": vehicle.air_density,
    }
    if vehicle.ceiling is not None:
        content["ceiling_m"] = vehicle.ceiling
    return content


def write_vehicle(path: Path, vehicle: Vehicle, with_lag: bool) -> None:
    """Vehicle file at path."""
    path.write_text(yaml.safe_dump(vehicle_file(vehicle, with_lag), sort_keys=False), encoding="utf-8")
