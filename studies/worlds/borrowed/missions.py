"""References that an experimenter would fly: a horizontal part, a vertical part and a heading for each flight."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter1d

from studies.worlds.borrowed.craft import Array

STEP_S = 0.01
SETTLE_S = 5.0

Part = tuple[str, dict[str, float]]


def part(name: str, **sizes: float) -> Part:
    """One part of a mission, by the name of its function."""
    return name, sizes


@dataclass(frozen=True)
class Mission:
    """Flight: its length, its parts and the unit of its heights."""

    seconds: float
    across: Part
    up: Part
    turn: str = "slow"
    unit: str = "metres"
    """`metres` above the ground, `radii` of the rotor plane, or radii `below` the ceiling."""


@dataclass(frozen=True)
class Reference:
    """Path at steps of `STEP_S`, north, west, up, with its derivatives and the heading; it begins with a hover.

    Also the paths of all flights at one time.
    """

    position: Array
    velocity: Array
    acceleration: Array
    yaw: Array


def _start(t: Array) -> Array:
    """Envelope that grows from 0 to 1 in the first three seconds."""
    x = np.clip(t / 3.0, 0.0, 1.0)
    return np.asarray(x * x * (3.0 - 2.0 * x))


def _sway(t: Array, rng: np.random.Generator, size: float = 0.15) -> Array:
    waves = [size * np.sin(2 * np.pi * t / rng.uniform(5, 12) + rng.uniform(0, 6)) for _ in range(2)]
    return np.stack(waves, axis=1) * _start(t)[:, None]


def _runs(t: Array, rng: np.random.Generator, speed: float, cruise: float, pull: float = 3.0) -> Array:
    """Out-and-back runs at speeds that vary, on a line that turns after each pair."""
    wanted, now, leg = np.zeros((len(t), 2)), 0.5, 0
    course, fast = rng.uniform(0, 2 * np.pi), speed
    while now < t[-1]:
        if leg % 2 == 0:
            fast = speed * float(rng.choice([0.55, 0.8, 1.0, 1.0]))
            course += rng.uniform(0.9, 2.2)
        ramps = now + np.cumsum([0.0, fast / pull, cruise, fast / pull])
        profile = np.interp(t, ramps, [0.0, fast, fast, 0.0], left=0, right=0)
        wanted += (-1.0) ** leg * profile[:, None] * np.array([np.cos(course), np.sin(course)])
        now, leg = ramps[-1] + 0.8, leg + 1
    return np.asarray(np.cumsum(wanted, axis=0) * STEP_S)


def _eight(t: Array, rng: np.random.Generator, size: float, period: float) -> Array:
    phase = np.cumsum(2 * np.pi / period * (1.0 + 0.12 * np.sin(2 * np.pi * t / 35.0)) * _start(t)) * STEP_S
    turn = rng.uniform(0, np.pi)
    path = size * np.stack([np.sin(phase), 0.5 * np.sin(2 * phase)], axis=1)
    return np.asarray(path @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]))


def _smooth(t: Array, rng: np.random.Generator, speed: float, smooth: float) -> Array:
    path = gaussian_filter1d(rng.normal(size=(len(t), 2)), smooth / STEP_S, axis=0)
    fast = np.quantile(np.linalg.norm(np.gradient(path, STEP_S, axis=0), axis=1), 0.97)
    return np.asarray((path - path[0]) * speed / fast * _start(t)[:, None])


def _shake(t: Array, rng: np.random.Generator, pull: float, period: float) -> Array:
    """Lateral oscillation, by turns along x, along y and on a circle, with an amplitude of acceleration."""
    rate = 2 * np.pi / period
    path = pull / rate**2 * np.stack([np.sin(rate * t), np.sin(rate * t * 1.07 + 1.0)], axis=1)
    wave = 0.5 + 0.5 * np.sin(2 * np.pi * t / 17.0 + np.array([[0.0], [2.2]])).T
    return np.asarray(path * wave * _start(t)[:, None])


def _hold(t: Array, rng: np.random.Generator, height: float) -> Array:
    return np.asarray(height * np.ones_like(t))


def _stairs(t: Array, rng: np.random.Generator, low: float, high: float, steps: float, ramp: float = 1.5) -> Array:
    """Staircase up and down, steps closer together at the lower end, each third time in another order."""
    levels, dwell = low * (high / low) ** np.linspace(0, 1, int(steps)), 3.5
    order = [levels[::-1]]
    while len(np.concatenate(order)) * (dwell + ramp) < t[-1]:
        order.append(rng.permutation(levels) if len(order) % 3 == 2 else order[-1][::-1][1:])
    heights = np.concatenate(order)
    ends = np.arange(len(heights)) * (dwell + ramp)
    return np.asarray(np.interp(t, np.sort([*ends, *(ends + dwell)]), np.repeat(heights, 2)))


def _swings(t: Array, rng: np.random.Generator, middle: float, pull: float, period: float) -> Array:
    """Vertical oscillation with an amplitude of acceleration, its period sweeping by a third; rests between bursts."""
    rate = 2 * np.pi / period * (1.0 + 0.3 * np.sin(2 * np.pi * t / 23.0 + rng.uniform(0, 6)))
    burst = gaussian_filter1d(np.where(np.mod(t, 14.0) < 11.0, 1.0, 0.15), 0.8 / STEP_S)
    return np.asarray(middle + pull / rate**2 * burst * np.sin(np.cumsum(rate) * STEP_S) * _start(t))


def _wander(t: Array, rng: np.random.Generator, low: float, high: float, smooth: float) -> Array:
    """Smooth random heights between two limits."""
    path = gaussian_filter1d(rng.normal(size=len(t)), smooth / STEP_S)
    return np.asarray(low + (high - low) * (path - path.min()) / np.ptp(path))


def _climbs(t: Array, rng: np.random.Generator, low: float, high: float, speed: float) -> Array:
    """Climbs and descents, each at a constant speed that varies from one to the next."""
    knots, values = [0.0, 1.5], [low, low]
    while knots[-1] < t[-1]:
        goal = high if values[-1] == low else low
        end = knots[-1] + (high - low) / (speed * float(rng.choice([0.5, 0.8, 1.0, 1.0])))
        knots, values = [*knots, end, end + 1.0], [*values, goal, goal]
    return np.asarray(np.interp(t, knots, values))


PARTS: dict[str, Callable[..., Any]] = {
    "sway": _sway,
    "runs": _runs,
    "eight": _eight,
    "smooth": _smooth,
    "shake": _shake,
    "hold": _hold,
    "stairs": _stairs,
    "swings": _swings,
    "wander": _wander,
    "climbs": _climbs,
}


def _heading(turn: str, t: Array, rng: np.random.Generator) -> Array:
    first = rng.uniform(-np.pi, np.pi)
    if turn == "slow":
        return np.asarray(first + 2 * np.pi * t / rng.uniform(28, 45) * rng.choice([-1, 1]))
    if turn == "steps":
        knots = np.arange(int(t[-1] / 9.0) + 2) * 9.0
        turns = first + np.cumsum(rng.choice([-1.6, 1.6, 0.8], len(knots)))
        return np.asarray(np.interp(t, np.sort([*knots, *(knots + 6.0)]), np.repeat(turns, 2)))
    return np.asarray(first + 0.05 * np.sin(2 * np.pi * t / 20.0))


def reference(
    mission: Mission, radius_m: float, rotor_height_m: float, ceiling_m: float | None, rng: np.random.Generator
) -> Reference:
    """Reference of a mission for a vehicle; heights in radii are those of the rotor plane."""
    t = np.arange(round((mission.seconds + 1.0) / STEP_S), dtype=np.float64) * STEP_S
    across = PARTS[mission.across[0]](t, rng, **mission.across[1])
    up = PARTS[mission.up[0]](t, rng, **mission.up[1])
    if mission.unit == "radii":
        up = up * radius_m - rotor_height_m
    elif mission.unit == "below":
        up = (ceiling_m or 0.0) - rotor_height_m - up * radius_m
    path = np.column_stack([across, up, _heading(mission.turn, t, rng)])
    path = np.concatenate([np.repeat(path[:1], round(SETTLE_S / STEP_S), axis=0), path])
    path = gaussian_filter1d(path, 0.2 / STEP_S, axis=0, mode="nearest")
    velocity = np.gradient(path[:, :3], STEP_S, axis=0)
    return Reference(path[:, :3], velocity, np.gradient(velocity, STEP_S, axis=0), path[:, 3])
