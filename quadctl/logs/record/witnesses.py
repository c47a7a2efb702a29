"""Three witnesses of one force on the body: the accelerometer, the thrust, and the change of the estimated velocity.

Over the mass, accelerometer and thrust tell it in the body, the velocity in the world: only the logged attitude turns
that into the body. Along the thrust an attitude that is off by degrees changes nothing, so that the three are
independent there; across it accelerometer and thrust agree where the attitude is wrong, and velocity and attitude are
one witness. A velocity that lags differs by its lag times its slope, which is no disagreement: its lag is found later,
from the position. The witness that does not follow the other two is odd, and nothing that only it shows is physics.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from quadctl.frames import GRAVITY_M_S2, quaternion_from_euler, rotate, rotate_inverse
from quadctl.logs.findings import Finding, Kind, Span, finding
from quadctl.logs.flight_log import ATTITUDE, IMU, VELOCITY, FlightLog, Floats
from quadctl.logs.kinematics import integral
from quadctl.logs.record.flight_time import averaged, on_clock, thrust_drive, without

STEP_S, SMOOTHED_STEPS, SLOW_S = 0.1, 5, 10.0
"""Step of the clock, half the width of the filter of all three, and the time over which their means are taken away: an
offset of the accelerometer is an effect of its own."""
NOTABLE_M_S2 = 0.1
"""Least root mean square of the difference that matters."""
ODD = 2.5
"""Ratio of what the third witness leaves of the two from which on one of them is odd, and half of that of the
difference to what it leaves of the sound one. Recordings of real and simulated autopilots, and of motion capture, reach
1.6 and 1.2."""
GAINS = (0.6, 1.3)
"""Range of the force along the thrust over that by the thrust."""
SIGMA = 3.0
"""Standard errors by which the size of a noise may be off."""
PIECE_S = 10.0
"""Shorter flights are not judged."""
ACROSS, ALONG = ("north", "east"), ("up",)


@dataclass(frozen=True)
class Disagreement:
    """Difference of the accelerometer and the change of velocity across or along the thrust."""

    axes: tuple[str, ...]
    """Axes of the world that it concerns in a vehicle that hovers."""
    difference_m_s2: float
    """Root mean square, of both axes together."""
    odd: str
    """`velocity`, `attitude` (or the velocity: across the thrust they are one witness) or `imu`."""


def disagreements(
    log: FlightLog, as_logged: FlightLog, thrust_source: str | None, flights: tuple[Span, ...]
) -> list[Disagreement]:
    """Directions along which accelerometer and velocity disagree; [] where the log has only one of them. The noise of
    the accelerometer's samples (vibration), which is no disagreement, is that `as_logged`, before any was moved."""
    if not all(log.has(name) for name in (*IMU, *VELOCITY, *ATTITUDE)) or len(as_logged.updates(*IMU)) < 2:
        return []
    drive = thrust_drive(log, thrust_source)
    sampled = [flight for flight in without(flights, _gaps(log)) if flight[1] - flight[0] > PIECE_S]
    if not sampled:
        return []
    pieces = [_pieces(log, drive, flight) for flight in sampled]
    by_imu, by_velocity, by_thrust, slope, speed = (np.concatenate(p, axis=1) for p in zip(*pieces, strict=True))
    noise = np.mean([_noise(as_logged, flight) for flight in sampled], axis=0)
    power = float(np.sum(slope**2))
    lag_s = float(np.sum((by_imu - by_velocity) * slope)) / power if power > 0.0 else 0.0
    by_velocity = by_velocity + lag_s * slope
    found = []
    for axes, here, beside in ((ACROSS, slice(0, 2), speed[:2]), (ALONG, slice(2, 3), speed[:0])):
        apart = (by_velocity - by_imu)[here]
        # Both the mean square of the noise and that of what holds it are of so many independent values.
        most = float(noise[here].sum()) * (1.0 + SIGMA * np.sqrt(4.0 * (2 * SMOOTHED_STEPS + 1) / apart.size))
        left = {
            "imu": _size(_beside(by_imu[here], by_thrust[here], beside), most),
            "velocity": _size(_beside(by_velocity[here], by_thrust[here], beside), 0.0),
        }
        odd, sound, size = max(left, key=left.__getitem__), min(left.values()), _size(apart, most)
        if size > max(NOTABLE_M_S2, 0.5 * ODD * sound) and left[odd] > ODD * sound:
            found.append(Disagreement(axes, size, "attitude" if (odd, axes) == ("velocity", ACROSS) else odd))
    return found


def disagreement_findings(found: list[Disagreement]) -> list[Finding]:
    """Findings, one for each odd channel."""
    told = []
    for odd in dict.fromkeys(one.odd for one in found):
        each = [(axis, one.difference_m_s2) for one in found if one.odd == odd for axis in one.axes]
        axes, sizes = zip(*each, strict=True)
        told.append(finding(Kind.WITNESSES_DISAGREE, odd=odd, axes=list(axes), difference_m_s2=list(sizes)))
    return told


def _pieces(log: FlightLog, drive: Floats | None, flight: Span) -> tuple[Floats, ...]:
    """Force over mass of one flight by accelerometer, by velocity and by thrust, the slope of that by velocity, and the
    velocity: forward, right and down, without slow changes, shape (3, n) each. The accelerometer's is without its
    offset, which is constant in the body."""
    grid = np.arange(flight[0], flight[1], STEP_S)
    roll, pitch, yaw = (np.radians(on_clock(grid, log, name, unwrap=True)) for name in ATTITUDE)
    heading, lean = quaternion_from_euler(0.0 * yaw, 0.0 * yaw, yaw), quaternion_from_euler(roll, pitch, 0.0 * yaw)
    north, east, up = (on_clock(grid, log, name) for name in VELOCITY)
    velocity = np.array([north, east, -up])
    acceleration = np.gradient(velocity, STEP_S, axis=1)
    jerk = np.gradient(acceleration, STEP_S, axis=1)
    force = acceleration - np.array([[0.0], [0.0], [GRAVITY_M_S2]])
    by_velocity, slope, speed = (np.array(rotate_inverse(heading, tuple(one))) for one in (force, jerk, velocity))
    read = _mean_force(grid, log, log.updates(*IMU))
    read -= np.mean(read - np.array(rotate_inverse(lean, tuple(by_velocity))), axis=1, keepdims=True)
    push = np.ones(len(grid)) if drive is None else np.interp(grid, log.time_s, np.nan_to_num(drive))
    thrust = push * (-GRAVITY_M_S2 / max(float(np.median(push)), 1e-9))
    by_imu, by_thrust = (np.array(rotate(lean, tuple(one))) for one in (read, (0.0 * thrust, 0.0 * thrust, thrust)))
    return tuple(_quick(values) for values in (by_imu, by_velocity, by_thrust, slope, speed))


def _quick(values: Floats) -> Floats:
    smooth = averaged(values, SMOOTHED_STEPS)
    return smooth - averaged(smooth, round(0.5 * SLOW_S / STEP_S))


def _gaps(log: FlightLog) -> list[Span]:
    """Times without samples of the accelerometer that are as long as the filter sees."""
    time_s = log.time_s[log.updates(*IMU)]
    return [(float(a), float(b)) for a, b in pairwise(time_s) if b - a > SMOOTHED_STEPS * STEP_S]


def _noise(log: FlightLog, flight: Span) -> Floats:
    """Mean square of each axis that noise of single samples leaves of the accelerometer, shape (3,): every other sample
    tells the same motion."""
    grid = np.arange(flight[0], flight[1], STEP_S)
    rows = log.updates(*IMU)
    halves = [_mean_force(grid, log, rows[i::2]) for i in (0, 1)]
    return np.asarray(np.mean(_quick(0.5 * (halves[0] - halves[1])) ** 2, axis=1))


def _mean_force(grid: Floats, log: FlightLog, rows: NDArray[np.intp]) -> Floats:
    """Mean of some samples of the accelerometer between the times of a clock, shape (3, n)."""
    time_s = log.time_s[rows]
    edges = np.concatenate([grid - 0.5 * STEP_S, [grid[-1] + 0.5 * STEP_S]])
    sums = (integral(time_s, log[name][rows]) for name in IMU)
    return np.array([np.diff(np.interp(edges, time_s, sum_)) / STEP_S for sum_ in sums])


def _beside(values: Floats, by_thrust: Floats, speed: Floats) -> Floats:
    """Remainder of a force beside thrust and a drag by `speed`, shape (axes, n) each, by the best gain of the thrust;
    near 1, as the drive that carries the weight is known, but a thrust line may have another slope."""
    x = speed.T
    values, thrust = ((one.T - x @ np.linalg.lstsq(x, one.T, rcond=None)[0]).T for one in (values, by_thrust))
    power = float(np.vdot(thrust, thrust))
    gain = float(np.clip(np.vdot(values, thrust) / power, *GAINS)) if power > 0.0 else 1.0
    return np.asarray(values - gain * thrust)


def _size(values: Floats, noise: float) -> float:
    """Root mean square of a vector, shape (axes, n), beside a noise of this mean square."""
    return float(np.sqrt(max(np.mean(np.sum(values**2, axis=0)) - noise, 0.0)))
