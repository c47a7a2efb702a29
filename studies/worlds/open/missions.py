"""References that a competent experimenter would fly: a horizontal, a vertical and a heading part for each flight."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter1d

from studies.worlds.open.vehicles import Array

STEP_S = 0.01
SETTLE_S = 5.0

Part = tuple[str, Mapping[str, Any]]


@dataclass(frozen=True)
class Mission:
    """Flight: its length and its parts, `across` (m, m/s), `up` (m above the ground, or radii) and the heading."""

    seconds: float
    across: Part = ("sway", {})
    up: Part = ("hold", {"height": 1.5})
    turn: str = "fixed"
    unit: str = "metres"  # of the heights: metres, rotor radii of the rotor plane, or radii below the ceiling


@dataclass(frozen=True)
class Reference:
    """Path at 100 Hz in north, east, down, with its derivatives and the heading; it begins with a hover to settle."""

    position: Array
    velocity: Array
    acceleration: Array
    yaw: Array


def _grid(seconds: float) -> Array:
    return np.arange(round(seconds / STEP_S), dtype=np.float64) * STEP_S


def _start(t: Array) -> Array:
    """Envelope that grows from 0 to 1 in the first three seconds."""
    x = np.clip(t / 3.0, 0.0, 1.0)
    return np.asarray(x * x * (3.0 - 2.0 * x))


def _ramps(t: Array, levels: Array, dwell: float, ramp: float) -> Array:
    """Staircase through levels."""
    knots, values, now = [0.0], [float(levels[0])], 0.0
    for level in levels[1:]:
        knots += [now + dwell, now + dwell + ramp]
        values += [values[-1], float(level)]
        now += dwell + ramp
    return np.asarray(np.interp(t, knots, values))


def _sway(t: Array, rng: np.random.Generator, size: float = 0.15) -> Array:
    waves = [size * np.sin(2 * np.pi * t / rng.uniform(5, 12) + rng.uniform(0, 6)) for _ in range(2)]
    return np.stack(waves, axis=1) * _start(t)[:, None]


def _runs(
    t: Array, rng: np.random.Generator, speed: float, cruise: float, pull: float = 3.0, star: bool = True
) -> Array:
    """Out-and-back runs of a constant speed; `star` turns the line after each pair, and the speed varies."""
    wanted = np.zeros((len(t), 2))
    now, leg = 0.5, 0
    course, fast = rng.uniform(0, 2 * np.pi), speed
    while now < t[-1]:
        if leg % 2 == 0:
            fast = speed * float(rng.choice([0.55, 0.8, 1.0, 1.0]))
            course += rng.uniform(0.9, 2.2) if star and leg else 0.0
        climb = fast / pull
        profile = np.interp(t, now + np.cumsum([0.0, climb, cruise, climb]), [0.0, fast, fast, 0.0], left=0, right=0)
        sign = 1.0 if leg % 2 == 0 else -1.0
        wanted += sign * profile[:, None] * np.array([np.cos(course), np.sin(course)])
        now += 2 * climb + cruise + 0.8
        leg += 1
    return np.asarray(np.cumsum(wanted, axis=0) * STEP_S)


def _eight(t: Array, rng: np.random.Generator, size: float, period: float) -> Array:
    rate = 2 * np.pi / period * (1.0 + 0.12 * np.sin(2 * np.pi * t / 35.0))
    phase = np.cumsum(rate * _start(t)) * STEP_S
    path = size * np.stack([np.sin(phase), 0.5 * np.sin(2 * phase)], axis=1)
    turn = rng.uniform(0, np.pi)
    return np.asarray(path @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]))


def _smooth(t: Array, rng: np.random.Generator, speed: float, smooth: float) -> Array:
    path = gaussian_filter1d(rng.normal(size=(len(t), 2)), smooth / STEP_S, axis=0)
    path -= path[0]
    fast = np.quantile(np.linalg.norm(np.gradient(path, STEP_S, axis=0), axis=1), 0.97)
    return np.asarray(path * speed / fast * _start(t)[:, None])


def _sticks(t: Array, rng: np.random.Generator, speed: float, room: float) -> Array:
    """Path under the sticks of a person who keeps within a room."""
    path, velocity, position = np.zeros((len(t), 2)), np.zeros(2), np.zeros(2)
    stick, until = np.zeros(2), 1.0
    for i, now in enumerate(t):
        if now > until:
            until = now + rng.uniform(0.8, 3.0)
            away = np.arctan2(position[1], position[0])
            course = rng.uniform(-np.pi, np.pi)
            if np.linalg.norm(position) > 0.6 * room:
                course = away + np.pi + rng.normal(0, 0.5)
            stick = speed * float(rng.choice([0.0, 0.4, 0.8, 1.0])) * np.array([np.cos(course), np.sin(course)])
        velocity = velocity + (stick - velocity) * STEP_S / 0.45
        position = position + velocity * STEP_S
        path[i] = position
    return path


def _shake(t: Array, rng: np.random.Generator, pull: float, period: float) -> Array:
    """Lateral oscillation, by turns along x, along y and on a circle, with an amplitude of acceleration."""
    rate = 2 * np.pi / period
    path = pull / rate**2 * np.stack([np.sin(rate * t), np.sin(rate * t * 1.07 + 1.0)], axis=1)
    wave = 0.5 + 0.5 * np.sin(2 * np.pi * t / 17.0 + np.array([[0.0], [2.2]])).T
    return np.asarray(path * wave * _start(t)[:, None])


ACROSS: dict[str, Callable[..., Array]] = {
    "sway": _sway,
    "runs": _runs,
    "eight": _eight,
    "spline": _smooth,
    "sticks": _sticks,
    "shake": _shake,
}


def _hold(t: Array, rng: np.random.Generator, height: float) -> Array:
    return np.asarray(height * np.ones_like(t))


def _stairs(
    t: Array, rng: np.random.Generator, low: float, high: float, steps: int, dwell: float = 3.5, ramp: float = 1.2
) -> Array:
    """Staircase up and down, steps closer together at the lower end, in an order that differs each time."""
    levels = low * (high / low) ** np.linspace(0, 1, steps)
    order = [levels[::-1]]
    while len(np.concatenate(order)) * (dwell + ramp) < t[-1]:
        order.append(rng.permutation(levels) if len(order) % 3 == 2 else order[-1][::-1][1:])
    return _ramps(t, np.concatenate(order), dwell, ramp)


def _swings(t: Array, rng: np.random.Generator, middle: float, pull: float, period: float, room: float = 1e3) -> Array:
    """Vertical oscillation with an amplitude of acceleration, its period sweeping by half; rests between bursts."""
    rate = 2 * np.pi / period * (1.0 + 0.3 * np.sin(2 * np.pi * t / 23.0 + rng.uniform(0, 6)))
    burst = gaussian_filter1d(np.where(np.mod(t, 14.0) < 11.0, 1.0, 0.15), 0.8 / STEP_S)
    size = np.minimum(pull / rate**2, room) * burst
    return np.asarray(middle + size * np.sin(np.cumsum(rate) * STEP_S) * _start(t))


def _wander(t: Array, rng: np.random.Generator, low: float, high: float, smooth: float) -> Array:
    """Smooth random heights between two limits."""
    path = gaussian_filter1d(rng.normal(size=len(t)), smooth / STEP_S)
    path = (path - path.min()) / (path.max() - path.min())
    return np.asarray(low + (high - low) * path)


def _climbs(t: Array, rng: np.random.Generator, low: float, high: float, speed: float) -> Array:
    """Climbs and descents at a constant speed that varies from one to the next."""
    knots, values, now, level = [0.0, 1.5], [low, low], 1.5, low
    while now < t[-1]:
        goal = high if level == low else low
        now += (high - low) / (speed * float(rng.choice([0.5, 0.8, 1.0, 1.0])))
        knots += [now, now + 1.0]
        values += [goal, goal]
        now, level = now + 1.0, goal
    return np.asarray(np.interp(t, knots, values))


UP: dict[str, Callable[..., Array]] = {
    "hold": _hold,
    "stairs": _stairs,
    "swings": _swings,
    "wander": _wander,
    "climbs": _climbs,
}


def _heading(turn: str, t: Array, rng: np.random.Generator, path: Array) -> Array:
    first = rng.uniform(-np.pi, np.pi)
    if turn == "slow":
        return np.asarray(first + 2 * np.pi * t / rng.uniform(28, 45) * rng.choice([-1, 1]))
    if turn == "steps":
        count = int(t[-1] / 9.0) + 2
        return _ramps(t, first + np.cumsum(rng.choice([-1.6, 1.6, 0.8], count)), 6.0, 3.0)
    if turn == "sticks":
        return np.asarray(first + np.cumsum(gaussian_filter1d(rng.normal(0, 8.0, len(t)), 1.5 / STEP_S)) * STEP_S)
    if turn == "nose":
        velocity = gaussian_filter1d(np.gradient(path, STEP_S, axis=0), 0.6 / STEP_S, axis=0)
        fast = np.linalg.norm(velocity, axis=1)
        course = np.unwrap(np.arctan2(velocity[:, 1], velocity[:, 0]))
        moving = fast > 0.25 * fast.max()
        wanted = np.interp(t, t[moving], course[moving])
        heading = np.zeros_like(t)
        heading[0] = wanted[0]
        for i in range(1, len(t)):
            heading[i] = heading[i - 1] + np.clip(wanted[i] - heading[i - 1], -0.9 * STEP_S, 0.9 * STEP_S)
        return gaussian_filter1d(heading, 0.5 / STEP_S)
    return np.asarray(first + 0.05 * np.sin(2 * np.pi * t / 20.0))


def reference(
    mission: Mission, radius_m: float, rotor_height_m: float, ceiling_m: float | None, rng: np.random.Generator
) -> Reference:
    """Reference of a mission for a vehicle; heights in radii are those of the rotor plane."""
    t = _grid(mission.seconds + 1.0)
    across = ACROSS[mission.across[0]](t, rng, **mission.across[1])
    up = UP[mission.up[0]](t, rng, **mission.up[1])
    if mission.unit == "radii":
        up = up * radius_m - rotor_height_m
    elif mission.unit == "below":
        up = (ceiling_m or 0.0) - rotor_height_m - up * radius_m
    elif mission.unit == "above":  # metres of the rotor plane
        up = up - rotor_height_m
    yaw = _heading(mission.turn, t, rng, across)
    path = np.column_stack([across, -up, yaw])
    rest = np.repeat(path[:1], round(SETTLE_S / STEP_S), axis=0)
    path = gaussian_filter1d(np.concatenate([rest, path]), 0.2 / STEP_S, axis=0, mode="nearest")
    velocity = np.gradient(path, STEP_S, axis=0)
    acceleration = np.gradient(velocity, STEP_S, axis=0)
    return Reference(path[:, :3], velocity[:, :3], acceleration[:, :3], path[:, 3])
