"""Hidden effects as forces and moments, for all flights of a case at once (N flights, n rotors).

Each effect takes the state of the air and its parameters, and changes the loads; `Air.strength` scales what it does.
A simulator that has physics of its own for an effect (`Simulator.own`) takes its parameters instead.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from studies.worlds.borrowed.craft import DENSITY_KG_M3, GRAVITY_M_S2, Array, Craft

Parameters = Mapping[str, float]


@dataclass(frozen=True)
class Fleet:
    """Numbers of the vehicles that fly together, a row for each flight."""

    strength: Array
    mass_kg: Array
    inertia_kg_m2: Array
    """(N, 3)."""
    radius_m: Array
    rotor_height_m: Array
    thrust: Array
    """(N, n): N/(rad/s)^2 of each rotor."""
    torque_m: Array
    positions_m: Array
    """(N, n, 3)."""
    clockwise: Array
    """(N, n)."""
    hover_rad_s: Array
    ceiling_m: Array

    @classmethod
    def of(cls, crafts: list[Craft], strengths: list[float], ceilings: list[float | None]) -> Fleet:
        """Vehicles side by side; all have the same number of rotors."""
        return cls(
            np.array(strengths),
            np.array([c.mass_kg for c in crafts]),
            np.array([c.inertia_kg_m2 for c in crafts]),
            np.array([c.kind.radius_m for c in crafts]),
            np.array([c.rotor_height_m for c in crafts]),
            np.array([c.thrust * c.rotor_gains for c in crafts]),
            np.array([c.kind.torque_m for c in crafts]),
            np.array([c.kind.positions_m for c in crafts]),
            np.array([c.kind.clockwise for c in crafts]),
            np.array([c.hover_rad_s for c in crafts]),
            np.array([1e6 if c is None else c for c in ceilings]),
        )

    @property
    def induced_m_s(self) -> Array:
        """Induced velocity in hover."""
        lift = self.mass_kg * GRAVITY_M_S2 / self.thrust.shape[1]
        return np.asarray(np.sqrt(lift / (2.0 * DENSITY_KG_M3 * np.pi * self.radius_m**2)))


@dataclass
class Air:
    """State of all flights at one time, and what the effects make of it."""

    fleet: Fleet
    time_s: float
    position: Array
    velocity: Array
    rotation: Array
    """From body to world, (N, 3, 3)."""
    rates: Array
    speeds: Array
    """Speeds of the rotors, rad/s, (N, n)."""
    gain: Array
    """Factor on the thrust of each rotor, (N, n)."""
    body_force: Array
    world_force: Array
    moment: Array
    load_kg: Array

    @classmethod
    def still(
        cls, fleet: Fleet, time_s: float, position: Array, velocity: Array, rotation: Array, rates: Array, speeds: Array
    ) -> Air:
        """State on which nothing acts yet."""
        body, world, moment = np.zeros((3, len(fleet.mass_kg), 3))
        return cls(
            fleet,
            time_s,
            position,
            velocity,
            rotation,
            rates,
            speeds,
            np.ones_like(speeds),
            body,
            world,
            moment,
            0.0 * fleet.mass_kg,
        )

    @property
    def flow(self) -> Array:
        """Velocity of the vehicle in its body axes."""
        return np.asarray(np.einsum("nji,nj->ni", self.rotation, self.velocity))

    @property
    def clearance(self) -> Array:
        """Height of each rotor over the ground, in radii."""
        f = self.fleet
        hubs = np.einsum("nj,nrj->nr", self.rotation[:, 2], f.positions_m)
        return np.asarray((self.position[:, 2] + f.rotor_height_m)[:, None] + hubs) / f.radius_m[:, None]

    def lift(self, change: Array) -> None:
        """Change the thrust of each rotor by a share, times the strength."""
        self.gain *= 1.0 + self.fleet.strength[:, None] * change


def ground_images(air: Air, p: Parameters) -> None:
    """Image of each rotor below the ground, Cheeseman and Bennett (1955), with a factor for the other rotors."""
    z = np.maximum(air.clearance, 0.6)
    air.lift(1.0 / (1.0 - np.minimum(p["rho"] / (16.0 * z**2), 0.4)) - 1.0)


def ground_hayden(air: Air, p: Parameters) -> None:
    """Hayden (1976), from flight tests at constant power, without its offset far from the ground."""
    air.lift((1.0 + p["a"] * 0.03794 * 4.0 / np.maximum(air.clearance, 0.6) ** 2) ** (2.0 / 3.0) - 1.0)


def _gap(air: Air, least: float) -> Array:
    return np.maximum(air.fleet.ceiling_m[:, None] / air.fleet.radius_m[:, None] - air.clearance, least)


def ceiling_sanchez(air: Air, p: Parameters) -> None:
    """Sanchez-Cuevas et al. (2017), fitted to a bench."""
    air.lift(1.0 / (1.0 - 1.0 / p["a1"] / (_gap(air, 0.15) + p["a2"]) ** 2) - 1.0)


def ceiling_throttled(air: Air, p: Parameters) -> None:
    """Momentum theory of a rotor with a throttled inlet, Hsiao and Chirarattananon (2018)."""
    air.lift((0.5 + 0.5 * np.sqrt(1.0 + 1.0 / (p["a"] * _gap(air, 0.15) ** 2))) ** (4.0 / 3.0) - 1.0)


def rotor_drag(air: Air, p: Parameters) -> None:
    """Hub force of flapping blades, proportional to rotor speed and flow in the rotor plane."""
    turn = air.speeds.mean(axis=1) / air.fleet.hover_rad_s * air.fleet.mass_kg * air.fleet.strength
    air.body_force[:, :2] -= turn[:, None] * air.flow[:, :2] * np.array([p["x"], p["y"]])


def body_drag(air: Air, p: Parameters) -> None:
    """Drag of the airframe, quadratic in the speed, with an area for each axis."""
    area = air.fleet.strength[:, None] * np.array([p["x"], p["y"], p["z"]])
    speed = np.linalg.norm(air.velocity, axis=1, keepdims=True)
    air.body_force -= 0.5 * DENSITY_KG_M3 * area * speed * air.flow


def wind(air: Air, p: Parameters) -> None:
    """Steady wind, felt by a linear or a quadratic drag of its own that is as on the ordinary vehicle."""
    course = np.radians(p["course_deg"])
    blow = air.fleet.strength[:, None] * p["speed"] * np.array([np.cos(course), -np.sin(course), 0.0])
    past = air.velocity - blow
    speed = np.linalg.norm(past, axis=1)
    felt = air.fleet.mass_kg * p.get("rate", 0.0) + 0.5 * DENSITY_KG_M3 * p.get("area", 0.0) * speed
    air.world_force -= felt[:, None] * past


def _induced(climb: Array, edge: Array) -> Array:
    """Induced velocity over that of hover, by momentum theory, at a flow through and along the disc."""
    w = 1.0 / np.sqrt(1.0 + 0.5 * edge**2 + np.maximum(climb, 0.0))
    for _ in range(4):
        root = np.sqrt(edge**2 + (climb + w) ** 2) + 1e-9
        w = w - (w * root - 1.0) / (root + w * (climb + w) / root)
    return np.asarray(w)


def inflow(air: Air, p: Parameters) -> None:
    """Thrust of blade elements at the inflow of a climb; momentum theory's induced velocity."""
    f = air.fleet
    climb = np.maximum(air.flow[:, 2] / f.induced_m_s, -0.7)
    tip = air.speeds.mean(axis=1) * f.radius_m
    air.lift((p["blade"] * f.induced_m_s * (1.0 - climb - _induced(climb, 0.0 * climb)) / tip)[:, None])


def translational_lift(air: Air, p: Parameters) -> None:
    """Thrust of blade elements whose induced velocity falls in edgewise flow (Glauert)."""
    f = air.fleet
    edge = np.hypot(air.flow[:, 0], air.flow[:, 1]) / f.induced_m_s
    tip = air.speeds.mean(axis=1) * f.radius_m
    air.lift((p["blade"] * f.induced_m_s * (1.0 - _induced(0.0 * edge, edge)) / tip)[:, None])


def thrust_scale(air: Air, p: Parameters) -> None:
    """Thrust coefficient wrong by a share."""
    air.lift(np.full_like(air.gain, p["error"]))


def payload(air: Air, p: Parameters) -> None:
    """Load picked up or dropped in flight, a share of the mass."""
    if air.time_s >= p["time"]:
        air.load_kg += air.fleet.strength * p["share"] * air.fleet.mass_kg


def thrust_tilt(air: Air, p: Parameters) -> None:
    """Thrust axis that is not the axis of the frame."""
    tilt = air.fleet.strength[:, None] * np.radians([p["forward_deg"], p["left_deg"]])
    thrust = np.sum(air.fleet.thrust * air.speeds**2 * air.gain, axis=1)
    air.body_force[:, :2] += thrust[:, None] * np.sin(tilt)
    air.body_force[:, 2] += thrust * (np.sqrt(1.0 - np.sum(np.sin(tilt) ** 2, axis=1)) - 1.0)


def tether(air: Air, p: Parameters) -> None:
    """Weight of the cable that hangs below, a share of the vehicle's weight for each metre."""
    weight = air.fleet.strength * p["share"] * air.fleet.mass_kg * GRAVITY_M_S2
    air.world_force[:, 2] -= weight * np.maximum(air.position[:, 2], 0.0)


def rotor_fault(air: Air, p: Parameters) -> None:
    """Chipped propeller: one rotor gives less at the same speed."""
    air.lift(np.where(np.arange(air.gain.shape[1]) == int(p["rotor"]) - 1, -p["loss"], 0.0)[None])


def thrust_curve(air: Air, p: Parameters) -> None:
    """Thrust by another power of rotor speed than 2; it meets the square at hover."""
    ratio = np.maximum(air.speeds / air.fleet.hover_rad_s[:, None], 0.1)
    air.gain *= ratio ** (p["change"] * air.fleet.strength[:, None])


def rotor_interaction(air: Air, p: Parameters) -> None:
    """Rear rotors in the wake of the front ones, which is swept back flat as the speed grows."""
    flow = air.flow[:, :2]
    speed = np.linalg.norm(flow, axis=1)
    hubs = air.fleet.positions_m[:, :, :2]
    along = np.einsum("nri,ni->nr", hubs, flow) / np.maximum(speed, 1e-6)[:, None]
    behind = np.maximum(-along, 0.0) / np.linalg.norm(hubs[:, :1], axis=2)
    air.lift(-np.minimum(p["per_m_s"] * speed, 0.4)[:, None] * behind)


def ground_torque(air: Air, p: Parameters) -> None:
    """Levelling moment near the ground, exponential in the height over 1.5 radii."""
    height = (air.position[:, 2] + air.fleet.rotor_height_m) / air.fleet.radius_m
    stiff = (air.fleet.strength * p["stiffness"] * np.exp(-height / 1.5))[:, None] * air.fleet.inertia_kg_m2[:, :2]
    air.moment[:, :2] += stiff * np.column_stack([-air.rotation[:, 2, 1], air.rotation[:, 2, 0]])


EFFECTS: dict[str, Callable[[Air, Parameters], None]] = {
    "ground_effect.images": ground_images,
    "ground_effect.hayden": ground_hayden,
    "ceiling_effect.sanchez": ceiling_sanchez,
    "ceiling_effect.throttled": ceiling_throttled,
    "rotor_drag": rotor_drag,
    "body_drag": body_drag,
    "wind": wind,
    "inflow": inflow,
    "translational_lift": translational_lift,
    "thrust_scale": thrust_scale,
    "payload": payload,
    "tether": tether,
    "rotor_fault": rotor_fault,
    "thrust_curve": thrust_curve,
    "rotor_interaction": rotor_interaction,
    "ground_torque": ground_torque,
    "thrust_tilt": thrust_tilt,
}
"""Effects that are injected, the tilt of all thrust last."""

ELSEWHERE = ("battery_sag", "motor_lag", "thrust_map", "imu_bias")
"""Effects on the command, the motors and the accelerometers: no forces."""
