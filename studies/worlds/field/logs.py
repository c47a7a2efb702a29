"""Flight logs as loggers write them: jittered rows, held and delayed rotor speeds, missing and repeated rows."""

from pathlib import Path

import numpy as np

from studies.worlds.field.arrays import Floats, euler_deg
from studies.worlds.field.cases import Case, Flight
from studies.worlds.field.simulation import Track


def _row_times(rng: np.random.Generator, duration_s: float, rate_hz: float) -> Floats:
    """Times of rows with the jitter of a loop on a computer that does other things."""
    steps = (1.0 + np.clip(rng.normal(0.0, 0.07, int(duration_s * rate_hz)), -0.4, 0.4)) / rate_hz
    late = rng.random(len(steps)) < 0.004
    steps[late] += rng.uniform(0.5, 2.0, int(late.sum())) / rate_hz
    times = 0.06 + np.cumsum(steps)
    return np.asarray(times[times < duration_s - 0.06])


def _sample(track: Track, values: Floats, times: Floats) -> Floats:
    """Linear interpolation of recorded columns."""
    flat = values.reshape(len(values), -1)
    columns = [np.interp(times, track.time_s, flat[:, column]) for column in range(flat.shape[1])]
    return np.stack(columns, axis=1).reshape(len(times), *values.shape[1:])


def _held(times: Floats, rate_hz: float, start: float) -> Floats:
    """Time of the newest update at each row: a row takes a new value when the next update of the source is due."""
    latest = np.empty_like(times)
    due, current = start, times[0]
    for row, time in enumerate(times):
        if time >= due:
            current = time
            due += np.ceil((time - due) * rate_hz + 1e-9) / rate_hz
        latest[row] = current
    return latest


def log_table(case: Case, flight: Flight, track: Track) -> tuple[list[str], list[str], Floats]:
    """Columns, their formats and the rows of one flight's log (x north, y east, z up; degrees)."""
    rng = np.random.default_rng(flight.seed)
    sensing = case.sensing
    times = _row_times(rng, float(track.time_s[-1]), sensing.log_rate_hz)
    state_times = times if sensing.hold_rate_hz <= 0.0 else _held(times, sensing.hold_rate_hz, times[0])
    flip = np.array([1.0, 1.0, -1.0])
    roll, pitch, yaw = euler_deg(_sample(track, track.estimated_attitude, state_times))
    names = ["time_s", "x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s", "roll_deg", "pitch_deg", "yaw_deg"]
    names += ["roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s"]
    formats = ["%.4f"] + ["%.5f"] * 3 + ["%.4f"] * 3 + ["%.3f"] * 3 + ["%.4f"] * 3
    rates = _sample(track, track.estimated_rates_rad_s, state_times)
    parts = [
        times[:, None],
        _sample(track, track.estimated_position_m, state_times) * flip,
        _sample(track, track.estimated_velocity_m_s, state_times) * flip,
        np.stack([roll, pitch, yaw], axis=1),
        rates + rng.normal(0.0, 0.004, rates.shape) + rng.normal(0.0, 0.002, 3),
    ]
    delay = sensing.rotor_delay_s
    if sensing.rotor_columns:
        speeds = track.commanded_rpm if "motor_lag" in case.families else track.rpm
        first = times[0] + rng.uniform(0.0, 1.0 / sensing.rotor_rate_hz)
        updates = _held(times, sensing.rotor_rate_hz, first)
        shown = _sample(track, speeds, updates - delay)
        shown = np.round(shown / sensing.rpm_quantum) * sensing.rpm_quantum
        # Rows before the first message of the motor controllers have no rotor speeds.
        shown[times < first] = np.nan
        parts.append(shown)
        names += [f"motor{number + 1}_rpm" for number in range(case.vehicle.rotors)]
        formats += ["%.1f"] * case.vehicle.rotors
    if sensing.imu:
        force = _sample(track, track.specific_force_m_s2, times - sensing.imu_lag_s)
        trim = flight.trim_rad
        force = force - np.cross(np.broadcast_to(trim, force.shape), force)
        noise = rng.normal(0.0, sensing.imu_noise_m_s2, force.shape) * np.array([1.0, 1.0, 1.5])
        parts.append(force + noise + sensing.imu_bias_m_s2)
        names += ["imu_x_m_s2", "imu_y_m_s2", "imu_z_m_s2"]
        formats += ["%.4f"] * 3
    if sensing.battery_column:
        voltage = _sample(track, track.voltage_v, times) + rng.normal(0.0, 0.003 * case.vehicle.cells, len(times))
        parts.append(voltage[:, None])
        names.append("battery_v")
        formats.append("%.2f")
    if sensing.command_columns:
        thrust = _sample(track, track.thrust_command_n, times - delay)
        vehicle = case.vehicle
        parts.append(np.stack([thrust, vehicle.throttle_offset + vehicle.throttle_per_newton * thrust], axis=1))
        names += ["thrust_cmd_n", "throttle_cmd"]
        formats += ["%.5g", "%.4f"]
    table = np.concatenate(parts, axis=1)
    keep = rng.random(len(table)) >= sensing.missing_rows
    for _ in range(int(rng.integers(0, 3))):
        gap = rng.uniform(0.04, 0.96) * times[-1]
        keep &= ~((times > gap) & (times < gap + rng.uniform(0.1, 0.35)))
    keep[0] = True
    repeats = np.where(rng.random(len(table)) < sensing.repeated_rows, 2, 1)
    return names, formats, np.repeat(table[keep], repeats[keep], axis=0)


def write_log(path: Path, case: Case, flight: Flight, track: Track) -> None:
    """Write one flight's log."""
    names, formats, table = log_table(case, flight, track)
    line = ",".join(formats)
    rows = "\n".join(line % tuple(row) for row in table.tolist())
    path.write_text(",".join(names) + "\n" + rows + "\n")
