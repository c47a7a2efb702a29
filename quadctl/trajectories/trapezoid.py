"""Trapezoid: motion along a given length, from rest to rest, at limited speed and acceleration."""

import math
from typing import NamedTuple


class Along(NamedTuple):
    """Distance travelled and its first two derivatives."""

    distance: float
    speed: float
    acceleration: float


class Trapezoid(NamedTuple):
    """Constant acceleration, constant speed, constant braking; a triangle where the way is too short for full speed."""

    length: float
    top_speed: float
    acceleration: float

    @classmethod
    def over(cls, length: float, speed: float, acceleration: float) -> "Trapezoid":
        """Profile over `length` that reaches `speed` where the way is long enough."""
        return cls(length, min(speed, math.sqrt(length * acceleration)), acceleration)

    @property
    def ramp_s(self) -> float:
        return self.top_speed / self.acceleration

    @property
    def duration_s(self) -> float:
        if self.top_speed < 1e-9:
            return 0.0
        return 2.0 * self.ramp_s + max(0.0, self.length / self.top_speed - self.ramp_s)

    def at(self, t_s: float) -> Along:
        """Distance, speed and acceleration at `t_s` since the start; at rest before it and after the end."""
        left_s = self.duration_s - t_s
        if t_s < 0.0 or left_s <= 0.0:
            return Along(0.0 if t_s < 0.0 else self.length, 0.0, 0.0)
        a = self.acceleration
        if t_s < self.ramp_s:
            return Along(0.5 * a * t_s * t_s, a * t_s, a)
        if left_s > self.ramp_s:
            return Along(0.5 * a * self.ramp_s**2 + self.top_speed * (t_s - self.ramp_s), self.top_speed, 0.0)
        return Along(self.length - 0.5 * a * left_s * left_s, a * left_s, -a)
