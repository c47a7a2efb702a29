"""Three witnesses of one force on the body: the accelerometer, the thrust, and the change of the estimated velocity.

Over the mass, accelerometer and thrust tell it in the body, the velocity in the world: only the logged attitude turns
that into the body. Along the thrust an attitude that is off by degrees changes nothing, so that the three are
independent there; across it accelerometer and thrust agree where the attitude is wrong, and velocity and attitude are
one witness. A velocity that lags differs by its lag times its slope, which is no disagreement: its lag is found later,
from the position. The witness that does not follow the other two is odd, and nothing that only it shows is physics.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from quadctl.frames import GRAVITY_M_S2, quaternion_from_euler, rotate_inverse
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
    if not all(log.has(name) for name in (*IMU, *VELOCITY, *ATTITUDE)):
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
    apart = by_velocity - by_imu
    across = {name: _beside_drag(own[:2], speed[:2]) for name, own in (("imu", by_imu), ("velocity", by_velocity))}
    along = {name: _beside_thrust(own[2:], by_thrust[2]) for name, own in (("imu", by_imu), ("velocity", by_velocity))}
    judged = (
        _judged(ACROSS, apart[:2], across, float(noise[:2].sum())),
        _judged(ALONG, apart[2:], along, float(noise[2])),
    )
    return [one for one in judged if one is not None]


def _judged(axes: tuple[str, ...], apart: Floats, left: Mapping[str, Floats], noise: float) -> Disagreement | None:
    """Disagreement of two witnesses that differ by `apart`, of which the third one leaves so much, shape (axes, n)
    each; `noise` is the accelerometer's share of the mean squares."""
    difference = _size(apart, noise)
    sizes = {name: _size(values, noise if name == "imu" else 0.0) for name, values in left.items()}
    odd, sound = max(sizes, key=sizes.__getitem__), min(sizes.values())
    if difference <= max(NOTABLE_M_S2, 0.5 * ODD * sound) or sizes[odd] <= ODD * sound:
        return None
    return Disagreement(axes, difference, "attitude" if (odd, axes) == ("velocity", ACROSS) else odd)


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
    velocity, all in the body, FRD, without slow changes, shape (3, n) each."""
    grid = np.arange(flight[0], flight[1], STEP_S)
    north, east, up = (on_clock(grid, log, name) for name in VELOCITY)
    attitude = quaternion_from_euler(*(np.radians(on_clock(grid, log, name, unwrap=True)) for name in ATTITUDE))
    velocity = np.array([north, east, -up])
    acceleration = np.gradient(velocity, STEP_S, axis=1)
    force = acceleration - np.array([[0.0], [0.0], [GRAVITY_M_S2]])
    push = np.ones(len(grid)) if drive is None else np.interp(grid, log.time_s, np.nan_to_num(drive))
    thrust = push * (-GRAVITY_M_S2 / max(float(np.median(push)), 1e-9))
    by_imu = np.array([_mean_on(grid, log, name, log.updates(name)) for name in IMU])
    by_thrust = np.array([0.0 * thrust, 0.0 * thrust, thrust])
    slope = np.gradient(acceleration, STEP_S, axis=1)
    turned = (np.array(rotate_inverse(attitude, (v[0], v[1], v[2]))) for v in (force, slope, velocity))
    by_velocity, slope, speed = turned
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
    rows = [log.updates(name) for name in IMU]
    halves = [np.array([_mean_on(grid, log, n, r[i::2]) for n, r in zip(IMU, rows, strict=True)]) for i in (0, 1)]
    return np.asarray(np.mean(_quick(0.5 * (halves[0] - halves[1])) ** 2, axis=1))


def _mean_on(grid: Floats, log: FlightLog, name: str, rows: NDArray[np.intp]) -> Floats:
    """Mean of some samples of a fast channel between the times of a clock."""
    time_s = log.time_s[rows]
    sums = integral(time_s, log[name][rows])
    edges = np.concatenate([grid - 0.5 * STEP_S, [grid[-1] + 0.5 * STEP_S]])
    return np.asarray(np.diff(np.interp(edges, time_s, sums)) / STEP_S)


def _beside_thrust(values: Floats, by_thrust: Floats) -> Floats:
    """What the thrust leaves of the force along it, shape (1, n), by the gain that fits best; near 1, as the drive that
    carries the weight is known: drag takes some of a motion away, and a thrust line may have another slope."""
    power = float(by_thrust @ by_thrust)
    gain = float(np.clip(values[0] @ by_thrust / power, *GAINS)) if power > 0.0 else 1.0
    return np.asarray(values - gain * by_thrust)


def _beside_drag(values: Floats, speed: Floats) -> Floats:
    """What a drag leaves of the force across the thrust, shape (2, n): the rotors make none."""
    x = speed.T
    return np.asarray(values - (x @ np.linalg.lstsq(x, values.T, rcond=None)[0]).T)


def _size(values: Floats, noise: float) -> float:
    """Root mean square of a vector, shape (axes, n), beside a noise of this mean square."""
    return float(np.sqrt(max(np.mean(np.sum(values**2, axis=0)) - noise, 0.0)))
