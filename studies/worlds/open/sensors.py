"""Estimator, sensors and logger: from what happened to the columns of a log, with ordinary imperfections."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import bilinear, lfilter
from scipy.spatial.transform import Rotation

from studies.worlds.open.control import euler
from studies.worlds.open.effects import Hidden
from studies.worlds.open.noise import drift, low_pass
from studies.worlds.open.simulate import RECORD_S, Record, rotations
from studies.worlds.open.vehicles import GRAVITY_M_S2, Array, Craft

Columns = dict[str, Array]


@dataclass(frozen=True)
class Equipment:
    """Sensors and logger of a case: the same in all its flights."""

    place: str  # room and hall: motion capture; field: satellites
    source: str  # of the thrust: speeds, setpoints, outputs or throttle
    imu: bool
    extras: bool  # references and commands are logged, too
    log_hz: float
    rpm_hz: float
    rpm_delay_s: float
    rpm_step: float
    velocity_lag_s: float
    attitude_lag_s: float
    imu_lag_s: float
    mount: Array  # rotation vector from the thrust frame to the frame that is logged
    lean: float  # aim of the attitude error by acceleration, rad
    attitude_drift: float
    imu_noise: float
    jitter: float


def equip(place: str, source: str, imu: bool, quick: bool, slow: bool, rng: np.random.Generator) -> Equipment:
    """Equipment with imperfections drawn at random; telemetry of the rotors fast enough for moments, or slow."""
    field = place == "field"
    turn = rng.uniform(0, 2 * np.pi)
    trim = np.radians(rng.uniform(0.05, 0.4))
    log_hz = float(rng.choice([50, 60, 80, 100] if quick else [20, 25, 40, 50, 80, 100]))
    rates = [40.0, 50.0] if quick else [3.0, 4.0, 5.0] if slow else [8.0, 10.0, 15.0, 20.0, 25.0, 50.0]
    return Equipment(
        place=place,
        source=source,
        imu=imu,
        extras=bool(rng.random() < 0.5),
        log_hz=log_hz,
        rpm_hz=float(rng.choice(rates)),
        rpm_delay_s=rng.uniform(0.0, 0.02 if quick else 0.04),
        rpm_step=float(rng.choice([0.0005, 0.001, 0.002])),
        velocity_lag_s=rng.uniform(0.0, 0.04),
        attitude_lag_s=rng.uniform(0.0, 0.015),
        imu_lag_s=rng.uniform(0.0, 0.01),
        mount=np.array([trim * np.cos(turn), trim * np.sin(turn), np.radians(rng.normal(0, 0.5))]),
        lean=np.radians(rng.uniform(0.1, 0.3) if field else rng.uniform(0.05, 0.15)),
        attitude_drift=np.radians(rng.uniform(0.06, 0.15) if field else rng.uniform(0.03, 0.08)),
        imu_noise=rng.uniform(0.03, 0.1),
        jitter=rng.uniform(0.01, 0.08),
    )


def attitude_error(record: Record, kit: Equipment, rng: np.random.Generator) -> Array:
    """Error of the estimated attitude: a complementary filter that takes part of each acceleration for a tilt."""
    a = record.acceleration
    apparent = np.stack([-a[:, 1], a[:, 0], np.zeros(len(a))], axis=1) / GRAVITY_M_S2
    pulled = low_pass(apparent, RECORD_S, rng.uniform(1.5, 6.0))
    size = float(np.sqrt(np.mean(np.sum(pulled**2, axis=1))))
    walk = drift(rng, len(a), RECORD_S, 15.0, kit.attitude_drift)
    walk[:, 2] = drift(rng, len(a), RECORD_S, 30.0, np.radians(1.0 if kit.place == "field" else 0.3), 1)[:, 0]
    return np.asarray(pulled * min(kit.lean / max(size, 1e-6), 0.6) + walk)


def navigation_error(record: Record, lean: Array, kit: Equipment, rng: np.random.Generator) -> tuple[Array, Array]:
    """Errors of position and velocity of an error-state filter on accelerometers, with three equal poles."""
    rows = len(lean)
    force = record.acceleration - np.array([0.0, 0.0, GRAVITY_M_S2])
    wrong = np.cross(lean, force) + drift(rng, rows, RECORD_S, 40.0, 0.04) + rng.normal(0, 0.3, (rows, 3))
    if kit.place == "field":
        w, hold = rng.uniform(0.8, 1.3), 40
        seen = drift(rng, rows, RECORD_S, rng.uniform(15, 30), rng.uniform(0.1, 0.25)) * np.array([1, 1, 1.2])
        white = rng.normal(0, 0.02, (rows // hold + 1, 3))
    else:
        w, hold = rng.uniform(12.0, 20.0), 2
        seen = drift(rng, rows, RECORD_S, 20.0, 0.0005)
        white = rng.normal(0, rng.uniform(0.0002, 0.0006), (rows // hold + 1, 3))
    seen = seen + np.repeat(white, hold, axis=0)[:rows]
    poles = np.array([1.0, 3 * w, 3 * w**2, w**3])

    def passed(numerator: list[float], signal: Array) -> Array:
        b, a = bilinear(numerator, poles, 1.0 / RECORD_S)
        return np.asarray(lfilter(b, a, signal, axis=0))

    seen = seen - seen[0]
    position = passed([1.0, 0.0], wrong) + passed([3 * w, 3 * w**2, w**3], seen)
    velocity = passed([1.0, 3 * w, 0.0], wrong) + passed([3 * w**2, w**3, 0.0], seen)
    return position, velocity


def _at(values: Array, times: Array) -> Array:
    """Values of 200 Hz rows at other times."""
    place = np.clip(times / RECORD_S, 0.0, len(values) - 1.001)
    low = place.astype(np.int64)
    share = (place - low)[:, None]
    return np.asarray(values[low] * (1.0 - share) + values[low + 1] * share)


def _held(values: Array, times: Array, rate_hz: float, delay_s: float, rng: np.random.Generator) -> Array:
    """Latest samples of a slower sensor that have arrived."""
    phase = rng.uniform(0.0, 1.0 / rate_hz)
    taken = np.floor((times - delay_s - phase) * rate_hz) / rate_hz + phase
    return _at(values, taken)


def _log_times(end_s: float, kit: Equipment, rng: np.random.Generator) -> Array:
    """Times of the rows: jitter, and a few small gaps."""
    times = np.arange(0.3, end_s - 0.1, 1.0 / kit.log_hz)
    times = times + np.clip(rng.normal(0, kit.jitter / kit.log_hz, len(times)), -0.3 / kit.log_hz, 0.3 / kit.log_hz)
    keep = rng.random(len(times)) > 0.001
    for _ in range(rng.integers(0, 4)):
        start = rng.uniform(2.0, end_s - 2.0)
        keep &= (times < start) | (times > start + rng.uniform(0.05, 0.4))
    return np.asarray(times[keep])


def log_columns(
    record: Record, hidden: Hidden, craft: Craft, kit: Equipment, rng: np.random.Generator
) -> tuple[Columns, float]:
    """Columns of one flight's log, and when it begins."""
    rows = len(record.position)
    lean = attitude_error(record, kit, rng)
    position_error, velocity_error = navigation_error(record, lean, kit, rng)
    body = rotations(record.quaternion)
    frame = Rotation.from_rotvec(lean) * Rotation.from_matrix(body) * Rotation.from_rotvec(kit.mount)
    angles = np.unwrap(euler(frame.as_matrix()), axis=0)
    t = _log_times((rows - 1) * RECORD_S, kit, rng)
    up = np.array([1.0, 1.0, -1.0])
    position = _at(record.position + position_error, t) * up
    velocity = _at(record.velocity + velocity_error, t - kit.velocity_lag_s) * up
    attitude = np.degrees(_at(angles, t - kit.attitude_lag_s)) + rng.normal(0, 0.02, (len(t), 3))
    attitude[:, 2] = np.mod(attitude[:, 2] + 180.0, 360.0) - 180.0
    rates = _at(record.rates, t - 0.5 * kit.attitude_lag_s) + rng.normal(0, 0.01, (len(t), 3)) + rng.normal(0, 0.003, 3)
    out: Columns = {"time_s": t - t[0]}
    for i, axis in enumerate("xyz"):
        out[f"{axis}_m"] = position[:, i]
    for i, axis in enumerate("xyz"):
        out[f"v{axis}_m_s"] = velocity[:, i]
    for i, axis in enumerate(("roll", "pitch", "yaw")):
        out[f"{axis}_deg"] = attitude[:, i]
    for i, axis in enumerate(("roll", "pitch", "yaw")):
        out[f"{axis}_rate_rad_s"] = rates[:, i]
    out.update(_thrust_columns(record, craft, kit, t, rng))
    if kit.imu:
        force = np.einsum("nji,nj->ni", body, record.acceleration - np.array([0.0, 0.0, GRAVITY_M_S2]))
        force = low_pass(force, RECORD_S, 0.008)
        bias = rng.normal(0, 0.015, 3) + hidden.imu_bias_m_s2
        read = _at(force, t - kit.imu_lag_s) + bias + rng.normal(0, kit.imu_noise, (len(t), 3))
        for i, axis in enumerate("xyz"):
            out[f"imu_{axis}_m_s2"] = read[:, i]
    volts = _held(record.voltage[:, None], t, 5.0, 0.05, rng)[:, 0]
    out["battery_v"] = np.round(volts * (1 + rng.normal(0, 0.0008, len(t))), 2 if craft.cells > 1 else 3)
    return out, float(t[0])


def _thrust_columns(record: Record, craft: Craft, kit: Equipment, t: Array, rng: np.random.Generator) -> Columns:
    """Columns that tell the thrust, and the commands where they are logged, too."""
    out: Columns = {}
    total = _at(record.command.sum(axis=1, keepdims=True), t - 0.005)[:, 0]
    if kit.source == "speeds":
        for i in range(craft.count):
            speed = _held(record.rpm[:, i : i + 1], t, kit.rpm_hz, kit.rpm_delay_s, rng)[:, 0]
            speed = speed * (1.0 + rng.normal(0, 0.001, len(t)))
            step = kit.rpm_step * craft.hover_rpm
            out[f"motor{i + 1}_rpm"] = np.round(speed / step) * step
    elif kit.source == "setpoints":
        speeds = np.sqrt(_at(record.command, t - 0.003) / craft.thrust_n_per_rpm2)
        out = {f"motor{i + 1}_rpm": np.asarray(np.round(speeds[:, i]), dtype=np.float64) for i in range(craft.count)}
    elif kit.source == "outputs":
        # Shares of the full range, each rotor on the vehicle's throttle line: their mean is the throttle.
        slope = craft.throttle_per_newton * craft.count
        shares = craft.throttle_offset + slope * _at(record.command, t - 0.003)
        out = {f"motor{i + 1}_output": np.round(shares[:, i], 4) for i in range(craft.count)}
    else:
        out["throttle_cmd"] = np.round(craft.throttle_offset + craft.throttle_per_newton * total, 4)
    if kit.extras and kit.source != "throttle":
        out["thrust_cmd_n"] = total
    if kit.extras:
        wanted = np.degrees(_at(np.unwrap(record.angles, axis=0), t - 0.005))
        out["roll_cmd_deg"], out["pitch_cmd_deg"] = wanted[:, 0], wanted[:, 1]
    return out
