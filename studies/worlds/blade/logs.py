"""Logs: what a recorder writes of a flight, at its rates, with its delays, steps and gaps."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from studies.worlds.blade.flight import MEASURED, THROTTLE, TICK, Flight, Recording
from studies.worlds.blade.rotation import Array, euler
from studies.worlds.blade.vehicles import RPM


@dataclass(frozen=True)
class Recorder:
    """Recorder of one vehicle."""

    rate: float
    jitter: float
    """Standard deviation of the time between rows, as a share of it."""
    gaps: int
    rotor_rate: float
    rotor_delay: float
    rotor_step_rpm: float
    rotor_noise: float
    """Noise of measured rotor speeds, as a share of them."""
    accelerometer: bool
    accelerometer_cutoff_hz: float
    battery: bool
    reference: bool
    commands: bool


def draw_recorder(rng: np.random.Generator, hover_rpm: float, rotor_rates: tuple[float, float]) -> Recorder:
    """Recorder with rates as autopilots have them; rotor speeds arrive at a rate in the range."""
    rate = float(rng.choice([25.0, 30.0, 50.0, 50.0, 100.0]))
    rotor_rate = float(np.exp(rng.uniform(*np.log(rotor_rates))))
    return Recorder(
        rate=rate,
        jitter=float(rng.uniform(0.02, 0.12)),
        gaps=int(rng.choice([0, 0, 0, 1, 2])),
        rotor_rate=min(round(rotor_rate, 1), rate),
        rotor_delay=float(rng.uniform(0.002, 0.03)),
        rotor_step_rpm=float(round(hover_rpm * rng.choice([0.0005, 0.002, 0.004]), 1)),
        rotor_noise=float(rng.uniform(0.0005, 0.003)),
        accelerometer=bool(rng.random() < 0.55),
        accelerometer_cutoff_hz=float(rng.uniform(15.0, 40.0)),
        battery=bool(rng.random() < 0.7),
        reference=bool(rng.random() < 0.4),
        commands=bool(rng.random() < 0.6),
    )


def row_times(rng: np.random.Generator, recorder: Recorder, duration: float) -> Array:
    """Times of the rows, with jitter, and without those in gaps."""
    count = int((duration - 0.05) * recorder.rate)
    steps = np.maximum(rng.normal(1.0, recorder.jitter, count), 0.25) / recorder.rate
    times = 0.02 + np.cumsum(steps)
    for _ in range(recorder.gaps):
        start, length = rng.uniform(0.1, 0.9) * duration, rng.uniform(0.3, 1.5)
        times = times[(times < start) | (times > start + length)]
    kept: Array = times[times < duration - 0.02]
    return kept


def held(rng: np.random.Generator, times: Array, recorder: Recorder, duration: float) -> Array:
    """Ticks whose rotor speeds each row holds: the last telegram that has arrived."""
    sent = np.arange(0.0, duration, 1.0 / recorder.rotor_rate)
    sent = sent + rng.uniform(0.0, 0.2, len(sent)) / recorder.rotor_rate
    arrived = np.searchsorted(sent + recorder.rotor_delay, times, side="right") - 1
    ticks: Array = np.clip((sent[np.clip(arrived, 0, None)] / TICK).astype(int), 0, None)
    return ticks


def low_pass(values: Array, cutoff_hz: float) -> Array:
    """Values through a first-order filter at the ticks."""
    from scipy.signal import lfilter

    decay = np.exp(-2.0 * np.pi * cutoff_hz * TICK)
    first = np.asarray(values[:1], float) * decay
    filtered: Array = lfilter([1.0 - decay], [1.0, -decay], values.astype(float), axis=0, zi=first)[0]
    return filtered


def tabulate(rng: np.random.Generator, flight: Flight, recorder: Recorder, recording: Recording) -> dict[str, Array]:
    """Columns of the log, in files' axes and units."""
    tape = recording.columns
    duration = len(tape["position"]) * TICK
    times = row_times(rng, recorder, duration)
    at = np.clip((times / TICK).astype(int), 0, len(tape["position"]) - 1)
    up = np.array([1.0, 1.0, -1.0])
    vehicle = flight.vehicle
    columns: dict[str, Array] = {"time_s": times - times[0]}

    def add(names: str, values: Array) -> None:
        for name, value in zip(names.split(), np.atleast_2d(np.asarray(values, float).T), strict=True):
            columns[name] = value

    add("x_m y_m z_m", tape["position"][at] * up)
    add("vx_m_s vy_m_s vz_m_s", tape["velocity"][at] * up)
    add("roll_deg pitch_deg yaw_deg", np.degrees(euler(tape["attitude"][at].astype(float))))
    add("roll_rate_rad_s pitch_rate_rad_s yaw_rate_rad_s", low_pass(tape["rates"], 40.0)[at])
    if flight.source != THROTTLE:
        if flight.source == MEASURED:
            speeds = tape["speed"][held(rng, times, recorder, duration)] * RPM
            speeds = speeds * (1.0 + recorder.rotor_noise * _per_telegram(rng, speeds))
        else:
            speeds = tape["command"][at] * RPM
        step = max(recorder.rotor_step_rpm, 1.0)
        speeds = np.round(speeds.astype(float) / step) * step
        columns |= {f"motor{i + 1}_rpm": speeds[:, i] for i in range(vehicle.count)}
    if recorder.accelerometer:
        add("imu_x_m_s2 imu_y_m_s2 imu_z_m_s2", low_pass(tape["accelerometer"], recorder.accelerometer_cutoff_hz)[at])
    if recorder.battery:
        columns["battery_v"] = np.round(tape["voltage"][at, 0].astype(float) + rng.normal(0, 0.01, len(at)), 2)
    if recorder.commands or flight.source == THROTTLE:
        thrust = tape["thrust_command"][at, 0].astype(float)
        columns["thrust_cmd_n"] = thrust
        columns["throttle_cmd"] = np.clip(vehicle.throttle[1] + vehicle.throttle[0] * thrust, 0.0, 1.0)
        add("roll_cmd_deg pitch_cmd_deg yaw_cmd_deg", np.degrees(euler(tape["attitude_command"][at].astype(float))))
    if recorder.reference:
        add("x_ref_m y_ref_m z_ref_m", tape["goal"][at] * up)
        add("vx_ref_m_s vy_ref_m_s vz_ref_m_s", tape["goal_velocity"][at] * up)
    return columns


def _per_telegram(rng: np.random.Generator, speeds: Array) -> Array:
    """Noise that changes with each telegram and is held with it."""
    fresh = np.concatenate([[True], np.any(np.diff(speeds, axis=0) != 0, axis=1)])
    noise: Array = rng.standard_normal((int(fresh.sum()), speeds.shape[1]))[np.cumsum(fresh) - 1]
    return noise


def write_log(path: Path, columns: dict[str, Array]) -> None:
    """CSV of the columns."""
    decimals = {"time_s": 4, "battery_v": 2}
    formats = [f"%.{decimals.get(name, 1 if name.endswith('_rpm') else 5)}f" for name in columns]
    template = ",".join(formats)
    rows = np.column_stack(list(columns.values())).tolist()
    lines = [",".join(columns), *(template % tuple(row) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
