"""Records that are wrong, as real logs are: what happened stays, what the columns of its log say of it is distorted.

Each distortion is a function of the columns of one log. Sizes are those seen in public flight data: NanoBench (arXiv
2603.09908: channels that wander by tens of milliseconds, a pitch that is off by place), RAPTOR's, PX4's and ArduPilot's
logs (vibration, filters, packets, telemetry).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.signal import lfilter

from studies.worlds.borrowed.craft import Array
from studies.worlds.borrowed.sensors import Columns

PLACE = ("x_m", "y_m", "z_m")
VELOCITY = ("vx_m_s", "vy_m_s", "vz_m_s")
ATTITUDE = ("roll_deg", "pitch_deg", "yaw_deg")
RATES = ("roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s")
IMU = ("imu_x_m_s2", "imu_y_m_s2", "imu_z_m_s2")
FINE_S = 0.002
"""Step at which filters run, s."""
SHARE = 0.6
"""Probability of each flaw."""
WAVES = 12


@dataclass(frozen=True)
class Flaws:
    """Flaws of the record of one flight; what is 0 is not there."""

    pose: tuple[str, ...]
    """Columns that come in the packets of the pose."""
    delay_s: float = 0.0
    """Delay of the pose against rotor signal and IMU."""
    wander_s: float = 0.0
    """Amplitude by which that delay wanders."""
    velocity_lag_s: float = 0.0
    lean_deg: float = 0.0
    """Size of the attitude error by place."""
    lean_length_m: float = 1.5
    heading_deg: float = 0.0
    """Largest drift of the heading."""
    datum_m: float = 0.0
    accelerometer_bias_m_s2: tuple[float, float, float] = (0.0, 0.0, 0.0)
    accelerometer_scale: tuple[float, float, float] = (0.0, 0.0, 0.0)
    vibration_m_s2: float = 0.0
    gyro_lag_s: float = 0.0
    battery_lag_s: float = 0.0
    battery_noise: float = 0.0
    """Share of the voltage; so are the offset and the step."""
    battery_offset: float = 0.0
    battery_step: float = 0.0
    command_exponent: float = 0.0
    """Power of the voltage in the thrust of a recorded command."""
    repeated: float = 0.0
    """Share of the packets of the pose that are the one before."""
    between: int = 1
    """Rows for each packet of the pose, those between drawn by a straight line."""
    gaps_s: tuple[float, ...] = ()

    @property
    def also(self) -> list[str]:
        """Families that these columns show besides the physics: to name them is right, not to name them as well.

        A scale of accelerometers in flights near hover is a bias of gravity's axis.
        """
        biased = any((*self.accelerometer_bias_m_s2, *self.accelerometer_scale))
        return ["imu_bias"] * biased + ["battery_sag"] * bool(self.command_exponent)

    def content(self) -> dict[str, Any]:
        """Flaws as the truth says them."""
        return asdict(self)


def draw_flaws(
    count: int, *, outdoors: bool, radius_m: float, by_voltage: bool, rng: np.random.Generator
) -> list[Flaws]:
    """Flaws of the flights of a case, several at once: of the equipment the same in all, the delay of each its own.

    `by_voltage`: the command is recorded before the voltage acts on it. The height is off by centimetres, at most half
    a rotor radius.
    """

    def often(value: float) -> float:
        return value if rng.random() < SHARE else 0.0

    def either(low: float, high: float) -> float:
        return float(rng.uniform(low, high) * rng.choice([-1.0, 1.0]))

    way = rng.normal(size=3)
    bias = often(rng.uniform(0.05, 0.3)) * way / np.linalg.norm(way)
    scale = often(0.01) * rng.normal(size=3)
    battery = often(1.0)
    common: dict[str, Any] = {
        "pose": (*PLACE, *VELOCITY) if outdoors else (*PLACE, *VELOCITY, *ATTITUDE),
        "velocity_lag_s": often(rng.uniform(0.05, 0.15)),
        "lean_deg": 0.0 if outdoors else often(rng.uniform(0.6, 1.2)),
        "lean_length_m": rng.uniform(1.0, 2.0),
        "datum_m": often(min(0.5 * radius_m, 0.06) * either(0.3, 1.0)),
        "accelerometer_bias_m_s2": tuple(bias.tolist()),
        "accelerometer_scale": tuple(scale.tolist()),
        "vibration_m_s2": often(rng.uniform(0.5, 1.5)),
        "gyro_lag_s": often(rng.uniform(0.005, 0.015)),
        "battery_lag_s": battery * rng.uniform(0.5, 4.0),
        "battery_noise": battery * rng.uniform(0.002, 0.006),
        "battery_offset": battery * either(0.005, 0.02),
        "battery_step": battery * rng.uniform(0.004, 0.01),
        "command_exponent": rng.uniform(1.2, 2.0) if by_voltage else 0.0,
        "repeated": often(rng.uniform(0.03, 0.2)),
        "between": int(often(float(rng.integers(2, 4)))) or 1,
    }
    delayed, wanders = often(1.0), rng.random() < 0.4
    return [
        Flaws(
            **common,
            delay_s=delayed * rng.uniform(-0.04, 0.08),
            wander_s=delayed * wanders * rng.uniform(0.01, 0.03),
            heading_deg=often(either(1.0, 5.0)) if outdoors else 0.0,
            gaps_s=tuple(rng.uniform(0.1, 1.0, int(often(float(rng.integers(1, 5))))).tolist()),
        )
        for _ in range(count)
    ]


def distorted(columns: Columns, flaws: Flaws, field: int, rng: np.random.Generator) -> Columns:
    """Columns with all flaws, in the order in which they come about; `field`: seed of the attitude error by place."""
    out = lagged(columns, VELOCITY, flaws.velocity_lag_s)
    out = lagged(out, RATES, flaws.gyro_lag_s)
    out = leaning(out, flaws.lean_deg, flaws.lean_length_m, np.random.default_rng(field))
    out = turned(out, flaws.heading_deg, rng)
    out = out | {"z_m": out["z_m"] + flaws.datum_m}
    out = delayed(out, flaws.pose, wandering(out["time_s"], flaws.delay_s, flaws.wander_s, rng))
    out = shaken(out, flaws, rng)
    out = commanded(out, flaws.command_exponent)
    out = metered(out, flaws, rng)
    out = between_packets(out, flaws.pose, flaws.between)
    out = repeated(out, flaws.pose, flaws.repeated, rng)
    return cut(out, flaws.gaps_s, rng)


def lagged(columns: Columns, names: Sequence[str], lag_s: float) -> Columns:
    """Columns through a first-order low-pass, which starts settled."""
    if not lag_s:
        return columns
    t = columns["time_s"]
    fine, share = np.arange(t[0], t[-1] + FINE_S, FINE_S), 1.0 - np.exp(-FINE_S / lag_s)
    out = dict(columns)
    for name in names:
        x = np.interp(fine, t, columns[name])
        y, _ = lfilter([share], [1.0, share - 1.0], x, zi=(1.0 - share) * x[:1])
        out[name] = np.interp(t, fine, y)
    return out


def wandering(t: Array, delay_s: float, wander_s: float, rng: np.random.Generator) -> Array:
    """A delay at each time, s: constant, and a slow wave about it."""
    period, phase = rng.uniform(25.0, 60.0), rng.uniform(0.0, 2.0 * np.pi)
    return np.asarray(delay_s + wander_s * np.sin(2.0 * np.pi * t / period + phase))


def delayed(columns: Columns, names: Sequence[str], delay_s: Array) -> Columns:
    """Columns whose values at t are those of t minus the delay of that row."""
    t, out = columns["time_s"], dict(columns)
    for name in names:
        whole = np.unwrap(columns[name], period=360.0) if name in ATTITUDE else columns[name]
        out[name] = _wrapped(name, np.interp(t - delay_s, t, whole))
    return out


def _wrapped(name: str, values: Array) -> Array:
    return np.mod(values + 180.0, 360.0) - 180.0 if name == "yaw_deg" else values


def leaning(columns: Columns, size_deg: float, length_m: float, rng: np.random.Generator) -> Columns:
    """Roll and pitch with an error that is a smooth function of the place, of a size and a length.

    A Gaussian process by random cosines (Rahimi and Recht 2007, eq. 2). Its mean over the flight is left out: the
    vehicle is levelled, and what is the same everywhere would be a tilt of the thrust.
    """
    place, out = np.column_stack([columns[name] for name in PLACE]), dict(columns)
    for name in ATTITUDE[:2]:
        waves, phases = rng.normal(0.0, 1.0 / length_m, (3, WAVES)), rng.uniform(0.0, 2.0 * np.pi, WAVES)
        error = size_deg * np.sqrt(2.0 / WAVES) * np.sum(np.cos(place @ waves + phases), axis=1)
        out[name] = columns[name] + error - error.mean()
    return out


def turned(columns: Columns, size_deg: float, rng: np.random.Generator) -> Columns:
    """Heading that drifts away from 0 to at most a size, by a ramp and a slow wave."""
    t = columns["time_s"] - columns["time_s"][0]
    wave = np.sin(2.0 * np.pi * t / rng.uniform(30.0, 70.0))
    error = size_deg * (0.7 * t / t[-1] + 0.3 * wave)
    return columns | {"yaw_deg": _wrapped("yaw_deg", columns["yaw_deg"] + error)}


def shaken(columns: Columns, flaws: Flaws, rng: np.random.Generator) -> Columns:
    """Accelerometers with bias, scale and vibration, where the log has them."""
    out = dict(columns)
    for name, bias, scale in zip(IMU, flaws.accelerometer_bias_m_s2, flaws.accelerometer_scale, strict=True):
        if name in columns:
            noise = rng.normal(0.0, flaws.vibration_m_s2, len(columns[name]))
            out[name] = columns[name] * (1.0 + scale) + bias + noise
    return out


def commanded(columns: Columns, exponent: float) -> Columns:
    """Throttle as it is commanded where the voltage acts on it later: more, as the battery sinks from its first."""
    if not exponent or "throttle_cmd" not in columns:
        return columns
    volts = columns["battery_v"]
    return columns | {"throttle_cmd": columns["throttle_cmd"] * (np.median(volts[:20]) / volts) ** exponent}


def metered(columns: Columns, flaws: Flaws, rng: np.random.Generator) -> Columns:
    """Battery voltage filtered, off, with noise, in steps."""
    volts = columns["battery_v"]
    nominal = float(np.median(volts))
    slow = lagged(columns, ["battery_v"], flaws.battery_lag_s)["battery_v"]
    read = slow + nominal * (flaws.battery_offset + rng.normal(0.0, flaws.battery_noise, len(volts)))
    step = nominal * flaws.battery_step
    return columns | {"battery_v": np.round(read / step) * step if step else read}


def between_packets(columns: Columns, names: Sequence[str], rows: int) -> Columns:
    """Columns that are known in one of so many rows, and a straight line in the others."""
    t, out = columns["time_s"], dict(columns)
    for name in names:
        whole = np.unwrap(columns[name], period=360.0) if name in ATTITUDE else columns[name]
        out[name] = _wrapped(name, np.interp(t, t[::rows], whole[::rows]))
    return out


def repeated(columns: Columns, names: Sequence[str], share: float, rng: np.random.Generator) -> Columns:
    """Columns that keep the row before in a share of the rows, all at once."""
    fresh = rng.random(len(columns["time_s"])) >= share
    fresh[0] = True
    source = np.maximum.accumulate(np.where(fresh, np.arange(len(fresh)), 0))
    return columns | {name: columns[name][source] for name in names}


def cut(columns: Columns, gaps_s: Sequence[float], rng: np.random.Generator) -> Columns:
    """Rows without those of gaps at random times."""
    t = columns["time_s"]
    starts = rng.uniform(t[0] + 2.0, t[-1] - 3.0, len(gaps_s))
    keep = np.ones(len(t), dtype=bool)
    for start, length in zip(starts, gaps_s, strict=True):
        keep &= (t < start) | (t > start + length)
    return {name: values[keep] for name, values in columns.items()}
