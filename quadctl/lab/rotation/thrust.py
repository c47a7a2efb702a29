"""Thrust over command near hover, and the command of level hover, from the accelerometer."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from quadctl.frames import GRAVITY_M_S2
from quadctl.lab.arrays import Floats
from quadctl.lab.rotation.fits import HIGH_NOISE, LOW_NOISE, SETTLED_S, block_means, estimated, half_interval
from quadctl.lab.rotation.innovations import (
    NOISE_NAMES,
    Estimated,
    Regression,
    first_order,
    force_filter,
    noise_of,
)
from quadctl.lab.rotation.records import Delayed, Record
from quadctl.lab.rotation.value import Value

UNIFORM_95 = 0.475
"""Half of the range that holds 95 % of an even distribution of width 1."""
CLIMB_DRAG = (0.5, 0.3, 0.0, 10.0)
"""Start, scale and bounds of the loss of thrust over climb rate, 1/s."""


@dataclass(frozen=True)
class ThrustMap:
    """Elasticity of the thrust over the command near the mean command: thrust in weights per relative change. The mean
    thrust of a flight that tilts is more than the weight, so it is as much above dln T / dln x."""

    value: float
    """Used in the moments; 1 where nothing is known."""
    by_voltage: bool
    found: Value | None
    """None: the accelerometer does not tell it."""
    inflow_1_s: Value | None = None
    """Loss of thrust over climb rate, over the mass."""


def fit_thrust_map(records: Sequence[Record], lag: Value | None) -> ThrustMap:
    """Elasticity of the thrust of all rotors, with the voltage where that predicts the accelerometer better, and with
    the measured climb rate or that which the thrust itself gives a vehicle that flies upright, whichever does.

    Its interval holds what the interval of the rotors' lag, which the gyro tells, adds, and the time within its
    sampling interval at which a command changed; where the gyro does not tell the lag (None), nothing is told: delays
    of the accelerometer hide it.
    """
    if all(r.measured for r in records):
        return ThrustMap(1.0, False, Value(1.0, 1.0, 1.0))
    if lag is None or any(r.force is None for r in records):
        return ThrustMap(1.0, False, None)
    voltages = [False, *([True] if all(r.voltage is not None for r in records) else [])]
    climbs = [False, *([True] if all(r.airspeed is not None for r in records) else [])]
    fits = [(_elasticity(records, lag.value, v, climbed=c), v, c) for v in voltages for c in climbs]
    found, by_voltage, climbed = min(fits, key=lambda fit: fit[0].innovation)
    value = found.values["elasticity"]
    unknown_s = UNIFORM_95 * max(r.logged_s for r in records)
    reach_s = float(np.hypot((lag.high - lag.low) / 2.0, unknown_s))
    others = [
        _elasticity(records, max(lag.value + sign * reach_s, 0.0), by_voltage, climbed=climbed).values["elasticity"]
        for sign in (-1.0, 1.0)
    ]
    by_lag = max(abs(other.value - value.value) for other in others)
    half = float(np.hypot((value.high - value.low) / 2.0, by_lag))
    value = Value(value.value, value.value - half, value.value + half)
    trusted = found.white and 0.3 < value.low < value.high < 3.5
    return ThrustMap(
        value.value if trusted else 1.0, by_voltage, value if trusted else None, found.values.get("inflow_1_s")
    )


def _elasticity(records: Sequence[Record], lag_s: float, by_voltage: bool, *, climbed: bool) -> Estimated:
    """Fit the thrust over the command; by the measured climb rate where it is `climbed`, else by that of a vehicle that
    the thrust moves up and down: its drag is a parameter of the fit."""
    hover = hover_command(records, by_voltage)
    flights = []
    for r in records:
        assert r.force is not None
        own = r.command(by_voltage) / hover - 1.0
        # A search that varies the noise alone asks for the same again.
        mean, curved = (lru_cache(maxsize=2)(Delayed(x.mean(axis=1), r.step_s).by) for x in (own, own**2))
        flights.append((-r.force[:, 2] / GRAVITY_M_S2, mean, curved, _beside_thrust(r), r))
    names = ["delay_s", *NOISE_NAMES, *([] if climbed else ["inflow_1_s"])]

    def regress(x: Floats) -> list[Regression]:
        made = []
        for force, mean, curved, beside, r in flights:
            bend = curved(x[0], lag_s)
            told = np.array([bend, mean(x[0], lag_s) + bend])
            if climbed and r.airspeed is not None:
                told = np.vstack([told, r.airspeed[:, 2] / GRAVITY_M_S2])
            else:
                # w' = g_z + (q u - p v) - thrust - drag w, and the force is thrust + drag w.
                fallen = first_order(np.vstack([told, beside]), x[5], r.step_s)
                told = told - x[5] * fallen[:2]
                told[0] -= x[5] * fallen[2]
            bend, *others = r.as_measured(np.vstack([told, np.ones(len(force))]))
            signals = r.without_shared(np.array([force[:: r.every] + bend, *others]), x[len(names) :])
            white = force_filter(noise_of(x[1:5]), r.measured_s).whitened(signals)
            white = white[:, round(SETTLED_S / r.measured_s) :]
            made.append(Regression(white[0], white[1:-1], white[-1:]))
        return made

    start = np.array([1.5 * min(r.step_s for r in records), -3.3, 0.7, -0.5, -1.0])
    low, high, scale = np.array([0.0, *LOW_NOISE]), np.array([0.2, *HIGH_NOISE]), np.array([0.01, 1.0, 1.0, 1.0, 1.0])
    if not climbed:
        start, scale, low, high = (np.append(a, b) for a, b in zip((start, scale, low, high), CLIMB_DRAG, strict=True))
    linear = ["elasticity", *(["inflow_1_s"] if climbed else [])]
    return estimated(records, regress, names, linear, start, scale, low, high)


def _beside_thrust(record: Record) -> Floats:
    """Acceleration along body z beside the thrust, less that of a level vehicle at rest, g, shape (n,): 0 where
    attitude and velocity are not known."""
    if record.down is None or record.airspeed is None:
        return np.zeros(len(record.rates))
    turned = record.rates[:, 1] * record.airspeed[:, 0] - record.rates[:, 0] * record.airspeed[:, 1]
    return np.asarray(record.down[:, 2] - 1.0 + turned / GRAVITY_M_S2)


def hover_command(records: Sequence[Record], by_voltage: bool) -> float:
    """Mean command of all rotors over these flights."""
    return float(np.mean(np.concatenate([r.command(by_voltage).mean(axis=1) for r in records])))


def level_hover(records: Sequence[Record], thrust: ThrustMap) -> Value | None:
    """Output, or squared speed, at which the thrust is the weight: of each part of the flights the mean one, less what
    its thrust is beyond the weight by the accelerometer; None where that or the thrust map is not known.

    Drag is no thrust: it is removed by the velocity; where that is not known, the interval holds all of what the
    accelerometer shows beyond the weight.
    """
    e = thrust.found
    if e is None or any(r.force is None for r in records):
        return None
    drive = block_means(records, [r.drive.mean(axis=1, keepdims=True) for r in records])[:, 0]
    beyond = block_means(records, [-r.force[:, 2:] / GRAVITY_M_S2 for r in records if r.force is not None])[:, 0] - 1.0
    with_air = thrust.inflow_1_s is not None and all(r.airspeed is not None for r in records)
    if with_air and thrust.inflow_1_s is not None:
        down = block_means(records, [r.airspeed[:, 2:] for r in records if r.airspeed is not None])[:, 0]
        beyond -= thrust.inflow_1_s.value * down / GRAVITY_M_S2
    level = drive * (1.0 - beyond / e.value)
    moved = float(abs(np.mean(drive * beyond)))
    by_map = moved * ((1.0 / e.low - 1.0 / e.high) / 2.0 if with_air else 1.0 / e.low)
    half = float(half_interval(level[:, None])[0]) + by_map
    mean = float(level.mean())
    return Value(mean, mean - half, mean + half)
