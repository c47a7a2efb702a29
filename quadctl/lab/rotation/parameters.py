"""Parameters of rotation from gyro and commands, of the thrust map and the drag from the accelerometer.

Roll, about the body's x axis, with the commands x_i over their mean in flight, and the rotors' arms a_i:

    p' = S sum(a_i h(x_i)) / (n mean|a|) - c p + k v + bias + slow moment,  h(x) = x - 1 + (e - 1) / e (x - 1)^2

S is the angular acceleration per relative difference of the commands, and S / e that per weight of thrust difference,
where e = dln T / dln x is the elasticity of the thrust, T = k1 x + k2 x^2. The gyro alone tells S, and the
accelerometer e.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.stats import t as student

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
    earlier,
    estimate,
    first_order,
    held_response,
    noise_of,
)
from quadctl.lab.rotation.records import Delayed, Record
from quadctl.vehicle import Vehicle

AXES = ("roll", "pitch", "yaw")
YAW = 2
GUST_TURNS_S, GUST_PUSHES_S = 0.4, 0.12
"""Time until a gust shows in the gyro, and in the accelerometer, above their noise. A gust moves the vehicle before: by
the velocity of this instant it would pass for a weaker moment and a weaker drag."""
LEAST_LAG_S, MOST_LAG_S = 1e-3, 0.5
MOST_LEAD_S = 2.0
KNOWN_LAG_S = 0.2
"""Bound of a lag that may be none, below which it is told."""
MOST_UNKNOWN = 0.25
"""Share of the commands' variance that may be unknown between their samples: it weakens the slope."""
DRAG_STEP_S = 0.04
"""Drag answers a velocity, which changes within tenths of seconds."""
SHARED = (0.5, 0.1, 0.0, 0.98)
"""Start, scale and bounds of the share of its noise that a sample of an integrated sensor has from the sample before,
over its own: by a trapezoid between two samples it is 1, where what began is never forgotten."""
CLIMB_DRAG = (0.5, 0.3, 0.0, 10.0)
"""Start, scale and bounds of the loss of thrust over climb rate, 1/s."""
UNIFORM_95 = 0.475
"""Half of the range that holds 95 % of an even distribution of width 1."""
SETTLED_S = 1.5
"""Time until the filter's start is forgotten."""
LOW_NOISE, HIGH_NOISE = np.array([-5.0, -1.5, -7.0, -9.0]), np.array([-1.5, 3.0, 3.0, 5.0])
"""Bounds of the noise's logarithms: the quick disturbance is quicker than the slow one."""
LOW_QUICK = -8.0
"""That of the quick one in yaw: the rotors' inertia hands on at once what their speed scatters by."""


@dataclass(frozen=True, eq=False)
class _Axis:
    """Signals of one axis in one flight."""

    rate: Floats
    difference: Delayed
    airspeed: Floats | None
    record: Record

    def regression(
        self, damping: float, acts: tuple[float, float, float], shared: Floats, noise: SteadyFilter
    ) -> Regression:
        """Regression with lag, delay and lead of the moment, `acts`."""
        step_s, (lag_s, delay_s, lead_s) = self.record.step_s, acts
        held_s = delay_s - step_s / 2.0
        command = self.difference.before(step_s + max(held_s, 0.0))
        turned = held_response(command, damping, lag_s, step_s, max(-held_s, 0.0), lead_s)
        forces = [*([] if self.airspeed is None else [self.airspeed]), np.ones(len(self.rate))]
        moved = np.vstack([turned, first_order(np.array(forces), damping, step_s)])
        rate = (self.rate - self.rate[0])[:: self.record.every]
        seen = self.record.without_shared(np.vstack([rate, self.record.as_measured(moved)]), shared)
        white = noise.whitened(seen)[:, round(SETTLED_S / self.record.measured_s) :]
        columns = white[1:-1].T
        instruments = columns.copy()
        instruments[:, 1:] = earlier(columns[:, 1:], round(GUST_TURNS_S / self.record.measured_s))
        return Regression(white[0], columns, white[-1:].T, instruments)


def differences(command: Floats, elasticity: float, vehicle: Vehicle) -> Floats:
    """Differences of thrust about the body axes, in weights, over the elasticity, shape (n, 3); `command` is relative,
    shape (n, k)."""
    arms = np.array(vehicle.moment_arms_m)
    own = command - 1.0
    bent = own + (elasticity - 1.0) / elasticity * own**2
    return np.asarray(bent @ (arms / np.abs(arms).mean(axis=0)) / len(arms))


def fit_axis(
    records: Sequence[Record],
    vehicle: Vehicle,
    axis: int,
    hover: float,
    thrust: "ThrustMap",
    late: tuple[float, Value] | None = None,
) -> Estimated:
    """Fit the moments about a body axis; `hover` is the mean command in flight. Yaw has no moment by airspeed.

    Where lag and delay of the rotors are known, `late`, the lead of the moment is fitted, by the rotors' inertia, and
    the delay within its interval.
    """
    by_air = axis != YAW and flown(records, 1 - axis)
    flights = [
        _Axis(
            r.rates[:, axis],
            Delayed(differences(r.command(thrust.by_voltage) / hover, thrust.value, vehicle)[:, axis], r.step_s),
            None if r.airspeed is None or not by_air else r.airspeed[:, 1 - axis],
            r,
        )
        for r in records
    ]

    def regress(x: Floats) -> list[Regression]:
        noise = {s: noise_of(x[3:7]).of_rate(x[0], s) for s in {r.measured_s for r in records}}
        acts = (x[1], x[2], 0.0) if late is None else (late[0], x[2], x[1])
        return [f.regression(x[0], acts, x[7:], noise[f.record.measured_s]) for f in flights]

    step_s = min(r.step_s for r in records)
    names = ["damping_1_s", "lag_s", "delay_s", *NOISE_NAMES]
    linear = ["slope", *(["airspeed"] if flights[0].airspeed is not None else [])]
    start = np.array([2.0, 0.04, 1.1 * step_s, -3.3, 0.7, -1.0, -6.0])
    earliest_s = 0.0 if all(r.own_times for r in records) else step_s
    low, high = np.array([0.0, LEAST_LAG_S, earliest_s, *LOW_NOISE]), np.array([40.0, MOST_LAG_S, 0.2, *HIGH_NOISE])
    scale = np.array([1.0, 0.01, 0.01, 1.0, 1.0, 1.0, 1.0])
    if late is not None:
        lag_s, delay = late
        earliest_s = max(delay.low, earliest_s)
        latest_s = max(delay.high, earliest_s + step_s)
        names[1], start[1], low[1], high[1] = "lead_s", max(lag_s, 0.02), 0.0, MOST_LEAD_S
        start[2], low[2], high[2] = 0.5 * (earliest_s + latest_s), earliest_s, latest_s
        low[3] = LOW_QUICK
    return _estimated(records, regress, names, linear, start, scale, low, high)


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
        mean, curved = (Delayed(x.mean(axis=1), r.step_s) for x in (own, own**2))
        flights.append((-r.force[:, 2] / GRAVITY_M_S2, mean, curved, _beside_thrust(r), r))
    names = ["delay_s", *NOISE_NAMES, *([] if climbed else ["inflow_1_s"])]

    def regress(x: Floats) -> list[Regression]:
        made = []
        for force, mean, curved, beside, r in flights:
            bend = curved.by(x[0], lag_s)
            told = np.array([bend, mean.by(x[0], lag_s) + bend])
            if climbed and r.airspeed is not None:
                told = np.vstack([told, r.airspeed[:, 2] / GRAVITY_M_S2])
            else:
                # w' = g_z + (q u - p v) - thrust - drag w, and the force is thrust + drag w.
                fallen = first_order(np.vstack([told, beside]), x[5], r.step_s)
                told = told - x[5] * fallen[:2]
                told[0] -= x[5] * fallen[2]
            bend, *others = r.as_measured(np.vstack([told, np.ones(len(force))]))
            signals = r.without_shared(np.array([force[:: r.every] + bend, *others]), x[len(names) :])
            white = noise_of(x[1:5]).of_force(r.measured_s).whitened(signals)
            white = white[:, round(SETTLED_S / r.measured_s) :]
            made.append(Regression(white[0], white[1:-1].T, white[-1:].T))
        return made

    start = np.array([1.5 * min(r.step_s for r in records), -3.3, 0.7, -0.5, -1.0])
    low, high, scale = np.array([0.0, *LOW_NOISE]), np.array([0.2, *HIGH_NOISE]), np.array([0.01, 1.0, 1.0, 1.0, 1.0])
    if not climbed:
        start, scale, low, high = (np.append(a, b) for a, b in zip((start, scale, low, high), CLIMB_DRAG, strict=True))
    linear = ["elasticity", *(["inflow_1_s"] if climbed else [])]
    return _estimated(records, regress, names, linear, start, scale, low, high)


def _beside_thrust(record: Record) -> Floats:
    """Acceleration along body z beside the thrust, less that of a level vehicle at rest, g, shape (n,): 0 where
    attitude and velocity are not known."""
    if record.down is None or record.airspeed is None:
        return np.zeros(len(record.rates))
    turned = record.rates[:, 1] * record.airspeed[:, 0] - record.rates[:, 0] * record.airspeed[:, 1]
    return np.asarray(record.down[:, 2] - 1.0 + turned / GRAVITY_M_S2)


def _estimated(
    records: Sequence[Record],
    regress: Callable[[Floats], Sequence[Regression]],
    names: list[str],
    linear: list[str],
    start: Floats,
    scale: Floats,
    low: Floats,
    high: Floats,
) -> Estimated:
    """The fit of `regress`, with a parameter more at its end where an integrated sensor's neighbours share noise."""
    if any(r.integrated for r in records):
        names = [*names, "shared"]
        pairs = zip((start, scale, low, high), SHARED, strict=True)
        start, scale, low, high = (np.append(array, more) for array, more in pairs)
    rows = round(BLOCK_S / min(r.measured_s for r in records))
    return estimate(regress, start, (low, high), scale, names, linear, rows)


def fit_drag(records: Sequence[Record], axis: int) -> Estimated:
    """Drag along body x (0) or y (1), 1/s, from the accelerometer: f = -d u + bias + slow force.

    Both are averaged over `DRAG_STEP_S`: the filter of a slow force raises what is quick, of a velocity its noise,
    which weakens the drag. So does its error: the velocity that the tilt gives a vehicle of this drag is an estimate of
    its own, and the interval reaches up to the drag that is right where all that the two differ by is an error of the
    measured one, or that has the error which estimators have (Frisch 1934: the regression weakens by the error's share
    of the variance).

    A force that follows the velocity late passes for more drag, by the instrument of earlier velocities: where the
    flights show that it does, f = -d u + m u' with m > 0, the interval reaches down to that drag, which gusts weaken.
    """
    flights = []
    for r in records:
        assert r.force is not None and r.airspeed is not None
        rows = max(round(DRAG_STEP_S / r.step_s), 1)
        speed = r.airspeed[:, axis]
        signals = (r.force[:, axis], np.ones(len(speed)), -speed, np.gradient(speed, r.step_s))
        flights.append((np.array([_means(signal, rows) for signal in signals]), rows * r.step_s))

    def fitted(*linear: str) -> Estimated:
        def regress(x: Floats) -> list[Regression]:
            made = []
            for signals, step_s in flights:
                white = noise_of(x).of_force(step_s).whitened(signals[: 2 + len(linear)])
                white = white[:, round(SETTLED_S / step_s) :]
                columns = white[2:].T
                before = earlier(columns, round(GUST_PUSHES_S / step_s))
                made.append(Regression(white[0], columns, white[1:2].T, before))
            return made

        start, rows = np.array([-2.5, 0.7, 0.5, -1.0]), round(BLOCK_S / flights[0][1])
        return estimate(regress, start, (LOW_NOISE, HIGH_NOISE), np.ones(4), NOISE_NAMES, linear, rows)

    found, late = fitted("drag_1_s"), fitted("drag_1_s", "late")
    drag = found.values["drag_1_s"]
    share = _velocity_error(records, axis, found)
    high = drag.high / (1.0 - share) if drag.high > 0.0 and share < 1.0 else np.inf
    low = min(drag.low, late.values["drag_1_s"].low) if late.values["late"].low > 0.0 else drag.low
    return replace(found, values=found.values | {"drag_1_s": Value(drag.value, low, max(high, drag.high))})


def _velocity_error(records: Sequence[Record], axis: int, found: Estimated) -> float:
    """Largest share of the velocity's variance that is its error, as the drag's fit weighs it; 0 where the attitude is
    not known."""
    steady = noise_of([found.values[name].value for name in NOISE_NAMES])
    drag = max(found.values["drag_1_s"].value, 0.0)
    whole = wrong = estimated = 0.0
    for r in records:
        if r.down is None or r.airspeed is None:
            return 0.0
        estimated += (r.velocity_error_m_s**2 / float(np.var(r.airspeed[:, axis]))) / len(records)
        rows = max(round(DRAG_STEP_S / r.step_s), 1)
        step_s = rows * r.step_s
        # u' = g_x - d u + r v - q w, and v' = g_y - d v + p w - r u.
        u, v, w = r.airspeed.T
        p, q, yaw = r.rates.T
        turned = (yaw * v - q * w) if axis == 0 else (p * w - yaw * u)
        forcing = _means(GRAVITY_M_S2 * r.down[:, axis] + turned, rows)
        speed = _means(r.airspeed[:, axis], rows)
        own = first_order(forcing, drag, step_s)
        white = steady.of_force(step_s).whitened(np.array([speed, own, np.ones(len(speed))]))
        speed, own, one = white[:, round(SETTLED_S / step_s) :]
        speed, own = (x - one * (one @ x) / (one @ one) for x in (speed, own))
        whole += float(speed @ speed)
        wrong += float((speed - own) @ (speed - own))
    return max(wrong / whole, estimated)


def _means(signal: Floats, rows: int) -> Floats:
    """Means of `rows` samples each."""
    whole = len(signal) // rows * rows
    return np.asarray(signal[:whole].reshape(-1, rows, *signal.shape[1:]).mean(axis=1))


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
    step_s: float = 0.0
    """Step of the records: what happens within it is not told."""
    unknown: dict[str, float] = field(default_factory=dict)
    """Share of the commands about each axis that is unknown between their samples."""
    share_half: Floats | None = None
    """Half of the 95 % interval of each rotor's share, shape (k,)."""
    level: Value | None = None
    """Output, or squared speed, of all rotors at which their thrust is the weight."""
    centre_m: dict[str, Value] = field(default_factory=dict)
    """Centre of mass before (`forward`) and right of (`right`) the middle of the rotors, m, with rotors that are alike
    and no wind; empty where the thrust map is not known."""
    ratios: dict[str, float] = field(default_factory=dict)
    """Inertia over weight times arm, by the vehicle's file, times the gain: 1 for each axis."""

    @cached_property
    def gain(self) -> dict[str, Value]:
        """Angular acceleration per weight of thrust difference, rad/s^2; empty where the map is not known."""
        e = self.thrust.found
        if e is None:
            return {}
        return {name: over(axis.values["slope"], e) for name, axis in self.axes.items()}

    def told(self, axis: str) -> dict[str, Value]:
        """Parameters of an axis whose intervals can be trusted: none where its innovations are not white, or slope or
        commands are not told; no lag that is not known, no damping at a bound, no moment of an airspeed that hardly
        changed."""
        fit = self.axes[axis]
        if not self.is_told(axis):
            return {}
        shown = {"slope": fit.values["slope"]}
        if axis in self.gain:
            shown["gain"] = self.gain[axis]
        others = [
            name for name in ("damping_1_s", "airspeed", "lead_s") if name in fit.values and name not in fit.at_bound
        ]
        shown |= {name: fit.values[name] for name in others}
        lag = None if "lead_s" in fit.values else self._lag(axis)
        return shown | ({} if lag is None else {"lag_s": lag})

    def is_told(self, axis: str) -> bool:
        """Tell whether the parameters of an axis can be trusted."""
        return is_told(self.axes[axis]) and self.unknown.get(axis, 0.0) < MOST_UNKNOWN

    def _lag(self, axis: str) -> Value | None:
        """Lag of the rotors by an axis; None where it may be anything."""
        return known_lag(self.axes[axis].values["lag_s"], self.step_s)

    @cached_property
    def lag(self) -> Value | None:
        """Lag of the rotors by roll and pitch together; None where neither tells it.

        Yaw is left out: there the rotors' own inertia acts, too.
        """
        told = [self.axes[axis].values["lag_s"] for axis in AXES[:YAW] if axis in self.axes and self.is_told(axis)]
        return known_lag(together(told), self.step_s) if told else None

    @cached_property
    def delay(self) -> Value | None:
        """Delay of the commands before that lag; None where roll and pitch do not tell the lag. What happens within a
        step, and within a logged one, is not told."""
        told = [self.axes[axis].values["delay_s"] for axis in AXES[:YAW] if axis in self.axes and self.is_told(axis)]
        return known_lag(together(told), self.step_s) if told and self.lag is not None else None

    @cached_property
    def inertia(self) -> dict[str, Value]:
        """Moment of inertia about each axis, kg m^2, with the mass, the arms and the torque constant of the vehicle's
        file."""
        return {
            name: over(Value(self.ratios[name], self.ratios[name], self.ratios[name]), gain)
            for name, gain in self.gain.items()
            if name in self.ratios and self.is_told(name)
        }

    def to_dict(self) -> dict[str, Any]:
        thrust = {"elasticity": self.thrust.found, "inflow_1_s": self.thrust.inflow_1_s if self.thrust.found else None}
        half = np.zeros(len(self.share)) if self.share_half is None else self.share_half
        return {
            "flights": list(self.names),
            "axes": {name: {k: v.to_dict() for k, v in self.told(name).items()} for name in self.axes},
            "lag_s": None if self.lag is None else self.lag.to_dict(),
            "delay_s": None if self.delay is None else self.delay.to_dict(),
            "inertia_kg_m2": {name: value.to_dict() for name, value in self.inertia.items()},
            "correlation_of_innovations": {name: fit.correlation for name, fit in self.axes.items()},
            "unknown_of_commands": self.unknown,
            "thrust": {name: value.to_dict() for name, value in thrust.items() if value is not None}
            | {"by_voltage": self.thrust.by_voltage},
            "drag": {name: fit.values["drag_1_s"].to_dict() for name, fit in self.drag.items() if fit.white},
            "hover_command": self.hover_drive,
            "level_hover_command": None if self.level is None else self.level.to_dict(),
            "share_of_rotors": [float(s) for s in self.share],
            "share_of_rotors_half_ci95": [float(h) for h in half],
            "centre_of_mass_m": {name: value.to_dict() for name, value in self.centre_m.items()},
        }


def over(above: Value, below: Value) -> Value:
    """Quotient of two parameters whose errors are independent; `below` is positive."""
    value = above.value / below.value
    half = np.hypot(above.high - above.low, value * (below.high - below.low)) / below.value / 2.0
    return Value(value, value - float(half), value + float(half))


def together(values: Sequence[Value]) -> Value:
    """One parameter by several estimates; its interval is wider where these differ by more than theirs allow (Birge
    1932, Phys. Rev. 40)."""
    halves = np.array([max((value.high - value.low) / 2.0, 1e-12) for value in values])
    of = np.array([value.value for value in values])
    weights = halves**-2
    mean = float(weights @ of / weights.sum())
    parted = 1.96 * float(np.sqrt(weights @ (of - mean) ** 2 / max(len(values) - 1, 1)))
    half = max(parted, 1.0) / float(np.sqrt(weights.sum()))
    return Value(mean, mean - half, mean + half)


def known_lag(lag: Value, step_s: float) -> Value | None:
    """Lag of the rotors by records of this step; None where it may be anything.

    What happens within a step is not told: a lag that is computed once a step differs from one that goes on within it
    by half a step, so much wider is the interval on both sides.
    """
    half = (lag.high - lag.low) / 2.0 + step_s / 2.0
    wide = Value(lag.value, max(lag.value - half, 0.0), lag.value + half)
    return wide if wide.low > 0.0 or wide.high < KNOWN_LAG_S else None


def is_told(fit: Estimated) -> bool:
    """Tell whether the commands have turned an axis, as far as its prediction errors are white."""
    return fit.white and fit.values["slope"].low > 0.0 and fit.values["lag_s"].value < 0.99 * MOST_LAG_S


def fit_rotation(records: Sequence[Record], vehicle: Vehicle) -> Rotation:
    """Estimate rotation, thrust map and drag from these flights; the map first with the lag that the gyro shows."""
    first = ThrustMap(1.0, False, None)
    rough = [fit_axis(records, vehicle, axis, hover_command(records, False), first) for axis in range(YAW)]
    step_s = max(r.step_s for r in records)
    thrust = fit_thrust_map(records, _lag_of(rough, step_s))
    hover = hover_command(records, thrust.by_voltage)
    axes = {name: fit_axis(records, vehicle, i, hover, thrust) for i, name in enumerate(AXES[:YAW])}
    axes[AXES[YAW]] = _fit_yaw(records, vehicle, hover, thrust, list(axes.values()))
    with_force = all(r.force is not None for r in records)
    drag = {f"d_{'xy'[i]}": fit_drag(records, i) for i in (0, 1) if with_force and flown(records, i)}
    share, half = shares(records)
    arms = np.abs(np.array(vehicle.moment_arms_m)).mean(axis=0)
    return Rotation(
        tuple(dict.fromkeys(r.name for r in records)),
        axes,
        thrust,
        hover,
        hover_command(records, False),
        records[0].measured,
        drag,
        share,
        step_s,
        {name: float(np.mean([r.unknown[i] for r in records])) for i, name in enumerate(AXES)},
        half,
        level_hover(records, thrust),
        _centre(records, vehicle, hover, thrust, axes),
        {name: float(vehicle.weight_n * arms[i]) for i, name in enumerate(AXES) if arms[i] > 0.0},
    )


def _lag_of(fits: Iterable[Estimated], step_s: float) -> Value | None:
    """Lag of the rotors by roll and pitch; None where neither tells it."""
    lags = [fit.values["lag_s"] for fit in fits if is_told(fit)]
    return known_lag(together(lags), step_s) if lags else None


def _fit_yaw(
    records: Sequence[Record], vehicle: Vehicle, hover: float, thrust: ThrustMap, others: Sequence[Estimated]
) -> Estimated:
    """Moments about yaw, with lag and delay of the rotors as roll and pitch tell them.

    What the lag is off by widens the intervals.
    """
    lag = _lag_of(others, max(r.step_s for r in records))
    if lag is None:
        return fit_axis(records, vehicle, YAW, hover, thrust)
    delay = together([fit.values["delay_s"] for fit in others if is_told(fit)])
    found, *ends = (
        fit_axis(records, vehicle, YAW, hover, thrust, (lag_s, delay)) for lag_s in (lag.value, lag.low, lag.high)
    )

    def widened(name: str) -> Value:
        value = found.values[name]
        by_lag = max(abs(end.values[name].value - value.value) for end in ends)
        half = float(np.hypot((value.high - value.low) / 2.0, by_lag))
        return Value(value.value, value.value - half, value.value + half)

    told = {name: widened(name) for name in ("lead_s", "damping_1_s", "slope")}
    return replace(found, values=found.values | told | {"lag_s": lag})


def shares(records: Sequence[Record]) -> tuple[Floats, Floats]:
    """Mean command of each rotor over that of all, and half of its 95 % interval, each of shape (k,)."""
    parts = _block_means(records, [r.drive for r in records])
    of_all = parts / parts.mean(axis=1, keepdims=True)
    return of_all.mean(axis=0), _half(of_all)


def _centre(
    records: Sequence[Record], vehicle: Vehicle, hover: float, thrust: ThrustMap, axes: Mapping[str, Estimated]
) -> dict[str, Value]:
    """Centre of mass as the moments tell it that the rotors balance on the mean, beside those of the airspeed."""
    e, arms = thrust.found, np.abs(np.array(vehicle.moment_arms_m)).mean(axis=0)
    if e is None:
        return {}
    found = {}
    for name, i, sign in (("forward", 1, 1.0), ("right", 0, -1.0)):
        fit, signals = axes[AXES[i]], []
        by_air = fit.values["airspeed"].value / fit.values["slope"].value if "airspeed" in fit.values else 0.0
        for r in records:
            split = differences(r.command(thrust.by_voltage) / hover, thrust.value, vehicle)[:, i]
            signals.append((split if r.airspeed is None else split + by_air * r.airspeed[:, 1 - i])[:, None])
        blocks = sign * arms[i] * _block_means(records, signals)
        mean = float(blocks.mean()) * e.value
        half = float(np.hypot(e.value * _half(blocks)[0], mean * (e.high - e.low) / 2.0 / e.value))
        if is_told(fit):
            found[name] = Value(mean, mean - half, mean + half)
    return found


def level_hover(records: Sequence[Record], thrust: ThrustMap) -> Value | None:
    """Output, or squared speed, at which the thrust is the weight: of each part of the flights the mean one, less what
    its thrust is beyond the weight by the accelerometer; None where that or the thrust map is not known.

    Drag is no thrust: it is removed by the velocity; where that is not known, the interval holds all of what the
    accelerometer shows beyond the weight.
    """
    e = thrust.found
    if e is None or any(r.force is None for r in records):
        return None
    drive = _block_means(records, [r.drive.mean(axis=1, keepdims=True) for r in records])[:, 0]
    beyond = _block_means(records, [-r.force[:, 2:] / GRAVITY_M_S2 for r in records if r.force is not None])[:, 0] - 1.0
    with_air = thrust.inflow_1_s is not None and all(r.airspeed is not None for r in records)
    if with_air and thrust.inflow_1_s is not None:
        down = _block_means(records, [r.airspeed[:, 2:] for r in records if r.airspeed is not None])[:, 0]
        beyond -= thrust.inflow_1_s.value * down / GRAVITY_M_S2
    level = drive * (1.0 - beyond / e.value)
    moved = float(abs(np.mean(drive * beyond)))
    by_map = moved * ((1.0 / e.low - 1.0 / e.high) / 2.0 if with_air else 1.0 / e.low)
    half = float(_half(level[:, None])[0]) + by_map
    mean = float(level.mean())
    return Value(mean, mean - half, mean + half)


def _block_means(records: Sequence[Record], signals: Sequence[Floats]) -> Floats:
    """Means of signals, each of shape (n, q), over blocks of `BLOCK_S`, shape (blocks, q)."""
    pairs = zip(records, signals, strict=True)
    return np.concatenate([_means(signal, max(round(BLOCK_S / r.step_s), 1)) for r, signal in pairs])


def _half(blocks: Floats) -> Floats:
    """Half of the 95 % interval of the mean of blocks, shape (blocks, q), as if each depended on none but itself."""
    n = len(blocks)
    if n < 2:
        return np.full(blocks.shape[1], np.inf)
    return np.asarray(student.ppf(0.975, n - 1) * blocks.std(axis=0, ddof=1) / np.sqrt(n))
