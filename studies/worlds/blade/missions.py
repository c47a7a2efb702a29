"""Missions: positions and headings over time, smooth and within limits."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import make_interp_spline

from studies.worlds.blade.rotation import Array

STEP = 0.01
"""Step of references, s."""
SETTLE = 8.0
"""Hover before the log begins, s, in which the estimator converges."""


@dataclass(frozen=True)
class Demand:
    """Mission that is wanted: its shape and its limits."""

    shape: str
    duration: float
    speed: float
    """Greatest horizontal speed, m/s."""
    low: float
    high: float
    """Heights of the logged position above the ground, m."""
    extent: float
    """Half of the width of the space, m."""
    acceleration: float = 3.0
    climb: float = 2.0
    """Greatest vertical speed, m/s."""
    lift: float = 3.0
    """Greatest vertical acceleration, m/s^2."""
    heading: str = "turning"
    rate: float = 0.4
    """Frequency of vertical oscillations, Hz; they sweep from half of it to it."""


@dataclass(frozen=True)
class Reference:
    """Positions (north, east, down), velocities, accelerations and headings, at every STEP."""

    position: Array
    velocity: Array
    acceleration: Array
    yaw: Array


def ease(share: Array) -> Array:
    """Rise from 0 to 1 with no speed and no acceleration at either end."""
    x = np.clip(share, 0.0, 1.0)
    risen: Array = x**3 * (10.0 - 15.0 * x + 6.0 * x * x)
    return risen


def fly_spline(rng: np.random.Generator, time: Array, d: Demand) -> Array:
    """Minimum-snap curve through random points: the natural spline of degree 7 (Mellinger and Kumar 2011)."""
    legs = max(int(d.duration / rng.uniform(2.5, 4.5)), 6)
    points = rng.uniform(-1.0, 1.0, (legs + 1, 3)) * [d.extent, d.extent, 1.0]
    points[:, 2] = d.low + (d.high - d.low) * rng.beta(0.8, 0.8, legs + 1)
    knots = np.concatenate([[0.0], np.cumsum(rng.uniform(0.8, 1.2, legs))])
    knots *= d.duration / knots[-1]
    rest = [(1, np.zeros(3)), (2, np.zeros(3)), (3, np.zeros(3))]
    conditions: Any = (rest, rest)
    curve: Array = make_interp_spline(knots, points, k=7, bc_type=conditions)(time)
    return curve


def fly_lemniscate(rng: np.random.Generator, time: Array, d: Demand) -> Array:
    """Lemniscate, tilted, that speeds up and slows down."""
    laps = d.duration * d.speed / (6.1 * d.extent)
    pace = 1.0 + 0.35 * np.sin(2.0 * np.pi * time / d.duration * rng.uniform(1.0, 2.5) + rng.uniform(0, 6))
    pace *= ease(time / 4.0) * ease((d.duration - time) / 4.0)
    phase = np.cumsum(pace)
    phase *= 2.0 * np.pi * max(laps, 1.0) / phase[-1]
    turn, middle = rng.uniform(0, 2 * np.pi), (d.low + d.high) / 2
    x, y = d.extent * np.sin(phase), d.extent * np.sin(phase) * np.cos(phase)
    tilt = rng.uniform(0.5, 1.0) * (d.high - d.low) / 2 * np.sin(phase * rng.choice([1.0, 0.5]) + 0.3)
    return np.stack([x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn), middle + tilt], -1)


def fly_staircase(rng: np.random.Generator, time: Array, d: Demand) -> Array:
    """Hover at heights that are closer to each other below, down and up, with short ways sideways."""
    steps = int(rng.integers(8, 13))
    heights = d.low + (d.high - d.low) * np.linspace(1.0, 0.0, steps // 2) ** rng.uniform(1.0, 1.8)
    heights = np.concatenate([heights, heights[::-1]])
    return _visit(rng, time, d, heights)


def fly_ceiling_staircase(rng: np.random.Generator, time: Array, d: Demand) -> Array:
    """Hover at heights that are closer to each other above."""
    steps = int(rng.integers(8, 13))
    heights = d.high - (d.high - d.low) * np.linspace(1.0, 0.0, steps // 2) ** rng.uniform(1.0, 1.8)
    heights = np.concatenate([heights, heights[::-1]])
    return _visit(rng, time, d, heights)


def _visit(rng: np.random.Generator, time: Array, d: Demand, heights: Array) -> Array:
    places = rng.uniform(-1.0, 1.0, (len(heights), 2)) * d.extent
    starts = np.linspace(0.0, d.duration, len(heights) + 1)[1:-1] + rng.uniform(-0.4, 0.4, len(heights) - 1)
    way = min(0.55 * d.duration / len(heights), 4.0)
    goals = np.column_stack([places, heights])
    curve = np.tile(goals[0], (len(time), 1))
    for start, change in zip(starts, np.diff(goals, axis=0), strict=True):
        curve += ease((time - start) / way)[:, None] * change
    return curve


def fly_vertical(rng: np.random.Generator, time: Array, d: Demand) -> Array:
    """Vertical oscillations whose frequency goes up and down again, with a slow drift sideways."""
    sweep = 0.5 + 0.5 * 0.5 * (1.0 - np.cos(2.0 * np.pi * time / d.duration * rng.choice([1.0, 2.0])))
    phase = 2.0 * np.pi * np.cumsum(d.rate * sweep) * STEP
    height = np.sin(phase) / sweep
    rise = min(max(1.2 / d.rate, 3.0), d.duration / 4.0)
    height *= ease(time / rise) * ease((d.duration - time) / rise)
    height /= np.abs(height).max()
    slow = 2.0 * np.pi * time / d.duration
    x, y = d.extent * 0.5 * np.sin(slow), d.extent * 0.5 * np.sin(2 * slow)
    return np.stack([x, y, (d.low + d.high) / 2 + height * (d.high - d.low) / 2], -1)


def fly_dashes(rng: np.random.Generator, time: Array, d: Demand) -> Array:
    """Runs to and fro in several directions at different speeds, with stops."""
    places, times = [np.zeros(2)], [1.0]
    speeds: list[float] = []
    course = rng.uniform(0, 2 * np.pi)
    while times[-1] < d.duration:
        course += np.pi + rng.choice([0.0, 0.0, 0.5, -0.5, np.pi / 2])
        ends = d.extent * np.array([np.cos(course), np.sin(course)])
        length = float(np.hypot(*(ends - places[-1])))
        if length < 0.3 * d.extent:
            course += 1.0
            continue
        speeds.append(d.speed * rng.uniform(0.45, 1.0))
        places.append(ends)
        times.append(times[-1] + 1.875 * length / speeds[-1] + rng.uniform(0.2, 1.2))
    curve = np.tile(np.append(places[0], 0.0), (len(time), 1))
    for i, speed in enumerate(speeds):
        change = places[i + 1] - places[i]
        curve[:, :2] += ease((time - times[i]) * speed / (1.875 * np.hypot(*change)))[:, None] * change
    slow = rng.uniform(0.03, 0.06) * time + rng.uniform()
    curve[:, 2] = (d.low + d.high) / 2 + (d.high - d.low) / 2 * np.sin(2 * np.pi * slow)
    return curve


def fly_sticks(rng: np.random.Generator, time: Array, d: Demand) -> Array:
    """Way that a person has in mind: sums of sines without common periods (McRuer and Jex 1967)."""
    curve = np.zeros((len(time), 3))
    for axis in range(3):
        for harmonic in (2, 3, 5, 9, 14):
            wave = 2.0 * np.pi * harmonic * time / d.duration * rng.uniform(0.9, 1.1) + rng.uniform(0, 6.3)
            curve[:, axis] += np.sin(wave) / harmonic
    curve *= [d.extent, d.extent, (d.high - d.low) / 2]
    curve[:, 2] += (d.low + d.high) / 2
    return curve


SHAPES: dict[str, Callable[[np.random.Generator, Array, Demand], Array]] = {
    "spline": fly_spline,
    "lemniscate": fly_lemniscate,
    "staircase": fly_staircase,
    "ceiling_staircase": fly_ceiling_staircase,
    "vertical": fly_vertical,
    "dashes": fly_dashes,
    "sticks": fly_sticks,
}


def head(rng: np.random.Generator, time: Array, d: Demand, velocity: Array) -> Array:
    """Headings: `fixed`, `turning` slowly by more than a turn, in `steps`, or along the `course`."""
    first = rng.uniform(-np.pi, np.pi)
    if d.heading == "fixed":
        return np.full_like(time, first)
    if d.heading == "turning":
        turns = rng.uniform(1.1, 1.8) * rng.choice([-1.0, 1.0])
        yaw: Array = first + 2.0 * np.pi * turns * ease(time / d.duration)
        return yaw
    if d.heading == "steps":
        yaw = np.full_like(time, first)
        for start in np.arange(5.0, d.duration - 3.0, rng.uniform(7.0, 11.0)):
            yaw = yaw + rng.choice([-1.0, 1.0]) * rng.uniform(1.0, 2.2) * ease((time - start) / 3.5)
        return yaw
    course = np.arctan2(velocity[:, 1], velocity[:, 0])
    smooth = np.unwrap(course)
    width = int(2.0 / STEP)
    padded = np.pad(smooth, width, mode="edge")
    kernel = np.hanning(2 * width + 1)
    blurred: Array = np.convolve(padded, kernel / kernel.sum(), mode="same")[width:-width]
    return blurred


def plan(rng: np.random.Generator, d: Demand) -> Reference:
    """Reference of a mission: SETTLE seconds of hover at its first point, then its shape, within its limits."""
    time = np.arange(0.0, d.duration, STEP)
    curve = SHAPES[d.shape](rng, time, d)
    curve[:, :2] -= curve[:1, :2]
    # A shape that passes a height is squeezed; one that is too fast shrinks towards its middle.
    low, high = curve[:, 2].min(), curve[:, 2].max()
    if low < d.low - 1e-9 or high > d.high + 1e-9:
        curve[:, 2] = d.low + (curve[:, 2] - low) * (d.high - d.low) / (high - low)
    rate = np.gradient(curve, STEP, axis=0)
    curve[:, :2] *= min(1.0, d.speed / max(np.hypot(rate[:, 0], rate[:, 1]).max(), 1e-6))
    second = np.gradient(np.gradient(curve, STEP, axis=0), STEP, axis=0)
    curve[:, :2] *= min(1.0, d.acceleration / max(np.hypot(second[:, 0], second[:, 1]).max(), 1e-6))
    shrink = min(1.0, d.climb / max(np.abs(rate[:, 2]).max(), 1e-6), d.lift / max(np.abs(second[:, 2]).max(), 1e-6))
    anchor = d.low if d.shape == "staircase" else d.high if d.shape == "ceiling_staircase" else curve[:, 2].mean()
    curve[:, 2] = anchor + (curve[:, 2] - anchor) * shrink
    velocity = np.gradient(curve, STEP, axis=0)
    yaw = head(rng, time, d, velocity)
    before = round(SETTLE / STEP)
    whole = np.concatenate([np.tile(curve[0], (before, 1)), curve])
    # A shape that begins with a speed is eased in.
    share = ease((np.arange(len(whole)) * STEP - SETTLE) / 3.0)[:, None]
    whole = whole[0] + (whole - whole[0]) * share
    position = whole * [1.0, 1.0, -1.0]
    speed = np.gradient(position, STEP, axis=0)
    headings = np.concatenate([np.full(before, yaw[0]), yaw])
    return Reference(position, speed, np.gradient(speed, STEP, axis=0), headings)
