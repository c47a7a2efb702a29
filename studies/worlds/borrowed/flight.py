"""Flights through a simulator: what is asked of the vehicles, the motors' commands, and the record of what happened."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from studies.worlds.borrowed.craft import FLIP, GRAVITY_M_S2, RPM, Array, Craft, Kind
from studies.worlds.borrowed.effects import EFFECTS, Air, Fleet, Parameters
from studies.worlds.borrowed.missions import SETTLE_S, STEP_S, Reference

TICK_S = 0.008
OUTER = 3
"""Ticks between two aims of a controller."""


def drift(rng: np.random.Generator, rows: int, step_s: float, time_s: float, size: float, columns: int = 3) -> Array:
    """Gauss-Markov processes of a standard deviation and a correlation time."""
    keep = np.exp(-step_s / time_s)
    white = rng.normal(0.0, size * np.sqrt(1.0 - keep**2), (rows, columns))
    out, _ = lfilter([1.0], [1.0, -keep], white, axis=0, zi=rng.normal(0.0, size, (1, columns)) * keep)
    return np.asarray(out)


@dataclass(frozen=True)
class Battery:
    """Battery of one flight: endurance in hover, share used at the start, and the drop in hover over the voltage."""

    endurance_s: float
    used: float
    drop: float


@dataclass(frozen=True)
class Flight:
    """Flight to be flown: vehicle, hidden physics, reference, disturbances at steps of `STEP_S`, and battery."""

    craft: Craft
    hidden: Mapping[str, Parameters]
    strength: float
    reference: Reference
    gust: Array
    """Acceleration, world."""
    twist: Array
    """Angular acceleration, body."""
    hand: Array
    """Error of the wanted acceleration."""
    stiffness: float
    """Factor on the gains of the controller."""
    battery: Battery
    ceiling_m: float | None

    def parameter(self, family: str, name: str, plain: float = 0.0) -> float:
        """Parameter of a hidden effect times the strength, or the plain value where that effect is not hidden."""
        return plain + self.strength * self.hidden[family][name] if family in self.hidden else plain


@dataclass(frozen=True)
class Record:
    """Record of a flight from the end of the settling, rows at steps of `TICK_S`; NED and FRD."""

    position: Array
    velocity: Array
    acceleration: Array
    rotation: Array
    rates: Array
    rpm: Array
    command_n: Array
    """Thrust that is wanted of each rotor."""
    wanted: Array
    """Rotation that is wanted."""
    gust: Array
    levelling: Array
    """Moment by the hidden effects besides that of the thrusts."""
    voltage: Array
    saturated: float


@dataclass
class State:
    """State of all flights: north, west, up and forward, left, up."""

    position: Array
    velocity: Array
    quaternion: Array
    """x, y, z, w."""
    rates: Array
    speeds: Array
    """Speeds of the rotors, rad/s."""
    spin_up: Array
    """Angular acceleration, of the step before."""

    @property
    def rotation(self) -> Array:
        """Rotations from body to world."""
        x, y, z, w = self.quaternion.T
        rows = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
        return np.moveaxis(np.array(rows), 2, 0)


@dataclass(frozen=True)
class Aim:
    """Demand of a position controller: thrusts, and rotations from body to world."""

    thrust: Array
    rotation: Array


@dataclass(frozen=True)
class Slope:
    """Answer of a simulator: accelerations, angular accelerations, and those of the rotors."""

    acceleration: Array
    spin_up: Array
    speeds: Array


class Simulator(ABC):
    """Simulator of others, with the flights of one case in it."""

    kinds: ClassVar[dict[str, Kind]]
    """Vehicles that it publishes."""
    own: ClassVar[frozenset[str]]
    """Effects for which it has physics of its own."""

    def __init__(self, flights: Sequence[Flight]) -> None:
        """Take the flights; their vehicles have the same number of rotors."""
        self.flights = flights
        crafts = [f.craft for f in flights]
        self.fleet = Fleet.of(crafts, [f.strength for f in flights], [f.ceiling_m for f in flights])
        self.lags = np.array([f.craft.lag_s + f.parameter("motor_lag", "extra") for f in flights])
        self.bandwidth = np.array([f.stiffness * bandwidth(lag) for f, lag in zip(flights, self.lags, strict=True)])

    @abstractmethod
    def aim(self, state: State, goal: Reference) -> Aim:
        """Aim of the controllers of positions."""

    @abstractmethod
    def slope(self, state: State, command: Array, force: Array, moment: Array, load_kg: Array) -> Slope:
        """Derivatives under commanded rotor speeds, with injected forces (world), moments (body) and loads."""


def bandwidth(lag_s: float) -> float:
    """Bandwidth of the attitude that suits a motor lag, with the angular acceleration fed back."""
    return min(0.48 / lag_s, 8.0)


def turning(aim: Array, state: State, rotation: Array, inertia: Array, bandwidth: Array) -> Array:
    """Moments that turn the vehicles to an aim: attitude, then rates, with the angular acceleration of roll
    and pitch fed back; in yaw the rotors' own spin-up would be fed back with it."""
    error = np.einsum("nji,njk->nik", aim, rotation)
    twist = 0.5 * np.stack([error[:, i, j] - error[:, j, i] for i, j in ((2, 1), (0, 2), (1, 0))], axis=1)
    quick = bandwidth[:, None] * np.array([1.0, 1.0, 0.35])
    angular = -4.2 * quick * (quick * twist + state.rates) - np.array([1.0, 1.0, 0.0]) * state.spin_up
    return np.asarray(inertia * np.clip(angular, -120.0, 120.0))


def loads(air: Air, hidden: Mapping[str, Parameters], own: frozenset[str]) -> Array:
    """Put the effects that are injected and the uneven rotors into the loads; returns the moments besides thrusts."""
    f = air.fleet
    for name, effect in EFFECTS.items():
        if name in hidden and name not in own:
            effect(air, hidden[name])
    levelling = air.moment.copy()
    even = f.thrust.mean(axis=1, keepdims=True)
    extra = (f.thrust * air.gain - even) * air.speeds**2
    x, y = f.positions_m[:, :, 0], f.positions_m[:, :, 1]
    air.body_force[:, 2] += extra.sum(axis=1)
    turn = f.clockwise * f.torque_m[:, None] * extra
    air.moment += np.stack([np.sum(y * extra, 1), -np.sum(x * extra, 1), np.sum(turn, 1)], axis=1)
    air.world_force += np.einsum("nij,nj->ni", air.rotation, air.body_force)
    return levelling


def cell_voltage(used: Array) -> Array:
    """Open voltage of a cell by the share of the charge that is used."""
    return np.asarray(4.2 - 0.55 * used - 0.12 * (1.0 - np.exp(-15.0 * used)))


class Motors:
    """Batteries and motor controllers: wanted thrusts to commanded rotor speeds."""

    def __init__(self, flights: Sequence[Flight], fleet: Fleet) -> None:
        """Take the batteries and what is hidden in the command."""
        self.mixer = np.array([np.linalg.pinv(f.craft.allocation()) for f in flights])
        self.most = np.array([f.craft.kind.max_thrust_n for f in flights])[:, None]
        self.lift = fleet.mass_kg * GRAVITY_M_S2
        self.k = fleet.thrust.mean(axis=1)
        self.slope = np.array([f.parameter("thrust_map", "slope", 1.0) for f in flights])
        self.offset = np.array([f.parameter("thrust_map", "offset") for f in flights])
        self.sag = np.array([f.parameter("battery_sag", "exponent") for f in flights])
        self.endurance = np.array([f.battery.endurance_s for f in flights])
        self.used = np.array([f.battery.used for f in flights])
        self.drop = np.array([f.battery.drop for f in flights])
        self.full = cell_voltage(self.used) * (1.0 - self.drop)
        self.cells = np.array([float(f.craft.kind.cells) for f in flights])
        self.command_n = np.zeros((len(flights), self.mixer.shape[1]))
        self.voltage = self.full * self.cells
        self.saturated = np.zeros(len(flights))

    def step(self, thrust: Array, moment: Array) -> Array:
        """Commanded rotor speeds, rad/s."""
        each = np.einsum("nij,nj->ni", self.mixer, np.column_stack([thrust, moment]))
        self.saturated = np.any((each > 1.001 * self.most) | (each < 0.049 * self.most), axis=1).astype(float)
        self.command_n = np.clip(each, 0.05 * self.most, self.most)
        total = self.command_n.sum(axis=1) / self.lift
        cell = cell_voltage(self.used) * (1.0 - self.drop * total**1.5)
        real = np.maximum(self.slope * total + self.offset, 0.05) / total * (cell / self.full) ** self.sag
        self.used = self.used + TICK_S / self.endurance * total**1.5
        self.voltage = cell * self.cells
        return np.asarray(np.sqrt(self.command_n * (real / self.k)[:, None]))


def _rows(flights: Sequence[Flight], columns: Sequence[Array]) -> Array:
    """Columns of all flights side by side, the shorter ones filled up with their last row."""
    length = max(len(c) for c in columns)
    return np.stack([np.concatenate([c, np.repeat(c[-1:], length - len(c), axis=0)]) for c in columns], axis=1)


def _turned(quaternion: Array, rates: Array) -> Array:
    """Quaternions after one tick at body rates."""
    x, y, z, w = quaternion.T
    a, b, c = 0.5 * TICK_S * rates.T
    turned = quaternion + np.stack(
        [w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a, -x * a - y * b - z * c], axis=1
    )
    return np.asarray(turned / np.linalg.norm(turned, axis=1, keepdims=True))


def fly(simulator: type[Simulator], flights: Sequence[Flight]) -> list[Record]:
    """Fly all flights of a case side by side."""
    world = simulator(flights)
    fleet, motors, hidden = world.fleet, Motors(flights, world.fleet), flights[0].hidden
    goals = [_rows(flights, [getattr(f.reference, name) for f in flights]) for name in Reference.__dataclass_fields__]
    gust, twist, hand = (_rows(flights, [getattr(f, name) for f in flights]) for name in ("gust", "twist", "hand"))
    n, yaw = len(flights), goals[3][0]
    still = np.zeros((n, 3))
    upright = Rotation.from_euler("z", yaw[:, None]).as_quat()
    speeds = np.repeat(fleet.hover_rad_s[:, None], fleet.thrust.shape[1], axis=1)
    state = State(goals[0][0].copy(), still, upright, still, speeds, still)
    integral = np.zeros((n, 3))
    stiff = 0.2 * (0.28 * world.bandwidth[:, None]) ** 3
    saturated = np.zeros(n)
    ends = np.array([len(f.reference.yaw) * STEP_S for f in flights]) - SETTLE_S
    kept: dict[str, list[Array]] = {name: [] for name in Record.__dataclass_fields__ if name != "saturated"}
    for tick in range(int((len(goals[3]) - 1) * STEP_S / TICK_S)):
        time, i = tick * TICK_S - SETTLE_S, int(tick * TICK_S / STEP_S + 1e-9)
        rotation = state.rotation
        integral = np.clip(integral + stiff * (goals[0][i] - state.position) * TICK_S, -3.0, 3.0)
        goal = Reference(goals[0][i], goals[1][i], goals[2][i] + hand[i] + integral, goals[3][i])
        if tick % OUTER == 0:
            aim = world.aim(state, goal)
        command = motors.step(aim.thrust, turning(aim.rotation, state, rotation, fleet.inertia_kg_m2, world.bandwidth))
        air = Air.still(fleet, time, state.position, state.velocity, rotation, state.rates, state.speeds)
        air.world_force += gust[i] * fleet.mass_kg[:, None]
        levelling = loads(air, hidden, world.own)
        slope = world.slope(state, command, air.world_force, air.moment + twist[i] * fleet.inertia_kg_m2, air.load_kg)
        if time >= 0.0:
            saturated += motors.saturated * (time < ends)
            row = (
                state.position * FLIP, state.velocity * FLIP, slope.acceleration * FLIP,
                rotation * FLIP[:, None] * FLIP, state.rates * FLIP, state.speeds * RPM, motors.command_n,
                aim.rotation * FLIP[:, None] * FLIP, gust[i] * FLIP, levelling * FLIP, motors.voltage,
            )  # fmt: skip
            for name, value in zip(kept, row, strict=True):
                kept[name].append(value)
        middle = state.rates + 0.5 * slope.spin_up * TICK_S
        state = State(
            state.position + state.velocity * TICK_S + 0.5 * slope.acceleration * TICK_S**2,
            state.velocity + slope.acceleration * TICK_S,
            _turned(state.quaternion, middle),
            np.clip(state.rates + slope.spin_up * TICK_S, -30.0, 30.0),
            np.maximum(state.speeds + slope.speeds * TICK_S, 1.0),
            slope.spin_up,
        )
    stacks = {name: np.stack(rows) for name, rows in kept.items()}
    records = []
    for j, end in enumerate(ends):
        rows = round((end - 0.5) / TICK_S)
        parts = {name: stack[:rows, j] for name, stack in stacks.items()}
        records.append(Record(**parts, saturated=float(saturated[j]) / rows))
    return records
