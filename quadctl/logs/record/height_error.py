"""Error of an estimated height that leans on a barometer, told by the acceleration along up.

Air that flows past a barometer changes its reading with the square of the speed, by the side from which it comes
(`quadctl.effects.barometer`), and an estimator follows it: height and climb rate err together, as its lag lets them.
The accelerometer is right, and the thrust goes with the motion; so what of the change of the climb rate has the form of
such an error, and goes with neither, is no force. The lag is that of a complementary filter of second order.

An error near the ground is told by a range finder alone: where a vehicle climbs through it, delays of the rotors have
the same form.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from quadctl.frames import GRAVITY_M_S2, quaternion_from_euler, rotate, rotate_inverse
from quadctl.logs.findings import Finding, Kind, Span, finding
from quadctl.logs.flight_log import ATTITUDE, IMU, VELOCITY, FlightLog, Floats
from quadctl.logs.record.flight_time import averaged, on_clock, thrust_drive

STEP_S, SMOOTHED_STEPS, SLOW_S = 0.05, 4, 10.0
"""Step of the clock, half the width of the filter, used twice, and the time over which means are taken away."""
FREQUENCIES_RAD_S = (0.5, 1.0, 2.0, 4.0, 20.0)
"""Frequencies of the estimator that are tried: those of EKF2 and EKF3 with a barometer are 0.3 to 2 rad/s, and the last
one follows the reading at once."""
DAMPING = 0.7
NEAR_GROUND_M = 0.4
"""Height over which a force of the ground falls to 1/e."""
USUAL = 1.0
"""Standard deviation of the coefficients before the flight: so those of sides that it hardly moves to stay small."""
CLEAR = 45.0
"""Least Wald statistic of the four forms: p of 1e-8; each frequency is a trial, and the noise is not quite white."""
MATTERS_M_S2 = 0.02
"""Least root mean square of the acceleration that the error stands for."""
BLOCK_S = 10.0
"""Blocks of time of the two halves, of which each must foretell the other."""
FADES_M = (0.2, 0.5)
"""Heights over which errors of the ground fall to 1/e: between them lie those that are known."""
MATTERS_M = 0.05
"""Least span of an error of the height near the ground."""
SEEN, LOW_M, STEEP_M = 0.8, 1.0, 0.5
"""Share of the flight that a range finder must see, and heights that it must span: below the first, and a range."""
LEAST_S, LONGEST_S = 20.0, 36000.0
"""Time in flight that is needed, and length of a log, with its pauses, that is looked at."""


class HeightError(NamedTuple):
    """Error of the estimated height, as a barometer gives it."""

    frequency_rad_s: float
    coefficients: tuple[float, ...]
    """Static pressure error over dynamic pressure forward, backward, right and left; or those of FADES_M, m."""
    std: tuple[float, ...]
    size: float
    """Root mean square of its acceleration, m/s^2; of one near the ground, the span of the height, m."""


def leans_on_barometer(parameters: Mapping[str, float], autopilot: str) -> bool:
    """Tell whether the estimated height is, or may be, that of the barometer."""
    if "EKF2_HGT_REF" in parameters:  # PX4 1.14 and later fuse all that is enabled
        return parameters.get("EKF2_BARO_CTRL", 1.0) != 0.0
    if "EKF2_HGT_MODE" in parameters:
        return parameters["EKF2_HGT_MODE"] == 0.0
    for name in ("EK3_SRC1_POSZ", "EK2_ALT_SOURCE"):
        if name in parameters:
            return parameters[name] == (1.0 if name == "EK3_SRC1_POSZ" else 0.0)
    return bool(autopilot)


def without_height_error(
    log: FlightLog, thrust_source: str | None, spans: tuple[Span, ...]
) -> tuple[FlightLog, list[Finding]]:
    """The log without the barometer's error in its height and climb rate, and the finding where there is one."""
    if not all(log.has(name) for name in (*VELOCITY, *ATTITUDE, "z_m")):
        return log, []
    if not leans_on_barometer(log.meta.get("parameters", {}), str(log.meta.get("autopilot", ""))):
        return log, []
    if sum(end - begin for begin, end in spans) < LEAST_S:
        return log, []
    begin, end = spans[0][0], spans[-1][1]
    if end - begin > LONGEST_S:
        return log, []
    clock = np.arange(begin, end, STEP_S)
    drive = thrust_drive(log, thrust_source)
    lift = np.ones(len(clock)) if drive is None else np.interp(clock, log.time_s, np.nan_to_num(drive))
    inside = np.any([(clock >= begin) & (clock <= end) for begin, end in spans], axis=0)
    lift = lift / max(float(np.median(lift[inside])), 1e-9)
    told = []
    near = _near_ground(log, clock, lift, inside)
    if near is not None:
        forms, found = near
        log, largest_m = _without(log, clock, forms, inside, found)
        told.append(_told(found, largest_m, "range finder"))
    by_imu = all(log.has(name) for name in IMU)
    forms = _forms(log, clock)
    by_speed = _fitted(log, clock, forms, inside, None if by_imu else lift)
    if by_speed is not None:
        log, largest_m = _without(log, clock, forms, inside, by_speed)
        told.append(_told(by_speed, largest_m, "imu" if by_imu else "thrust"))
    return log, told


def _told(found: HeightError, largest_m: float, witness: str) -> Finding:
    return finding(
        Kind.HEIGHT_ERROR,
        witness=witness,
        largest_m=largest_m,
        coefficients=list(found.coefficients),
        std=list(found.std),
        frequency_rad_s=found.frequency_rad_s,
        difference_m_s2=None if witness == "range finder" else found.size,
    )


def _without(
    log: FlightLog, clock: Floats, forms: Floats, inside: np.ndarray, found: HeightError
) -> tuple[FlightLog, float]:
    """The log without the error, and the span of the error in flight, m."""
    height, climb, _ = _followed(forms, found.frequency_rad_s)
    by_m, by_m_s = (each @ np.array(found.coefficients) for each in (height, climb))
    columns = {
        "z_m": log["z_m"] - np.interp(log.time_s, clock, by_m - by_m[inside][0]),
        "vz_m_s": log["vz_m_s"] - np.interp(log.time_s, clock, by_m_s),
    }
    return replace(log, columns={**log.columns, **columns}), float(np.ptp(np.percentile(by_m[inside], (0.5, 99.5))))


def _near_ground(log: FlightLog, clock: Floats, lift: Floats, inside: np.ndarray) -> tuple[Floats, HeightError] | None:
    """Forms of errors near the ground, m, shape (n, 2), and the error of the height that a range finder tells."""
    if not (log.has("range_m") and log.has("baro_m")):
        return None
    lean = np.cos(np.radians(log["roll_deg"])) * np.cos(np.radians(log["pitch_deg"]))
    above = log["range_m"] * lean
    known = np.isfinite(above) & np.isfinite(log["z_m"]) & np.isfinite(log["baro_m"])
    seen = np.interp(clock, log.time_s, known) > 0.5
    if not known.any() or np.mean(seen[inside]) < SEEN:
        return None
    near, far = np.percentile(above[known], (3.0, 97.0))
    if near > LOW_M or far - near < STEEP_M:
        return None
    true, height, reading = (
        np.interp(clock, log.time_s[known], each[known]) for each in (above, log["z_m"], log["baro_m"])
    )
    forms = np.stack([lift * np.exp(-np.maximum(true, 0.0) / fade_m) for fade_m in FADES_M], axis=1)
    by_speed, climb = _forms(log, clock), on_clock(clock, log, "vz_m_s")
    rows = inside & seen

    def fitted(read: Floats, near: Floats, sides: Floats) -> tuple[float, Floats, Floats, float] | None:
        columns = np.column_stack([_quick(near), _quick(sides), _quick(climb)])[rows]
        return _regression(columns, _quick(read - true)[rows], len(FADES_M), clock[rows], 0.0)

    if fitted(reading, forms, by_speed) is None:  # the height errs for another reason
        return None
    best: tuple[float, HeightError] | None = None
    for frequency in FREQUENCIES_RAD_S:
        near_m, sides_m = (_followed(each, frequency)[0] for each in (forms, by_speed))
        found = fitted(height, near_m, sides_m)
        if found is not None and (best is None or found[0] < best[0]):
            left, value, std, _ = found
            span = float(np.ptp(near_m[rows] @ value))
            best = left, HeightError(frequency, tuple(value.tolist()), tuple(std.tolist()), span)
    return None if best is None or best[1].size < MATTERS_M else (forms, best[1])


def _forms(log: FlightLog, clock: Floats) -> Floats:
    """Errors of the reading for coefficients of 1, by the side to which the vehicle moves, m, shape (n, 4)."""
    attitude = quaternion_from_euler(*(np.radians(on_clock(clock, log, name, unwrap=True)) for name in ATTITUDE))
    north, east, up = (on_clock(clock, log, name) for name in VELOCITY)
    forward, right, _ = rotate_inverse(attitude, (north, east, -up))
    sides = [half(speed, 0.0) ** 2 for speed in (forward, right) for half in (np.maximum, np.minimum)]
    return -np.stack(sides, axis=1) / (2.0 * GRAVITY_M_S2)


def _followed(forms: Floats, frequency_rad_s: float) -> tuple[Floats, Floats, Floats]:
    """Errors of height, climb rate and its change of an estimator that follows these readings, each (n, k)."""
    from scipy.signal import lfilter  # heavy, and needed only where a height leans on a barometer

    w, parts = frequency_rad_s, max(round(frequency_rad_s * STEP_S * 5.0), 1)
    dt = STEP_S / parts
    step = np.array([[1.0 - 2.0 * DAMPING * w * dt - (w * dt) ** 2, dt], [-w * w * dt, 1.0]])
    push, whole = np.zeros(2), np.eye(2)
    for _ in range(parts):
        push = step @ push + [2.0 * DAMPING * w * dt + (w * dt) ** 2, w * w * dt]
        whole = step @ whole
    below = [1.0, -float(np.trace(whole)), float(np.linalg.det(whole))]
    of_height = [push[0], whole[0, 1] * push[1] - whole[1, 1] * push[0]]
    of_climb = [push[1], whole[1, 0] * push[0] - whole[0, 0] * push[1]]
    apart = forms - forms[0]
    height, climb = (np.asarray(lfilter(above, below, apart, axis=0)) for above in (of_height, of_climb))
    return height + forms[0], climb, np.gradient(climb, STEP_S, axis=0)


def _fitted(
    log: FlightLog, clock: Floats, forms: Floats, inside: np.ndarray, lift: Floats | None
) -> HeightError | None:
    """The error that the forms explain best; None where it is not clear, or of no matter."""
    up, others = _accelerations(log, clock, forms, lift)
    if not (np.all(np.isfinite(up)) and np.all(np.isfinite(forms)) and np.all(np.isfinite(others))):
        return None
    best: tuple[float, HeightError] | None = None
    for frequency in FREQUENCIES_RAD_S:
        *_, change = _followed(forms, frequency)
        columns = np.hstack([_quick(change), others])[inside]
        found = _regression(columns, up[inside], forms.shape[1], clock[inside], MATTERS_M_S2)
        if found is not None and (best is None or found[0] < best[0]):
            left, value, std, size = found
            best = left, HeightError(frequency, tuple(value.tolist()), tuple(std.tolist()), size)
    return None if best is None else best[1]


def _regression(
    columns: Floats, target: Floats, k: int, time_s: Floats, matters: float
) -> tuple[float, Floats, Floats, float] | None:
    """Mean square of the rest, the first `k` coefficients, their standard errors, and the size of their sum; None where
    they are not clear, or their sum is smaller than `matters`."""
    products, along = columns.T @ columns, columns.T @ target
    left = target - columns @ (np.linalg.pinv(products) @ along)
    if not left.any():  # made, not measured
        return None
    variance = float(np.mean(left**2)) * _alike(left)
    prior = np.diag(np.where(np.arange(len(products)) < k, variance / USUAL**2, 0.0))
    inverse = np.linalg.pinv(products + prior)
    value = inverse @ along
    left = target - columns @ value
    covariance = variance * inverse[:k, :k]
    wald = float(value[:k] @ np.linalg.pinv(covariance) @ value[:k])
    size = float(np.sqrt(np.mean((columns[:, :k] @ value[:k]) ** 2)))
    if wald < CLEAR or size < matters or not _foretells(columns, target, k, time_s):
        return None
    return float(np.mean(left**2)), value[:k], np.sqrt(np.maximum(np.diag(covariance), 0.0)), size


def _alike(left: Floats) -> float:
    """Number of neighbours that tell as much as one: twice the sum of the autocorrelation up to its first zero."""
    n, total = len(left), float(left @ left)
    sums = 1.0
    for lag in range(1, n // 10):
        share = float(left[lag:] @ left[:-lag]) / total
        if share <= 0.0:
            break
        sums += 2.0 * share
    return sums


def _foretells(columns: Floats, target: Floats, k: int, time_s: Floats) -> bool:
    """Tell whether each half of the flight, in blocks of time, foretells the other better with the first `k` columns
    than without."""
    half = np.floor(time_s / BLOCK_S).astype(int) % 2 == 0

    def squares(own: Floats, seen: np.ndarray) -> float:
        value = np.linalg.pinv(own[seen].T @ own[seen]) @ own[seen].T @ target[seen]
        return float(np.sum((target[~seen] - own[~seen] @ value) ** 2))

    return all(squares(columns, seen) < squares(columns[:, k:], seen) for seen in (half, ~half))


def _accelerations(log: FlightLog, clock: Floats, forms: Floats, lift: Floats | None) -> tuple[Floats, Floats]:
    """Quick part of the acceleration along up by the velocity, beyond that by the accelerometer where `lift` is None,
    and columns of what else may be in it."""
    attitude = quaternion_from_euler(*(np.radians(on_clock(clock, log, name, unwrap=True)) for name in ATTITUDE))
    climb = on_clock(clock, log, "vz_m_s")
    up = np.gradient(climb, STEP_S)
    if lift is None:
        force = [on_clock(clock, log, name) for name in IMU]
        north, east, down = (np.asarray(a) for a in rotate(attitude, (force[0], force[1], force[2])))
        sensed = -down - GRAVITY_M_S2
        return _quick(up - sensed), np.stack([_quick(each) for each in (sensed, north, east)], axis=1)
    x, y, z = (np.asarray(each) for each in rotate(attitude, (0.0, 0.0, -1.0)))
    push = -z * lift * GRAVITY_M_S2
    # Drag along the body's axes, and the flow along those of the rotors, have a part along up where the vehicle leans.
    leaning = x * on_clock(clock, log, "vx_m_s") + y * on_clock(clock, log, "vy_m_s")
    side_squared = -forms.sum(axis=1)
    height = on_clock(clock, log, "z_m")
    low = np.exp(-np.maximum(height - np.percentile(height, 1.0), 0.0) / NEAR_GROUND_M)
    others = (push, climb, leaning, lift * side_squared, side_squared, push * low, push * low**2)
    return _quick(up), np.stack([_quick(each) for each in others], axis=1)


def _quick(values: Floats) -> Floats:
    smooth = averaged(averaged(values.T, SMOOTHED_STEPS), SMOOTHED_STEPS)
    return np.asarray((smooth - averaged(smooth, round(0.5 * SLOW_S / STEP_S))).T)
