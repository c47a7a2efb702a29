"""The estimate of the autopilot: the true state, delayed, with noise, at the rates of a real one."""

import math
import random
from collections import deque
from collections.abc import Callable

from quadctl.frames import multiply, quaternion_from_euler
from quadctl.sitl.vehicle.body import Motion
from quadctl.sitl.vehicle.height_sensors import HeightSensors
from quadctl.sitl.vehicle.hidden import Noise, Telemetry
from quadctl.state import NAN, Quat, Vec3

UPDATE_S = 0.01
"""Interval of position, velocity, attitude and rates: 100 Hz."""
AIDED_STD_M, VERTICAL_STD_M = 0.29, 0.1
"""Standard deviations of the position that PX4 states with GPS; those of the height were 0.03 to 0.26 m."""
STD_GROWTH, STD_POWER = 0.209, 1.2
"""Growth of the horizontal one by dead reckoning, m and s: measured were 0.56 m after 2 s and 1.46 m after 5 s."""
UNAIDED_DRIFT_M_S2 = 0.14
"""Error of the acceleration by dead reckoning: measured were position errors of 1.1 and 2.3 m after 5 s."""
LAST_BITS = 1e-7
"""Noise of velocity (m/s) and rates (rad/s) in a world without noise: no estimate repeats itself to the last bit, and
one that does counts as frozen."""


class _Drift:
    """A slow error in three axes: a Gauss-Markov process in each, one step for every update of the estimate."""

    def __init__(self, sigma: Vec3, time_s: float) -> None:
        self._kept = math.exp(-UPDATE_S / time_s)
        x, y, z = (size * math.sqrt(1.0 - self._kept * self._kept) for size in sigma)
        self._push: Vec3 = (x, y, z)
        self._value: Vec3 = (0.0, 0.0, 0.0)

    def next(self, gauss: Callable[[float], float]) -> Vec3:
        """Error one update later."""
        (x, y, z), (px, py, pz), kept = self._value, self._push, self._kept
        self._value = kept * x + gauss(px), kept * y + gauss(py), kept * z + gauss(pz)
        return self._value


class Estimator:
    """Estimator: takes the true motion of every physics step, gives the estimate of the latest update.

    The power side (rotor speeds, battery) has a rate and a delay of its own.
    """

    def __init__(
        self, noise: Noise, telemetry: Telemetry, seed: int, height_sensors: HeightSensors | None = None
    ) -> None:
        self._noise = noise
        self.height_sensors = height_sensors
        """Barometer and range finder; None: the height is known without them."""
        self._telemetry = telemetry
        self._random = random.Random(seed)
        self._past: deque[Motion] = deque()
        self._kept_s = max(telemetry.delay_s, telemetry.rpm_delay_s) + UPDATE_S
        self._position_drift = _Drift((noise.position_drift_m,) * 3, noise.drift_time_s)
        self._velocity_drift = _Drift(noise.velocity_drift_m_s, noise.velocity_drift_time_s)
        self._attitude_drift = _Drift(noise.attitude_drift_deg, noise.attitude_drift_time_s)
        self._next_update_s = 0.0
        self._next_rpm_s = 0.0
        self.updated_s = -math.inf
        self.rpm_updated_s = -math.inf
        self.position: Vec3 = (NAN, NAN, NAN)
        self.velocity: Vec3 = (NAN, NAN, NAN)
        self.attitude: Quat = (NAN, NAN, NAN, NAN)
        self.rates: Vec3 = (NAN, NAN, NAN)
        self.aid_lost_s: float | None = None
        """Time since which no GPS or motion capture measures the position; None: it is measured."""
        self.vertical_std_m = VERTICAL_STD_M
        """Standard deviation of the height that it states; by the barometer alone 0.51 m was measured."""
        self.height_step_m = 0.0
        """Sum of the steps of the height that it has told."""
        self.rotor_rpm: tuple[float, ...] = ()
        self.battery_v = NAN

    def unaided_s(self, now_s: float) -> float:
        """Time for which the position has been dead reckoning, s."""
        return 0.0 if self.aid_lost_s is None else max(now_s - self.aid_lost_s, 0.0)

    @property
    def horizontal_std_m(self) -> float:
        """Standard deviation of the horizontal position that it states."""
        return math.hypot(AIDED_STD_M, STD_GROWTH * self.unaided_s(self.updated_s) ** STD_POWER)

    def observe(self, motion: Motion) -> None:
        """Take in the true motion, and update the parts that are due."""
        past, now = self._past, motion.time_s
        past.append(motion)
        while past[0].time_s < now - self._kept_s:
            past.popleft()
        if now >= self._next_update_s - 1e-9:
            self._next_update_s += UPDATE_S
            self._update(self._at(now - self._telemetry.delay_s), now)
        if now >= self._next_rpm_s - 1e-9:
            self._next_rpm_s += 1.0 / self._telemetry.rpm_rate_hz
            late = self._at(now - self._telemetry.rpm_delay_s)
            known = self._telemetry.rotor_speeds
            self.rotor_rpm = tuple(
                max(0.0, round(r + self._gauss(self._noise.rpm))) if known else NAN for r in late.rotor_rpm
            )
            self.rpm_updated_s = now
            self.battery_v = late.battery_v + self._gauss(self._noise.battery_v)

    def _at(self, time_s: float) -> Motion:
        """True motion of the last physics step before `time_s`."""
        past = self._past
        step = past[1].time_s - past[0].time_s if len(past) > 1 else 1.0
        index = round((time_s - past[0].time_s) / step)
        return past[min(max(index, 0), len(past) - 1)]

    def _update(self, motion: Motion, now: float) -> None:
        noise, gauss = self._noise, self._gauss
        x, y, z = motion.position_ned_m
        vx, vy, vz = motion.velocity_ned_m_s
        p, q, r = motion.rates_rad_s
        s, v, w = noise.position_m, max(noise.velocity_m_s, LAST_BITS), max(noise.rates_rad_s, LAST_BITS)
        angle = math.radians(noise.attitude_deg)
        dx, dy, dz = self._position_drift.next(gauss)
        north, east, up = self._velocity_drift.next(gauss)
        roll, pitch, yaw = map(math.radians, self._attitude_drift.next(gauss))
        unaided_s = self.unaided_s(now)
        off_m_s = UNAIDED_DRIFT_M_S2 * unaided_s
        off_m = 0.5 * off_m_s * unaided_s
        self.position = (x + dx + off_m + gauss(s), y + dy + gauss(s), z - self.height_step_m + dz + gauss(s))
        self.velocity = (vx + off_m_s + north + gauss(v), vy + east + gauss(v), vz - up + gauss(v))
        if self.height_sensors is not None:
            self._lean_on_barometer(self.height_sensors, motion)
        self.rates = (p + gauss(w), q + gauss(w), r + gauss(w))
        error = quaternion_from_euler(roll + gauss(angle), pitch + gauss(angle), yaw + gauss(angle))
        self.attitude = multiply(motion.attitude, error)
        self.updated_s = now

    def _lean_on_barometer(self, sensors: HeightSensors, motion: Motion) -> None:
        """Read the sensors of the height, and add the error with which the estimate follows the barometer."""
        sensors.update(motion, UPDATE_S)
        (x, y, z), (vx, vy, vz) = self.position, self.velocity
        self.position = (x, y, z - sensors.height_error_m)
        self.velocity = (vx, vy, vz - sensors.climb_error_m_s)

    def _gauss(self, sigma: float) -> float:
        return self._random.gauss(0.0, sigma) if sigma > 0.0 else 0.0
