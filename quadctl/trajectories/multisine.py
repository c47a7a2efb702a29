"""Multisine: waves of many frequencies at once in all three axes, to excite whatever a model may lack."""

import math
from functools import cached_property
from typing import Annotated, ClassVar, NamedTuple, Self

import numpy as np
from pydantic import Field, model_validator

from quadctl.numeric import Number, cos, sin, sqrt
from quadctl.state import Vec3
from quadctl.trajectories.base import Reference, Trajectory

SAMPLES_PER_WAVE = 40
"""Samples per period of the quickest wave when peaks are searched: between samples none is more than 0.3 % higher."""

_Excursion = Annotated[float, Field(ge=0.0, le=100.0)]


class _Motion(NamedTuple):
    """Excursion of one axis, m, and its first two derivatives."""

    x: Number
    v: Number
    a: Number


class Multisine(Trajectory):
    """Keys: amplitude_m [north, east, up], speed_m_s, acceleration_m_s2, slowest_hz, fastest_hz, waves, duration_s,
    fade_s.

    Each axis is a sum of `waves` sines about the point where the phase before ended. The frequencies run from
    `slowest_hz` to `fastest_hz` in equal ratios and are dealt to the axes in turn, so that no two axes share one and
    what one axis does cannot be mistaken for another's (Morelli 2003, AIAA 2003-5492). All waves of an axis bring the
    same speed, with the phases of Schroeder (1970), which keep the peaks of the sum low. The excursion of each axis
    reaches `amplitude_m`, or less where `speed_m_s` or `acceleration_m_s2`, which limits the tilt, would be exceeded:
    then all axes shrink together. It swells from rest and ends at rest where it began, over `fade_s` each.
    """

    kind: ClassVar[str] = "multisine"

    amplitude_m: tuple[_Excursion, _Excursion, _Excursion] = (1.5, 1.5, 0.3)
    speed_m_s: float = Field(default=1.5, gt=0.0, le=20.0)
    acceleration_m_s2: float = Field(default=2.5, gt=0.0, le=8.0)
    slowest_hz: float = Field(default=0.06, ge=0.001, le=5.0)
    fastest_hz: float = Field(default=0.6, ge=0.001, le=5.0)
    waves: int = Field(default=4, ge=1, le=20)
    seconds: float = Field(default=60.0, alias="duration_s", ge=1.0, le=600.0)
    fade_s: float = Field(default=3.0, ge=0.5, le=60.0)

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if self.fastest_hz < self.slowest_hz:
            raise ValueError(f"fastest_hz is {self.fastest_hz:g}, expected at least slowest_hz = {self.slowest_hz:g}")
        if 2.0 * self.fade_s > self.seconds:
            raise ValueError(f"fade_s is {self.fade_s:g}, expected at most half of duration_s = {self.seconds:g}")
        return self

    def duration_s(self, start_m: Vec3) -> float:
        return self.seconds

    def reference(self, t_s: float, start_m: Vec3) -> Reference:
        if not 0.0 < t_s < self.seconds:
            return Reference(start_m)
        window = self._window(t_s)
        x, y, z = (_faded(window, self._sum(axis, t_s), size) for axis, size in enumerate(self._sizes))
        return Reference((start_m[0] + x.x, start_m[1] + y.x, start_m[2] + z.x), (x.v, y.v, z.v), (x.a, y.a, z.a))

    @cached_property
    def _waves(self) -> tuple[tuple[tuple[float, float], ...], ...]:
        """Angular frequency, rad/s, and phase of every wave of each axis."""
        count = 3 * self.waves
        ratio = self.fastest_hz / self.slowest_hz
        rates = [2.0 * math.pi * self.slowest_hz * ratio ** (i / (count - 1)) for i in range(count)]
        phases = [-math.pi * k * (k - 1) / self.waves for k in range(1, self.waves + 1)]
        return tuple(tuple(zip(rates[axis::3], phases, strict=True)) for axis in range(3))

    @cached_property
    def _sizes(self) -> Vec3:
        """Factor by which the sum of waves of each axis is multiplied."""
        steps = math.ceil(self.seconds * self.fastest_hz * SAMPLES_PER_WAVE) + 1
        t = np.linspace(0.0, self.seconds, max(steps, 1000))
        window = _Motion(*(np.array(part) for part in zip(*map(self._window, t.tolist()), strict=True)))
        sums = [self._sum(axis, t) for axis in range(3)]
        peaks = [float(np.max(np.abs(_faded(window, motion, 1.0).x))) for motion in sums]
        sizes = [wanted / peak for wanted, peak in zip(self.amplitude_m, peaks, strict=True)]
        motions = [_faded(window, motion, size) for motion, size in zip(sums, sizes, strict=True)]
        speed = float(np.max(sqrt(sum(motion.v**2 for motion in motions))))
        push = float(np.max(sqrt(sum(motion.a**2 for motion in motions))))
        # The least numbers stand for a trajectory of no amplitude at all.
        shrink = min(1.0, self.speed_m_s / max(speed, 1e-9), self.acceleration_m_s2 / max(push, 1e-9))
        return shrink * sizes[0], shrink * sizes[1], shrink * sizes[2]

    def _sum(self, axis: int, t_s: Number) -> _Motion:
        """Sum of the waves of one axis, before scaling and window."""
        x: Number = 0.0
        v: Number = 0.0
        a: Number = 0.0
        for rate, phase in self._waves[axis]:
            s, c = sin(rate * t_s + phase), cos(rate * t_s + phase)
            x, v, a = x + s / rate, v + c, a - rate * s
        return _Motion(x, v, a)

    def _window(self, t_s: float) -> _Motion:
        """Envelope from 0 to 1 and back to 0, smooth up to the second derivative (6 p^5 - 15 p^4 + 10 p^3)."""
        rising = t_s < 0.5 * self.seconds
        p = min((t_s if rising else self.seconds - t_s) / self.fade_s, 1.0)
        rate = (1.0 if rising else -1.0) / self.fade_s
        return _Motion(
            p**3 * (10.0 - 15.0 * p + 6.0 * p * p),
            30.0 * p * p * (1.0 - p) ** 2 * rate,
            60.0 * p * (1.0 - p) * (1.0 - 2.0 * p) * rate * rate,
        )


def _faded(window: _Motion, motion: _Motion, size: float) -> _Motion:
    """Product of the window and a motion, times `size`."""
    return _Motion(
        size * window.x * motion.x,
        size * (window.v * motion.x + window.x * motion.v),
        size * (window.a * motion.x + 2.0 * window.v * motion.v + window.x * motion.a),
    )
