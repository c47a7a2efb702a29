"""Parameters of rotation from gyro and commands.

Roll, about the body's x axis, with the commands x_i over their mean in flight, and the rotors' arms a_i:

    p' = S sum(a_i h(x_i)) / (n mean|a|) - c p + k v + bias + slow moment,  h(x) = x - 1 + (e - 1) / e (x - 1)^2

S is the angular acceleration per relative difference of the commands, and S / e that per weight of thrust difference,
where e = dln T / dln x is the elasticity of the thrust, T = k1 x + k2 x^2. The gyro alone tells S, and the
accelerometer e.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from quadctl.lab.arrays import Floats
from quadctl.lab.rotation.drag import fit_drag, flown
from quadctl.lab.rotation.fits import HIGH_NOISE, LOW_NOISE, SETTLED_S, block_means, estimated, half_interval
from quadctl.lab.rotation.innovations import (
    NOISE_NAMES,
    Estimated,
    Regression,
    SteadyFilter,
    earlier,
    first_order,
    held_response,
    noise_of,
    rate_filter,
    unforeseen,
)
from quadctl.lab.rotation.records import Delayed, Record
from quadctl.lab.rotation.shares import Shares, fit_shares
from quadctl.lab.rotation.thrust import ThrustMap, fit_thrust_map, hover_command, level_hover
from quadctl.lab.rotation.value import Value
from quadctl.vehicle import Vehicle

AXES = ("roll", "pitch", "yaw")
YAW = 2
GUST_TURNS_S = 0.4
"""Time until a gust shows in the gyro above its noise. A gust moves the vehicle before: by the velocity of this instant
it would pass for a weaker moment."""
LEAST_LAG_S, MOST_LAG_S = 1e-3, 0.5
MOST_LEAD_S = 2.0
KNOWN_LAG_S = 0.2
"""Bound of a lag that may be none, below which it is told."""
MOST_UNKNOWN = 0.25
"""Share of the commands' variance that may be unknown between their samples: it weakens the slope."""
FORESEEN_S = 0.5
"""Time after which a command has forgotten samples of the gyro that are not logged."""
LEAST_PER_TAP = 40
"""Samples that are needed for each one before from which a command is foreseen."""
ANSWERED = 2
"""Rates after a command that tell again what it answers."""
LOW_QUICK = -8.0
"""That of the quick one in yaw: the rotors' inertia hands on at once what their speed scatters by."""


@dataclass(frozen=True, eq=False)
class _Axis:
    """Signals of one axis in one flight."""

    rate: Floats
    difference: Delayed
    airspeed: Floats | None
    record: Record
    late: bool
    """True where lag and delay of the rotors are known: then nothing else passes for a late command, and a reaction of
    the rotors is told by what comes at once."""

    def regression(
        self, damping: float, acts: tuple[float, float, float], shared: Floats, noise: SteadyFilter
    ) -> Regression:
        """Regression with lag, delay and lead of the moment, `acts`."""
        seen = self.record.without_shared(self._seen(damping, acts), shared)
        settled = round(SETTLED_S / self.record.measured_s)
        white = noise.whitened(seen)[:, settled:]
        instruments = white[1:-1].copy()
        instruments[1:] = earlier(instruments[1:], round(GUST_TURNS_S / self.record.measured_s))
        own = white[-1:] if self.late else np.vstack([white[-1], self._answered[:, settled:]])
        return Regression(white[0], white[1:-1], own, instruments)

    @cached_property
    def _answered(self) -> Floats:
        """Unforeseen parts of the commands before each measured rate, shape (ANSWERED, n)."""
        measured = slice(None, None, self.record.every)
        reach = min(round(FORESEEN_S / self.record.measured_s), len(self.rate[measured]) // LEAST_PER_TAP)
        surprise = unforeseen(self.difference.signal[measured], self.rate[measured], reach)
        return np.vstack([earlier(surprise, k) for k in range(1, ANSWERED + 1)])

    @cached_property
    def _seen(self) -> Callable[[float, tuple[float, float, float]], Floats]:
        """The last results of `_moved`: a search that varies the noise alone asks for the same again."""
        return lru_cache(maxsize=2)(self._moved)

    def _moved(self, damping: float, acts: tuple[float, float, float]) -> Floats:
        """Rate, and what command, airspeed and a steady moment make of it, at the measured samples."""
        step_s, (lag_s, delay_s, lead_s) = self.record.step_s, acts
        held_s = delay_s - step_s / 2.0
        command = self.difference.before(step_s + max(held_s, 0.0))
        turned = held_response(command, damping, lag_s, step_s, max(-held_s, 0.0), lead_s)
        forces = [*([] if self.airspeed is None else [self.airspeed]), np.ones(len(self.rate))]
        moved = np.vstack([turned, first_order(np.array(forces), damping, step_s)])
        rate = (self.rate - self.rate[0])[:: self.record.every]
        return np.vstack([rate, self.record.as_measured(moved)])


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
            late is not None,
        )
        for r in records
    ]

    def regress(x: Floats) -> list[Regression]:
        noise = {s: rate_filter(noise_of(x[3:7]), x[0], s) for s in {r.measured_s for r in records}}
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
    return estimated(records, regress, names, linear, start, scale, low, high)


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
    shares: Shares | None = None
    """Thrust of each rotor; None where it is not told."""

    @cached_property
    def gain(self) -> dict[str, Value]:
        """Angular acceleration per weight of thrust difference, rad/s^2; empty where the map is not known."""
        e = self.thrust.found
        if e is None:
            return {}
        return {name: over(axis.values["slope"], e) for name, axis in self.axes.items()}

    def told(self, axis: str) -> dict[str, Value]:
        """Parameters of an axis whose intervals can be trusted: none where its innovations are not white, or slope or
        commands are not told; no lag that is not known, no damping at a bound or of a disturbance, no moment of an
        airspeed that hardly changed."""
        fit = self.axes[axis]
        if not self.is_told(axis):
            return {}
        shown = {"slope": fit.values["slope"]}
        if axis in self.gain:
            shown["gain"] = self.gain[axis]
        others = ("airspeed", "lead_s", *(["damping_1_s"] if _damps(fit) else []))
        shown |= {name: fit.values[name] for name in others if name in fit.values and name not in fit.at_bound}
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
        file; none whose interval reaches 0."""
        told = {
            name: over(Value(self.ratios[name], self.ratios[name], self.ratios[name]), gain)
            for name, gain in self.gain.items()
            if name in self.ratios and self.is_told(name)
        }
        return {name: value for name, value in told.items() if value.low > 0.0}

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
            "thrust_of_rotors": None if self.shares is None else self.shares.to_dict(),
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


def _damps(fit: Estimated) -> bool:
    """Tell whether the damping is the body's own: where the slow disturbance has the shortest memory that it may have,
    a rate that forgets sooner may do so in place of the disturbance."""
    memory = fit.values["log_slow_s"].value
    shortest = "log_slow_s" in fit.at_bound and memory < 0.0 and "log_slow" not in fit.at_bound
    return not shortest or fit.values["damping_1_s"].value * np.exp(memory) < 1.0


def fit_rotation(records: Sequence[Record], vehicle: Vehicle) -> Rotation:
    """Estimate rotation, thrust map and drag from these flights; the map first with the lag that the gyro shows."""
    first = ThrustMap(1.0, False, None)
    rough = [fit_axis(records, vehicle, axis, hover_command(records, False), first) for axis in range(YAW)]
    step_s = max(r.step_s for r in records)
    thrust = fit_thrust_map(records, _lag_of(rough, step_s))
    hover = hover_command(records, thrust.by_voltage)
    if (thrust.value, thrust.by_voltage) == (first.value, first.by_voltage):
        tilting = rough  # a map that is not told, or of measured speeds, is the first one
    else:
        tilting = [fit_axis(records, vehicle, axis, hover, thrust) for axis in range(YAW)]
    axes = dict(zip(AXES[:YAW], tilting, strict=True))
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
        fit_shares(records, vehicle, hover, thrust, axes),
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
    parts = block_means(records, [r.drive for r in records])
    of_all = parts / parts.mean(axis=1, keepdims=True)
    return of_all.mean(axis=0), half_interval(of_all)


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
        blocks = sign * arms[i] * block_means(records, signals)
        mean = float(blocks.mean()) * e.value
        half = float(np.hypot(e.value * half_interval(blocks)[0], mean * (e.high - e.low) / 2.0 / e.value))
        if is_told(fit):
            found[name] = Value(mean, mean - half, mean + half)
    return found
