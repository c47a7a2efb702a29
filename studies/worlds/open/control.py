"""Controllers of this world, for all flights at once: geometric, cascaded, and a person's slow hand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from studies.worlds.open.vehicles import GRAVITY_M_S2, Array


@dataclass(frozen=True)
class Gains:
    """Gains of one flight's controller."""

    position: float
    velocity: float
    stiffness_up: float  # factor on the bandwidth in the vertical
    integral: float
    feed_forward: float
    attitude: float
    rate: float
    damping: float
    geometric: bool
    reaction_s: float


def gains(style: str, lag_s: float, rng: np.random.Generator) -> Gains:
    """Gains that suit a motor lag, in one of the styles `geometric`, `cascaded` and `pilot`."""
    damping = 0.5 if lag_s < 0.07 else 1.5
    rate = (1.0 + damping) ** 2 / (4.0 * 0.5 * lag_s) * rng.uniform(0.85, 1.0)
    rate = min(rate, 45.0)
    attitude = rate / rng.uniform(3.8, 4.6)
    share = {"geometric": 0.33, "cascaded": 0.3, "pilot": 0.17}[style] * rng.uniform(0.9, 1.1)
    bandwidth = min(share * attitude, 2.6)
    return Gains(
        position=bandwidth**2,
        velocity=1.7 * bandwidth,
        stiffness_up=float(np.clip(0.35 / (lag_s * bandwidth), 1.0, 2.0)),
        integral=0.22 * bandwidth**3,
        feed_forward={"geometric": 1.0, "cascaded": 0.4, "pilot": 0.5}[style],
        attitude=attitude,
        rate=rate,
        damping=damping,
        geometric=style == "geometric",
        reaction_s=0.25 if style == "pilot" else 0.0,
    )


class Controllers:
    """State of the controllers of all flights."""

    def __init__(self, settings: list[Gains], mass: Array, inertia: Array, arm: Array, torque: Array) -> None:
        """Take the settings and the masses, inertias, arms and torque per thrust of the vehicles."""

        def stack(name: str) -> Array:
            return np.array([getattr(s, name) for s in settings], dtype=float)[:, None]

        self.kp, self.kv, self.ki = stack("position"), stack("velocity"), stack("integral")
        self.ff, self.ka, self.kr = stack("feed_forward"), stack("attitude"), stack("rate")
        self.kd = stack("damping")
        up = np.concatenate([np.ones((len(settings), 2)), stack("stiffness_up")], axis=1)
        self.kp, self.kv, self.ki = self.kp * up**2, self.kv * up, self.ki * up**2
        self.geometric = stack("geometric") > 0.5
        self.mass, self.inertia = mass, inertia
        self.weight = np.array([1.0, 1.0, 0.35])
        n = len(settings)
        self.integral = np.zeros((n, 3))
        self.wanted = np.tile(np.eye(3), (n, 1, 1))
        self.angles = np.zeros((n, 3))  # roll, pitch and yaw that are commanded
        self.thrust = mass * GRAVITY_M_S2
        hard = 0.35 * self.thrust * arm
        self.limit = np.stack([hard, hard, 0.3 * self.thrust * torque], axis=1) / inertia

    def outer(
        self,
        position: Array,
        velocity: Array,
        rotation: Array,
        goal: tuple[Array, Array, Array],
        yaw: Array,
        step: float,
    ) -> None:
        """Set the wanted attitude and thrust from the errors of position and velocity."""
        away = goal[0] - position
        slip = goal[1] - velocity
        self.integral = np.clip(self.integral + self.ki * away * step, -4.0, 4.0)
        wish = self.kp * away + self.kv * slip + self.integral + self.ff * goal[2]
        flat = np.hypot(wish[:, 0], wish[:, 1])
        wish[:, :2] *= np.minimum(1.0, 6.5 / np.maximum(flat, 1e-9))[:, None]
        wish[:, 2] = np.clip(wish[:, 2], -7.0, 5.5)
        force = wish - np.array([0.0, 0.0, GRAVITY_M_S2])
        down = -force / np.linalg.norm(force, axis=1, keepdims=True)
        now = np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0])
        yaw = now + np.clip(np.mod(yaw - now + np.pi, 2 * np.pi) - np.pi, -0.4, 0.4)
        right = np.cross(down, np.stack([np.cos(yaw), np.sin(yaw), np.zeros_like(yaw)], axis=1))
        right /= np.linalg.norm(right, axis=1, keepdims=True)
        self.wanted = np.stack([np.cross(right, down), right, down], axis=2)
        self.angles = euler(self.wanted)
        self.thrust = self.mass * np.maximum(-np.sum(force * rotation[:, :, 2], axis=1), 2.0)

    def inner(self, rotation: Array, rates: Array, spin_up: Array) -> Array:
        """Moments that turn the vehicle to the wanted attitude."""
        error = np.einsum("nji,njk->nik", self.wanted, rotation)
        twist = 0.5 * np.stack(
            [error[:, 2, 1] - error[:, 1, 2], error[:, 0, 2] - error[:, 2, 0], error[:, 1, 0] - error[:, 0, 1]], axis=1
        )
        angles = euler(rotation) - self.angles
        angles[:, 2] = np.mod(angles[:, 2] + np.pi, 2 * np.pi) - np.pi
        wish = -self.ka * self.weight * np.where(self.geometric, twist, angles)
        turn = np.clip(self.kr * self.weight * (wish - rates) - self.kd * spin_up, -self.limit, self.limit)
        return np.asarray(self.inertia * turn + np.cross(rates, self.inertia * rates))


def euler(rotation: Array) -> Array:
    """Roll, pitch and yaw (ZYX) of rotations from body to world."""
    roll = np.arctan2(rotation[..., 2, 1], rotation[..., 2, 2])
    pitch = -np.arcsin(np.clip(rotation[..., 2, 0], -1.0, 1.0))
    yaw = np.arctan2(rotation[..., 1, 0], rotation[..., 0, 0])
    return np.stack([roll, pitch, yaw], axis=-1)
