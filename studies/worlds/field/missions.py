"""Missions as paths of position and heading over time, put together from segments that people fly in the field."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from studies.worlds.field.arrays import Floats
from studies.worlds.field.noise import smooth_noise

STEP_S = 0.01


@dataclass(frozen=True)
class Arena:
    """Space and pace of one vehicle's flights; positions are north, east, up of the logged point."""

    half_width_m: float
    low_m: float
    """Lowest altitude that the reference may ask for."""
    middle_m: float
    high_m: float
    speed_m_s: float
    climb_m_s: float
    accel_m_s2: float


@dataclass(frozen=True)
class Reference:
    """Reference of a flight at steps of `STEP_S`, in NED: position, velocity, acceleration (samples, 3) and yaw."""

    position_m: Floats
    velocity_m_s: Floats
    accel_m_s2: Floats
    yaw_rad: Floats

    @property
    def duration_s(self) -> float:
        """Length of the reference."""
        return len(self.yaw_rad) * STEP_S


Segment = Callable[[np.random.Generator, Arena, Floats], Floats]


def _move(arena: Arena, start: Floats, end: Floats, speed: float | None = None) -> Floats:
    """Path from rest to rest by a quintic, as fast as speeds and accelerations allow."""
    way = end - start
    flat, up = float(np.hypot(way[0], way[1])), abs(float(way[2]))
    pace = arena.speed_m_s if speed is None else speed
    climb = arena.climb_m_s if speed is None else min(speed, arena.climb_m_s)
    seconds = max(1.9 * flat / pace, 1.9 * up / climb, np.sqrt(5.8 * np.hypot(flat, up) / arena.accel_m_s2), 0.3)
    s = np.linspace(0.0, 1.0, max(int(seconds / STEP_S), 2))[:, None]
    return np.asarray(start + (10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5) * way)


def _stay(start: Floats, seconds: float) -> Floats:
    return np.repeat(start[None], max(int(seconds / STEP_S), 1), axis=0)


def _spot(rng: np.random.Generator, arena: Arena, low: float | None = None, high: float | None = None) -> Floats:
    """Random point of the arena."""
    flat = rng.uniform(-arena.half_width_m, arena.half_width_m, 2)
    up = rng.uniform(arena.low_m if low is None else low, arena.high_m if high is None else high)
    return np.append(flat, up)


def _swell(samples: int, seconds: float = 2.5) -> Floats:
    """Weight that grows from 0 to 1 and falls back at the ends of a segment, so that it begins and ends at rest."""
    edge = min(int(seconds / STEP_S), samples // 2)
    ramp = 0.5 - 0.5 * np.cos(np.pi * np.arange(edge) / max(edge, 1))
    return np.concatenate([ramp, np.ones(samples - 2 * edge), ramp[::-1]])


def hover_heights(rng: np.random.Generator, arena: Arena, start: Floats) -> Floats:
    """Hover at a few heights between the lowest and the middle altitude."""
    parts, here = [], start
    for height in rng.permutation(np.linspace(arena.low_m, arena.middle_m, 5)):
        there = np.array([here[0] + rng.normal(0.0, 0.1), here[1] + rng.normal(0.0, 0.1), height])
        parts += [_move(arena, here, there, 0.6 * arena.climb_m_s), _stay(there, rng.uniform(2.0, 3.5))]
        here = there
    return np.concatenate(parts)


def low_passes(rng: np.random.Generator, arena: Arena, start: Floats) -> Floats:
    """Passes along the ground at low altitudes and different speeds, with climbs between them."""
    parts, here = [], start
    span = min(arena.half_width_m, 4.0)
    for _ in range(3):
        low = arena.low_m * rng.uniform(1.0, 2.2)
        side = rng.uniform(-span, span, 2)
        begin, end = np.append(side, low), np.append(-side, low * rng.uniform(1.0, 1.3))
        high = np.append(-side, rng.uniform(0.5, 1.0) * arena.middle_m)
        pace = rng.uniform(0.25, 0.8) * arena.speed_m_s
        above = np.append(side, 0.6 * arena.middle_m)
        parts += [
            _move(arena, here, above),
            _move(arena, above, begin, 0.6 * arena.climb_m_s),
            _move(arena, begin, end, pace),
        ]
        parts += [_stay(end, rng.uniform(0.5, 2.0)), _move(arena, end, high)]
        here = high
    return np.concatenate(parts)


def figure_eight(rng: np.random.Generator, arena: Arena, start: Floats) -> Floats:
    """Figure-eight with swelling amplitude, inclined at random."""
    size = arena.half_width_m * rng.uniform(0.5, 1.0)
    pace = arena.speed_m_s * rng.uniform(0.6, 1.0)
    period = max(2.0 * np.pi * size * 1.25 / pace, 2.0 * np.pi * np.sqrt(2.0 * size / arena.accel_m_s2))
    samples = int(max(2.2 * period, 10.0) / STEP_S)
    phase = 2.0 * np.pi * np.arange(samples) * STEP_S / period
    rise = rng.uniform(0.0, 0.4) * min(arena.high_m - start[2], start[2] - arena.low_m)
    shape = np.stack([np.sin(phase), 0.5 * np.sin(2.0 * phase), np.zeros(samples)], axis=1) * size
    shape[:, 2] = max(rise, 0.0) * np.sin(phase)
    heading = rng.uniform(-np.pi, np.pi)
    turned = shape.copy()
    turned[:, 0] = np.cos(heading) * shape[:, 0] - np.sin(heading) * shape[:, 1]
    turned[:, 1] = np.sin(heading) * shape[:, 0] + np.cos(heading) * shape[:, 1]
    return np.asarray(start + turned * _swell(samples, 0.6 * period)[:, None])


def random_spline(rng: np.random.Generator, arena: Arena, start: Floats) -> Floats:
    """Cubic spline through random points."""
    points = [start] + [_spot(rng, arena, 0.6 * arena.low_m + 0.4 * arena.middle_m) for _ in range(6)]
    legs = np.diff(np.array(points), axis=0)
    slow = rng.uniform(0.5, 1.0)
    flat = np.hypot(legs[:, 0], legs[:, 1]) / (slow * arena.speed_m_s)
    seconds = np.maximum(np.maximum(1.4 * flat, 1.4 * np.abs(legs[:, 2]) / arena.climb_m_s), 0.8)
    knots = np.concatenate([[0.0], np.cumsum(seconds)])
    curve = CubicSpline(knots, np.array(points), bc_type="clamped")
    return np.asarray(curve(np.arange(0.0, knots[-1], STEP_S)))


def climbs(rng: np.random.Generator, arena: Arena, start: Floats) -> Floats:
    """Climbs and descents at several rates."""
    parts, here = [], start
    for share in rng.permutation(np.array([0.3, 0.6, 1.0, 1.0])):
        for height in (rng.uniform(0.7, 1.0) * arena.high_m, rng.uniform(0.25, 0.5) * arena.middle_m + arena.low_m):
            there = np.array([here[0], here[1], height])
            parts += [_move(arena, here, there, share * arena.climb_m_s), _stay(there, rng.uniform(0.3, 1.5))]
            here = there
    return np.concatenate(parts)


def bounces(rng: np.random.Generator, arena: Arena, start: Floats) -> Floats:
    """Vertical oscillation whose frequency rises from 0.15 to about 0.7 Hz at constant peak acceleration or speed."""
    samples = int(rng.uniform(14.0, 18.0) / STEP_S)
    frequency = np.geomspace(0.15, rng.uniform(0.5, 0.9), samples)
    omega = 2.0 * np.pi * frequency
    room = max(min(arena.high_m - start[2], start[2] - arena.low_m), 0.05)
    amplitude = np.minimum(np.minimum(0.8 * arena.accel_m_s2 / omega**2, arena.climb_m_s / omega), 0.9 * room)
    path = np.repeat(start[None], samples, axis=0)
    path[:, 2] += amplitude * np.sin(np.cumsum(omega) * STEP_S) * _swell(samples)
    return path


def sticks(rng: np.random.Generator, arena: Arena, start: Floats) -> Floats:
    """Flight of a person at the sticks: band-limited random motion in all axes."""
    samples = int(rng.uniform(16.0, 24.0) / STEP_S)
    pace = rng.uniform(0.5, 0.9)
    time = max(0.7 * arena.half_width_m / (pace * arena.speed_m_s), 0.9)
    wander = smooth_noise(rng, samples, STEP_S, 1.0, time, 3)
    room = 0.5 * max(min(arena.high_m - start[2], start[2] - arena.low_m), 0.05)
    reach = np.array([0.5 * arena.half_width_m, 0.5 * arena.half_width_m, min(room, arena.climb_m_s * time)])
    return np.asarray(start + 1.3 * np.tanh(wander / 1.3) * reach * _swell(samples)[:, None])


def straight_runs(rng: np.random.Generator, arena: Arena, start: Floats) -> Floats:
    """Fast straight runs there and back in several directions, with a stop at each end."""
    parts, here = [], start
    angle = rng.uniform(-np.pi, np.pi)
    for index in range(3):
        reach = arena.half_width_m * rng.uniform(0.7, 1.0)
        there = np.array([reach * np.cos(angle), reach * np.sin(angle), start[2] * rng.uniform(0.9, 1.1)])
        parts += [_move(arena, here, there, arena.speed_m_s * rng.uniform(0.6, 1.15)), _stay(there, 0.7)]
        here = there
        angle += np.pi if index % 2 == 0 else rng.uniform(0.3, 0.7) * np.pi
    return np.concatenate(parts)


def high_hovers(rng: np.random.Generator, arena: Arena, start: Floats) -> Floats:
    """Hover at heights between the middle and the highest altitude: below a ceiling where there is one."""
    parts, here = [], start
    below = (arena.high_m - arena.middle_m) * np.array([0.0, 0.02, 0.06, 0.15, 0.4, 1.0])
    for height in rng.permutation(arena.high_m - below):
        there = np.array([here[0] + rng.normal(0.0, 0.2), here[1] + rng.normal(0.0, 0.2), height])
        parts += [_move(arena, here, there, 0.6 * arena.climb_m_s), _stay(there, rng.uniform(2.0, 3.0))]
        here = there
    return np.concatenate(parts)


def still(rng: np.random.Generator, arena: Arena, start: Floats) -> Floats:
    """Hover at the middle altitude."""
    there = np.array([start[0], start[1], arena.middle_m])
    return np.concatenate([_move(arena, start, there), _stay(there, rng.uniform(4.0, 8.0))])


SEGMENTS: dict[str, Segment] = {
    segment.__name__: segment
    for segment in (
        hover_heights,
        low_passes,
        figure_eight,
        random_spline,
        climbs,
        bounces,
        sticks,
        straight_runs,
        high_hovers,
        still,
    )
}


def _headings(rng: np.random.Generator, samples: int, kind: str) -> Floats:
    """Yaw of a flight: held, turned slowly or changed in steps that the vehicle can follow."""
    start = rng.uniform(-np.pi, np.pi) if kind != "north" else 0.0
    time = np.arange(samples) * STEP_S
    if kind == "turning":
        return np.asarray(start + rng.choice([-1.0, 1.0]) * rng.uniform(0.1, 0.35) * time)
    if kind == "steps":
        yaw = np.full(samples, start)
        for moment in np.arange(rng.uniform(6.0, 12.0), time[-1], rng.uniform(9.0, 15.0)):
            yaw[time >= moment] += rng.uniform(-1.6, 1.6)
        return np.asarray(gaussian_filter1d(yaw, 0.7 / STEP_S, mode="nearest"))
    return np.full(samples, start)


def draw_reference(
    rng: np.random.Generator,
    arena: Arena,
    segments: list[str],
    duration_s: float,
    heading: str,
    settle_s: float,
) -> Reference:
    """Draw a reference: `settle_s` of hover at the middle altitude, then the segments in turn until `duration_s`."""
    start = np.array([*rng.uniform(-0.2, 0.2, 2) * min(arena.half_width_m, 5.0), arena.middle_m])
    parts = [_stay(start, 1.0)]
    total, index = 1.0, 0
    while total < duration_s:
        here = parts[-1][-1]
        name = segments[index % len(segments)]
        if name in ("bounces", "sticks", "figure_eight", "straight_runs"):
            base = np.array([0.2 * here[0], 0.2 * here[1], arena.middle_m])
            parts.append(_move(arena, here, base))
            here = base
        parts.append(SEGMENTS[name](rng, arena, here))
        total = sum(len(part) for part in parts) * STEP_S
        index += 1
    path = np.concatenate(parts)
    path[:, 2] = np.clip(path[:, 2], arena.low_m, arena.high_m)
    path = gaussian_filter1d(path, 0.12 / STEP_S, axis=0, mode="nearest")
    # A path that asks for too much acceleration is flown slower as a whole.
    accel = np.gradient(np.gradient(path, STEP_S, axis=0), STEP_S, axis=0)
    peak = float(np.percentile(np.sqrt(np.sum(accel**2, axis=1)), 99.5))
    slower = max(1.0, np.sqrt(peak / (1.1 * arena.accel_m_s2)))
    samples = int(duration_s / STEP_S)
    old = np.arange(len(path)) * STEP_S * slower
    new = np.arange(samples) * STEP_S
    path = np.stack([np.interp(new, old, path[:, axis]) for axis in range(3)], axis=1)
    path = np.concatenate([np.repeat(path[:1], int(settle_s / STEP_S), axis=0), path])
    path = gaussian_filter1d(path, 0.05 / STEP_S, axis=0, mode="nearest")
    path = path * np.array([1.0, 1.0, -1.0])
    velocity = np.gradient(path, STEP_S, axis=0)
    yaw = np.concatenate([np.zeros(int(settle_s / STEP_S)), _headings(rng, samples, heading)])
    yaw[: int(settle_s / STEP_S)] = yaw[int(settle_s / STEP_S)]
    return Reference(path, velocity, np.gradient(velocity, STEP_S, axis=0), yaw)
