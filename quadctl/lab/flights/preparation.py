"""Preparation of a flight log: the part in flight, on an even clock, with one filter for all signals.

Logs repeat a value between updates, and each channel has its own rate and delay. So each channel is read at its updates
only and joined by a spline. The measured and the predicted acceleration go through the same low-pass filter. The
bandwidth of that filter is limited by the slowest channel, and is stated with every result.
"""

import hashlib
import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.sparse import csr_matrix

from quadctl.effects import Conditions
from quadctl.errors import LogError
from quadctl.frames import (
    GRAVITY_M_S2,
    Quaternion,
    quaternion_from_euler,
    rotate,
    rotate_inverse,
)
from quadctl.lab.arrays import Floats
from quadctl.lab.flights.channels import THROTTLE, THRUST_COMMAND, Signals, signals_of, without_absent_motors
from quadctl.lab.flights.flight import Flight, SlowFilter
from quadctl.lab.flights.prediction import AXES
from quadctl.lab.flights.timing import timed
from quadctl.lab.flights.vehicle_match import motion_problem, sidecar_problem, thrust_problem, weight_doubt
from quadctl.lab.flights.velocity_scale import scale_finding
from quadctl.logs.findings import Finding, Kind, finding, worded
from quadctl.logs.flight_log import MOTION_CAPTURE, FlightLog, attitude_source, doubt_of_copy
from quadctl.logs.record.flight_time import total
from quadctl.logs.record.record import LEFT_OUT_S, MIN_FLIGHT_S, Record, examine
from quadctl.model import Model
from quadctl.numeric import Vector
from quadctl.surfaces import read_place
from quadctl.vehicle import Vehicle
from quadctl.words import Fact

MAX_BANDWIDTH_HZ = 3.0
BANDWIDTH_PER_UPDATE_RATE = 0.35
"""Filter bandwidth over the update rate of the slowest channel: well below the Nyquist frequency, half that rate."""
SAME_FORCE_M_S2 = 0.5
"""Largest difference of the forces by the accelerometer and by the velocity, over the mass, root mean square: 5 % of
the weight, as a bias and a scale of a small accelerometer make. An offset of its clock by 0.1 s makes less in
manoeuvres of 1 m/s^2 at 0.5 Hz."""
BLOCK_S = 5.0
"""Length of the blocks of time that are held out and resampled as a whole."""


def prepare(log: FlightLog, vehicle: Vehicle) -> Flight:
    """Prepare `log`, flown by `vehicle`, for analysis.

    Raises
    ------
    LogError
        The log lacks a signal, belongs to another vehicle, or holds no flight.
    """
    findings: list[Finding] = []
    record = examine(without_absent_motors(log, vehicle.n_rotors, findings), vehicle.allocation.fully_actuated)
    findings = [*record.findings, *findings]
    _require(record, lambda obstacle: obstacle.kind not in (Kind.TOO_SHORT, Kind.TOO_SLOW))
    _refuse(log.name, sidecar_problem(log, vehicle))
    signals = signals_of(record.log, vehicle, findings)
    _refuse(log.name, _thrust_problem(record.log, signals, vehicle))
    _require_flight(record, signals, vehicle)
    _require(record, lambda obstacle: True)
    segments = list(record.usable)
    seconds, of_seconds = total(segments), float(log.time_s[-1] - log.time_s[0])
    findings.append(finding(Kind.IN_FLIGHT, segments, seconds=seconds, of_seconds=of_seconds))
    slowest = min(channel.rate_hz(segments) for channel in signals.timed.values())
    bandwidth = min(MAX_BANDWIDTH_HZ, BANDWIDTH_PER_UPDATE_RATE * slowest)
    sigma = math.sqrt(math.log(2.0)) / (2.0 * math.pi * bandwidth)
    step = min(0.02, sigma / 2.5)
    begin, end = segments[0][0], segments[-1][1]
    grid = np.arange(begin, end, step)
    time, smooth, derivative = _filter(grid, segments, sigma)
    if len(time) < 40 or total(segments) < MIN_FLIGHT_S:
        raise LogError(
            f"{log.name}: holds {total(segments):.0f} s of usable flight, expected at least {MIN_FLIGHT_S:.0f} s"
        )
    flight = _over_surfaces(
        _assemble(log.name, vehicle, signals, grid, smooth, derivative, time, bandwidth, findings), log
    )
    flight = replace(flight, changes_s=record.changes_s, attitude_by=attitude_source(log))
    if _tells_force(flight, signals, segments):
        flight = flight.by_force()
        findings.append(finding(Kind.FORCE_BY_ACCELEROMETER))
    else:
        flight = flight.by_accelerometer(tuple(AXES.index(axis) for axis in record.velocity_doubted))
    del signals, grid, smooth, derivative  # of a long log they need as much memory as the flight
    (flight,) = timed([replace(flight, sha256=_sha256(log))], Model(vehicle))
    thrust = np.column_stack([flight.filtered(nominal) for nominal in flight.nominal_n])
    lean = np.column_stack([flight.variables[name] for name in ("roll", "pitch")])
    _refuse(log.name, motion_problem(flight.measured, thrust, flight.torque, lean, vehicle))
    *_, upright = rotate(flight.conditions.attitude, (0.0, 0.0, 1.0))
    carried = float(np.median(np.sum(flight.logged_n, axis=0) * upright)) / vehicle.weight_n
    doubts = (weight_doubt(carried, vehicle, flight.thrust_source), scale_finding(flight))
    return replace(flight, findings=[*findings, *(doubt for doubt in doubts if doubt is not None)])


def _tells_force(flight: Flight, signals: Signals, segments: Sequence[tuple[float, float]]) -> bool:
    """Tell whether the accelerometer is trusted to measure the force on the body.

    The attitude is that of a motion capture, whose errors by place would turn a force that is derived from the
    velocity; an estimator has attitude and velocity from this accelerometer, so that nothing would be gained. Its
    updates come as often as those of other channels must. And the size of its force, which needs no attitude, follows
    that of the velocity. It takes away forces that only the velocity shows: those are errors of the accelerometer here.
    """
    if flight.sensed is None or flight.attitude_by != MOTION_CAPTURE:
        return False
    if BANDWIDTH_PER_UPDATE_RATE * signals.imu[0].rate_hz(segments) < flight.bandwidth_hz:
        return False
    gravity = np.array([0.0, 0.0, GRAVITY_M_S2])
    sizes = (np.linalg.norm(acceleration + gravity, axis=1) for acceleration in (flight.sensed, flight.motion))
    return bool(np.sqrt(np.mean(np.square(np.subtract(*sizes)))) < SAME_FORCE_M_S2)


def _over_surfaces(flight: Flight, log: FlightLog) -> Flight:
    """The flight with the surfaces below it, where the log's meta file says them."""
    place = read_place(log.meta, log.name)
    if place is None:
        return flight
    here = flight.conditions
    return replace(flight, conditions=replace(here, surfaces=place.shares(here.position_ne_m)))


def _sha256(log: FlightLog) -> str:
    if log.path is None or not log.path.is_file():
        return ""
    with log.path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _refuse(name: str, problem: Fact | str | None) -> None:
    if problem:
        raise LogError(f"{name}: {problem}")


def _require(record: Record, matters: Callable[[Finding], bool]) -> None:
    """Raise LogError for the first of the obstacles that matters."""
    _refuse(record.log.name, next((worded(found) for found in record.obstacles if matters(found)), None))


def _thrust_problem(log: FlightLog, signals: Signals, vehicle: Vehicle) -> Fact | None:
    total = np.sum([channel.at(log.time_s) for channel in signals.rotor], axis=0)
    return thrust_problem(total, signals.position[2].at(log.time_s), vehicle, signals.thrust_source)


def _require_flight(record: Record, signals: Signals, vehicle: Vehicle) -> None:
    """Raise LogError for a log without enough flight, with the likely reason."""
    if not any(obstacle.kind == Kind.TOO_SHORT for obstacle in record.obstacles):
        return
    log = record.log
    z = signals.position[2].at(log.time_s)
    total_n = np.sum([channel.at(log.time_s) for channel in signals.rotor], axis=0)
    if not record.flights:
        raise LogError(
            f"{log.name}: never leaves the ground: z ranges over {float(np.nanmax(z) - np.nanmin(z)):.2f} m (is it "
            f"up?) and the rotors give at most {float(np.nanmax(total_n)):.1f} N of the vehicle's "
            f"{vehicle.weight_n:.1f} N{doubt_of_copy(log.findings)}"
        )
    why = [worded(found) for found in record.findings if found.kind in LEFT_OUT_S and found.times_s]
    raise LogError(
        f"{log.name}: holds {total(record.usable):.0f} s of usable flight, expected at least {MIN_FLIGHT_S:.0f} s"
        f"{''.join(f'; {reason}' for reason in why)}"
    )


def _filter(
    grid: Floats, segments: Sequence[tuple[float, float]], sigma: float
) -> tuple[Floats, csr_matrix, csr_matrix]:
    """Sample times 2 sigma apart, the matrix of the Gaussian filter from the grid to them, and that of its derivative.

    The derivative matrix differentiates the Gaussian, so that a velocity becomes the filtered acceleration, with
    exactly the frequency response that the prediction has.
    """
    reach = 3.0 * sigma
    times = [np.arange(a + reach, b - reach, 2.0 * sigma) for a, b in segments if b - a > 2.0 * reach]
    time = np.concatenate(times) if times else np.empty(0)
    half = math.ceil(reach / (grid[1] - grid[0]))
    centre = np.clip(np.rint((time - grid[0]) / (grid[1] - grid[0])).astype(int), half, len(grid) - 1 - half)
    columns = centre[:, None] + np.arange(-half, half + 1)
    offset = grid[columns] - time[:, None]
    weights = np.exp(-0.5 * (offset / sigma) ** 2)
    weights /= weights.sum(axis=1, keepdims=True)
    derivatives = weights * (offset - (weights * offset).sum(axis=1, keepdims=True))
    derivatives /= (derivatives * offset).sum(axis=1, keepdims=True)
    places, ends = columns.astype(np.int32).ravel(), np.arange(0, columns.size + 1, columns.shape[1])
    shape = (len(time), len(grid))
    smooth, derivative = (csr_matrix((rows.ravel(), places, ends), shape=shape) for rows in (weights, derivatives))
    return time, smooth, derivative


def _assemble(
    name: str,
    vehicle: Vehicle,
    signals: Signals,
    grid: Floats,
    smooth: csr_matrix,
    derivative: csr_matrix,
    time: Floats,
    bandwidth: float,
    findings: list[Finding],
) -> Flight:
    roll, pitch, yaw = (channel.at(grid) for channel in signals.attitude)
    attitude = quaternion_from_euler(roll, pitch, yaw)
    north, east, up = (channel.at(grid) for channel in signals.velocity)
    velocity_body = rotate_inverse(attitude, (north, east, -up))
    battery = signals.battery.at(grid) if signals.battery else np.full_like(grid, np.nan)
    height = signals.position[2].at(grid) + vehicle.rotor_height_m
    position = (signals.position[0].at(grid), signals.position[1].at(grid))
    rates: Vector = (0.0, 0.0, 0.0)
    if signals.rates:
        p, q, r = (channel.at(grid) for channel in signals.rates)
        rates = p, q, r
    measured = np.column_stack([derivative @ v for v in (north, east, up)])
    nominal = signals.thrust_on(grid)
    return Flight(
        name=name,
        vehicle=vehicle,
        grid_s=grid,
        conditions=Conditions(height, velocity_body, attitude, grid, battery, position, rates_rad_s=rates),
        nominal_n=nominal,
        logged_n=nominal,
        velocity_neu=(north, east, up),
        smooth=smooth,
        derivative=derivative,
        time_s=time,
        slowly=SlowFilter(time),
        measured=measured,
        block=((time - time[0]) // BLOCK_S).astype(np.int64) if len(time) else np.empty(0, dtype=np.int64),
        bandwidth_hz=bandwidth,
        thrust_source=signals.thrust_source,
        delay_s=0.0,
        torque=_torque(vehicle, signals, grid, smooth, derivative),
        sensed=_sensed(signals, grid, attitude, smooth),
        findings=findings,
    )


def _sensed(signals: Signals, grid: Floats, attitude: Quaternion, smooth: csr_matrix) -> Floats | None:
    """Kinematic acceleration by the accelerometer, filtered, north, east, up, m/s^2, shape (n, 3)."""
    if not signals.imu:
        return None
    x, y, z = (channel.at(grid) for channel in signals.imu)
    north, east, down = rotate(attitude, (x, y, z))
    return np.column_stack([smooth @ component for component in (north, east, -(down + GRAVITY_M_S2))])


def _torque(
    vehicle: Vehicle, signals: Signals, grid: Floats, smooth: csr_matrix, derivative: csr_matrix
) -> Floats | None:
    """Euler's equation I dw/dt + w x I w, filtered, FRD, N m, shape (n, 3), where single rotors and rates are known."""
    if not signals.rates or signals.thrust_source in (THROTTLE, THRUST_COMMAND):
        return None
    p, q, r = (channel.at(grid) for channel in signals.rates)
    ix, iy, iz = vehicle.principal_inertia_kg_m2
    turning = ((iz - iy) * q * r, (ix - iz) * r * p, (iy - ix) * p * q)
    spin_up = (ix * (derivative @ p), iy * (derivative @ q), iz * (derivative @ r))
    return np.column_stack([a + smooth @ b for a, b in zip(spin_up, turning, strict=True)])
