"""Estimator, sensors and logger: from what happened to the columns of a log, with ordinary imperfections."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import bilinear, lfilter
from scipy.spatial.transform import Rotation

from studies.worlds.borrowed.craft import GRAVITY_M_S2, RPM, Array, Craft
from studies.worlds.borrowed.flight import TICK_S, Record, drift

Columns = dict[str, Array]


@dataclass(frozen=True)
class Equipment:
    """Sensors and logger of a case: the same in all its flights."""

    outdoors: bool
    """Satellites; motion capture otherwise."""
    source: str
    """Source of the thrust: `speeds`, `outputs` or `throttle`."""
    imu: bool
    log_hz: float
    rpm_hz: float
    rpm_delay_s: float
    rpm_step: float
    velocity_lag_s: float
    attitude_lag_s: float
    imu_lag_s: float
    mount: Array
    """Rotation vector from the thrust frame to the frame that is logged."""
    lean: float
    """Attitude error by acceleration, rad."""
    attitude_drift: float
    imu_noise: float
    jitter: float


def equip(outdoors: bool, source: str, imu: bool, quick: bool, rng: np.random.Generator) -> Equipment:
    """Equipment with imperfections drawn at random; `quick`: telemetry of the rotors fast enough for moments."""
    turn, trim = rng.uniform(0, 2 * np.pi), np.radians(rng.uniform(0.05, 0.4))
    return Equipment(
        outdoors=outdoors,
        source=source,
        imu=imu,
        log_hz=float(rng.choice([50, 60, 80, 100] if quick else [20, 25, 40, 50, 80, 100])),
        rpm_hz=float(rng.choice([40.0, 50.0] if quick else [8.0, 10.0, 15.0, 20.0, 25.0, 50.0])),
        rpm_delay_s=rng.uniform(0.0, 0.02 if quick else 0.04),
        rpm_step=float(rng.choice([0.0005, 0.001, 0.002])),
        velocity_lag_s=rng.uniform(0.0, 0.04),
        attitude_lag_s=rng.uniform(0.0, 0.015),
        imu_lag_s=rng.uniform(0.0, 0.01),
        mount=np.array([trim * np.cos(turn), trim * np.sin(turn), np.radians(rng.normal(0, 0.5))]),
        lean=np.radians(rng.uniform(0.1, 0.3) if outdoors else rng.uniform(0.05, 0.15)),
        attitude_drift=np.radians(rng.uniform(0.06, 0.15) if outdoors else rng.uniform(0.03, 0.08)),
        imu_noise=rng.uniform(0.03, 0.1),
        jitter=rng.uniform(0.01, 0.08),
    )


def low_pass(values: Array, time_s: float) -> Array:
    """First-order lag along the rows, starting settled."""
    share = 1.0 - np.exp(-TICK_S / time_s)
    out, _ = lfilter([share], [1.0, share - 1.0], values, axis=0, zi=(1.0 - share) * values[:1])
    return np.asarray(out)


def attitude_error(record: Record, kit: Equipment, rng: np.random.Generator) -> Array:
    """Error of the estimated attitude: a complementary filter that takes part of each acceleration for a tilt."""
    a = record.acceleration
    apparent = np.stack([-a[:, 1], a[:, 0], np.zeros(len(a))], axis=1) / GRAVITY_M_S2
    pulled = low_pass(apparent, rng.uniform(1.5, 6.0))
    size = float(np.sqrt(np.mean(np.sum(pulled**2, axis=1))))
    walk = drift(rng, len(a), TICK_S, 15.0, kit.attitude_drift)
    walk[:, 2] = drift(rng, len(a), TICK_S, 30.0, np.radians(1.0 if kit.outdoors else 0.3), 1)[:, 0]
    return np.asarray(pulled * min(kit.lean / max(size, 1e-6), 0.6) + walk)


def navigation_error(record: Record, lean: Array, kit: Equipment, rng: np.random.Generator) -> tuple[Array, Array]:
    """Errors of position and velocity of an error-state filter on accelerometers, with three equal poles."""
    rows = len(lean)
    force = record.acceleration - np.array([0.0, 0.0, GRAVITY_M_S2])
    wrong = np.cross(lean, force) + drift(rng, rows, TICK_S, 40.0, 0.04) + rng.normal(0, 0.3, (rows, 3))
    if kit.outdoors:
        w, hold = rng.uniform(0.8, 1.3), 25
        seen = drift(rng, rows, TICK_S, rng.uniform(15, 30), rng.uniform(0.1, 0.25)) * np.array([1, 1, 1.2])
        white = rng.normal(0, 0.02, (rows // hold + 1, 3))
    else:
        w, hold = rng.uniform(12.0, 20.0), 1
        seen = drift(rng, rows, TICK_S, 20.0, 0.0005)
        white = rng.normal(0, rng.uniform(0.0002, 0.0006), (rows // hold + 1, 3))
    seen = seen + np.repeat(white, hold, axis=0)[:rows]
    seen = seen - seen[0]
    poles = np.array([1.0, 3 * w, 3 * w**2, w**3])

    def passed(numerator: list[float], signal: Array) -> Array:
        b, a = bilinear(numerator, poles, 1.0 / TICK_S)
        return np.asarray(lfilter(b, a, signal, axis=0))

    position = passed([1.0, 0.0], wrong) + passed([3 * w, 3 * w**2, w**3], seen)
    velocity = passed([1.0, 3 * w, 0.0], wrong) + passed([3 * w**2, w**3, 0.0], seen)
    return position, velocity


def _at(values: Array, times: Array) -> Array:
    """Values of the record's rows at other times."""
    place = np.clip(times / TICK_S, 0.0, len(values) - 1.001)
    low = place.astype(np.int64)
    share = (place - low)[:, None]
    return np.asarray(values[low] * (1.0 - share) + values[low + 1] * share)


def _held(values: Array, times: Array, rate_hz: float, delay_s: float, rng: np.random.Generator) -> Array:
    """Latest samples of a slower sensor that have arrived."""
    phase = rng.uniform(0.0, 1.0 / rate_hz)
    return _at(values, np.floor((times - delay_s - phase) * rate_hz) / rate_hz + phase)


def _log_times(end_s: float, kit: Equipment, rng: np.random.Generator) -> Array:
    """Times of the rows: jitter, and a few small gaps."""
    times = np.arange(0.3, end_s - 0.1, 1.0 / kit.log_hz)
    times = times + np.clip(rng.normal(0, kit.jitter, len(times)), -0.3, 0.3) / kit.log_hz
    keep = rng.random(len(times)) > 0.001
    for _ in range(rng.integers(0, 4)):
        start = rng.uniform(2.0, end_s - 2.0)
        keep &= (times < start) | (times > start + rng.uniform(0.05, 0.4))
    return np.asarray(times[keep])


def euler(rotation: Array) -> Array:
    """Roll, pitch and yaw, continuous in time."""
    return np.unwrap(Rotation.from_matrix(rotation).as_euler("ZYX")[:, ::-1], axis=0)


def log_columns(
    record: Record, bias: Array, craft: Craft, kit: Equipment, rng: np.random.Generator
) -> tuple[Columns, float]:
    """Columns of one flight's log, by accelerometers with a bias, and when it begins."""
    rows = len(record.position)
    lean = attitude_error(record, kit, rng)
    position_error, velocity_error = navigation_error(record, lean, kit, rng)
    frame = Rotation.from_rotvec(lean) * Rotation.from_matrix(record.rotation) * Rotation.from_rotvec(kit.mount)
    t = _log_times((rows - 1) * TICK_S, kit, rng)
    up = np.array([1.0, 1.0, -1.0])
    attitude = np.degrees(_at(euler(frame.as_matrix()), t - kit.attitude_lag_s)) + rng.normal(0, 0.02, (len(t), 3))
    attitude[:, 2] = np.mod(attitude[:, 2] + 180.0, 360.0) - 180.0
    rates = _at(record.rates, t - 0.5 * kit.attitude_lag_s) + rng.normal(0, 0.01, (len(t), 3)) + rng.normal(0, 0.003, 3)
    groups = [
        ("{}_m", "xyz", _at(record.position + position_error, t) * up),
        ("v{}_m_s", "xyz", _at(record.velocity + velocity_error, t - kit.velocity_lag_s) * up),
        ("{}_deg", ("roll", "pitch", "yaw"), attitude),
        ("{}_rate_rad_s", ("roll", "pitch", "yaw"), rates),
    ]
    if kit.imu:
        force = record.acceleration - np.array([0.0, 0.0, GRAVITY_M_S2])
        force = low_pass(np.einsum("nji,nj->ni", record.rotation, force), 0.008)
        read = (
            _at(force, t - kit.imu_lag_s) + bias + rng.normal(0, 0.015, 3) + rng.normal(0, kit.imu_noise, (len(t), 3))
        )
        groups.append(("imu_{}_m_s2", "xyz", read))
    out: Columns = {"time_s": t - t[0]}
    for title, axes, values in groups:
        out |= {title.format(axis): values[:, i] for i, axis in enumerate(axes)}
    out |= _thrust_columns(record, craft, kit, t, rng)
    volts = _held(record.voltage[:, None], t, 5.0, 0.05, rng)[:, 0]
    out["battery_v"] = np.round(volts * (1 + rng.normal(0, 0.0008, len(t))), 2 if craft.kind.cells > 1 else 3)
    return out, float(t[0])


def _thrust_columns(record: Record, craft: Craft, kit: Equipment, t: Array, rng: np.random.Generator) -> Columns:
    """Columns that tell the thrust."""
    if kit.source == "speeds":
        speeds = _held(record.rpm, t, kit.rpm_hz, kit.rpm_delay_s, rng)
        speeds = speeds * (1.0 + rng.normal(0, 0.001, speeds.shape))
        step = kit.rpm_step * craft.hover_rad_s * RPM
        return {f"motor{i + 1}_rpm": np.round(speeds[:, i] / step) * step for i in range(craft.count)}
    command = _at(record.command_n, t - 0.004)
    if kit.source == "outputs":
        # Shares of the full range, each rotor on the vehicle's throttle line: their mean is the throttle.
        shares = np.round(craft.throttle_offset + craft.throttle_per_newton * craft.count * command, 4)
        return {f"motor{i + 1}_output": shares[:, i] for i in range(craft.count)}
    return {"throttle_cmd": np.round(craft.throttle_offset + craft.throttle_per_newton * command.sum(axis=1), 4)}
