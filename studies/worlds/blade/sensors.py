"""Sensors of many flights: IMU, GNSS, motion capture, optical flow, range finder, barometer, compass; and what the
filter makes of them."""

from dataclasses import asdict, dataclass

import numpy as np

from studies.worlds.blade.estimator import ANGLE, POSITION, VELOCITY, Filter, Memory
from studies.worlds.blade.rotation import (
    Array,
    conjugate,
    euler,
    from_vector,
    matrix,
    multiply,
    rotate_back,
    skew,
    to_vector,
)
from studies.worlds.blade.vehicles import GRAVITY

CHANNELS = 32
"""White noises that one flight uses in one tick."""
GYRO, ACCEL, GUST, FIX, SPEED, POSE, FLOW, RANGE, BARO, COMPASS, HAND = (
    slice(0, 3),
    slice(3, 6),
    slice(6, 9),
    slice(9, 12),
    slice(12, 15),
    slice(15, 18),
    slice(18, 20),
    slice(20, 21),
    slice(21, 22),
    slice(22, 23),
    slice(23, 26),
)
FIX_WALK = slice(26, 29)
SPEED_WALK = slice(29, 32)


@dataclass(frozen=True)
class Suite:
    """Sensors of one flight, and what its filter believes of them."""

    kind: str
    """`gnss`, `rtk`, `mocap` or `flow`."""
    gyro_noise: float
    """Noise of one sample of 5 ms, rad/s."""
    accel_noise: float
    gyro_bias: list[float]
    accel_bias: list[float]
    board: list[float]
    """Rotation of the IMU's board against the rotors, rad."""
    rate: float
    """Fixes (or poses, or flow) per second."""
    phase: float
    """Moment of the first one, as a share of the time between two."""
    delay: float
    believed_delay: float
    fix_noise: float
    fix_walk: float
    """Slow error of the position, m."""
    fix_time: float
    """Correlation time of the slow error, s."""
    speed_noise: float
    speed_walk: float
    attitude_noise: float
    flow_scale: float
    heading_bias: float
    height: str
    """Second source of height: `baro`, `range` or none."""
    height_noise: float
    gravity: float
    """Noise that the filter allows for levelling by the accelerometer, m/s^2; 0 for no levelling. Accelerations of the
    vehicle then mislead the attitude."""


def draw_suite(rng: np.random.Generator, kind: str, *, low: bool) -> Suite:
    """Sensors as they are sold; `low` for flights close to the ground, whose height a range finder measures."""
    board = rng.normal(0.0, np.radians(0.08), 3).clip(-np.radians(0.12), np.radians(0.12))
    rate, delay, fix, walk, correlated = {
        "gnss": (rng.choice([5.0, 10.0]), rng.uniform(0.1, 0.2), 0.02, rng.uniform(0.15, 0.5), rng.uniform(40, 120)),
        "rtk": (rng.choice([5.0, 10.0]), rng.uniform(0.1, 0.2), 0.008, 0.006, 60.0),
        "mocap": (rng.choice([50.0, 100.0]), rng.uniform(0.005, 0.02), rng.uniform(3e-4, 1e-3), 0.0, 60.0),
        "flow": (rng.choice([20.0, 40.0]), rng.uniform(0.02, 0.05), 0.0, 0.0, 60.0),
    }[kind]
    satellite = kind in ("gnss", "rtk")
    return Suite(
        kind=kind,
        gyro_noise=float(rng.uniform(0.002, 0.006)),
        accel_noise=float(rng.uniform(0.04, 0.12)),
        gyro_bias=rng.normal(0.0, 0.004, 3).tolist(),
        accel_bias=rng.normal(0.0, 0.012, 3).clip(-0.02, 0.02).tolist(),
        board=board.tolist(),
        rate=float(rate),
        phase=float(rng.uniform()),
        delay=float(delay),
        believed_delay=float(max(delay + (rng.uniform(-0.03, 0.03) if satellite else rng.uniform(-0.004, 0.004)), 0.0)),
        fix_noise=float(fix),
        fix_walk=float(walk),
        fix_time=float(correlated),
        speed_noise=float(rng.uniform(0.02, 0.05)),
        speed_walk=float(rng.uniform(0.01, 0.03)) if satellite else 0.0,
        attitude_noise=float(np.radians(rng.uniform(0.08, 0.25))),
        flow_scale=float(rng.normal(0.0, 0.008)) if kind == "flow" else 0.0,
        heading_bias=float(np.radians(rng.normal(0.0, 0.8))),
        height="" if kind == "mocap" else "range" if low or kind == "flow" else "baro",
        height_noise=float(rng.uniform(0.006, 0.015) if low or kind == "flow" else rng.uniform(0.06, 0.12)),
        gravity=float(rng.uniform(2.0, 4.0)) if kind == "flow" else 0.0,
    )


class Sensors:
    """Sensors of flights, and their corrections of the filter. A tick is the IMU's sample."""

    def __init__(self, suites: list[Suite], bias: Array, tick: float) -> None:
        """Sensors; bias is a hidden one of the accelerometer that is added to its own."""
        self._tick = tick
        named = {name: np.array([asdict(s)[name] for s in suites]) for name in asdict(suites[0])}
        self._n = named
        self._lanes = {kind: np.flatnonzero(named["kind"] == kind) for kind in ("gnss", "rtk", "mocap", "flow")}
        self._satellite = np.flatnonzero(np.isin(named["kind"], ("gnss", "rtk")))
        self._bias = named["accel_bias"] + bias
        self.board = from_vector(named["board"])
        self._every = np.round(1.0 / (named["rate"] * tick)).astype(int)
        self._phase = (named["phase"] * self._every).astype(int)
        self._late = np.round(named["delay"] / tick).astype(int)
        self._believed = np.round(named["believed_delay"] / tick).astype(int)
        self._walk = np.zeros((len(suites), 3))
        self._speed_walk = np.zeros((len(suites), 3))
        self._height_walk = np.zeros(len(suites))
        self._memory = Memory(len(suites))
        self._attitude, self._position = np.zeros((0, 4)), np.zeros((0, 3))
        self._count = 0

    def noise(self) -> Array:
        """Noise densities for the filter: gyro, accelerometer, walks of their biases."""
        root = np.sqrt(self._tick)
        size = len(self._late)
        gyro, accelerometer = 1.5 * self._n["gyro_noise"] * root, 2.0 * self._n["accel_noise"] * root + 0.01
        return np.stack([gyro, accelerometer, np.full(size, 2e-4), np.full(size, 2e-3)], -1)

    def start(self, attitude: Array) -> Array:
        """Attitude of the boards of vehicles at this attitude."""
        return multiply(attitude, self.board)

    def sample(self, rates: Array, force: Array, white: Array) -> tuple[Array, Array]:
        """Gyro and accelerometer, in the axes of the board, from body rates and specific force."""
        turn = matrix(self.board)
        gyro = rotate_back(turn, rates) + self._n["gyro_bias"] + self._n["gyro_noise"][:, None] * white[:, GYRO]
        return gyro, rotate_back(turn, force) + self._bias + self._n["accel_noise"][:, None] * white[:, ACCEL]

    def _past(self, lanes: Array) -> tuple[Array, Array, Array]:
        return self._memory.past(lanes, self._late[lanes])

    def correct(self, filter_: Filter, truth: tuple[Array, Array, Array], white: Array, accelerometer: Array) -> None:
        """Corrections of the filter by what arrives at this tick; truth is attitude, velocity, position."""
        self._attitude, self._position = self.start(truth[0]), truth[2]
        self._memory.push(self._attitude, truth[1], truth[2])
        self._advance_walks(white)
        due = (self._count + self._phase) % self._every == 0
        for lanes, act in (
            (self._satellite, self._satellites),
            (self._lanes["mocap"], self._poses),
            (self._lanes["flow"], self._flow),
        ):
            now = lanes[due[lanes]]
            if len(now):
                act(filter_, now, white)
        if self._count % 10 == 0:
            self._heights(filter_, white)
        if self._count % 20 == 5:
            self._compass(filter_, white)
        if self._count % 20 == 15:
            self._gravity(filter_, accelerometer)
        self._count += 1

    def _advance_walks(self, white: Array) -> None:
        n, tick = self._n, self._tick
        decay = np.exp(-tick / n["fix_time"])[:, None]
        self._walk = decay * self._walk + np.sqrt(1 - decay**2) * n["fix_walk"][:, None] * white[:, FIX_WALK]
        decay = np.exp(-tick / 2.0)
        drive = np.sqrt(1 - decay**2) * n["speed_walk"][:, None] * white[:, SPEED_WALK]
        self._speed_walk = decay * self._speed_walk + drive
        decay = np.exp(-tick / 60.0)
        share = np.where(n["height"] == "baro", 1.0, 0.0) * n["height_noise"]
        self._height_walk = decay * self._height_walk + np.sqrt(1 - decay**2) * share * white[:, BARO][:, 0]

    def _satellites(self, filter_: Filter, lanes: Array, white: Array) -> None:
        n = self._n
        _, velocity, position = self._past(lanes)
        fix = position + self._walk[lanes] + n["fix_noise"][lanes, None] * white[lanes, FIX]
        speed = velocity + self._speed_walk[lanes] + n["speed_noise"][lanes, None] * white[lanes, SPEED]
        _, old_velocity, old_position = filter_.memory.past(lanes, self._believed[lanes])
        slope = np.zeros((len(lanes), 6, 15))
        slope[:, :3, POSITION] = slope[:, 3:, VELOCITY] = np.eye(3)
        residual = np.concatenate([fix - old_position, speed - old_velocity], -1)
        sigma = np.empty_like(residual)
        sigma[:, :3] = (n["fix_noise"] + n["fix_walk"])[lanes, None] + 0.02
        sigma[:, 2] *= 1.5 + 3.0 * (n["kind"][lanes] == "gnss")
        sigma[:, 3:] = 1.3 * n["speed_noise"][lanes, None] + 0.04
        filter_.correct(lanes, slope, residual, sigma)

    def _poses(self, filter_: Filter, lanes: Array, white: Array) -> None:
        n = self._n
        attitude, _, position = self._past(lanes)
        seen = multiply(attitude, from_vector(n["attitude_noise"][lanes, None] * white[lanes, POSE]))
        old_attitude, _, old_position = filter_.memory.past(lanes, self._believed[lanes])
        slope = np.zeros((len(lanes), 6, 15))
        slope[:, :3, POSITION] = slope[:, 3:, ANGLE] = np.eye(3)
        at = position + n["fix_noise"][lanes, None] * white[lanes, FIX]
        residual = np.concatenate([at - old_position, to_vector(multiply(conjugate(old_attitude), seen))], -1)
        sigma = np.repeat(np.stack([n["fix_noise"] + 4e-4, 2.0 * n["attitude_noise"]], -1)[lanes], 3, axis=1)
        filter_.correct(lanes, slope, residual, sigma)

    def _flow(self, filter_: Filter, lanes: Array, white: Array) -> None:
        n = self._n
        attitude, velocity, _ = self._past(lanes)
        seen = rotate_back(matrix(attitude), velocity)[:, :2] * (1.0 + n["flow_scale"][lanes, None])
        seen = seen + n["speed_noise"][lanes, None] * white[lanes, FLOW]
        old_attitude, old_velocity, _ = filter_.memory.past(lanes, self._believed[lanes])
        rotation = matrix(old_attitude)
        expected = rotate_back(rotation, old_velocity)
        slope = np.zeros((len(lanes), 2, 15))
        slope[:, :, ANGLE] = skew(expected)[:, :2]
        slope[:, :, VELOCITY] = np.swapaxes(rotation, -1, -2)[:, :2]
        sigma = np.repeat(1.3 * n["speed_noise"][lanes, None] + 0.01, 2, axis=1)
        filter_.correct(lanes, slope, seen - expected[:, :2], sigma)

    def _heights(self, filter_: Filter, white: Array) -> None:
        n = self._n
        lanes = np.flatnonzero(n["height"] != "")
        if not len(lanes):
            return
        noise = n["height_noise"][lanes] * white[lanes, RANGE][:, 0]
        residual = self._position[lanes, 2] + self._height_walk[lanes] + noise - filter_.position[lanes, 2]
        slope = np.zeros((len(lanes), 1, 15))
        slope[:, 0, 8] = 1.0
        factor = np.where(n["height"][lanes] == "baro", 3.0, 1.3)
        filter_.correct(lanes, slope, residual[:, None], (factor * n["height_noise"][lanes])[:, None])

    def _compass(self, filter_: Filter, white: Array) -> None:
        n = self._n
        lanes = np.flatnonzero(n["kind"] != "mocap")
        if not len(lanes):
            return
        heading = euler(self._attitude[lanes])[:, 2] + n["heading_bias"][lanes]
        heading = heading + 0.01 * white[lanes, COMPASS][:, 0]
        residual = heading - euler(filter_.attitude[lanes])[:, 2]
        residual = (residual + np.pi) % (2.0 * np.pi) - np.pi
        slope = np.zeros((len(lanes), 1, 15))
        slope[:, 0, ANGLE] = matrix(filter_.attitude[lanes])[:, 2]  # turn about the vertical, to first order
        filter_.correct(lanes, slope, residual[:, None], np.full((len(lanes), 1), 0.05))

    def _gravity(self, filter_: Filter, accelerometer: Array) -> None:
        n = self._n
        lanes = np.flatnonzero(n["gravity"] > 0)
        if not len(lanes):
            return
        force = accelerometer[lanes] - filter_.accelerometer_bias[lanes]
        still = np.abs(np.sqrt((force**2).sum(-1)) - GRAVITY) < 1.0
        lanes, force = lanes[still], force[still]
        if not len(lanes):
            return
        rotation = matrix(filter_.attitude[lanes])
        expected = rotate_back(rotation, np.broadcast_to(np.array([0.0, 0.0, -GRAVITY]), force.shape))
        slope = np.zeros((len(lanes), 3, 15))
        slope[:, :, ANGLE] = skew(expected)
        filter_.correct(lanes, slope, force - expected, np.repeat(n["gravity"][lanes, None], 3, axis=1))
