"""Parameters of rotation from gyro and commands, of the thrust map and the drag from the accelerometer.

Roll, about the body's x axis, with the commands x_i over their mean in flight, and the rotors' arms a_i:

    p' = S sum(a_i h(x_i)) / (n mean|a|) - c p + k v + bias + slow moment,  h(x) = x - 1 + (e - 1) / e (x - 1)^2

S is the angular acceleration per relative difference of the commands, and S / e that per weight of thrust difference,
where e = dln T / dln x is the elasticity of the thrust, T = k1 x + k2 x^2. The gyro alone tells S, and the
accelerometer e.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from quadctl.effects.rotor_drag import FLOWN_M_S
from quadctl.frames import GRAVITY_M_S2
from quadctl.lab.arrays import Floats
from quadctl.lab.rotation.innovations import (
    BLOCK_S,
    NOISE_NAMES,
    Estimated,
    Regression,
    SteadyFilter,
    Value,
    estimate,
    first_order,
    noise_of,
)
from quadctl.lab.rotation.records import Delayed, Record
from quadctl.vehicle import Vehicle

AXES = ("roll", "pitch", "yaw")
YAW = 2
DRAG_STEP_S = 0.04
"""Drag answers a velocity, which changes within tenths of seconds."""
SETTLED_S = 1.5
"""Time until the filter's start is forgotten."""
LOW_NOISE, HIGH_NOISE = np.array([-5.0, -1.5, -7.0, -9.0]), np.array([-1.5, 3.0, 3.0, 5.0])
"""Bounds of the noise's logarithms: the quick disturbance is quicker than the slow one."""


@dataclass(frozen=True, eq=False)
class _Axis:
    """Signals of one axis in one flight."""

    rate: Floats
    difference: Delayed
    airspeed: Floats | None
    step_s: float

    def regression(self, damping: float, lag_s: float, delay_s: float, noise: SteadyFilter) -> Regression:
        forces = [self.difference.by(delay_s, lag_s)]
        if self.airspeed is not None:
            forces.append(self.airspeed)
        forces.append(np.ones(len(self.rate)))
        moved = first_order(np.array(forces), damping, self.step_s)
        rows = round(SETTLED_S / self.step_s)
        white = noise.whitened(np.vstack([self.rate - self.rate[0], moved]))[:, rows:]
        return Regression(white[0], white[1:-1].T, white[-1:].T)


def differences(command: Floats, elasticity: float, vehicle: Vehicle) -> Floats:
    """Differences of thrust about the body axes, in weights, over the elasticity, shape (n, 3); `command` is relative,
    shape (n, k)."""
    arms = np.array(vehicle.moment_arms_m)
    own = command - 1.0
    bent = own + (elasticity - 1.0) / elasticity * own**2
    return np.asarray(bent @ (arms / np.abs(arms).mean(axis=0)) / len(arms))


def fit_axis(records: Sequence[Record], vehicle: Vehicle, axis: int, hover: float, thrust: "ThrustMap") -> Estimated:
    """Fit the moments about a body axis; `hover` is the mean command in flight. Yaw has no moment by airspeed."""
    by_air = axis != YAW and flown(records, 1 - axis)
    flights = [
        _Axis(
            r.rates[:, axis],
            Delayed(differences(r.command(thrust.by_voltage) / hover, thrust.value, vehicle)[:, axis], r.step_s),
            None if r.airspeed is None or not by_air else r.airspeed[:, 1 - axis],
            r.step_s,
        )
        for r in records
    ]

    def regress(x: Floats) -> list[Regression]:
        damping, lag_s, delay_s = x[:3]
        noise = {s: noise_of(x[3:]).of_rate(damping, s) for s in {f.step_s for f in flights}}
        return [f.regression(damping, lag_s, delay_s, noise[f.step_s]) for f in flights]

    step_s = min(r.step_s for r in records)
    names = ("damping_1_s", "lag_s", "delay_s", *NOISE_NAMES)
    shared = ["slope", *(["airspeed"] if flights[0].airspeed is not None else [])]
    start = np.array([2.0, 0.04, 1.5 * step_s, -3.3, 0.7, -1.0, -6.0])
    low, high = np.array([0.0, 1e-3, step_s, *LOW_NOISE]), np.array([40.0, 0.5, 0.2, *HIGH_NOISE])
    scale = np.array([1.0, 0.01, 0.01, 1.0, 1.0, 1.0, 1.0])
    return estimate(regress, start, (low, high), scale, names, shared, round(BLOCK_S / step_s))


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
    """Elasticity of the thrust of all rotors, with the voltage where that predicts the accelerometer better.

    Its interval holds what the interval of the rotors' lag, which the gyro tells, adds; where the gyro does not tell it
    (None), nothing is told: delays of the accelerometer hide the lag.
    """
    if all(r.measured for r in records):
        return ThrustMap(1.0, False, Value(1.0, 1.0, 1.0))
    if lag is None or any(r.force is None for r in records):
        return ThrustMap(1.0, False, None)
    options = [False, *([True] if all(r.voltage is not None for r in records) else [])]
    fits = [(_elasticity(records, lag.value, by_voltage), by_voltage) for by_voltage in options]
    found, by_voltage = min(fits, key=lambda fit: fit[0].innovation)
    value = found.values["elasticity"]
    others = [_elasticity(records, lag_s, by_voltage).values["elasticity"].value for lag_s in (lag.low, lag.high)]
    by_lag = max(abs(other - value.value) for other in others)
    half = float(np.hypot((value.high - value.low) / 2.0, by_lag))
    value = Value(value.value, value.value - half, value.value + half)
    trusted = found.white and 0.3 < value.low < value.high < 3.5
    return ThrustMap(
        value.value if trusted else 1.0, by_voltage, value if trusted else None, found.values.get("inflow_1_s")
    )


def _elasticity(records: Sequence[Record], lag_s: float, by_voltage: bool) -> Estimated:
    hover = hover_command(records, by_voltage)
    with_air = all(r.airspeed is not None for r in records)
    flights = []
    for r in records:
        assert r.force is not None
        own = r.command(by_voltage) / hover - 1.0
        curved = Delayed((own**2).mean(axis=1), r.step_s)
        others = [r.airspeed[:, 2] / GRAVITY_M_S2] if with_air and r.airspeed is not None else []
        flights.append((-r.force[:, 2] / GRAVITY_M_S2, Delayed(own.mean(axis=1), r.step_s), curved, others, r.step_s))

    def regress(x: Floats) -> list[Regression]:
        delay_s = x[0]
        made = []
        for force, mean, curved, others, step_s in flights:
            bend = curved.by(delay_s, lag_s)
            signals = np.array([force + bend, mean.by(delay_s, lag_s) + bend, *others, np.ones(len(force))])
            white = noise_of(x[1:]).of_force(step_s).whitened(signals)
            white = white[:, round(SETTLED_S / step_s) :]
            made.append(Regression(white[0], white[1:-1].T, white[-1:].T))
        return made

    step_s = min(r.step_s for r in records)
    start = np.array([1.5 * step_s, -3.3, 0.7, -0.5, -1.0])
    low, high = np.array([0.0, *LOW_NOISE]), np.array([0.2, *HIGH_NOISE])
    scale, names = np.array([0.01, 1.0, 1.0, 1.0, 1.0]), ("delay_s", *NOISE_NAMES)
    shared = ["elasticity", *(["inflow_1_s"] if with_air else [])]
    return estimate(regress, start, (low, high), scale, names, shared, round(BLOCK_S / step_s))


def fit_drag(records: Sequence[Record], axis: int) -> Estimated:
    """Drag along body x (0) or y (1), 1/s, from the accelerometer: f = -d u + bias + slow force.

    Both are averaged over `DRAG_STEP_S`: the filter of a slow force raises what is quick, of a velocity its noise,
    which weakens the drag.
    """
    flights = []
    for r in records:
        assert r.force is not None and r.airspeed is not None
        rows = max(round(DRAG_STEP_S / r.step_s), 1)
        flights.append((_means(r.force[:, axis], rows), _means(r.airspeed[:, axis], rows), rows * r.step_s))

    def regress(x: Floats) -> list[Regression]:
        made = []
        for force, speed, step_s in flights:
            noise = noise_of(x).of_force(step_s)
            white = noise.whitened(np.array([force, -speed, np.ones(len(force))]))[:, round(SETTLED_S / step_s) :]
            made.append(Regression(white[0], white[1:2].T, white[2:].T))
        return made

    start, rows = np.array([-2.5, 0.7, 0.5, -1.0]), round(BLOCK_S / flights[0][2])
    return estimate(regress, start, (LOW_NOISE, HIGH_NOISE), np.ones(4), NOISE_NAMES, ["drag_1_s"], rows)


def _means(signal: Floats, rows: int) -> Floats:
    """Means of `rows` samples each."""
    whole = len(signal) // rows * rows
    return np.asarray(signal[:whole].reshape(-1, rows).mean(axis=1))


def flown(records: Sequence[Record], axis: int) -> bool:
    """True where the flights are fast enough along body x (0) or y (1) to tell what grows with the airspeed: an
    estimate of a slow velocity is mostly error."""
    speeds = [r.airspeed[:, axis] for r in records if r.airspeed is not None]
    return len(speeds) == len(records) and float(np.ptp(np.quantile(np.concatenate(speeds), (0.05, 0.95)))) > FLOWN_M_S


def hover_command(records: Sequence[Record], by_voltage: bool) -> float:
    """Mean command of all rotors over these flights."""
    return float(np.mean(np.concatenate([r.command(by_voltage).mean(axis=1) for r in records])))


@dataclass(frozen=True, eq=False)
class Rotation:
    """Parameters of a vehicle's rotation and thrust, by these flights."""

    names: tuple[str, ...]
    axes: dict[str, Estimated]
    thrust: ThrustMap
    hover: float
    """Mean command in flight, in the unit of `Record.command`."""
    hover_drive: float
    """Mean output in flight, or mean squared speed, krpm^2, where speeds are `measured`."""
    measured: bool
    drag: dict[str, Estimated]
    share: Floats
    """Mean command of each rotor over that of all, shape (k,): unequal rotors, or a centre of mass off the middle."""

    @cached_property
    def gain(self) -> dict[str, Value]:
        """Angular acceleration per weight of thrust difference, rad/s^2; empty where the map is not known."""
        e = self.thrust.found
        if e is None:
            return {}
        found = {}
        for name, axis in self.axes.items():
            slope = axis.values["slope"]
            value = slope.value / e.value
            half = abs(value) * np.hypot((slope.high - slope.low) / slope.value, (e.high - e.low) / e.value) / 2.0
            found[name] = Value(value, value - float(half), value + float(half))
        return found

    def told(self, axis: str) -> dict[str, Value]:
        """Parameters of an axis whose intervals can be trusted: none where its innovations are not white, or slope or
        lag are not told; no lag that may be 0, no damping at a bound, no moment of an airspeed that hardly changed."""
        fit = self.axes[axis]
        if not is_told(fit):
            return {}
        shown = {"slope": fit.values["slope"]}
        if axis in self.gain:
            shown["gain"] = self.gain[axis]
        others = [name for name in ("damping_1_s", "airspeed") if name in fit.values and name not in fit.at_bound]
        shown |= {name: fit.values[name] for name in others}
        lag = fit.values["lag_s"]
        return shown | ({"lag_s": lag} if lag.low > 0.0 else {})

    def to_dict(self) -> dict[str, Any]:
        thrust = {"elasticity": self.thrust.found, "inflow_1_s": self.thrust.inflow_1_s if self.thrust.found else None}
        return {
            "flights": list(self.names),
            "axes": {name: {k: v.to_dict() for k, v in self.told(name).items()} for name in self.axes},
            "correlation_of_innovations": {name: fit.correlation for name, fit in self.axes.items()},
            "thrust": {name: value.to_dict() for name, value in thrust.items() if value is not None}
            | {"by_voltage": self.thrust.by_voltage},
            "drag": {name: fit.values["drag_1_s"].to_dict() for name, fit in self.drag.items() if fit.white},
            "hover_command": self.hover_drive,
            "share_of_rotors": [float(s) for s in self.share],
        }


def is_told(fit: Estimated) -> bool:
    """Tell whether the commands have turned an axis, as far as its prediction errors are white."""
    return fit.white and fit.values["slope"].low > 0.0 and "lag_s" not in fit.at_bound


def fit_rotation(records: Sequence[Record], vehicle: Vehicle) -> Rotation:
    """Estimate rotation, thrust map and drag from these flights; the map first with the lag that the gyro shows."""
    first = ThrustMap(1.0, False, None)
    rough = fit_axis(records, vehicle, 0, hover_command(records, False), first)
    lag = rough.values["lag_s"]
    thrust = fit_thrust_map(records, lag if is_told(rough) and lag.low > 0.0 else None)
    hover = hover_command(records, thrust.by_voltage)
    axes = {name: fit_axis(records, vehicle, i, hover, thrust) for i, name in enumerate(AXES)}
    with_force = all(r.force is not None for r in records)
    drag = {f"d_{'xy'[i]}": fit_drag(records, i) for i in (0, 1) if with_force and flown(records, i)}
    mean = np.mean([r.drive.mean(axis=0) for r in records], axis=0)
    names = tuple(r.name for r in records)
    return Rotation(
        names, axes, thrust, hover, hover_command(records, False), records[0].measured, drag, mean / mean.mean()
    )
