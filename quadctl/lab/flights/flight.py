"""Prepared flight, on which every analysis works."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_banded
from scipy.ndimage import correlate1d
from scipy.sparse import csr_matrix

from quadctl.effects import Conditions
from quadctl.frames import GRAVITY_M_S2, Quaternion, euler_from_quaternion, rotate_inverse
from quadctl.lab.arrays import Floats, Mask
from quadctl.logs.findings import Finding, Kind, of_kind, worded
from quadctl.numeric import Number, Vector
from quadctl.vehicle import Vehicle

MOMENTS_S = 0.5
"""Standard deviation of the Gaussian filter of the moments, s. Moments are compared over seconds only: faster ones
depend on the inertia, which vehicle files often guess, and on delays of the rotor speeds."""
LASTING_S = 3.0
"""Time over which `lasting_acceleration` averages, s: complementary filters of the attitude have 1 to 10 s."""
SAME_STEP = 1e-6
"""Largest relative difference of time steps that count as the same."""


class SlowFilter:
    """Gaussian filter of the moments over the samples at `time_s`. Its weights are computed at the first use and shared
    by all copies of a flight.

    Where samples are evenly spaced, all have the same weights; only those near a gap or an end need their own.
    """

    def __init__(self, time_s: Floats) -> None:
        self._time_s = time_s

    def __call__(self, values: Floats) -> Floats:
        """Filter values at the samples, shape (n,) or (n, k)."""
        filtered = np.asarray(correlate1d(values, self._even_weights, axis=0, mode="nearest"))
        uneven, own = self._own_weights
        filtered[uneven] = own @ values
        return filtered

    @cached_property
    def _step_s(self) -> float:
        return float(np.median(np.diff(self._time_s)))

    @property
    def _reach(self) -> int:
        """Number of samples on each side that count."""
        return math.ceil(3.0 * MOMENTS_S / self._step_s)

    @cached_property
    def _even_weights(self) -> Floats:
        return self._weights(self._step_s * np.arange(-self._reach, self._reach + 1))

    @cached_property
    def _own_weights(self) -> tuple[NDArray[np.intp], csr_matrix]:
        """Samples that have not the same neighbours as most, and their weights, shape (samples, n)."""
        n, reach = len(self._time_s), self._reach
        odd = np.abs(np.diff(self._time_s) / self._step_s - 1.0) > SAME_STEP
        before = np.concatenate([[0], np.cumsum(odd)])  # number of odd steps before each sample
        uneven = np.ones(n, dtype=bool)
        inside = max(n - 2 * reach, 0)
        uneven[reach : reach + inside] = before[2 * reach :] > before[:inside]
        places = np.flatnonzero(uneven)
        there = np.clip(places[:, None] + np.arange(-reach, reach + 1), 0, n - 1)
        weights = self._weights(self._time_s[there] - self._time_s[places, None])
        ends = np.arange(0, there.size + 1, there.shape[1])
        return places, csr_matrix((weights.ravel(), there.ravel(), ends), shape=(len(places), n))

    @staticmethod
    def _weights(offset_s: NDArray[np.floating]) -> Floats:
        weights = np.exp(-0.5 * (offset_s / MOMENTS_S) ** 2)
        return np.asarray(weights / weights.sum(axis=-1, keepdims=True))


LARGEST_DELAY_S = 0.5
"""Time around the samples that a part of a flight keeps, s: no signal is read later or earlier by more."""


@dataclass(frozen=True)
class Estimate:
    """Estimated value with its standard error."""

    value: float
    std: float

    @property
    def ci95(self) -> tuple[float, float]:
        """95 % interval."""
        return self.value - 1.96 * self.std, self.value + 1.96 * self.std


@dataclass(frozen=True)
class Timing:
    """Times by which the channels of a vehicle's logs are late, s (see `timing`)."""

    rotor: Estimate
    """Delay of the rotor signal relative to the force that it makes."""
    velocity: Estimate
    """Lag of the velocity behind the position."""
    earliest_s: float = -math.inf
    """Least delay of a rotor signal that is taken out: one that comes still earlier has rotors that follow it late."""

    def to_dict(self) -> dict[str, list[float]]:
        """Value and 95 % interval of each time, s."""
        return {
            name: [estimate.value, *estimate.ci95]
            for name, estimate in (("rotor_s", self.rotor), ("velocity_s", self.velocity))
        }


UNKNOWN_TIMING = Timing(Estimate(0.0, math.inf), Estimate(0.0, math.inf))


@dataclass(frozen=True, eq=False)
class Flight:
    """Prepared flight. Signals on the `grid` are unfiltered, on an even clock; those at the samples are filtered and
    nearly independent."""

    name: str
    vehicle: Vehicle
    grid_s: Floats
    """Even clock, s, shape (m,)."""
    conditions: Conditions
    """Conditions on the grid."""
    nominal_n: list[Floats]
    """Nominal thrust k rpm^2 of each rotor on the grid, N, shape (m,) each."""
    logged_n: list[Floats]
    """The same, as late as it was logged."""
    velocity_neu: tuple[Floats, Floats, Floats]
    """Logged velocity on the grid, north, east, up, m/s, shape (m,) each, as late as it was logged."""
    smooth: csr_matrix
    """Matrix of filter and sampling, shape (n, m), applicable to any signal on the grid."""
    derivative: csr_matrix
    """Matrix of filter, derivative and sampling, 1/s, shape (n, m)."""
    time_s: Floats
    """Time of the samples, s, shape (n,)."""
    slowly: SlowFilter
    """Filter of the measured and the predicted torque at the samples."""
    measured: Floats
    """Filtered kinematic acceleration, north, east, up, m/s^2, shape (n, 3)."""
    block: NDArray[np.int64]
    """Block number of each sample, shape (n,)."""
    bandwidth_hz: float
    thrust_source: str
    delay_s: float
    """Delay of the logged rotor signal relative to its force, s, which has been taken out; positive: logged late."""
    delay_std_s: float = 0.0
    """Standard error of that delay, s."""
    torque: Floats | None = None
    """Filtered torque from the body rates, FRD, N m, shape (n, 3); None without rates or signals of single rotors."""
    sensed: Floats | None = None
    """Filtered kinematic acceleration by the accelerometer, north, east, up, m/s^2, shape (n, 3); None without one."""
    velocity_lag_s: float = 0.0
    """Lag of the logged velocity behind the position, s, which has been taken out."""
    velocity_filtered: bool = False
    """True where that lag is one of a first-order filter, which rounds the velocity, and not a delay."""
    trajectory: Floats | None = None
    """Filtered kinematic acceleration by the velocity, as `measured`, where an axis of that is by the accelerometer
    (see `by_force` and `by_accelerometer`); None where it is by the velocity itself."""
    doubted_axes: tuple[int, ...] = ()
    """Axes of `measured` along which the velocity is wrong, so that the accelerometer tells the acceleration."""
    changes_s: tuple[float, ...] = ()
    """Times at which something of the record changes: the flight mode, a parameter on which the thrust depends, the
    estimator's state."""
    attitude_by: str = ""
    """Source of the attitude, of `ATTITUDE_SOURCES`; empty where the log does not say."""
    sha256: str = ""
    """Hash of the log file; empty for a log without a file."""
    timing: Timing = UNKNOWN_TIMING
    """Timing of the vehicle's channels, from all flights that were prepared together."""
    findings: list[Finding] = field(default_factory=list)
    """Findings about the record, by its reader and by its preparation."""

    @property
    def notes(self) -> list[str]:
        """The findings in words."""
        return [worded(found) for found in self.findings]

    @property
    def weight_doubt(self) -> str | None:
        """Doubt whether the vehicle is the one that flew, as its thrust would carry another weight; None without."""
        return next((worded(doubt) for doubt in of_kind(self.findings, Kind.WEIGHT_DOUBT)), None)

    def some(self, kept: Mask) -> "Flight":
        """Select the samples of the mask `kept`, shape (n,), with the part of the grid that they need."""
        smooth, derivative = self.smooth[kept], self.derivative[kept]
        margin = math.ceil(LARGEST_DELAY_S / (self.grid_s[1] - self.grid_s[0]))
        needed = np.zeros(len(self.grid_s) + 2 * margin + 1, dtype=np.int64)
        inside = np.unique(smooth.indices)
        np.add.at(needed, inside, 1)
        np.add.at(needed, inside + 2 * margin + 1, -1)
        columns = np.flatnonzero(np.cumsum(needed)[margin : margin + len(self.grid_s)])
        north, east, up = self.velocity_neu
        return replace(
            self,
            grid_s=self.grid_s[columns],
            conditions=_conditions_at(self.conditions, columns),
            nominal_n=[thrust[columns] for thrust in self.nominal_n],
            logged_n=[thrust[columns] for thrust in self.logged_n],
            velocity_neu=(north[columns], east[columns], up[columns]),
            smooth=smooth[:, columns],
            derivative=derivative[:, columns],
            time_s=self.time_s[kept],
            slowly=SlowFilter(self.time_s[kept]),
            measured=self.measured[kept],
            block=self.block[kept],
            torque=None if self.torque is None else self.torque[kept],
            sensed=None if self.sensed is None else self.sensed[kept],
            trajectory=None if self.trajectory is None else self.trajectory[kept],
        )

    def shifted(self, delay_s: float) -> "Flight":
        """Copy of the flight with its rotor signal read `delay_s` later."""
        if delay_s == 0.0:
            return self
        nominal = list(self.later(np.array(self.nominal_n), delay_s))
        return replace(self, nominal_n=nominal, delay_s=self.delay_s + delay_s)

    def later_attitude(self, delay_s: float) -> Quaternion:
        """Attitude, body to world, on the grid, read `delay_s` later."""
        return _unit(self.later(np.array(self.conditions.attitude), delay_s))

    def with_rotor_delay(self, delay_s: float) -> "Flight":
        """Copy of the flight whose rotor signal is read `delay_s` later than it was logged."""
        if delay_s == self.delay_s:
            return self
        return replace(self, nominal_n=list(self.later(np.array(self.logged_n), delay_s)), delay_s=delay_s)

    def prompt_velocity(self, lag_s: float, filtered: bool) -> tuple[Floats, Floats, Floats]:
        """Velocity on the grid, north, east, up, m/s, shape (m,) each, with a lag taken out: it is read `lag_s` later,
        or what a first-order filter of that time constant has done to it is undone."""
        lag_steps = lag_s / (self.grid_s[1] - self.grid_s[0])

        def prompt(logged: Floats) -> Floats:
            return logged + lag_steps * np.gradient(logged) if filtered else self.later(logged, lag_s)

        north, east, up = self.velocity_neu
        return prompt(north), prompt(east), prompt(up)

    def with_velocity_lag(self, lag_s: float, filtered: bool = False) -> "Flight":
        """Copy of the flight with the lag of its velocity taken out (see `prompt_velocity`)."""
        if (lag_s, filtered) == (self.velocity_lag_s, self.velocity_filtered):
            return self
        north, east, up = self.prompt_velocity(lag_s, filtered)
        c = self.conditions
        later = replace(
            self,
            conditions=replace(c, velocity_body_m_s=rotate_inverse(c.attitude, (north, east, -up))),
            measured=np.column_stack([self.derivative @ v for v in (north, east, up)]),
            trajectory=None,
            doubted_axes=(),
            velocity_lag_s=lag_s,
            velocity_filtered=filtered,
        )
        return later.by_force() if self.tells_force else later.by_accelerometer(self.doubted_axes)

    def by_force(self) -> "Flight":
        """Copy of the flight whose acceleration is that of the accelerometer: the force on the body over its mass.

        The logged attitude turns it into the world as it turns the predicted force, so that errors of the attitude
        cancel. The acceleration by the velocity is kept as `trajectory`, for `imu_error`.
        """
        return self if self.sensed is None else replace(self, measured=self.sensed, trajectory=self.motion)

    @property
    def tells_force(self) -> bool:
        """True where the accelerometer tells the acceleration along all axes (see `by_force`)."""
        return self.trajectory is not None and not self.doubted_axes

    @property
    def motion(self) -> Floats:
        """Filtered kinematic acceleration by the velocity, north, east, up, m/s^2, shape (n, 3)."""
        return self.measured if self.trajectory is None else self.trajectory

    def by_accelerometer(self, axes: tuple[int, ...]) -> "Flight":
        """Copy of the flight whose acceleration along some axes is that of the accelerometer; its mean stays that of
        the velocity, which is off by less than an accelerometer may be."""
        if not axes or self.sensed is None:
            return self
        measured = self.measured.copy()
        for axis in axes:
            measured[:, axis] = self.sensed[:, axis] + np.mean(self.measured[:, axis] - self.sensed[:, axis])
        return replace(self, measured=measured, trajectory=self.motion, doubted_axes=axes)

    @property
    def duration_s(self) -> float:
        """Time in the air without gaps, s; each sample counts as one sampling step."""
        return float(len(self.time_s) * np.median(np.diff(self.time_s)))

    @property
    def imu_error(self) -> Floats | None:
        """Filtered acceleration by the accelerometer minus `motion`, north, east, up, m/s^2, shape (n, 3); None
        without one. Along doubted axes, too: a velocity that is wrong changes by no more over a flight, but an offset
        of the accelerometer stays."""
        return None if self.sensed is None else self.sensed - self.motion

    @property
    def velocity_up(self) -> Floats:
        """Climb rate over ground on the grid, m/s, shape (m,)."""
        return self.prompt_velocity(self.velocity_lag_s, self.velocity_filtered)[2]

    def later(self, signal: Floats, delay_s: float) -> Floats:
        """Signal on the grid, shape (m,) or (signals, m), read `delay_s` later, by linear interpolation; constant
        beyond its ends."""
        if delay_s == 0.0:
            return signal
        steps = delay_s / (self.grid_s[1] - self.grid_s[0])
        whole, n = math.floor(steps), signal.shape[-1]
        before, after = signal[..., :-1], signal[..., 1:]
        between = before + (steps - whole) * (after - before)
        read = np.empty_like(signal)
        if whole < 0:
            first = min(-whole, n)
            read[..., :first], read[..., first:] = signal[..., :1], between[..., : n - first]
        else:
            last = max(n - 1 - whole, 0)
            read[..., :last], read[..., last:] = between[..., whole:], signal[..., -1:]
        return read

    def pieces(self, most: int) -> Iterator[tuple[slice, list[Floats], Conditions]]:
        """Nominal thrusts and conditions of pieces of the grid of at most so many places, without copies."""
        c = self.conditions
        if len(self.grid_s) <= most:
            yield slice(0, len(self.grid_s)), self.nominal_n, c
            return
        for begin in range(0, len(self.grid_s), most):
            piece = slice(begin, begin + most)
            yield piece, [thrust[piece] for thrust in self.nominal_n], _conditions_at(c, piece)

    def filtered(self, signal: Any) -> Floats:
        """Filter a signal on the grid; values at the samples."""
        return np.asarray(self.smooth @ np.broadcast_to(np.asarray(signal, dtype=float), self.grid_s.shape))

    def filtered_vector(self, vector: Vector) -> Floats:
        """Filter three signals on the grid at once; values at the samples, shape (n, 3)."""
        columns = np.empty((len(self.grid_s), 3))
        for i, component in enumerate(vector):
            columns[:, i] = component
        return np.asarray(self.smooth @ columns)

    @cached_property
    def slow_share(self) -> float:
        """Number of independent moments per sample: a Gaussian filter makes one of those within 2 sqrt(pi) of its
        standard deviations."""
        every_s = float(np.median(np.diff(self.time_s)))
        return min(every_s / (2.0 * math.sqrt(math.pi) * MOMENTS_S), 1.0)

    @cached_property
    def moments(self) -> Floats | None:
        """Slowly filtered `torque`, FRD, N m, shape (n, 3)."""
        return None if self.torque is None else self.slowly(self.torque)

    @cached_property
    def nominal_torque(self) -> Floats:
        """Slowly filtered torque of the nominal rotor thrusts, FRD, N m, shape (n, 3)."""
        nominal = np.column_stack([self.filtered(thrust) for thrust in self.nominal_n])
        return self.slowly(np.asarray(nominal @ np.array(self.vehicle.moment_arms_m)))

    @cached_property
    def load(self) -> Floats:
        """Slowly filtered nominal thrust of all rotors over the weight, shape (n,)."""
        return self.slowly(self.filtered(sum(self.nominal_n))) / self.vehicle.weight_n

    @cached_property
    def lasting_acceleration(self) -> Floats:
        """Measured acceleration averaged over the last seconds with exponential weights, north, east, m/s^2, shape
        (n, 2); from 0 at the begin, and after long gaps."""
        steps = np.diff(self.time_s)
        banded = np.ones((2, len(self.time_s)))
        banded[1, :-1] = -np.exp(-steps / LASTING_S)
        new = -math.expm1(-float(np.median(steps)) / LASTING_S)
        return np.asarray(solve_banded((1, 0), banded, new * self.measured[:, :2]))

    @cached_property
    def heading_rad(self) -> Floats:
        """Filtered yaw, unwrapped, at the samples, shape (n,)."""
        return self.filtered(np.unwrap(euler_from_quaternion(self.conditions.attitude)[2]))

    @cached_property
    def sampled_attitude(self) -> Quaternion:
        """Filtered attitude, body to world, at the samples, shape (n,) each part."""
        return _unit(np.array([self.filtered(part) for part in self.conditions.attitude]))

    @cached_property
    def manoeuvres(self) -> dict[str, Floats]:
        """Accelerations, m/s^2, shape (n,), for which the variables of the attitude controller are flown: those up,
        to the right and forward, by the names of `variables`."""
        yaw = self.heading_rad
        north, east, up = self.measured.T
        return {
            "thrust": up,
            "roll": np.cos(yaw) * east - np.sin(yaw) * north,
            "pitch": np.cos(yaw) * north + np.sin(yaw) * east,
        }

    @cached_property
    def variables(self) -> dict[str, Floats]:
        """Variables over which residuals are analysed, by name, at the samples, shape (n,) each."""
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
        """5th and 95th percentile of a variable or another entry of `SPAN_UNITS`; nan where it is not logged."""
        u, v, _ = self.conditions.velocity_body_m_s
        if name == "heading":
            values = np.degrees(np.unwrap(euler_from_quaternion(self.conditions.attitude)[2]))
        elif name == "speed":
            values = np.hypot(u, v)
        elif name == "thrust_share":
            # The thrust that the motion needs: the logged thrust also follows whatever disturbs the vehicle.
            values = 1.0 + self.measured[:, 2] / GRAVITY_M_S2
        else:
            values = self.variables.get(name, np.array([np.nan]))
        low, high = np.percentile(values, [5.0, 95.0])
        return float(low), float(high)


def _conditions_at(c: Conditions, columns: NDArray[np.int64] | slice) -> Conditions:
    """Conditions at some places of the grid."""
    speed_x, speed_y, speed_z = c.velocity_body_m_s
    w, x, y, z = c.attitude
    p, q, r = c.rates_rad_s
    return replace(
        c,
        height_m=_at(c.height_m, columns),
        velocity_body_m_s=(_at(speed_x, columns), _at(speed_y, columns), _at(speed_z, columns)),
        attitude=(_at(w, columns), _at(x, columns), _at(y, columns), _at(z, columns)),
        time_s=_at(c.time_s, columns),
        battery_v=_at(c.battery_v, columns),
        position_ne_m=(_at(c.position_ne_m[0], columns), _at(c.position_ne_m[1], columns)),
        surfaces=tuple((name, _at(share, columns)) for name, share in c.surfaces),
        rates_rad_s=(_at(p, columns), _at(q, columns), _at(r, columns)),
        thrust_rate_n_s=tuple(_at(rate, columns) for rate in c.thrust_rate_n_s),
    )


def _unit(parts: Floats) -> Quaternion:
    """Quaternion of length 1, from its interpolated or filtered parts, shape (4, n)."""
    w, x, y, z = parts / np.linalg.norm(parts, axis=0)
    return w, x, y, z


def _at(signal: Number, columns: NDArray[np.int64] | slice) -> Number:
    """Signal at some places of the grid; a constant stays what it is."""
    return signal[columns] if isinstance(signal, np.ndarray) else signal


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
SPAN_NAMES = {"thrust_share": "the thrust that the motion needs"}
"""Names of those whose key does not say it."""
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
