"""Two witnesses of one acceleration: the accelerometer, and the change of the estimated velocity.

They agree within some tenths of a m/s^2 while the record is sound. Where they do not, the thrust and the attitude are
the third witness: the one that does not follow them is odd, and nothing that only it shows is physics.
"""

from dataclasses import dataclass

import numpy as np

from quadctl.frames import GRAVITY_M_S2, quaternion_from_euler, rotate
from quadctl.logs.findings import Finding, Kind, Span, finding
from quadctl.logs.flight_log import ATTITUDE, IMU, VELOCITY, FlightLog, Floats
from quadctl.logs.kinematics import integral
from quadctl.logs.record.flight_time import averaged, on_clock, thrust_drive

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
"""Range of the acceleration over that by thrust and attitude."""
PIECE_S = 10.0
"""Shorter flights are not judged."""
AXES = ("north", "east", "up")


@dataclass(frozen=True)
class Disagreement:
    """Difference of the accelerometer and the change of velocity along one axis."""

    axis: str
    difference_m_s2: float
    """Root mean square."""
    odd: str
    """`velocity` or `imu`: the one that does not follow thrust and attitude."""


def disagreements(log: FlightLog, thrust_source: str | None, flights: tuple[Span, ...]) -> list[Disagreement]:
    """Axes of the world along which accelerometer and velocity disagree; [] where the log has only one of them."""
    if not all(log.has(name) for name in (*IMU, *VELOCITY, *ATTITUDE)):
        return []
    drive = thrust_drive(log, thrust_source)
    pieces = [_pieces(log, drive, flight) for flight in flights if flight[1] - flight[0] > PIECE_S]
    if not pieces:
        return []
    by_velocity, by_imu, by_thrust, *of_body = (np.concatenate(parts, axis=1) for parts in zip(*pieces, strict=True))
    by_imu = _without_offset(by_imu, by_velocity, of_body)
    found = []
    for i, axis in enumerate(AXES):
        apart = _size(by_velocity[i] - by_imu[i])
        left = {name: _unexplained(own[i], by_thrust[i]) for name, own in (("velocity", by_velocity), ("imu", by_imu))}
        odd, sound = max(left, key=left.__getitem__), min(left.values())
        if apart > max(NOTABLE_M_S2, 0.5 * ODD * sound) and left[odd] > ODD * sound:
            found.append(Disagreement(axis, apart, odd))
    return found


def disagreement_findings(found: list[Disagreement]) -> list[Finding]:
    """Findings, one for each odd channel."""
    told = []
    for odd in dict.fromkeys(one.odd for one in found):
        own = [one for one in found if one.odd == odd]
        told.append(
            finding(
                Kind.WITNESSES_DISAGREE,
                odd=odd,
                axes=[one.axis for one in own],
                difference_m_s2=[one.difference_m_s2 for one in own],
            )
        )
    return told


def _pieces(log: FlightLog, drive: Floats | None, flight: Span) -> tuple[Floats, ...]:
    """Acceleration of one flight by velocity, by accelerometer and by thrust, and the three axes of the body, in the
    world, without slow changes, shape (3, n) each."""
    grid = np.arange(flight[0], flight[1], STEP_S)
    velocity = np.array([on_clock(grid, log, name) for name in VELOCITY])
    angles = (np.radians(on_clock(grid, log, name, unwrap=True)) for name in ATTITUDE)
    attitude = quaternion_from_euler(*angles)
    force = (_mean_on(grid, log, name) for name in IMU)
    north, east, down = rotate(attitude, (next(force), next(force), next(force)))
    by_imu = np.array([north, east, -np.asarray(down)])
    by_velocity = np.gradient(velocity, STEP_S, axis=1)
    push = np.ones(len(grid)) if drive is None else np.interp(grid, log.time_s, np.nan_to_num(drive))
    north, east, down = rotate(attitude, (0.0, 0.0, -1.0))
    by_thrust = push * np.array([north, east, -np.asarray(down)]) * (GRAVITY_M_S2 / max(float(np.median(push)), 1e-9))
    body = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    axes = [np.array([n, e, -np.asarray(d)]) for n, e, d in (rotate(attitude, axis) for axis in body)]
    return tuple(_quick(values) for values in (by_velocity, by_imu, by_thrust, *axes))


def _without_offset(by_imu: Floats, by_velocity: Floats, of_body: list[Floats]) -> Floats:
    """Acceleration by an accelerometer without its offset, which is constant in the body and turns with it in the
    world, shape (3, n); `of_body` are the axes of the body, shape (3, n) each."""
    columns = np.column_stack([axis.ravel() for axis in of_body])
    offset = np.linalg.lstsq(columns, (by_imu - by_velocity).ravel(), rcond=None)[0]
    return by_imu - np.tensordot(offset, np.array(of_body), axes=1)


def _quick(values: Floats) -> Floats:
    smooth = averaged(values, SMOOTHED_STEPS)
    return smooth - averaged(smooth, round(0.5 * SLOW_S / STEP_S))


def _mean_on(grid: Floats, log: FlightLog, name: str) -> Floats:
    """Mean of a fast channel between the times of a clock."""
    rows = log.updates(name)
    time_s = log.time_s[rows]
    sums = integral(time_s, log[name][rows])
    edges = np.concatenate([grid - 0.5 * STEP_S, [grid[-1] + 0.5 * STEP_S]])
    return np.asarray(np.diff(np.interp(edges, time_s, sums)) / STEP_S)


def _unexplained(values: Floats, by_thrust: Floats) -> float:
    """Root mean square that the third witness leaves, by the gain that fits best; near 1, as the drive that carries the
    weight is known: drag takes some of a motion away, and a thrust line may have another slope."""
    power = float(by_thrust @ by_thrust)
    gain = float(np.clip(values @ by_thrust / power, *GAINS)) if power > 0.0 else 1.0
    return _size(values - gain * by_thrust)


def _size(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))
