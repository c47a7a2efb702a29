"""Forces and moments on all flights at once, with whatever is hidden in each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from studies.worlds.open.effects import MAX_ROTORS, TABLE, TABLE_STEP, Hidden
from studies.worlds.open.vehicles import DENSITY_KG_M3, GRAVITY_M_S2, Array, Craft

INFLOW_LAG_S = 0.03


@dataclass(frozen=True)
class Loads:
    """Force in the world and moment in the body, and what of the moment only the hidden effects explain."""

    force: Array
    moment: Array
    levelling: Array
    mass: Array


def padded(values: Array, fill: float = 0.0) -> Array:
    """Values of the rotors of one vehicle, filled up to the largest number of rotors."""
    out = np.full((MAX_ROTORS, *values.shape[1:]), fill)
    out[: len(values)] = values
    return out


def _lookup(table: Array, clearance: Array) -> Array:
    """Interpolation in one table for each flight, at one clearance each."""
    place = np.clip(clearance / TABLE_STEP, 0.0, len(TABLE) - 1.001)
    low = place.astype(np.int64)
    share = place - low
    rows = np.arange(len(table))
    return np.asarray(table[rows, low] * (1.0 - share) + table[rows, low + 1] * share)


class World:
    """Vehicles and their hidden physics, stacked, with the state of the rotor inflow."""

    def __init__(self, crafts: Sequence[Craft], hiddens: Sequence[Hidden], ceilings: Sequence[float | None]) -> None:
        """Stack the numbers of all flights."""

        def each(name: str) -> Array:
            return np.array([getattr(h, name) for h in hiddens], dtype=float)

        self.mass = np.array([c.mass_kg for c in crafts])
        self.inertia = np.array([c.inertia_kg_m2 for c in crafts])
        self.radius = np.array([c.radius_m for c in crafts])
        self.height = np.array([c.rotor_height_m for c in crafts])
        self.count = np.array([float(c.count) for c in crafts])
        self.k = np.array([c.thrust_n_per_rpm2 for c in crafts])
        self.torque = np.array([c.torque_to_thrust_m for c in crafts])
        self.hover = np.array([c.hover_rpm for c in crafts])
        self.gain = np.array([padded(c.rotor_gains) for c in crafts]) * self.k[:, None]
        self.x = np.array([padded(c.positions_m[:, 0]) for c in crafts])
        self.y = np.array([padded(c.positions_m[:, 1]) for c in crafts])
        self.spin = np.array([padded(c.spins) for c in crafts])
        self.arm = np.array([c.arm_m for c in crafts])
        self.roof = np.array([1e6 if c is None else c for c in ceilings])
        self.h = {name: each(name) for name in Hidden.__dataclass_fields__}
        tilt = self.h["tilt_rad"]
        self.axis = np.stack([np.sin(tilt[:, 0]), np.sin(tilt[:, 1]), -np.ones(len(tilt))], axis=1)
        self.axis /= np.linalg.norm(self.axis, axis=1, keepdims=True)
        self.disc = 2.0 * DENSITY_KG_M3 * np.pi * self.radius**2
        self.induced = np.sqrt(self.k * self.hover**2 / self.disc)
        self.bent = bool(np.any(self.h["exponent"] != 2.0))

    def _blades(self, mean_rpm: Array, along: Array, edge: Array, step: float) -> Array:
        """Factor of thrust by the inflow, with the induced velocity relaxing to momentum theory's."""
        climb, forward = self.h["blade_climb"], self.h["blade_forward"]
        through = climb * along
        hover = np.sqrt(self.k / self.disc) * mean_rpm
        stream = np.hypot(forward * edge, through + self.induced)
        goal = hover**2 / np.maximum(stream, 0.4 * hover)
        self.induced = self.induced + (goal - self.induced) * min(1.0, 0.5 * step / INFLOW_LAG_S)
        tip = mean_rpm * (np.pi / 30.0) * self.radius
        return np.asarray(1.0 - self.h["blade"] * (through + self.induced - hover) / tip)

    def loads(
        self,
        time: float | Array,
        position: Array,
        velocity: Array,
        rotation: Array,
        rpm: Array,
        gust: Array,
        step: float,
    ) -> Loads:
        """Loads at one time."""
        h = self.h
        air = np.einsum("nji,nj->ni", rotation, velocity - h["wind_m_s"])
        edge = np.hypot(air[:, 0], air[:, 1])
        thrust = self.gain * rpm**2
        if self.bent:
            thrust = thrust * (np.maximum(rpm, 1.0) / self.hover[:, None]) ** (h["exponent"][:, None] - 2.0)
        mean_rpm = rpm.sum(axis=1) / self.count
        factor = h["scale"] * self._blades(mean_rpm, -air[:, 2], edge, step)
        plane = -position[:, 2] + self.height
        near = _lookup(h["ground"], plane / self.radius)
        above = _lookup(h["ceiling"], (self.roof - plane) / self.radius)
        ahead = (self.x * air[:, 0, None] + self.y * air[:, 1, None]) / (self.arm * np.maximum(edge, 1e-6))[:, None]
        wake = np.minimum(h["wake_s_m"] * edge, 0.4)[:, None] * np.maximum(-ahead, 0.0)
        thrust = thrust * h["rotors"] * (factor * (1.0 + near + above))[:, None] * (1.0 - wake)
        total = thrust.sum(axis=1)
        speed = np.linalg.norm(air, axis=1)
        hub = 1.0 + h["drag_by_speed"] * (mean_rpm / self.hover - 1.0)
        body = total[:, None] * self.axis - h["drag_n_s_m"] * hub[:, None] * air
        body -= 0.5 * DENSITY_KG_M3 * h["area_m2"] * speed[:, None] * air
        force = np.einsum("nij,nj->ni", rotation, body) + self.mass[:, None] * gust
        mass = self.mass + np.where(time >= h["load_time_s"], h["load_kg"], 0.0)
        force[:, 2] += mass * GRAVITY_M_S2
        force[:, 2] += h["tether_n_m"] * np.maximum(-position[:, 2] - h["tether_from_m"], 0.0)
        stiff = h["level_1_s2"] * np.exp(-np.maximum(plane, 0.0) / (1.5 * self.radius))
        levelling = np.zeros_like(force)
        levelling[:, 0] = -stiff * rotation[:, 2, 1]
        levelling[:, 1] = stiff * rotation[:, 2, 0]
        levelling *= self.inertia
        moment = np.stack(
            [
                -np.sum(self.y * thrust, axis=1),
                np.sum(self.x * thrust, axis=1),
                self.torque * np.sum(self.spin * thrust, axis=1),
            ],
            axis=1,
        )
        return Loads(force, moment + levelling, levelling, mass)
