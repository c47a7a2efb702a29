"""Flights of a batch, all at once: rotors, body, battery, estimator and controller in steps of time."""

from dataclasses import dataclass, field

import numpy as np

from studies.worlds.blade import sensors
from studies.worlds.blade.air import Turbulence
from studies.worlds.blade.controllers import Pilots, Tuning
from studies.worlds.blade.effects import Change, Effect, Ensemble, Situation
from studies.worlds.blade.estimator import Filter
from studies.worlds.blade.missions import SETTLE, STEP, Reference
from studies.worlds.blade.power import Battery, open_loop_speed, open_voltage
from studies.worlds.blade.rotation import Array, from_axes, from_vector, matrix, multiply, rotate, rotate_back
from studies.worlds.blade.rotors import Blades, hover_induced_velocity
from studies.worlds.blade.sensors import CHANNELS, Sensors, Suite
from studies.worlds.blade.vehicles import GRAVITY, LARGEST_ROTORS, Vehicle

TICK = 0.005
"""Step of IMU, estimator and inner loop, s; the body takes SUBSTEPS in it."""
SUBSTEPS = 2
OUTER = round(STEP / TICK)
CHUNK = 400
MEASURED, COMMANDED, THROTTLE = "measured", "commanded", "throttle"


@dataclass(frozen=True)
class Copy:
    """Vehicle as it was built: small differences from its file."""

    k_error: float
    spread: list[float]
    """Share by which each rotor's coefficient differs from the others'."""
    centre: list[float]
    """Centre of mass forward and right of the file's, m."""
    inertia_error: list[float]


@dataclass(frozen=True)
class Pack:
    """Battery of one flight."""

    cells: int
    charge: float
    drain: float
    sag: float
    loss: float
    """Share of the voltage that the winding takes in hover."""


@dataclass(frozen=True)
class Flight:
    """Everything that one flight needs."""

    vehicle: Vehicle
    effects: tuple[Effect, ...]
    reference: Reference
    suite: Suite
    tuning: Tuning
    copy: Copy
    pack: Pack
    source: str
    """Rotor signal of the log: `measured` speeds, `commanded` speeds, or only the `throttle`."""
    command_delay: int
    """Ticks from the controller to the motors."""
    light_air: float
    """Root mean square of the acceleration by light turbulence, m/s^2."""
    seed: int

    def value(self, family: str, form: str, name: str) -> Array | None:
        """Value of a hidden effect, if the flight has it."""
        for effect in self.effects:
            if (effect.family, effect.form) == (family, form):
                return np.asarray(effect.values[name], float)
        return None


@dataclass
class Recording:
    """States of one flight at every tick from the start of the log, as arrays over time (float32)."""

    columns: dict[str, Array] = field(default_factory=dict)
    failure: str = ""


WIDTHS = {
    "attitude": 4,
    "velocity": 3,
    "position": 3,
    "rates": 3,
    "accelerometer": 3,
    "speed": LARGEST_ROTORS,
    "command": LARGEST_ROTORS,
    "voltage": 1,
    "thrust_command": 1,
    "attitude_command": 4,
    "goal": 3,
    "goal_velocity": 3,
    "true_attitude": 4,
    "true_velocity": 3,
    "true_position": 3,
    "true_acceleration": 3,
    "effect": 3,
    "effect_moment": 3,
    "air": 3,
}


def column(values: list[float]) -> Array:
    """One number of each flight."""
    return np.array(values, float)


def _padded(flights: list[Flight], name: str, fill: float) -> Array:
    out = np.full((len(flights), LARGEST_ROTORS, *np.shape(getattr(flights[0].vehicle, name))[1:]), fill)
    for row, flight in zip(out, flights, strict=True):
        row[: flight.vehicle.count] = getattr(flight.vehicle, name)
    return out


def mix(vehicle: Vehicle) -> Array:
    """Matrix from (thrust, three moments) to the thrusts of LARGEST_ROTORS rotors, by least squares."""
    x, y, spin = vehicle.positions[:, 0], vehicle.positions[:, 1], vehicle.spins
    effect = np.stack([np.ones_like(x), -y, x, spin * vehicle.torque_to_thrust])
    out = np.zeros((LARGEST_ROTORS, 4))
    out[: vehicle.count] = np.linalg.pinv(effect)
    return out


def _winds(flights: list[Flight]) -> tuple[Array, Array]:
    mean, sigma = np.zeros((len(flights), 3)), np.zeros(len(flights))
    for lane, flight in enumerate(flights):
        for effect in flight.effects:
            if effect.family == "wind":
                mean[lane, :2] = effect.values["mean_m_s"]
                sigma[lane] = effect.values["gust_m_s"]
    return mean, sigma


def fly(flights: list[Flight]) -> list[Recording]:
    """Recordings of the flights."""
    world = World(flights)
    ticks = max(len(f.reference.yaw) for f in flights) * OUTER
    for tick in range(ticks):
        world.advance(tick)
    return world.recordings()


class World:
    """State of all flights of a batch."""

    def __init__(self, flights: list[Flight]) -> None:
        """Flights in hover at the first point of their reference."""
        self.flights = flights
        self.lanes = np.arange(len(flights))
        self.failures = [""] * len(flights)
        self._build()
        self._hide()
        self._plan()
        self._begin()

    def _build(self) -> None:
        """Vehicles, as their files have them and as they were built."""
        flights, vehicles = self.flights, [f.vehicle for f in self.flights]
        n = len(flights)
        self.mass = column([v.mass for v in vehicles])
        self.inertia_file = np.array([v.inertia for v in vehicles])
        self.inertia = self.inertia_file * (1.0 + np.array([f.copy.inertia_error for f in flights]))
        self.places = _padded(flights, "positions", 0.0)
        self.spins = _padded(flights, "spins", 0.0)
        self.present = self.spins != 0.0
        self.k_file = column([v.k for v in vehicles])[:, None] * np.ones((1, LARGEST_ROTORS))
        spread = np.array([np.pad(f.copy.spread, (0, LARGEST_ROTORS - f.vehicle.count)) for f in flights])
        self.k = self.k_file * (1.0 + column([f.copy.k_error for f in flights])[:, None] + spread)
        self.radius = column([v.radius for v in vehicles])[:, None]
        wide = np.ones((n, LARGEST_ROTORS))
        lift, pitch = column([v.lift for v in vehicles])[:, None], column([v.pitch for v in vehicles])[:, None]
        density = column([v.air_density for v in vehicles])[:, None]
        self.blades = Blades(self.radius * wide, density * wide, lift * wide, pitch * wide)
        count = column([v.count for v in vehicles])
        self.hover = column([v.hover_speed for v in vehicles])
        self.induced = hover_induced_velocity(self.mass * GRAVITY / count, self.radius[:, 0], density[:, 0])
        self.torque_to_thrust = column([v.torque_to_thrust for v in vehicles])[:, None]
        self.arm = column([v.arm for v in vehicles])
        self.hub = column([v.rotor_height for v in vehicles])
        self.ceiling = column([v.ceiling or 1e6 for v in vehicles])
        self.centre = np.array([[*f.copy.centre, 0.0] for f in flights])

    def _hide(self) -> None:
        """Hidden effects, batteries and air."""
        flights, n = self.flights, len(self.flights)
        lags = [f.value("motor_lag", "first_order", "time_constant_s") for f in flights]
        lag = column(
            [
                v.time_constant if x is None else max(float(x), 1e-3)
                for x, v in zip(lags, (f.vehicle for f in flights), strict=True)
            ]
        )
        self.follow = 1.0 - np.exp(-TICK / SUBSTEPS / lag)[:, None]
        boards = [f.value("thrust_tilt", "board", "angles_rad") for f in flights]
        self.board = from_vector(np.array([np.zeros(3) if b is None else [*b, 0.0] for b in boards]))
        maps = [[f.value("thrust_map", "line", name) for name in ("slope_error", "offset")] for f in flights]
        self.map = np.array([[0.0 if x is None else float(x) for x in pair] for pair in maps]) + np.array([1.0, 0.0])
        sags = [f.value("battery_sag", "open_loop", "share") for f in flights]
        self.sags = column(
            [
                (1.0 if f.source == MEASURED else 0.0) if s is None else float(s)
                for s, f in zip(sags, flights, strict=True)
            ]
        )[:, None]
        packs = [f.pack for f in flights]
        cells, sag = column([p.cells for p in packs]), column([p.sag for p in packs])
        self.battery = Battery(column([p.charge for p in packs]), cells, column([p.drain for p in packs]), sag)
        self.nominal = cells * open_voltage(np.ones(n)) * (1.0 - sag)
        self.loss = column([p.loss for p in packs])[:, None]
        self.ensemble = Ensemble.of([f.effects for f in flights])
        self.wind, sigma = _winds(flights)
        self.turbulence = Turbulence(sigma, np.full(n, 15.0), np.sqrt((self.wind**2).sum(-1)) + 2.0, TICK)
        self.light = column([f.light_air for f in flights])
        self.light_turbulence = Turbulence(self.light, np.full(n, 10.0), np.full(n, 3.0), TICK)

    def _plan(self) -> None:
        """References, each held at its end, and tapes."""
        flights, n = self.flights, len(self.flights)
        steps = max(len(f.reference.yaw) for f in flights)
        self.reference = np.zeros((n, steps, 10), np.float32)
        for row, f in zip(self.reference, flights, strict=True):
            r = f.reference
            whole = np.column_stack([r.position, r.velocity, r.acceleration, r.yaw])
            row[: len(whole)], row[len(whole) :] = whole, whole[-1]
            row[len(whole) :, 3:9] = 0.0
        self.ends = np.array([len(f.reference.yaw) * OUTER for f in flights])
        self.begin = round(SETTLE / TICK)
        length = steps * OUTER - self.begin
        self.tape = {name: np.zeros((length, n, width), np.float32) for name, width in WIDTHS.items()}

    def _begin(self) -> None:
        """States in hover, sensors, filters and controllers."""
        flights, n = self.flights, len(self.flights)
        self.position = self.reference[:, 0, :3].astype(float)
        self.velocity, self.rates = np.zeros((n, 3)), np.zeros((n, 3))
        self.attitude = from_axes(np.tile([0.0, 0.0, 1.0], (n, 1)), self.reference[:, 0, 9].astype(float))
        self.acceleration = np.zeros((n, 3))
        self.speed = np.where(self.present, self.hover[:, None], 1.0)
        self.command = self.speed.copy()
        self.gust = self.wind.copy()
        self.light_force = np.zeros((n, 3))
        self.effect, self.effect_moment = np.zeros((n, 3)), np.zeros((n, 3))
        bias = [f.value("imu_bias", "constant", "bias_m_s2") for f in flights]
        self.sensors = Sensors(
            [f.suite for f in flights], np.array([np.zeros(3) if b is None else b for b in bias]), TICK
        )
        self.filter = Filter(self.sensors.start(self.attitude), self.velocity, self.position, self.sensors.noise())
        largest = column([f.vehicle.largest_thrust for f in flights])
        mixer = np.array([mix(f.vehicle) for f in flights])
        self.pilots = Pilots([f.tuning for f in flights], self.mass, self.inertia_file, mixer, largest)
        self.reaction = np.round(column([f.tuning.delay for f in flights]) / TICK).astype(int)
        self.remnant = column([f.tuning.remnant for f in flights])[:, None]
        self.hand = np.zeros((n, 3))
        self.waiting = np.array([f.command_delay for f in flights])
        self.queue = np.tile(self.command, (8, 1, 1))
        self.sources = np.array([f.source == MEASURED for f in flights])[:, None]
        self.generators = [np.random.default_rng([f.seed, 77]) for f in flights]
        self.white = np.zeros((n, CHUNK, CHANNELS), np.float32)
        self.pilots.trim(*self._trimmed())

    def advance(self, tick: int) -> None:
        """Step of one tick: IMU and estimator, controller, motors and body."""
        if tick % CHUNK == 0:
            for row, generator in zip(self.white, self.generators, strict=True):
                generator.standard_normal(out=row, dtype=np.float32)
        white = self.white[:, tick % CHUNK].astype(float)
        rates, force = self.rates, rotate_back(matrix(self.attitude), self.acceleration - [0.0, 0.0, GRAVITY])
        gyro, accelerometer = self.sensors.sample(rates, force, white)
        turn = self.filter.predict(gyro, accelerometer, TICK)
        if tick % 2 == 1:
            self.filter.spread(turn, 2 * TICK)
        self.sensors.correct(self.filter, (self.attitude, self.velocity, self.position), white, accelerometer)
        if tick % OUTER == 0:
            self._steer(tick // OUTER, white)
        body_rates = gyro - self.filter.gyro_bias
        thrusts = self.pilots.advance_inner(self.filter.attitude, body_rates, TICK)
        self.command = np.where(self.present, np.sqrt(thrusts / self.k_file), 1.0)
        self.queue[tick % 8] = self.command
        self.gust = self.wind + self.turbulence.advance(white[:, sensors.GUST])
        self.light_force = self.light_turbulence.advance(white[:, sensors.HAND])
        self._turn_motors_and_move(tick)
        if tick >= self.begin:
            self._record(tick - self.begin, body_rates, accelerometer)
        if tick % 20 == 0:
            self._watch(tick)

    def _steer(self, step: int, white: Array) -> None:
        row = self.reference[:, step].astype(float)
        _, velocity, position = self.filter.memory.past(self.lanes, self.reaction)
        self.hand = 0.98 * self.hand + 0.2 * self.remnant * white[:, sensors.HAND]
        reference = (row[:, :3], row[:, 3:6], row[:, 6:9], row[:, 9])
        self.pilots.advance_outer(position, velocity, reference, self.hand, STEP)

    def _targets(self, command: Array) -> Array:
        """Speeds that the motors turn towards at commanded speeds."""
        per_rotor = (self.mass * GRAVITY / self.present.sum(-1))[:, None]
        mapped = self.map[:, :1] * self.k_file * command**2 + self.map[:, 1:] * per_rotor
        target = np.sqrt(np.maximum(mapped, 0.02 * per_rotor) / self.k_file)
        ratio = 1.0 + self.sags * (self.battery.voltage / self.nominal - 1.0)[:, None]
        hover = self.hover[:, None]
        return np.where(self.present, hover * open_loop_speed(target / hover, ratio, self.loss), 1.0)

    def _trimmed(self) -> tuple[Array, Array]:
        """Acceleration and angular acceleration that the controllers add in hover."""
        self.speed = self._targets(self.command)
        rotation = matrix(self.attitude)
        now = self.situation(rotation)
        change = self.ensemble.act(now)
        thrusts = now.ideal * change.factor
        lift = thrusts.sum(-1) / (self.mass + change.added_mass)
        pull = (rotate(rotation, change.body) + change.world) / self.mass[:, None]
        pull[:, 2] += GRAVITY - lift
        return -pull, -(change.moment + self._moments(thrusts, now.ideal)) / self.inertia_file

    def _turn_motors_and_move(self, tick: int) -> None:
        step = TICK / SUBSTEPS
        late = self.queue[(tick - self.waiting) % 8, self.lanes]
        target = self._targets(late)
        change = self.ensemble.act(self.situation(matrix(self.attitude)))
        for _ in range(SUBSTEPS):
            self.speed = self.speed + self.follow * (target - self.speed)
            self._move(change, step)
        share = np.where(self.present, (self.speed / self.hover[:, None]) ** 3, 0.0).sum(-1) / self.present.sum(-1)
        self.battery.advance(share, TICK)
        self._account()

    def situation(self, rotation: Array) -> Situation:
        """Situation that the effects depend on."""
        return Situation(
            time=np.full(len(self.mass), self.clock),
            speed=self.speed,
            rotation=rotation,
            position=self.position,
            airspeed=rotate_back(rotation, self.velocity - self.gust),
            rates=self.rates,
            places=self.places,
            blades=self.blades,
            k=self.k,
            present=self.present,
            height=self.hub[:, None] - self.position[:, 2:] - (rotation[:, 2:] @ np.swapaxes(self.places, 1, 2))[:, 0],
            ceiling=self.ceiling,
            mass=self.mass,
            hover_speed=self.hover,
            hover_induced=self.induced,
            arm=self.arm,
        )

    def _move(self, change: Change, step: float) -> None:
        rotation = matrix(self.attitude)
        ideal = np.where(self.present, self.k * self.speed**2, 0.0)
        thrusts = ideal * change.factor
        whole = thrusts.sum(-1)
        up = 1.0 / np.sqrt(1.0 + (change.tilt**2).sum(-1))
        body = change.body + np.column_stack([change.tilt * (up * whole)[:, None], -up * whole])
        mass = self.mass + change.added_mass
        acceleration = (rotate(rotation, body) + change.world) / mass[:, None] + self.light_force
        acceleration[:, 2] += GRAVITY
        moment = change.moment + self._moments(thrusts, ideal)
        angular = (moment - np.cross(self.rates, self.inertia * self.rates)) / self.inertia
        self.effect_moment = change.moment + self._moments(thrusts - ideal, 0.0 * ideal)
        middle = self.rates + 0.5 * step * angular
        self.rates = self.rates + step * angular
        self.attitude = multiply(self.attitude, from_vector(step * middle))
        self.position = self.position + step * self.velocity + 0.5 * step * step * acceleration
        self.velocity = self.velocity + step * acceleration
        self.acceleration = acceleration
        self.clock += step
        self.rotation = rotation

    clock = -SETTLE
    rotation: Array

    def _moments(self, thrusts: Array, torques: Array) -> Array:
        """Moments of rotors about the centre of mass; reaction torque by the thrust out of effects."""
        x = self.places[:, :, 0] - self.centre[:, :1]
        y = self.places[:, :, 1] - self.centre[:, 1:2]
        yaw = (self.spins * torques * self.torque_to_thrust).sum(-1)
        return np.stack([-(y * thrusts).sum(-1), (x * thrusts).sum(-1), yaw], -1)

    def _account(self) -> None:
        """Acceleration by the hidden effects: what the flight has and its file, copy and light air do not explain."""
        known = np.where(self.sources, self.speed, self.command)
        thrust = np.where(self.present, self.k * known**2, 0.0).sum(-1) / self.mass
        turned = self.rotation @ matrix(self.board)
        explained = -turned[:, :, 2] * thrust[:, None] + self.light_force
        explained[:, 2] += GRAVITY
        self.effect = self.acceleration - explained

    def _record(self, row: int, rates: Array, accelerometer: Array) -> None:
        reference = self.reference[:, (row + self.begin) // OUTER]
        values = {
            "attitude": self.filter.attitude,
            "velocity": self.filter.velocity,
            "position": self.filter.position,
            "rates": rates,
            "accelerometer": accelerometer,
            "speed": self.speed,
            "command": self.command,
            "voltage": self.battery.voltage[:, None],
            "thrust_command": self.pilots.thrust[:, None],
            "attitude_command": self.pilots.attitude,
            "goal": reference[:, :3],
            "goal_velocity": reference[:, 3:6],
            "true_attitude": self.attitude,
            "true_velocity": self.velocity,
            "true_position": self.position,
            "true_acceleration": self.acceleration,
            "effect": self.effect,
            "effect_moment": self.effect_moment,
            "air": self.gust,
        }
        for name, value in values.items():
            self.tape[name][row] = value

    def _watch(self, tick: int) -> None:
        """Marks of flights that crash, diverge or leave their way."""
        rotation = matrix(self.attitude)
        height = self.hub - self.position[:, 2]
        off = np.sqrt(((self.position - self.reference[:, tick // OUTER, :3]) ** 2).sum(-1))
        reasons = {
            "turned over": rotation[:, 2, 2] < np.cos(np.radians(65.0)),
            "hit the ground": np.minimum(height - 0.25 * self.radius[:, 0], -self.position[:, 2] + 0.02) < 0.0,
            "hit the ceiling": height > self.ceiling - 0.4 * self.radius[:, 0],
            "left its way": ~(off < 12.0),
        }
        running = tick < self.ends
        for reason, hit in reasons.items():
            for lane in np.flatnonzero(hit & running):
                self.failures[lane] = self.failures[lane] or f"{reason} at {tick * TICK - SETTLE:.1f} s"
        broken = ~np.isfinite(self.position).all(-1) | (off > 1e3)
        if np.any(broken):  # a lost flight must not slow the others down with overflows
            self.velocity[broken] = self.rates[broken] = 0.0
            self.position[broken] = self.reference[broken, 0, :3]
            self.attitude[broken] = [1.0, 0.0, 0.0, 0.0]

    def recordings(self) -> list[Recording]:
        """Recordings of all flights, each to its end."""
        out = []
        for lane, end in enumerate(self.ends):
            columns = {name: tape[: end - self.begin, lane] for name, tape in self.tape.items()}
            out.append(Recording(columns, self.failures[lane]))
        return out
