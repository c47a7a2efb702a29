"""Records for the estimation of rotation: gyro, accelerometer, commands and airspeed of a flight on an even clock."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import binary_dilation
from scipy.signal import lfilter

from quadctl.effects.motor_lag import lagged
from quadctl.errors import LogError
from quadctl.frames import quaternion_from_euler, rotate_inverse
from quadctl.lab.arrays import Floats
from quadctl.lab.flights.channels import WIDE_GAP, refuse_other_rotors, without_absent_motors
from quadctl.lab.rotation.commands import FOLLOWED, LEAST_PAIRS, Filled, filled_in, fit_mixer, saturated
from quadctl.logs.columns import TORQUE, motor_columns, rpm_columns
from quadctl.logs.findings import Span
from quadctl.logs.flight_log import ATTITUDE, IMU, RATES, VELOCITY, FlightLog
from quadctl.logs.record.flight_time import driven, usable
from quadctl.logs.record.record import examine
from quadctl.logs.ulog import INTEGRATED_GYRO
from quadctl.vehicle import Vehicle

LEAST_HZ, MOST_HZ = 40.0, 250.0
"""Update rate of the commands below which a rotor lag is lost between samples, and the largest step rate of a
record."""
LEAST_GYRO_HZ = 20.0
"""Update rate of the gyro below which a turn is lost between samples; slower than the commands it may be."""
LEAST_S = 8.0
"""Time that is needed of a flight."""
AROUND_S = 0.3
"""Time that is left out on both sides of a saturated output: until the rotors have followed."""
MISSED = 0.02
"""Least error of the mixer's output that counts as its saturation."""
FASTER = 0.75
"""Commands over samples of the gyro, at and above which they come as fast."""
EVEN = 0.9
"""Share of the steps of an even channel that are alike."""
ESTIMATED_M_S = 0.3
"""Error of the velocity by an autopilot's own estimator without motion capture: flights of PX4's simulator, whose truth
is known, have 0.13 to 0.37 m/s along an axis."""
SETPOINTS = (*TORQUE, "throttle_cmd")


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
    every: int = 1
    """Samples from one measured rate to the next, from the first on; between them rates are interpolated."""
    integrated: bool = False
    """True where each rate is the mean since the one before, by trapezoids: neighbours share the sample at their
    border, and its noise."""
    own_times: bool = False
    """True where gyro and commands have their own times: in the rows of a table a command may stand before the sample
    that it answers, and acts a row later at least."""
    logged_s: float = 0.0
    """Time between logged commands, where they are interpolated."""
    unknown: Floats = field(default_factory=lambda: np.zeros(3))
    """Share of the variance of the commands about roll, pitch and yaw that neither their neighbours nor the gyro tell,
    shape (3,): so much is unknown between them."""
    velocity_error_m_s: float = 0.0
    """Standard deviation of the velocity's error, as far as its source tells it."""
    down: Floats | None = None
    """Direction of gravity in body axes, shape (n, 3)."""
    begin_s: float = 0.0
    """Time of the first sample in the log."""

    @property
    def measured_s(self) -> float:
        """Time from one measured rate to the next."""
        return self.step_s * self.every

    def as_measured(self, signals: Floats) -> Floats:
        """Signals, along the last axis, at the measured samples, as the gyro or the accelerometer gives them."""
        if self.integrated:
            signals = lfilter([0.5, 0.5], [1.0], signals, axis=-1)
        return np.asarray(signals[..., :: self.every])

    def without_shared(self, signals: Floats, share: Floats) -> Floats:
        """Signals, along the last axis, filtered so that noise is white of which each sample shares so much with the
        one before; `share` holds one value where the sensor is integrated."""
        return np.asarray(lfilter([1.0], [1.0, share[0]], signals, axis=-1)) if self.integrated else signals

    def command(self, by_voltage: bool) -> Floats:
        """Command of each rotor, shape (n, k): the drive, times the voltage where the thrust depends on it."""
        return self.drive * self.voltage[:, None] if by_voltage and self.voltage is not None else self.drive


@dataclass(frozen=True, eq=False)
class _Drive:
    """Commands of the rotors on a clock, shape (n, k)."""

    value: Floats
    measured: bool
    lost: NDArray[np.bool_]
    """True where an output saturates, shape (n,)."""
    unknown: Floats
    """As `Record.unknown`."""


def record_of(log: FlightLog, vehicle: Vehicle, span_s: Span | None = None) -> Record:
    """The longest part of a log that can be used, or the part `span_s`.

    Raises
    ------
    LogError
        The log has no gyro or no commands, of other rotors than the vehicle, or they are too slow or too short.
    """
    return max(records_of(log, vehicle, span_s), key=lambda record: len(record.rates))


def records_of(log: FlightLog, vehicle: Vehicle, span_s: Span | None = None) -> list[Record]:
    """The parts of a log that can be used, or those of the part `span_s`: without the seconds in which an output
    saturates.

    Raises
    ------
    LogError
        As `record_of`.
    """
    log, n_rotors = without_absent_motors(log, vehicle.n_rotors, []), vehicle.n_rotors
    refuse_other_rotors(log, vehicle)
    if not all(map(log.has, RATES)):
        raise LogError(f"{log.name}: has no body rates, expected a gyro to learn how it rotates")
    names, driven_by = _source(log, n_rotors)
    rate_hz = min(_rate_hz(log, RATES), MOST_HZ)
    if rate_hz < LEAST_GYRO_HZ:
        raise LogError(f"{log.name}: its body rates come at {rate_hz:.0f} Hz, expected at least {LEAST_GYRO_HZ:.0f}")
    finer = max(round(min(_rate_hz(log, _timed(names)), MOST_HZ) / rate_hz), 1)
    spans = [span_s] if span_s else _usable(log, driven_by)
    found = []
    for begin, end in spans:
        rows = log.updates(*RATES)
        times = log.time_s[rows]
        times = times[(times >= begin) & (times <= end)]
        if len(times) < 2 or times[-1] - times[0] < LEAST_S:
            continue
        found += _parts(log, vehicle, names, rate_hz, finer, (float(times[0]), float(times[-1])))
    if not found:
        longest = max((end - begin for begin, end in spans), default=0.0)
        raise LogError(f"{log.name}: flies for {longest:.0f} s, expected at least {LEAST_S:.0f} s")
    return found


def _source(log: FlightLog, n_rotors: int) -> tuple[list[str], str]:
    """Columns of the commands, and the channel by which the rotors work: speeds, outputs, or setpoints of torque and
    thrust where the outputs are slow."""
    outputs = motor_columns(n_rotors, "output")
    sources = [(rpm_columns(n_rotors), "rpm"), (outputs, "motor output")]
    there = [(names, by) for names, by in sources if all(map(log.has, names))]
    if not there:
        raise LogError(f"{log.name}: has no rotor speeds and no rotor outputs, expected one to learn how it rotates")
    with_setpoint = all(map(log.has, (*SETPOINTS, *outputs)))
    tried = [*there, *([(list(SETPOINTS), "motor output")] if with_setpoint else [])]
    found = next(((names, by) for names, by in tried if _rate_hz(log, _timed(names)) >= LEAST_HZ), None)
    if found is None:
        names, by = there[-1]
        what = {"rpm": "rotor speeds", "motor output": "rotor outputs"}[by]
        setpoint = f"its torque setpoint at {_rate_hz(log, TORQUE):.0f} Hz" if with_setpoint else "no torque setpoint"
        raise LogError(
            f"{log.name}: its {what} come at {_rate_hz(log, names):.0f} Hz and {setpoint}, expected one of them at "
            f"{LEAST_HZ:.0f} Hz or more"
        )
    return found


def _timed(names: Sequence[str]) -> Sequence[str]:
    """Columns of commands that come together: setpoints of torque, without that of thrust."""
    return TORQUE if list(names) == list(SETPOINTS) else names


def _parts(
    log: FlightLog, vehicle: Vehicle, names: Sequence[str], rate_hz: float, finer: int, span_s: Span
) -> list[Record]:
    """Records of a span, with `finer` steps for each sample of the gyro, without the seconds in which an output
    saturates."""
    step_s = 1.0 / (rate_hz * finer)
    integrated = finer == 1 and INTEGRATED_GYRO in log.meta.get("sources", {})
    clock = np.arange(*span_s, step_s)
    rates = _on_clock(log, RATES, clock)
    drive = _driven(log, vehicle, names, clock, rates if finer == 1 else None)
    edges = np.flatnonzero(np.diff(np.concatenate([[True], drive.lost, [True]])))
    airspeed = down = None
    if all(map(log.has, (*VELOCITY, *ATTITUDE))):
        rows = log.updates(*ATTITUDE)
        angles = [np.interp(clock, log.time_s[rows], np.unwrap(np.radians(log[name][rows]))) for name in ATTITUDE]
        north, east, up = _on_clock(log, VELOCITY, clock).T
        q, none = quaternion_from_euler(*angles), np.zeros(len(clock))
        airspeed = np.column_stack(rotate_inverse(q, (north, east, -up)))
        down = np.column_stack(rotate_inverse(q, (none, none, none + 1.0)))
    voltage = _on_clock(log, ["battery_v"], clock)[:, 0] if log.has("battery_v") else None
    force = _on_clock(log, IMU, clock) if all(map(log.has, IMU)) else None
    logged_s = 1.0 / _rate_hz(log, _timed(names))
    found = []
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        part = slice(int(-(-begin // finer) * finer), int(end))
        if (part.stop - part.start) * step_s >= LEAST_S:
            own = [None if signal is None else signal[part] for signal in (voltage, force, airspeed, down)]
            found.append(
                Record(
                    log.name,
                    step_s,
                    rates[part],
                    drive.value[part],
                    own[0],
                    own[1],
                    drive.measured,
                    own[2],
                    finer,
                    integrated,
                    "autopilot" in log.meta,
                    logged_s if logged_s > 1.5 * step_s else 0.0,
                    drive.unknown,
                    ESTIMATED_M_S if "autopilot" in log.meta else 0.0,
                    own[3],
                    float(clock[part.start]),
                )
            )
    return found


def _driven(log: FlightLog, vehicle: Vehicle, names: Sequence[str], clock: Floats, gyro: Floats | None) -> _Drive:
    """Commands of the rotors on the clock; of the `gyro`, where it is given on it."""

    def commands(columns: Sequence[str]) -> Filled:
        rows = _inside(log, columns, clock)
        value = np.column_stack([log[name][rows] for name in columns])
        return filled_in(clock, gyro if len(rows) < FASTER * len(clock) else None, log.time_s[rows], value)

    none = np.zeros(len(clock), dtype=bool)
    if list(names) != list(SETPOINTS):
        measured, found = names[0].endswith("rpm"), commands(names)
        value = 1e-6 * found.value**2 if measured else found.value
        return _Drive(value, measured, none, found.unknown_share(np.array(vehicle.moment_arms_m)))
    outputs = motor_columns(vehicle.n_rotors, "output")
    torque = commands(TORQUE)
    setpoint = np.column_stack([torque.value, commands(["throttle_cmd"]).value])
    rows = _inside(log, outputs, clock)
    logged = np.column_stack([log[name][rows] for name in outputs])
    at = np.column_stack([np.interp(log.time_s[rows], clock, column) for column in setpoint.T])
    mixer = fit_mixer(at, logged)
    if mixer is None or mixer.followed < FOLLOWED:
        told = "too few to tell" if mixer is None else f"{100.0 * mixer.followed:.0f} % of their variance"
        raise LogError(
            f"{log.name}: its rotor outputs are slow, and how they follow its setpoints of torque and thrust is not "
            f"known ({told}), expected {100.0 * FOLLOWED:.0f} % at {LEAST_PAIRS} instants or more"
        )
    value = mixer.outputs(setpoint)
    missed = np.abs(logged - mixer.outputs(at)).max(axis=1) > max(5.0 * mixer.scatter, MISSED)
    lost = saturated(value)
    lost[np.clip(np.searchsorted(clock, log.time_s[rows][missed]), 0, len(clock) - 1)] = True
    reach = round(AROUND_S / float(clock[1] - clock[0]))
    lost = binary_dilation(lost, iterations=reach) if lost.any() else lost
    return _Drive(value, False, lost, torque.unknown_share(np.eye(3)))


def _inside(log: FlightLog, names: Sequence[str], clock: Floats) -> NDArray[np.intp]:
    """Rows in which a channel is updated while the clock runs."""
    rows = log.updates(*names)
    inside = (log.time_s[rows] >= clock[0]) & (log.time_s[rows] <= clock[-1])
    return np.asarray(rows[inside])


def _on_clock(log: FlightLog, names: Sequence[str], clock: Floats) -> Floats:
    rows = log.updates(*names)
    return np.column_stack([np.interp(clock, log.time_s[rows], log[name][rows]) for name in names])


def _usable(log: FlightLog, source: str) -> list[Span]:
    """The stretches that the record leaves to an analysis; without a height, in which the rotors work."""
    return list(examine(log).usable if log.has("z_m") else usable(driven(log, source), ()))


def _rate_hz(log: FlightLog, names: Sequence[str]) -> float:
    """Rate at which a channel is updated, without its gaps: of an even channel by the median step, which a missing
    sample does not change."""
    rows = log.updates(*names)
    if len(rows) < 2:
        return 0.0
    steps = np.diff(log.time_s[rows])
    median = float(np.median(steps))
    even = float(np.mean(np.abs(steps - median) < 0.05 * median)) > EVEN
    return 1.0 / (median if even else float(np.mean(steps[steps < WIDE_GAP * median])))


@dataclass(frozen=True, eq=False)
class Delayed:
    """Signal, shape (n,), that can be read some time later: a cubic spline, smooth in the delay."""

    signal: Floats
    step_s: float

    def by(self, delay_s: float, lag_s: float, lead_s: float = 0.0) -> Floats:
        """The signal after a delay and a first-order lag, with `lead_s` times its own rate of change."""
        rows = np.arange(len(self.signal), dtype=float)
        late = np.asarray(self._spline(np.clip(rows - delay_s / self.step_s, 0.0, rows[-1])))
        found = lagged(late, self.step_s, max(lag_s, 0.0))
        if lead_s == 0.0:
            return found
        rate = (late - found) / lag_s if lag_s > self.step_s else np.gradient(found, self.step_s)
        return np.asarray(found + lead_s * rate)

    def before(self, delay_s: float) -> Floats:
        """The signal held over the step before each sample, after a delay of one step or more: no later sample is in
        it. A change within a step is its mean over that step."""
        rows = np.arange(len(self.signal), dtype=float)
        return np.interp(rows - delay_s / self.step_s, rows, self.signal)

    @cached_property
    def _spline(self) -> CubicSpline:
        return CubicSpline(np.arange(len(self.signal), dtype=float), self.signal)
