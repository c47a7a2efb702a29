"""Signals of a log that an analysis needs, each sampled at its own updates."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import Akima1DInterpolator
from scipy.ndimage import median_filter

from quadctl.effects.motor_lag import lagged
from quadctl.errors import LogError
from quadctl.lab.arrays import Floats
from quadctl.logs.channel_groups import come_in_turn
from quadctl.logs.columns import LATERAL_THROTTLE, LATERAL_THRUST, motor_columns, motor_of, rpm_columns
from quadctl.logs.findings import Finding, Kind, finding
from quadctl.logs.flight_log import ATTITUDE, IMU, POSITION, RATES, VELOCITY, FlightLog
from quadctl.vehicle import Vehicle

ROTOR_SPEED, THROTTLE, THRUST_COMMAND = "rotor speed", "throttle command", "thrust command"
"""Sources of the thrust signal: the best one, and those without information on single rotors."""
SPIKE_WINDOW_S = 1.0
"""Time over which the running median is taken with which a thrust is compared."""
LEAST_FOR_SPLINE = 5
PIECE = 1 << 16
"""Values of a channel that are computed at once: the intermediate ones of a whole long log need much memory."""
AROUND = 4
"""Updates before and after some that the spline between these depends on."""
WIDE_GAP = 3.0
"""Gap between updates, over their median, across which a signal is taken to be straight."""


@dataclass(frozen=True)
class Channel:
    """Signal sampled at its own updates."""

    time_s: Floats
    value: Floats

    def at(self, grid_s: Floats) -> Floats:
        """Values at other times, constant beyond the ends.

        Between the updates the signal is a modified Akima spline (Akima 1970, J. ACM 17(4)): straight lines would
        weaken motion at a third of the update rate by a third. It is linear across gaps, where it would swing.
        """
        if len(self.time_s) < LEAST_FOR_SPLINE:
            return np.interp(grid_s, self.time_s, self.value)
        steps = np.diff(self.time_s)
        wide = steps > WIDE_GAP * np.median(steps)
        values = np.empty(len(grid_s))
        for begin in range(0, len(grid_s), PIECE):
            t = grid_s[begin : begin + PIECE]
            place = np.clip(np.searchsorted(self.time_s, t, "right") - 1, 0, len(steps) - 1)
            first, last = max(int(place.min()) - AROUND, 0), int(place.max()) + 2 + AROUND
            curve = self._spline(slice(first, last))(np.clip(t, self.time_s[0], self.time_s[-1]))
            straight = wide[place]
            values[begin : begin + PIECE] = curve
            if straight.any():
                values[begin : begin + PIECE][straight] = np.interp(t[straight], self.time_s, self.value)
        return values

    def _spline(self, updates: slice) -> Akima1DInterpolator:
        # Not kept, and only of some updates: its coefficients need four times the memory of the channel.
        return Akima1DInterpolator(self.time_s[updates], self.value[updates], method="makima")

    def rate_hz(self, segments: Sequence[tuple[float, float]]) -> float:
        """Mean update rate in these segments of time."""
        ends = np.array(segments).T
        inside = np.sum(np.searchsorted(self.time_s, ends[1], "right") - np.searchsorted(self.time_s, ends[0]))
        return float(inside / max(sum(b - a for a, b in segments), 1e-9))


@dataclass(frozen=True)
class Signals:
    position: list[Channel]
    velocity: list[Channel]
    attitude: list[Channel]
    """Roll, pitch, yaw, rad, unwrapped."""
    rotor: list[Channel]
    """Nominal thrust of each rotor, N."""
    rates: list[Channel]
    """Body rates, FRD; empty where they are not logged."""
    imu: list[Channel]
    """Specific force, FRD; empty where it is not logged."""
    battery: Channel | None
    thrust_source: str
    lag_s: float = 0.0
    """Time constant with which the rotors follow `rotor`, s, from the vehicle file; 0 where `rotor` is measured
    speed."""

    def thrust_on(self, grid_s: Floats) -> list[Floats]:
        """Nominal thrust of each rotor on an even clock, N."""
        step_s = float(grid_s[1] - grid_s[0])
        return [lagged(channel.at(grid_s), step_s, self.lag_s) for channel in self.rotor]

    @property
    def timed(self) -> dict[str, Channel]:
        """One channel of each group, by the name of the group, for update rates and gaps."""
        return {
            "position": self.position[0],
            "velocity": self.velocity[0],
            "attitude": self.attitude[0],
            self.thrust_source: self.rotor[0],
        }


def updates_of(log: FlightLog, names: Sequence[str]) -> NDArray[np.intp]:
    rows = log.updates(*names)
    if not len(rows):
        raise LogError(f"{log.name}: {', '.join(names)} never hold values in one row, expected them to come together")
    return rows


def without_absent_motors(log: FlightLog, n_rotors: int, findings: list[Finding]) -> FlightLog:
    """The log without the columns of motors beyond `n_rotors` that never ran: loggers fill up their tables.

    A motor never ran where its speed and its output hold only 0 or nothing.
    """
    absent = []
    for name in log.columns:
        motor = motor_of(name)
        if motor is None or motor <= n_rotors:
            continue
        drive = (log.columns.get(f"motor{motor}_{quantity}") for quantity in ("rpm", "output"))
        if not any(values is not None and np.any(np.nan_to_num(values)) for values in drive):
            absent.append(name)
    if not absent:
        return log
    findings.append(finding(Kind.ABSENT_MOTORS, rotors=n_rotors, columns=absent))
    return replace(log, columns={name: values for name, values in log.columns.items() if name not in absent})


def signals_of(log: FlightLog, vehicle: Vehicle, findings: list[Finding]) -> Signals:
    def channels(names: Sequence[str], scale: float = 1.0, unwrap: bool = False) -> list[Channel]:
        rows = updates_of(log, names)
        time_s, found = log.time_s[rows], []
        for name in names:
            value = scale * log[name][rows]
            found.append(Channel(time_s, np.unwrap(value) if unwrap else value))
        return found

    rotor, source = _rotorsignals_of(log, vehicle)
    lag_s = 0.0 if source == ROTOR_SPEED else vehicle.rotor.time_constant_s
    if source != ROTOR_SPEED:
        findings.append(finding(Kind.THRUST_FROM, source=source))
    rotor = _without_spikes(rotor, vehicle.throttle.max_thrust_per_rotor_n, f"{source}s", findings)
    battery = None
    voltage = [n for n in ("battery_v", *motor_columns(vehicle.n_rotors, "voltage_v")) if log.has(n)]
    if voltage:
        rows = log.updates(voltage[0])
        battery = Channel(log.time_s[rows], log[voltage[0]][rows])
    return Signals(
        channels(POSITION),
        channels(VELOCITY),
        channels(ATTITUDE, math.pi / 180.0, unwrap=True),
        rotor,
        channels(RATES) if all(log.has(name) for name in RATES) else [],
        channels(IMU) if all(log.has(name) for name in IMU) else [],
        battery,
        source,
        lag_s,
    )


def _without_spikes(channels: list[Channel], limit: float, what: str, findings: list[Finding]) -> list[Channel]:
    """Remove the updates in which one of the channels is further than `limit` from its running median."""
    if any(len(channel.time_s) != len(channels[0].time_s) for channel in channels):  # they come in turn
        return [kept for channel in channels for kept in _without_spikes([channel], limit, what, findings)]
    time, values = channels[0].time_s, np.array([channel.value for channel in channels])
    if not np.any(np.abs(np.diff(values)) > limit):
        return channels
    per_second = (len(time) - 1) / float(time[-1] - time[0])
    window = max(5, round(per_second * SPIKE_WINDOW_S) | 1)
    kept = np.all(np.abs(values - median_filter(values, size=(1, window), mode="nearest")) <= limit, axis=0)
    if not kept.all():
        findings.append(finding(Kind.SPIKES, updates=int(np.count_nonzero(~kept)), of=what))
    time = time[kept]
    return [Channel(time, value) for value in values[:, kept]]


def refuse_other_rotors(log: FlightLog, vehicle: Vehicle) -> None:
    """Refuse a log of a vehicle with another number of rotors, by their speeds, or else by their outputs.

    Raises
    ------
    LogError
        The numbers differ.
    """
    by_speed = bool(log.n_rotors and log.has("motor1_rpm"))
    last = max((motor_of(name) or 0 for name in log.columns if name.endswith("_output") and log.has(name)), default=0)
    found, what = (
        (log.n_rotors, f"speeds of {log.n_rotors} rotors") if by_speed else (last, f"outputs of {last} motors")
    )
    if found not in (0, vehicle.n_rotors):
        raise LogError(f"{log.name}: has the {what}, expected {vehicle.n_rotors} as the vehicle '{vehicle.name}' has")


def _rotorsignals_of(log: FlightLog, vehicle: Vehicle) -> tuple[list[Channel], str]:
    """Nominal thrust of each rotor from the rpm, else from the motor outputs or the throttle by the vehicle's curve,
    else from the commanded thrust."""
    refuse_other_rotors(log, vehicle)
    if log.n_rotors and log.has("motor1_rpm"):
        names = rpm_columns(vehicle.n_rotors)
        k = vehicle.rotor.thrust_n_per_rpm2
        if come_in_turn(log, names):
            own = [log.updates(name) for name in names]
            turning = zip(names, own, strict=True)
            return [Channel(log.time_s[at], k * log[name][at] ** 2) for name, at in turning], ROTOR_SPEED
        rows = updates_of(log, names)
        return [Channel(log.time_s[rows], k * log[name][rows] ** 2) for name in names], ROTOR_SPEED
    curve, n = vehicle.throttle, vehicle.n_rotors
    outputs = motor_columns(n, "output")
    if all(log.has(name) for name in outputs):
        rows = updates_of(log, outputs)
        found = [np.maximum(log[name][rows] - curve.offset, 0.0) / (curve.per_newton * n) for name in outputs]
        time_s = log.time_s[rows]
        return [Channel(time_s, thrust) for thrust in found], "motor output"
    if log.has("throttle_cmd"):
        rows = log.updates("throttle_cmd", *(name for name in LATERAL_THROTTLE if log.has(name)))
        each = np.maximum(log["throttle_cmd"][rows] - curve.offset, 0.0) / (curve.per_newton * n)
        lateral = _lateral(log, rows, LATERAL_THROTTLE)
        mix = np.array(vehicle.allocation.lateral_mix) / (curve.per_newton * n)
        return _with_lateral(Channel(log.time_s[rows], each), mix, lateral), THROTTLE
    if log.has("thrust_cmd_n"):
        rows = log.updates("thrust_cmd_n", *(name for name in LATERAL_THRUST if log.has(name)))
        each = np.maximum(log["thrust_cmd_n"][rows], 0.0) / (n * vehicle.axial_share)
        lateral = _lateral(log, rows, LATERAL_THRUST)
        return _with_lateral(
            Channel(log.time_s[rows], each), vehicle.allocation.inverse[:, :2], lateral
        ), THRUST_COMMAND
    raise LogError(
        f"{log.name}: holds neither rotor speeds nor throttle_cmd nor motor outputs nor thrust_cmd_n, "
        "expected one of them to know the thrust"
    )


def _lateral(log: FlightLog, rows: NDArray[np.intp], names: Sequence[str]) -> Floats | None:
    """Lateral commands forward and right, shape (rows, 2), or None where the flight had none."""
    return np.column_stack([log[name][rows] for name in names]) if all(map(log.has, names)) else None


def _with_lateral(each: Channel, mix: Floats, lateral: Floats | None) -> list[Channel]:
    """Thrust of each rotor, N: the same `each`, with the lateral commands, shape (rows, 2), by `mix`, shape (n, 2)."""
    if lateral is None:
        return [each] * len(mix)
    thrusts = np.maximum(each.value[:, None] + lateral @ mix.T, 0.0)
    return [Channel(each.time_s, thrust) for thrust in thrusts.T]
