"""Readings of the sensors of the height in a log, and a reference that does not lean on them."""

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from quadctl.effects.sensor_error import SensorConditions
from quadctl.frames import GRAVITY_M_S2, Quaternion, quaternion_from_euler, rotate, rotate_inverse
from quadctl.lab.arrays import Floats
from quadctl.logs.findings import Kind, of_kind
from quadctl.logs.flight_log import ATTITUDE, VELOCITY, FlightLog
from quadctl.logs.record.flight_time import thrust_drive, within
from quadctl.logs.record.height_error import leans_on_barometer
from quadctl.logs.record.record import Record, examine
from quadctl.numeric import Vector

READINGS = {"barometer": "baro_m", "rangefinder": "range_m"}
"""Columns of the sensors."""
BIN_S = 0.5
"""Time over which readings are averaged: errors of the sensors' filters and delays average out, those of effects do
not."""
LEAST_BINS = 40
"""Bins with reading and reference below which nothing is told."""
LEAST_SHARE = 0.5
"""Share of the flight that a reference must cover."""
TRIM_M_S2 = 0.09
"""Standard error of the horizontal force by the lean: half a degree of the autopilot's level."""
UNKNOWN_WIND_M_S = 2.0
"""Standard deviation of a wind of which the flight says nothing."""
CLEAR = 5.0
"""Standard errors by which drag must differ from zero to tell a wind."""


class Reference(StrEnum):
    """Heights that do not lean on the sensor in question."""

    POSITION = "position"
    """The log's position, by motion capture or vision."""
    RANGE = "range finder"
    DOPPLER = "GPS climb rate"
    """Integrated."""
    ESTIMATE = "estimated height"
    """Without what the barometer did to it; beside GPS only, which tells whether it is true."""


SOUGHT = (Reference.POSITION, Reference.RANGE, Reference.DOPPLER)
"""References that a log may hold by themselves."""


class NoReference(StrEnum):
    """Reasons why a log has no reference for a barometer."""

    NONE = "none"
    LEANS = "leans"
    """The position's height is that of an estimator that takes it from the barometer."""


class Estimated(NamedTuple):
    """Height by the estimator, and what it took from other sensors to correct it."""

    height_m: Floats
    followed_m_s: Floats
    """Reading minus this height, integrated once and twice over time (m s, m s^2), about the mean, shape (n, 2)."""
    apart_m_s: Floats
    """Reference minus this height, integrated over time."""


@dataclass(frozen=True)
class Heights:
    """Reading of a sensor beside a reference, in bins of the time in flight."""

    name: str
    """Name of the log."""
    sensor: str
    reference: Reference
    time_s: Floats
    reading_m: Floats
    true_m: Floats
    """By the reference."""
    climb_m_s: Floats
    velocity_m_s: tuple[Floats, Floats, Floats]
    """Over ground, NED."""
    attitude: Quaternion
    above_ground_m: Floats
    thrust_share: Floats
    temperature_k: Floats
    wind_ne_m_s: tuple[float, float]
    """As the lean and the drag tell it."""
    wind_std_m_s: float
    sample_std_m: float
    """Scatter of single readings about the mean of their bin."""
    hover_throttle: float
    """Middle throttle; NaN where none is logged."""
    estimated: Estimated | None = None
    """Beside GPS, where the estimated height leans on the barometer."""
    nuisances: Floats | None = None
    """Nuisances that may be in the difference, shape (n, m)."""

    @property
    def difference_m(self) -> Floats:
        """Reading minus reference, about their middle."""
        difference = self.reading_m - self.true_m
        return difference - np.median(difference)

    def conditions(self, wind_ne_m_s: tuple[float, float]) -> SensorConditions:
        """Conditions of the sensor in a wind."""
        north, east, down = self.velocity_m_s
        relative = (north - wind_ne_m_s[0], east - wind_ne_m_s[1], down)
        return SensorConditions(
            self.above_ground_m,
            rotate_inverse(self.attitude, relative),
            self.attitude,
            self.thrust_share,
            self.time_s - self.time_s[0],
            self.temperature_k,
        )


def references(log: FlightLog, sensor: str) -> tuple[dict[Reference, Floats], NoReference]:
    """Heights that do not lean on the sensor, at the log's rows, the best first; and the reason where there is none."""
    found: dict[Reference, Floats] = {}
    leans = leans_on_barometer(log.meta.get("parameters", {}), str(log.meta.get("autopilot", "")))
    if not leans and log.has("z_m"):
        found[Reference.POSITION] = log["z_m"]
    if sensor != "rangefinder" and log.has("range_m"):
        found[Reference.RANGE] = log["range_m"] * _cos_tilt(log)
    if log.has("gps_vz_m_s"):
        found[Reference.DOPPLER] = _integrated(log.time_s, log["gps_vz_m_s"])
    return found, NoReference.LEANS if leans else NoReference.NONE


def heights(log: FlightLog, sensor: str) -> Heights | NoReference:
    """The sensor beside the best reference that covers the flight; the reason where there is none."""
    if not log.has(READINGS[sensor]):
        return NoReference.NONE
    record = examine(log)
    if of_kind(record.findings, Kind.HEIGHT_ERROR):  # which is what is looked for here
        as_logged = {name: np.interp(record.log.time_s, log.time_s, log[name]) for name in ("z_m", "vz_m_s")}
        record = replace(record, log=replace(record.log, columns={**record.log.columns, **as_logged}))
    known, reason = references(record.log, sensor)
    for kind, true_m in known.items():
        found = _binned(record, sensor, kind, true_m)
        if found is not None:
            return found
    return reason


def _binned(record: Record, sensor: str, kind: Reference, true_m: Floats) -> Heights | None:
    log = record.log
    flying = within(log.time_s, record.flights)
    if not flying.any():
        return None
    begin = float(log.time_s[flying][0])
    number = np.floor((log.time_s - begin) / BIN_S).astype(int)
    number[~flying] = -1
    n_bins = int(number.max()) + 1

    def mean(values: Floats) -> Floats:
        known = (number >= 0) & np.isfinite(values)
        count = np.bincount(number[known], minlength=n_bins)
        total = np.bincount(number[known], values[known], minlength=n_bins)
        return np.asarray(np.where(count > 0, total / np.maximum(count, 1), np.nan), dtype=np.float64)

    reading = mean(log["baro_m"] if sensor == "barometer" else log["range_m"] * _cos_tilt(log))
    roll, pitch, yaw = (mean(np.unwrap(np.nan_to_num(log[name]), period=360.0)) for name in ATTITUDE)
    north, east, up = (mean(log[name]) for name in VELOCITY)
    drive = thrust_drive(log, record.thrust_source)
    share = np.ones(n_bins) if drive is None else mean(drive)
    by_range = sensor != "rangefinder" and log.has("range_m")
    above = mean(_above_rest(log["range_m"] * _cos_tilt(log) if by_range else log["z_m"], flying, by_range))
    temperature = mean(log["baro_temperature_c"]) if log.has("baro_temperature_c") else np.zeros(n_bins)
    true = mean(true_m)
    rows = (
        np.isfinite(reading) & np.isfinite(true) & np.isfinite(roll + pitch + yaw + north + east + up + share + above)
    )
    covered = np.isfinite(true).sum() / max(np.isfinite(reading).sum(), 1)
    if rows.sum() < LEAST_BINS or covered < LEAST_SHARE:
        return None
    attitude = quaternion_from_euler(*np.radians([roll[rows], pitch[rows], yaw[rows]]))
    velocity: tuple[Floats, Floats, Floats] = (north[rows], east[rows], -up[rows])
    time = np.asarray(begin + BIN_S * (np.flatnonzero(rows) + 0.5), dtype=np.float64)
    wind, wind_std = wind_by_lean(time, velocity, attitude)
    updates = log.updates(READINGS[sensor])
    updates = updates[(number[updates] >= 0) & np.isfinite(true_m[updates])]
    each = log["baro_m"] if sensor == "barometer" else log["range_m"] * _cos_tilt(log)
    scatter = (each - true_m)[updates] - (reading - true)[number[updates]]
    estimated = None
    if sensor == "barometer" and kind is Reference.DOPPLER and log.has("z_m"):
        height, followed, apart = _estimated(log, true_m)
        columns = np.stack([mean(each)[rows] for each in (height, *followed.T, apart)], axis=1)
        columns[:, 1:] -= columns[:, 1:].mean(axis=0)
        estimated = Estimated(columns[:, 0], columns[:, 1:3], columns[:, 3]) if np.isfinite(columns).all() else None
    throttle = log["throttle_cmd"][flying] if log.has("throttle_cmd") else np.array([])
    throttle = throttle[np.isfinite(throttle)]
    return Heights(
        log.name,
        sensor,
        kind,
        time,
        reading[rows],
        true[rows],
        up[rows],
        velocity,
        attitude,
        above[rows],
        share[rows] / np.median(share[rows]),
        np.nan_to_num(temperature[rows] - temperature[rows][0]),
        wind,
        wind_std,
        float(np.sqrt(np.nanmean(scatter**2))),
        float(np.median(throttle)) if len(throttle) else np.nan,
        estimated,
    )


def wind_by_lean(time_s: Floats, velocity: Vector, attitude: Quaternion) -> tuple[tuple[float, float], float]:
    """Steady wind, m/s north and east, and its standard error: what drag there is where the vehicle stands still.

    The horizontal force by the lean, less the acceleration, is drag times the air speed.
    """
    north, east, down = velocity
    x, y, z = rotate(attitude, (0.0, 0.0, -1.0))
    lift = (GRAVITY_M_S2 - np.gradient(down, time_s)) / np.maximum(-np.asarray(z), 0.2)
    drag = np.array([np.gradient(north, time_s) - lift * x, np.gradient(east, time_s) - lift * y])
    speed = np.array([north, east])
    around = speed - speed.mean(axis=1, keepdims=True)
    size = float(np.sum(around**2))
    slope = -float(np.sum(around * drag)) / max(size, 1e-9)
    constant = drag.mean(axis=1) + slope * speed.mean(axis=1)
    left = drag + slope * speed - constant[:, np.newaxis]
    independent_s = 2.0
    std = float(np.sqrt(np.mean(left**2) * independent_s / BIN_S / max(size, 1e-9)))
    if slope < CLEAR * std:
        return (0.0, 0.0), UNKNOWN_WIND_M_S
    wind_north, wind_east = (constant / slope).tolist()
    trim = np.hypot(TRIM_M_S2 / slope, float(np.hypot(wind_north, wind_east)) * std / slope)
    return (wind_north, wind_east), min(float(trim), UNKNOWN_WIND_M_S)


def _cos_tilt(log: FlightLog) -> Floats:
    return np.asarray(np.cos(np.radians(log["roll_deg"])) * np.cos(np.radians(log["pitch_deg"])))


def _integrated(time_s: Floats, climb_m_s: Floats) -> Floats:
    """Height from a climb rate that is held between its updates."""
    known = np.nan_to_num(climb_m_s)
    steps = 0.5 * (known[1:] + known[:-1]) * np.diff(time_s)
    return np.where(np.isfinite(climb_m_s), np.concatenate([[0.0], np.cumsum(steps)]), np.nan)


def _above_rest(height_m: Floats, flying: np.ndarray, from_ground: bool) -> Floats:
    """Height above where the vehicle rests; where that is not known, above the ground, or the lowest place."""
    resting = height_m[~flying]
    if np.isfinite(resting).any():
        return np.asarray(height_m - np.nanmedian(resting))
    return height_m if from_ground else np.asarray(height_m - np.nanmin(height_m))


def _estimated(log: FlightLog, true_m: Floats) -> tuple[Floats, Floats, Floats]:
    """Height by the estimator and the integrals of `Estimated`, at the log's rows."""
    height = log["z_m"]
    step = np.diff(log.time_s, prepend=log.time_s[0])

    def integral(values: Floats) -> Floats:
        """Up to the middle of each step."""
        known = np.nan_to_num(values - np.nanmedian(values))
        return np.asarray(np.cumsum(known * step) - 0.5 * known * step)

    once = integral(log["baro_m"] - height)
    return height, np.stack([once, np.cumsum((once - once.mean()) * step)], axis=1), integral(true_m - height)
