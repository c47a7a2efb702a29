"""Records for the estimation of rotation: gyro, accelerometer, commands and airspeed of a flight on an even clock."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from quadctl.effects.motor_lag import lagged
from quadctl.errors import LogError
from quadctl.frames import quaternion_from_euler, rotate_inverse
from quadctl.lab.arrays import Floats
from quadctl.lab.flights.channels import refuse_other_rotors, without_absent_motors
from quadctl.logs.columns import motor_columns, rpm_columns
from quadctl.logs.findings import Span
from quadctl.logs.flight_log import ATTITUDE, IMU, RATES, VELOCITY, FlightLog
from quadctl.logs.record.flight_time import driven, usable
from quadctl.logs.record.record import examine
from quadctl.vehicle import Vehicle

LEAST_HZ, MOST_HZ = 40.0, 250.0
"""Update rate of the gyro below which a rotor lag is lost between samples, and the largest step rate of a record."""
LEAST_S = 8.0
"""Time that is needed of a flight."""


@dataclass(frozen=True, eq=False)
class Record:
    """One flight on an even clock. n samples, k rotors."""

    name: str
    step_s: float
    rates: Floats
    """Body rates, FRD, rad/s, shape (n, 3)."""
    drive: Floats
    """Output of each rotor, or its squared speed in krpm^2 where that is logged, shape (n, k)."""
    voltage: Floats | None
    """Battery voltage, V, shape (n,)."""
    force: Floats | None
    """Specific force, FRD, m/s^2, shape (n, 3)."""
    measured: bool
    """True where `drive` is of measured speeds, in proportion to the thrust."""
    airspeed: Floats | None
    """Velocity over ground in body axes, FRD, m/s, shape (n, 3); the wind is part of the slow disturbance."""

    def command(self, by_voltage: bool) -> Floats:
        """Command of each rotor, shape (n, k): the drive, times the voltage where the thrust depends on it."""
        return self.drive * self.voltage[:, None] if by_voltage and self.voltage is not None else self.drive


def record_of(log: FlightLog, vehicle: Vehicle, span_s: Span | None = None) -> Record:
    """The longest part of a log that can be used, or the part `span_s`.

    Raises
    ------
    LogError
        The log has no gyro or no outputs, of other rotors than the vehicle, or they are too slow or too short.
    """
    log, n_rotors = without_absent_motors(log, vehicle.n_rotors, []), vehicle.n_rotors
    refuse_other_rotors(log, vehicle)
    drive = next((c for c in (rpm_columns(n_rotors), motor_columns(n_rotors, "output")) if all(map(log.has, c))), None)
    if drive is None or not all(map(log.has, RATES)):
        raise LogError(f"{log.name}: has no body rates or no rotor outputs, expected both to learn how it rotates")
    rate_hz = _rate_hz(log, RATES, "body rates")
    _rate_hz(log, drive, "rotor outputs")
    begin, end = span_s or _longest_usable(log, "rpm" if drive[0].endswith("rpm") else "motor output")
    step_s = 1.0 / min(rate_hz, MOST_HZ)
    if end - begin < LEAST_S:
        raise LogError(f"{log.name}: flies for {max(end - begin, 0.0):.0f} s, expected at least {LEAST_S:.0f} s")
    clock = np.arange(begin, end, step_s)

    def on_clock(names: Sequence[str]) -> Floats:
        rows = log.updates(*names)
        return np.column_stack([np.interp(clock, log.time_s[rows], log[name][rows]) for name in names])

    turned = on_clock(drive)
    airspeed = None
    if all(map(log.has, (*VELOCITY, *ATTITUDE))):
        rows = log.updates(*ATTITUDE)
        angles = [np.interp(clock, log.time_s[rows], np.unwrap(np.radians(log[name][rows]))) for name in ATTITUDE]
        north, east, up = on_clock(VELOCITY).T
        airspeed = np.column_stack(rotate_inverse(quaternion_from_euler(*angles), (north, east, -up)))
    return Record(
        log.name,
        step_s,
        on_clock(RATES),
        1e-6 * turned**2 if drive[0].endswith("rpm") else turned,
        on_clock(["battery_v"])[:, 0] if log.has("battery_v") else None,
        on_clock(IMU) if all(map(log.has, IMU)) else None,
        drive[0].endswith("rpm"),
        airspeed,
    )


def _longest_usable(log: FlightLog, source: str) -> Span:
    """The longest stretch that the record leaves to an analysis; without a height, in which the rotors work."""
    spans = examine(log).usable if log.has("z_m") else usable(driven(log, source), ())
    return max(spans, key=lambda span: span[1] - span[0], default=(0.0, 0.0))


def _rate_hz(log: FlightLog, names: Sequence[str], called: str) -> float:
    """Median rate at which a channel is updated; refuses one that is too slow."""
    rows = log.updates(*names)
    rate_hz = 1.0 / float(np.median(np.diff(log.time_s[rows]))) if len(rows) > 1 else 0.0
    if rate_hz < LEAST_HZ:
        raise LogError(f"{log.name}: its {called} come at {rate_hz:.0f} Hz, expected at least {LEAST_HZ:.0f}")
    return rate_hz


@dataclass(frozen=True, eq=False)
class Delayed:
    """Signal, shape (n,), that can be read some time later: a cubic spline, smooth in the delay."""

    signal: Floats
    step_s: float

    def by(self, delay_s: float, lag_s: float) -> Floats:
        """The signal after a delay and a first-order lag."""
        rows = np.arange(len(self.signal), dtype=float)
        late = self._spline(np.clip(rows - delay_s / self.step_s, 0.0, rows[-1]))
        return lagged(np.asarray(late), self.step_s, max(lag_s, 0.0))

    @cached_property
    def _spline(self) -> CubicSpline:
        return CubicSpline(np.arange(len(self.signal), dtype=float), self.signal)
