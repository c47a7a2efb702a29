"""Integration of all flights at once, at 400 Hz, recorded at 200 Hz."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from studies.worlds.open.control import Controllers, Gains
from studies.worlds.open.effects import Hidden
from studies.worlds.open.missions import SETTLE_S, STEP_S, Reference
from studies.worlds.open.physics import World, padded
from studies.worlds.open.vehicles import GRAVITY_M_S2, Array, Craft

TICK_S = 0.0025
RECORD_S = 0.005
OUTER = round(STEP_S / TICK_S)
RECORD = round(RECORD_S / TICK_S)


@dataclass(frozen=True)
class Battery:
    """Battery of one flight: its endurance in hover, how empty it begins, and the drop in hover over the voltage."""

    endurance_s: float
    depth: float
    drop: float


@dataclass(frozen=True)
class Flight:
    """Flight to be flown: vehicle, hidden physics, reference, disturbances at 100 Hz, controller and battery."""

    craft: Craft
    hidden: Hidden
    reference: Reference
    gust: Array  # acceleration, world
    twist: Array  # angular acceleration, body
    hand: Array  # error of the wanted acceleration
    gains: Gains
    battery: Battery
    ceiling_m: float | None


@dataclass(frozen=True)
class Record:
    """Record of a flight, from the end of the settling, rows at 200 Hz."""

    position: Array
    velocity: Array
    acceleration: Array
    quaternion: Array
    rates: Array
    rpm: Array
    command: Array  # thrust wanted of each rotor
    angles: Array  # attitude wanted
    gust: Array
    levelling: Array  # hidden moment
    voltage: Array
    saturated: float


def rotations(q: Array) -> Array:
    """Rotation matrices from body to world of quaternions, one a row."""
    w, x, y, z = q.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def _turn(q: Array, rates: Array) -> Array:
    w, x, y, z = q.T
    a, b, c = rates.T
    slope = 0.5 * np.stack(
        [-x * a - y * b - z * c, w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a], 1
    )
    q = q + TICK_S * slope
    return np.asarray(q / np.linalg.norm(q, axis=1, keepdims=True))


def _fill(rows: Array, length: int) -> Array:
    return np.concatenate([rows, np.repeat(rows[-1:], length - len(rows), axis=0)])


def cell_voltage(depth: Array) -> Array:
    """Open voltage of a cell by the share of the charge that is used."""
    return np.asarray(4.2 - 0.55 * depth - 0.12 * (1.0 - np.exp(-15.0 * depth)))


class Motors:
    """Motors and batteries of all flights: thrust wanted of each rotor to rotor speed."""

    def __init__(self, flights: Sequence[Flight], world: World) -> None:
        """Take the vehicles and batteries."""
        crafts = [f.craft for f in flights]
        self.world = world
        self.mixer = np.array([padded(np.linalg.pinv(c.allocation()).astype(np.float64)) for c in crafts])
        self.alive = world.spin != 0.0
        self.most = np.array([c.max_thrust_n for c in crafts])[:, None]
        lag = np.array([c.time_constant_s for c in crafts]) + world.h["lag_s"]
        self.follow = (1.0 - np.exp(-TICK_S / lag))[:, None]
        self.lift = world.mass * GRAVITY_M_S2
        self.endurance = np.array([f.battery.endurance_s for f in flights])
        self.depth = np.array([f.battery.depth for f in flights])
        self.drop = np.array([f.battery.drop for f in flights])
        self.cells = np.array([float(c.cells) for c in crafts])
        self.full = cell_voltage(self.depth) * (1.0 - self.drop)  # at which the thrust was calibrated
        self.rpm = world.hover[:, None] * self.alive
        self.command = np.zeros_like(self.rpm)
        self.voltage = self.full * self.cells

    def step(self, wish: Array) -> Array:
        """Advance by one tick under the wanted thrust and moments; tells which flights saturate."""
        h = self.world.h
        each = np.einsum("nij,nj->ni", self.mixer, wish)
        self.command = np.clip(each, 0.06 * self.most, self.most) * self.alive
        total = np.sum(self.command, axis=1) / self.lift
        cell = cell_voltage(self.depth) * (1.0 - self.drop * total**1.5)
        real = np.maximum(h["map_slope"] * total + h["map_offset"], 0.05) ** h["map_power"] / total
        real = real * (cell / self.full) ** h["sag"]
        self.rpm = self.rpm + self.follow * (np.sqrt(self.command * (real / self.world.k)[:, None]) - self.rpm)
        self.depth = self.depth + TICK_S / self.endurance * total**1.5
        self.voltage = cell * self.cells
        return np.asarray(
            np.any((each > 1.001 * self.most) | ((each < 0.059 * self.most) & self.alive), axis=1), dtype=float
        )


@dataclass(frozen=True)
class Plans:
    """References and disturbances of all flights, rows at 100 Hz; the person's references are late."""

    position: Array
    velocity: Array
    acceleration: Array
    yaw: Array
    gust: Array
    twist: Array
    hand: Array


def plans(flights: Sequence[Flight]) -> Plans:
    """Plans of the flights, the shorter ones filled up with their last row."""
    length = max(len(f.reference.yaw) for f in flights)

    def goal(name: str) -> Array:
        parts = []
        for f in flights:
            part, late = getattr(f.reference, name), round(f.gains.reaction_s / STEP_S)
            parts.append(_fill(np.concatenate([np.repeat(part[:1], late, axis=0), part[: len(part) - late]]), length))
        return np.stack(parts, axis=1)

    def noise(name: str) -> Array:
        return np.stack([_fill(getattr(f, name), length) for f in flights], axis=1)

    goals = [goal(name) for name in ("position", "velocity", "acceleration", "yaw")]
    return Plans(*goals, *(noise(name) for name in ("gust", "twist", "hand")))


def simulate(flights: Sequence[Flight]) -> list[Record]:
    """Fly all flights."""
    plan = plans(flights)
    crafts = [f.craft for f in flights]
    world = World(crafts, [f.hidden for f in flights], [f.ceiling_m for f in flights])
    pilots = Controllers([f.gains for f in flights], world.mass, world.inertia, world.arm, world.torque)
    motors = Motors(flights, world)
    position, velocity, yaw = plan.position[0].copy(), plan.velocity[0].copy(), plan.yaw[0]
    q = np.stack([np.cos(yaw / 2), 0 * yaw, 0 * yaw, np.sin(yaw / 2)], axis=1)
    rates, spin_up = np.zeros_like(position), np.zeros_like(position)
    saturated = np.zeros(len(flights))
    ends = np.array([len(f.reference.yaw) * STEP_S for f in flights]) - SETTLE_S
    kept: dict[str, list[Array]] = {name: [] for name in Record.__dataclass_fields__ if name != "saturated"}
    for tick in range((len(plan.yaw) - 1) * OUTER):
        time = tick * TICK_S - SETTLE_S
        i = tick // OUTER
        rotation = rotations(q)
        if tick % OUTER == 0:
            goal = (plan.position[i], plan.velocity[i], plan.acceleration[i] + plan.hand[i])
            pilots.outer(position, velocity, rotation, goal, plan.yaw[i], STEP_S)
        moment = pilots.inner(rotation, rates, spin_up)
        limits = motors.step(np.concatenate([pilots.thrust[:, None], moment], axis=1))
        loads = world.loads(time, position, velocity, rotation, motors.rpm, plan.gust[i], TICK_S)
        acceleration = loads.force / loads.mass[:, None]
        spin_up = (loads.moment - np.cross(rates, world.inertia * rates)) / world.inertia + plan.twist[i]
        if time >= 0.0:
            saturated += limits * (time < ends)
            if tick % RECORD == 0:
                own = (position, velocity, acceleration, q, rates, motors.rpm, motors.command, pilots.angles)
                row = (*own, plan.gust[i], loads.levelling, motors.voltage)
                for name, value in zip(kept, row, strict=True):
                    kept[name].append(value)
        position = position + velocity * TICK_S + 0.5 * acceleration * TICK_S**2
        velocity = velocity + acceleration * TICK_S
        rates = np.clip(rates + spin_up * TICK_S, -30.0, 30.0)
        q = _turn(q, rates)
    stacks = {name: np.stack(kept.pop(name)) for name in list(kept)}
    return [_record(stacks, j, flight, float(saturated[j]) * TICK_S) for j, flight in enumerate(flights)]


def _record(stacks: dict[str, Array], j: int, flight: Flight, saturated_s: float) -> Record:
    """Record of one flight."""
    rows = round((len(flight.reference.yaw) * STEP_S - SETTLE_S - 0.5) / RECORD_S)
    parts = {name: rows_of_all[:rows, j] for name, rows_of_all in stacks.items()}
    for name in ("rpm", "command"):
        parts[name] = parts[name][:, : flight.craft.count]
    return Record(**parts, saturated=saturated_s / (rows * RECORD_S))
