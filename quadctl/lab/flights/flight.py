"""One prepared flight: what every analysis works on."""

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from quadctl.effects import Conditions
from quadctl.frames import euler_from_quaternion
from quadctl.lab.arrays import Floats
from quadctl.vehicle import Vehicle

MOMENTS_S = 0.5
"""Standard deviation of the filter of the moments: they are compared as they stand over seconds. What turns the vehicle
this way and that within one is inertia that vehicle files tell by a guess, and rotor speeds that come late."""


class SlowFilter:
    """The filter of the moments over the samples at `time_s`. Its matrix is made when first asked for, and is shared by
    all copies of a flight."""

    def __init__(self, time_s: Floats) -> None:
        self._time_s = time_s

    def __call__(self, values: Floats) -> Floats:
        """Values at the samples, shape (n,) or (n, k), filtered."""
        return np.asarray(self._matrix @ values)

    @cached_property
    def _matrix(self) -> csr_matrix:
        n = len(self._time_s)
        reach = math.ceil(3.0 * MOMENTS_S / float(np.median(np.diff(self._time_s))))
        here = np.arange(n)[:, None] + np.zeros(2 * reach + 1, dtype=int)
        there = np.clip(np.arange(n)[:, None] + np.arange(-reach, reach + 1), 0, n - 1)
        weights = np.exp(-0.5 * ((self._time_s[there] - self._time_s[here]) / MOMENTS_S) ** 2)
        weights /= weights.sum(axis=1, keepdims=True)
        return csr_matrix((weights.ravel(), (here.ravel(), there.ravel())), shape=(n, n))


@dataclass(frozen=True, eq=False)
class Flight:
    """One prepared flight. `grid` signals are raw on an even clock, `samples` are filtered and nearly independent."""

    name: str
    vehicle: Vehicle
    grid_s: Floats
    """Even clock, shape (m,)."""
    conditions: Conditions
    """On the grid."""
    nominal_n: list[Floats]
    """k rpm^2 of each rotor on the grid, N."""
    smooth: csr_matrix
    """Filter and sampling in one: (n, m), applied to any signal on the grid."""
    time_s: Floats
    """Of the samples, shape (n,)."""
    slowly: SlowFilter
    """Applied to the measured and the predicted torque at the samples."""
    measured: Floats
    """Filtered kinematic acceleration, north, east, up, shape (n, 3)."""
    block: NDArray[np.int64]
    """Number of the block of time that each sample belongs to, shape (n,)."""
    bandwidth_hz: float
    thrust_source: str
    delay_s: float
    """By which the rotor signal was shifted: it is logged that much later (+) than the force it makes."""
    torque: Floats | None = None
    """Filtered torque that the body rates tell of, FRD, N m, shape (n, 3); None without rates or single rotors."""
    imu_error: Floats | None = None
    """Filtered: the accelerometer's acceleration minus `measured`, north, east, up, shape (n, 3); None without one."""
    notes: list[str] = field(default_factory=list)

    def shifted(self, delay_s: float) -> "Flight":
        """The flight with its rotor signal taken so much later."""
        if delay_s == 0.0:
            return self
        nominal = [self.later(thrust, delay_s) for thrust in self.nominal_n]
        return replace(self, nominal_n=nominal, delay_s=self.delay_s + delay_s)

    def later(self, signal: Floats, delay_s: float) -> Floats:
        """A signal on the grid taken so much later, by a line between its values; before and after them it stays."""
        steps = delay_s / (self.grid_s[1] - self.grid_s[0])
        whole, n = math.floor(steps), len(signal)
        between = signal[:-1] + (steps - whole) * np.diff(signal)
        if whole < 0:
            return np.concatenate([np.full(min(-whole, n), signal[0]), between[: max(n + whole, 0)]])
        return np.concatenate([between[whole:], np.full(min(whole + 1, n), signal[-1])])

    def filtered(self, signal: Any) -> Floats:
        """A signal on the grid, filtered, at the samples."""
        return np.asarray(self.smooth @ np.broadcast_to(np.asarray(signal, dtype=float), self.grid_s.shape))

    @cached_property
    def slow_share(self) -> float:
        """Independent moments per sample: a Gaussian filter makes one of those within 2 sqrt(pi) of its deviations."""
        every_s = float(np.median(np.diff(self.time_s)))
        return min(every_s / (2.0 * math.sqrt(math.pi) * MOMENTS_S), 1.0)

    @cached_property
    def moments(self) -> Floats | None:
        """`torque`, slowly."""
        return None if self.torque is None else self.slowly(self.torque)

    @cached_property
    def nominal_torque(self) -> Floats:
        """Torque of the nominal rotor thrusts, filtered and slowly, FRD, N m, shape (n, 3)."""
        torque = self.smooth @ (np.column_stack(self.nominal_n) @ np.array(self.vehicle.moment_arms_m))
        return self.slowly(np.asarray(torque))

    @cached_property
    def load(self) -> Floats:
        """Nominal thrust of all rotors over the weight, filtered and slowly, shape (n,)."""
        return self.slowly(self.filtered(sum(self.nominal_n))) / self.vehicle.weight_n

    @cached_property
    def variables(self) -> dict[str, Floats]:
        """What residuals are looked at over, at the samples."""
        c = self.conditions
        roll, pitch, _ = euler_from_quaternion(c.attitude)
        u, v, w = (self.filtered(component) for component in c.velocity_body_m_s)
        found = {
            "height_over_radius": self.filtered(c.height_m) / self.vehicle.rotor.radius_m,
            "climb_rate": -w,
            "speed_forward": u,
            "speed_right": v,
            "roll": np.degrees(self.filtered(roll)),
            "pitch": np.degrees(self.filtered(pitch)),
            "thrust": self.filtered(sum(self.nominal_n)),
            "time": self.time_s,
            "north": self.filtered(c.position_ne_m[0]),
            "east": self.filtered(c.position_ne_m[1]),
        }
        battery = self.filtered(c.battery_v)
        if np.isfinite(battery).all():
            found["battery"] = battery
        return found

    def span(self, name: str) -> tuple[float, float]:
        """5th and 95th percentile of a variable, or of another of `SPAN_UNITS`; nan: not logged."""
        u, v, _ = self.conditions.velocity_body_m_s
        if name == "heading":
            values = np.degrees(np.unwrap(euler_from_quaternion(self.conditions.attitude)[2]))
        elif name == "speed":
            values = np.hypot(u, v)
        elif name == "thrust_share":
            values = self.variables["thrust"] / self.vehicle.weight_n
        else:
            values = self.variables.get(name, np.array([np.nan]))
        low, high = np.percentile(values, [5.0, 95.0])
        return float(low), float(high)


VARIABLE_UNITS = {
    "height_over_radius": "rotor radii",
    "climb_rate": "m/s",
    "speed_forward": "m/s",
    "speed_right": "m/s",
    "roll": "deg",
    "pitch": "deg",
    "thrust": "N",
    "time": "s",
    "battery": "V",
    "north": "m",
    "east": "m",
}
SPAN_UNITS = {**VARIABLE_UNITS, "heading": "deg", "speed": "m/s", "thrust_share": "of the weight"}
VARIABLE_NAMES = {
    "height_over_radius": "rotor height",
    "climb_rate": "climb rate",
    "speed_forward": "forward speed",
    "speed_right": "sideward speed",
    "roll": "roll",
    "pitch": "pitch",
    "thrust": "thrust",
    "time": "time",
    "battery": "battery voltage",
    "north": "position north",
    "east": "position east",
}
