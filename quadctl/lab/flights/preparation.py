"""Preparation of a flight log: the part in flight, on an even clock, with one filter for all signals.

Logs repeat a value between updates, and each channel has its own rate and delay. So each channel is read at its updates
only and joined by a spline. The measured and the predicted acceleration go through the same low-pass filter. The
bandwidth of that filter is limited by the slowest channel, and is stated with every result.
"""

import hashlib
import math
from collections.abc import Sequence
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
from quadctl.lab.flights.timing import timed
from quadctl.lab.flights.vehicle_match import motion_problem, sidecar_problem, thrust_problem, weight_doubt
from quadctl.lab.flights.velocity_scale import scale_finding
from quadctl.logs.contradictions import contradictions
from quadctl.logs.findings import Finding, Kind, finding
from quadctl.logs.flight_log import ATTITUDE, POSITION, VELOCITY, FlightLog, doubt_of_copy
from quadctl.model import Model
from quadctl.surfaces import read_place
from quadctl.vehicle import Vehicle

MAX_BANDWIDTH_HZ = 3.0
MIN_UPDATE_RATE_HZ = 2.5
"""Least update rate of the slowest channel; below it, motion between the updates would look like an unexplained
force."""
BANDWIDTH_PER_UPDATE_RATE = 0.35
"""Filter bandwidth over the update rate of the slowest channel: well below the Nyquist frequency, half that rate."""
TRIM_START_S, TRIM_END_S = 2.0, 1.0
"""Times cut off at the beginning and end of each stretch of flight, for the take-off transient and the touchdown."""
GROUND_PHASES = ("wait", "stream", "start", "spool_up", "land", "released", "done")
"""Phases of quadctl's own logs in which no mission is flown."""
MIN_DESCENT_M = 0.3
"""Least height of flight below the height at rest that is reported as a z axis that points down."""
MIN_CLEARANCE_M = 0.02
"""Least height above the height at rest in flight; lower is contact with the ground."""
MIN_FLIGHT_S, MIN_SEGMENT_S = 10.0, 2.0
LONGEST_ROW_GAP_S = 10.0
"""Largest time between rows of one flight; after a longer gap the clock has jumped, or another flight begins."""
BLOCK_S = 5.0
"""Length of the blocks of time that are held out and resampled as a whole."""


def prepare(log: FlightLog, vehicle: Vehicle) -> Flight:
    """Prepare `log`, flown by `vehicle`, for analysis.

    Raises
    ------
    LogError
        The log lacks a signal, belongs to another vehicle, or holds no flight.
    """
    findings = list(log.findings)
    log = without_absent_motors(log, vehicle.n_rotors, findings)
    _require_columns(log)
    for problem in (*contradictions(log, vehicle.allocation.fully_actuated), sidecar_problem(log, vehicle)):
        _refuse(log.name, problem)
    signals = signals_of(log, vehicle, findings)
    _refuse(log.name, _thrust_problem(log, signals, vehicle))
    segments = _flight_segments(log, signals, vehicle, findings)
    rates = {name: channel.rate_hz(segments) for name, channel in signals.timed.items()}
    name, slowest = min(rates.items(), key=lambda item: item[1])
    if max(slowest, signals.timed[name].usual_rate_hz(segments)) < MIN_UPDATE_RATE_HZ:
        changes = f"has {slowest:.2f} updates per second" if slowest > 0.0 else "never changes"
        raise LogError(
            f"{log.name}: its slowest channel, {name}, {changes} in flight, expected at least {MIN_UPDATE_RATE_HZ:g} "
            "updates per second"
        )
    bandwidth = min(MAX_BANDWIDTH_HZ, BANDWIDTH_PER_UPDATE_RATE * slowest)
    sigma = math.sqrt(math.log(2.0)) / (2.0 * math.pi * bandwidth)
    step = min(0.02, sigma / 2.5)
    begin, end = segments[0][0], segments[-1][1]
    grid = np.arange(begin, end, step)
    segments = _without_gaps(segments, signals, max(8.0 / slowest, 1.0), findings, log.name)
    time, smooth, derivative = _filter(grid, segments, sigma)
    if len(time) < 40 or sum(b - a for a, b in segments) < MIN_FLIGHT_S:
        seconds = sum(b - a for a, b in segments)
        why = "".join(f"; {frozen}" for frozen in signals.frozen)
        raise LogError(
            f"{log.name}: holds {seconds:.0f} s of usable flight, expected at least {MIN_FLIGHT_S:.0f} s{why}"
        )
    flight = _over_surfaces(
        _assemble(log.name, vehicle, signals, grid, smooth, derivative, time, bandwidth, findings), log
    )
    del signals, grid, smooth, derivative  # of a long log they need as much memory as the flight
    (flight,) = timed([replace(flight, sha256=_sha256(log))], Model(vehicle))
    thrust = np.column_stack([flight.filtered(nominal) for nominal in flight.nominal_n])
    lean = np.column_stack([flight.variables[name] for name in ("roll", "pitch")])
    _refuse(log.name, motion_problem(flight.measured, thrust, flight.torque, lean, vehicle))
    *_, upright = rotate(flight.conditions.attitude, (0.0, 0.0, 1.0))
    carried = float(np.median(np.sum(flight.logged_n, axis=0) * upright)) / vehicle.weight_n
    doubts = (weight_doubt(carried, vehicle, flight.thrust_source), scale_finding(flight))
    return replace(flight, findings=[*findings, *(doubt for doubt in doubts if doubt is not None)])


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


def _refuse(name: str, problem: str | None) -> None:
    if problem:
        raise LogError(f"{name}: {problem}")


def prepare_all(logs: Sequence[FlightLog], vehicle: Vehicle) -> list[Flight]:
    """Prepare all logs; raises LogError for the first that cannot be analysed."""
    return [prepare(log, vehicle) for log in logs]


def _require_columns(log: FlightLog) -> None:
    for name in (*POSITION, *VELOCITY, *ATTITUDE):
        if not log.has(name):
            raise LogError(f"{log.name}: holds no values of {name}, which an analysis needs")


def _thrust_problem(log: FlightLog, signals: Signals, vehicle: Vehicle) -> str | None:
    total = np.sum([channel.at(log.time_s) for channel in signals.rotor], axis=0)
    return thrust_problem(total, signals.position[2].at(log.time_s), vehicle, signals.thrust_source)


def _flight_segments(
    log: FlightLog, signals: Signals, vehicle: Vehicle, findings: list[Finding]
) -> list[tuple[float, float]]:
    """Intervals of time in flight: clear of the ground, rotors working, ends trimmed; s."""
    time = log.time_s
    z = signals.position[2].at(time)
    total = np.sum([channel.at(time) for channel in signals.rotor], axis=0)
    # For an instant the rotors may be idle in the air too: at the top of a quick climb.
    idle_s = 1.0
    around = [np.searchsorted(time, time - idle_s), np.searchsorted(time, time + idle_s, side="right")]
    count = np.concatenate([[0], np.cumsum(total > 0.4 * vehicle.weight_n)])
    working = count[around[1]] - count[around[0]] > 0.25 * (around[1] - around[0])
    still = ~working
    if log.phase is not None:
        working &= ~np.isin(log.phase, GROUND_PHASES)
    # A log that begins and ends in the air says nothing about the height at rest.
    rest = float(np.nanmedian(z[still])) if still.any() else -math.inf
    flying = working & (z > rest + MIN_CLEARANCE_M)
    flying[1:] &= np.diff(time) < LONGEST_ROW_GAP_S
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flying.astype(np.int8), [0]])))
    found = []
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        begin, end = float(time[first]) + TRIM_START_S, float(time[last - 1]) - TRIM_END_S
        if end - begin > MIN_SEGMENT_S:
            found.append((begin, end))
    if not found:
        rise = float(np.nanmax(z) - np.nanmin(z))
        lower = rest - float(np.median(z[working])) if working.any() else 0.0
        if MIN_DESCENT_M < lower < math.inf:
            raise LogError(
                f"{log.name}: z_m is {lower:.2f} m lower while the rotors carry the vehicle than at rest, "
                "expected it higher: are z_m and vz_m_s up?"
            )
        shortest_s = TRIM_START_S + TRIM_END_S + MIN_SEGMENT_S
        raise LogError(
            f"{log.name}: never leaves the ground for more than {shortest_s:g} s: z ranges over {rise:.2f} m (is it "
            f"up?) and the rotors give at most {float(np.nanmax(total)):.1f} N of the vehicle's "
            f"{vehicle.weight_n:.1f} N{doubt_of_copy(log.findings)}"
        )
    kept = sum(b - a for a, b in found)
    findings.append(finding(Kind.IN_FLIGHT, found, seconds=kept, of_seconds=float(time[-1] - time[0])))
    return found


def _without_gaps(
    segments: list[tuple[float, float]], signals: Signals, longest_s: float, findings: list[Finding], name: str
) -> list[tuple[float, float]]:
    """Cut out the times in which a channel brought nothing new for longer than `longest_s`, or a rotor's has frozen."""
    lost = 0.0
    for frozen in signals.frozen:
        segments = _cut(segments, frozen.begin_s, frozen.end_s)
    for channel in signals.timed.values():
        gaps = np.flatnonzero(np.diff(channel.time_s) > longest_s)
        for a, b in zip(channel.time_s[gaps], channel.time_s[gaps + 1], strict=True):
            lost += sum(max(0.0, min(b, end) - max(a, begin)) for begin, end in segments)
            segments = _cut(segments, a, b)
    if lost > 0.0:
        findings.append(finding(Kind.GAPS, seconds=lost, longest_s=longest_s))
    if not segments:
        raise LogError(f"{name}: no stretch of the flight has new values at least every {longest_s:.1f} s")
    return segments


def _cut(segments: Sequence[tuple[float, float]], begin: float, end: float) -> list[tuple[float, float]]:
    """Segments of time without what lies between `begin` and `end`."""
    pieces = [piece for a, b in segments for piece in ((a, min(b, begin)), (max(a, end), b))]
    return [(a, b) for a, b in pieces if b > a]


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
    measured = np.column_stack([derivative @ v for v in (north, east, up)])
    nominal = signals.thrust_on(grid)
    return Flight(
        name=name,
        vehicle=vehicle,
        grid_s=grid,
        conditions=Conditions(height, velocity_body, attitude, grid, battery, position),
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
