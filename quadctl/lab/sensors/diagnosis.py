"""Diagnosis of a height sensor: all errors are fitted together, and those that the flights do not need are left out."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import block_diag
from scipy.special import chdtrc

from quadctl.effects.barometer import GroundError
from quadctl.effects.sensor_error import SensorError
from quadctl.effects.sensors import SENSOR_ERRORS
from quadctl.errors import LogError
from quadctl.lab.arrays import Floats
from quadctl.lab.sensors.heights import BIN_S, READINGS, SOUGHT, Heights, NoReference
from quadctl.lab.sensors.inertial import above_ground, freed, with_unsure_gain
from quadctl.lab.sensors.wander import Estimate, Noise, Rows, estimate, learned, learned_with_gain, stacked
from quadctl.logs.contradictions import MAX_FACTOR
from quadctl.sensor_model import FittedError, SensorModel

P = 1e-3
"""Largest p-value of an error that is named."""
SMALL_M = 0.03
"""Largest error within the flights that does not matter: less than the reading scatters by."""
BLOCKS, BLOCK_S = 6, 8.0
"""Parts of the cross-validation, and length of the blocks of time that they take in turn: a mission may hover near the
ground but once, and each part must see some of it."""
WIND_STEP_M_S, SCALE_STEP = 0.1, 0.05
"""Steps of the derivatives by a wind, and by the logarithm of a scale."""
SCALE_STD = 1.0
"""Standard deviation of the logarithm of a scale about the best of those that were tried."""
TELLS = 0.9
"""Largest standard error, as a share of that before the flights, of a parameter that they tell."""
STEPS, LARGEST_STEP = 6, 0.5
"""Linearisations of a fit, and largest change of the logarithm of a scale in one."""
MOST = 99.0
"""Percentile that counts as the largest value."""
NO_EFFECT = 1e-9
"""Standard error, of a parameter, that only one has that acts on nothing in these flights."""


class Verdict(StrEnum):
    """Answers about a sensor."""

    MISSING = "missing"
    NONE = "none"
    CANNOT_TELL = "cannot tell"
    """No log has a reference."""


class Interval(NamedTuple):
    """A parameter with its 95 % interval."""

    value: float
    low: float
    high: float

    @property
    def is_identified(self) -> bool:
        """True where the interval does not hold 0."""
        return not self.low <= 0.0 <= self.high


@dataclass(frozen=True)
class Named:
    """An error that was tried."""

    error: SensorError
    """With the fitted parameters."""
    parameters: dict[str, Interval]
    p: float
    largest_m: float
    """Its size within the flights, all but the largest hundredth, without what a level, a lag or a scale of the sensor
    gives as well."""
    unknown: tuple[str, ...] = ()
    """Names of the other parameters, of which the flights tell little more than what physics allows."""

    @property
    def name(self) -> str:
        return self.error.name


@dataclass(frozen=True)
class SensorDiagnosis:
    """Answer about one sensor."""

    flights: tuple[Heights, ...]
    missing: tuple[Named, ...]
    small: tuple[Named, ...]
    """There, but of no matter."""
    absent: tuple[Named, ...]
    """Tried, and not told from zero."""
    not_tried: dict[str, str]
    """Names of errors that these flights cannot show, and the quantity that they do not span."""
    noise: Noise
    before_m: float
    """Root mean square of the difference beside its wander, on parts that no fit saw, without any error."""
    after_m: float
    """The same with those that are missing."""

    @property
    def sensor(self) -> str:
        return self.flights[0].sensor

    @property
    def verdict(self) -> Verdict:
        return Verdict.MISSING if self.missing else Verdict.NONE

    @property
    def scatter_m(self) -> float:
        """Standard deviation of single readings about the truth, their wander within a flight included."""
        samples = float(np.mean([flight.sample_std_m for flight in self.flights]))
        return float(np.hypot(samples, self.after_m))

    def model(self) -> SensorModel:
        """The errors that were tried, for a file."""
        tried = [*((one, True) for one in self.missing), *((one, False) for one in (*self.small, *self.absent))]
        errors = tuple(
            FittedError(one.error, {name: (told.low, told.high) for name, told in one.parameters.items()}, missing)
            for one, missing in tried
        )
        throttle = float(np.median([flight.hover_throttle for flight in self.flights]))
        logs = tuple(flight.name for flight in self.flights)
        of_barometer = self.scatter_m if self.sensor == "barometer" else None
        hover = throttle if np.isfinite(throttle) else None
        return SensorModel(errors, logs, of_barometer, hover, self._near_ground_s())

    def _near_ground_s(self) -> tuple[float, ...]:
        """Time of each flight from lift-off to the height at which the error of the ground has faded."""
        grounds = [one.error for one in self.missing if isinstance(one.error, GroundError)]
        return tuple(
            float(flight.time_s[above][0] - flight.time_s[0])
            for ground in grounds
            for flight in self.flights
            if (above := flight.above_ground_m > ground.faded_at_m).any() and not above[0]
        )

    def to_dict(self) -> dict[str, Any]:
        """The facts, as docs/sensors.md describes them."""
        named = {"missing": self.missing, "small": self.small, "absent": self.absent}
        return {
            "sensor": self.sensor,
            "verdict": str(self.verdict),
            "logs": [flight.name for flight in self.flights],
            "references": [str(flight.reference) for flight in self.flights],
            **{kind: [_as_dict(one) for one in each] for kind, each in named.items()},
            "not_tried": self.not_tried,
            "held_out_m": {"before": self.before_m, "after": self.after_m},
            "scatter_m": self.scatter_m,
            "noise": self.noise._asdict(),
        }


@dataclass(frozen=True)
class NoAnswer:
    """Answer about a sensor of which no log has a reference."""

    sensor: str
    reasons: tuple[tuple[str, NoReference], ...]
    """Name of each log, and why it has none."""
    verdict: Verdict = Verdict.CANNOT_TELL

    def to_dict(self) -> dict[str, Any]:
        """The facts, as docs/sensors.md describes them."""
        return {
            "sensor": self.sensor,
            "verdict": str(self.verdict),
            "logs": [name for name, _ in self.reasons],
            "reasons": [str(reason) for _, reason in self.reasons],
            "needs": [str(reference) for reference in SOUGHT],
        }


def _as_dict(one: Named) -> dict[str, Any]:
    told = {
        name: {"value": each.value, "ci95": [each.low, each.high], "told": each.is_identified}
        for name, each in one.parameters.items()
    }
    return {
        "error": one.name,
        "parameters": told,
        "scales": {name: one.error.values()[name] for name in one.error.scales},
        "p": one.p,
        "largest_m": one.largest_m,
    }


def diagnose_sensor(flights: Sequence[Heights]) -> SensorDiagnosis:
    """Name the errors of one sensor over some flights of a vehicle.

    Raises LogError where its reading is not in metres: its scale is fitted, and would hide that.
    """
    kinds = [kind for kind in SENSOR_ERRORS.values() if kind.sensor == flights[0].sensor]
    conditions = [flight.conditions((0.0, 0.0)) for flight in flights]
    reasons = {kind.name: reason for kind in kinds if (reason := kind.unshown(conditions))}
    tried = [kind() for kind in kinds if kind.name not in reasons]
    flights = [_beside_best(flight, tried) for flight in flights]
    noise = learned(_rows(flights, tried, _no_wind(flights)))
    _refuse_other_units(flights, tried, noise)
    tried = [_with_best_scale(error, tried, flights, noise) for error in tried]
    kept, absent = list(tried), list[Named]()
    named = _identified(flights, kept, noise)
    while kept and (i := _needless(flights, kept, named, noise)) is not None:
        absent.append(named[i])
        kept.pop(i)
        named = _identified(flights, kept, noise)
    while True:  # with the noise beside what is kept, and the scales as unsure as they are
        noise = learned(_rows(flights, kept, _no_wind(flights)))
        named = _identified(flights, kept, noise, with_scales=True)
        worst = max(range(len(kept)), key=lambda i: named[i].p, default=None)
        if worst is None or named[worst].p <= P:
            break
        absent.append(named[worst])
        kept.pop(worst)
    matters = [one for one in named if one.largest_m > SMALL_M]
    return SensorDiagnosis(
        tuple(flights),
        tuple(matters),
        tuple(one for one in named if one not in matters),
        tuple(absent),
        reasons,
        noise,
        _held_out(flights, [], noise),
        _held_out(flights, [one.error for one in matters], noise),
    )


def _identified(
    flights: Sequence[Heights], errors: Sequence[SensorError], noise: Noise, with_scales: bool = False
) -> list[Named]:
    fit = _fitted(flights, errors, noise, with_scales)
    return [_named(flights, fit, errors, i) for i in range(len(errors))]


def _needless(
    flights: Sequence[Heights], errors: Sequence[SensorError], named: Sequence[Named], noise: Noise
) -> int | None:
    """Number of the least sure error, if chance explains it or unseen parts are no likelier with it."""
    worst = max(range(len(errors)), key=lambda i: named[i].p)
    return worst if named[worst].p > P or not _foretells(flights, errors, worst, noise) else None


Winds = tuple[tuple[float, float], ...]
"""Wind of each flight, m/s north and east."""


class _Fit(NamedTuple):
    estimate: Estimate
    errors: tuple[SensorError, ...]
    """With the fitted scales."""
    winds: Winds
    places: dict[tuple[str, str], int]
    """Column of each parameter, by the error's name and its own; those of scales are of their logarithms."""


def _no_wind(flights: Sequence[Heights]) -> Winds:
    return tuple(flight.wind_ne_m_s for flight in flights)


def _linear(error: SensorError) -> list[str]:
    return [name for name in error.values() if name not in error.scales]


def _usual(errors: Sequence[SensorError], n: int) -> Floats:
    """Precision of `n` coefficients before the flight: bounds are two standard deviations from the middle, and of those
    beyond the errors' own nothing is known."""
    bounds = {(e.name, p.name): p.high - p.low for e in errors for p in e.parameters()}
    known = [(4.0 / bounds[error.name, name]) ** 2 for error in errors for name in _linear(error)]
    return np.array([*known, *[0.0] * (n - len(known))])


def _unit(error: SensorError, name: str) -> SensorError:
    """The error with one linear parameter at 1 and the others at 0."""
    return replace(error, **{other: float(other == name) for other in _linear(error)})


def _columns(flight: Heights, errors: Sequence[SensorError], wind: tuple[float, float]) -> Floats:
    conditions = flight.conditions(wind)
    units = [_unit(error, name) for error in errors for name in _linear(error)]
    columns = [np.broadcast_to(unit.error_m(conditions), flight.time_s.shape) for unit in units]
    return np.stack(columns, axis=1) if columns else np.empty((len(flight.time_s), 0))


def _nuisances(flight: Heights, number: int, n_flights: int) -> Floats:
    """Level of each flight, delay and lag of the sensor (times the climb rate and its change), and scale over height.

    The height here is not the reference's own: its noise is in the difference, too, and would pass for a scale. GPS's
    integrated climb rate wanders by as much as the vehicle climbs.
    """
    columns = np.zeros((len(flight.time_s), n_flights + 3))
    columns[:, number] = 1.0
    columns[:, n_flights] = flight.climb_m_s
    columns[:, n_flights + 1] = flight.above_ground_m - np.mean(flight.above_ground_m)
    columns[:, n_flights + 2] = np.gradient(flight.climb_m_s, flight.time_s)
    return columns


def _rows(flights: Sequence[Heights], errors: Sequence[SensorError], winds: Winds) -> Rows:
    own = [np.empty((len(f.time_s), 0)) if f.nuisances is None else f.nuisances for f in flights]
    own_columns = block_diag(*own)  # of one flight each
    parts = [
        Rows(
            flight.time_s,
            np.full(len(flight.time_s), float(i)),
            np.hstack([_columns(flight, errors, wind), _nuisances(flight, i, len(flights))]),
            flight.difference_m,
        )
        for i, (flight, wind) in enumerate(zip(flights, winds, strict=True))
    ]
    rows = stacked(parts)
    return rows._replace(columns=np.hstack([rows.columns, own_columns]))


def _beside_best(flight: Heights, tried: Sequence[SensorError]) -> Heights:
    """The flight beside its estimated height, where the reading is likelier there than beside GPS, and tells more of
    the errors; else as it is."""
    estimated = flight.estimated
    if estimated is None:
        return flight
    rows = _rows([flight], tried, _no_wind([flight]))
    noise = learned(rows)
    by_gps = estimate(rows, noise)
    followed = estimated.followed_m_s[:, 0]
    beside, n = flight, sum(len(_linear(error)) for error in tried)
    for _ in range(2):  # the height above the ground depends on the errors
        rows = _rows([freed(beside, estimated, 0.0)], tried, _no_wind([flight]))
        noise, gain, likelihood = learned_with_gain(rows, followed, BIN_S)
        fit = estimate(rows._replace(target=rows.target + gain * followed), noise)
        if likelihood < by_gps.log_likelihood or _spread(fit, n) > _spread(by_gps, n):
            return flight
        gains = gain, float(fit.value[-1])
        beside = replace(flight, above_ground_m=above_ground(flight, _with_values(tried, fit.value), gains))
    return with_unsure_gain(freed(beside, estimated, gain), estimated)


def _spread(fit: Estimate, n: int) -> float:
    """Logarithm of the volume of uncertainty of the first `n` coefficients, those that act on nothing left out."""
    acts = np.flatnonzero(np.diag(fit.covariance)[:n] > NO_EFFECT**2)
    return float(np.linalg.slogdet(fit.covariance[np.ix_(acts, acts)])[1])


def _with_values(errors: Sequence[SensorError], value: Floats) -> tuple[SensorError, ...]:
    """The errors with their linear parameters from the first of these values."""
    left = iter(value.tolist())
    return tuple(replace(error, **{name: next(left) for name in _linear(error)}) for error in errors)


def _with_best_scale(
    error: SensorError, others: Sequence[SensorError], flights: Sequence[Heights], noise: Noise
) -> SensorError:
    """The error with the scale that explains most beside the others."""
    if not error.scales:
        return error
    beside = [other for other in others if other.name != error.name]
    names, values = tuple(error.scales), tuple(error.scales.values())
    scaled = [replace(error, **dict(zip(names, each, strict=True))) for each in itertools.product(*values)]
    return min(scaled, key=lambda one: estimate(_rows(flights, [*beside, one], _no_wind(flights)), noise).misfit)


def _fitted(flights: Sequence[Heights], errors: Sequence[SensorError], noise: Noise, with_scales: bool = False) -> _Fit:
    """Parameters of all errors, with the wind of each flight as the lean tells it and as far as it is known.

    The errors are not linear in the wind, nor in their scales, which stay as they are unless `with_scales`: they are
    linearised there, again and again.
    """
    winds = _no_wind(flights)
    names = [(error.name, name) for error in errors for name in _linear(error)]
    windy = any(error.feels_wind for error in errors)
    scales = [(error.name, name) for error in errors for name in error.scales] if with_scales else []
    rows = _rows(flights, errors, winds)
    n = rows.columns.shape[1]
    fit = estimate(rows, noise, _usual(errors, n))
    usual = np.concatenate([np.ravel(winds), [0.0] * len(scales)])
    precision = np.concatenate(
        [_usual(errors, n), np.repeat([f.wind_std_m_s**-2 for f in flights], 2), np.full(len(scales), SCALE_STD**-2)]
    )
    log_scales = np.zeros(len(scales))
    for _ in range(STEPS if windy or scales else 0):
        there = _scaled(errors, scales, log_scales)
        rows = _rows(flights, there, winds)
        slopes = _slopes(flights, there, scales, winds, fit.value[: len(names)])
        moved = np.concatenate([np.ravel(winds), log_scales]) - usual
        joint = Rows(rows.time_s, rows.flight, np.hstack([rows.columns, slopes]), rows.target + slopes @ moved)
        fit = estimate(joint, noise, precision)
        change = usual + fit.value[n:]
        winds = tuple((float(north), float(east)) for north, east in change[: 2 * len(flights)].reshape(-1, 2))
        log_scales = np.clip(change[2 * len(flights) :], log_scales - LARGEST_STEP, log_scales + LARGEST_STEP)
    at = [*range(len(names)), *range(n + 2 * len(flights), n + 2 * len(flights) + len(scales))]
    return _Fit(fit, _scaled(errors, scales, log_scales), winds, dict(zip((*names, *scales), at, strict=True)))


def _scaled(
    errors: Sequence[SensorError], scales: Sequence[tuple[str, str]], log_scales: Floats
) -> tuple[SensorError, ...]:
    """The errors with scales that are larger by these logarithms."""
    factors = dict(zip(scales, np.exp(log_scales).tolist(), strict=True))
    return tuple(
        replace(e, **{name: e.values()[name] * factors[e.name, name] for name in e.scales if (e.name, name) in factors})
        for e in errors
    )


def _refuse_other_units(flights: Sequence[Heights], errors: Sequence[SensorError], noise: Noise) -> None:
    """Raise LogError where the reading changes by another factor than the height, whatever the errors' sizes."""
    fit = estimate(_rows(flights, errors, _no_wind(flights)), noise)
    at = sum(len(_linear(error)) for error in errors) + len(flights) + 1
    factor, reach = 1.0 + float(fit.value[at]), 1.96 * float(np.sqrt(max(fit.covariance[at, at], 0.0)))
    if factor + reach < 1.0 / MAX_FACTOR or factor - reach > MAX_FACTOR:
        names = ", ".join(dict.fromkeys(flight.name for flight in flights))
        column = READINGS[flights[0].sensor]
        raise LogError(f"{names}: {column} changes {factor:.3g} times as much as the height, expected once, in metres")


def _slopes(
    flights: Sequence[Heights],
    errors: Sequence[SensorError],
    scales: Sequence[tuple[str, str]],
    winds: Winds,
    value: Floats,
) -> Floats:
    """Change of the errors by the wind of each flight, north and east, and by the logarithm of each scale, shape
    (n, 2 flights + scales)."""
    n = sum(len(flight.time_s) for flight in flights)
    slopes, at = np.zeros((n, 2 * len(flights) + len(scales))), 0
    steps = SCALE_STEP * np.eye(len(scales))
    for i, (flight, (north, east)) in enumerate(zip(flights, winds, strict=True)):
        rows = slice(at, at := at + len(flight.time_s))
        for axis, (dn, de) in enumerate(((WIND_STEP_M_S, 0.0), (0.0, WIND_STEP_M_S))):
            more = _columns(flight, errors, (north + dn, east + de))
            less = _columns(flight, errors, (north - dn, east - de))
            slopes[rows, 2 * i + axis] = (more - less) @ value / (2.0 * WIND_STEP_M_S)
        for j, step in enumerate(steps):
            more, less = (_columns(flight, _scaled(errors, scales, s), (north, east)) for s in (step, -step))
            slopes[rows, 2 * len(flights) + j] = (more - less) @ value / (2.0 * SCALE_STEP)
    return slopes


def _named(flights: Sequence[Heights], fit: _Fit, errors: Sequence[SensorError], i: int) -> Named:
    """One of the errors with its parameters, their intervals, and the probability of as much by chance."""
    error = fit.errors[i]
    names = _linear(error)
    at = [fit.places[error.name, name] for name in names]
    value, covariance = fit.estimate.value[at], fit.estimate.covariance[np.ix_(at, at)]
    std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    known = std < TELLS * np.array([(p.high - p.low) / 4.0 for p in error.parameters() if p.name in names])
    ratio = float(value[known] @ np.linalg.pinv(covariance[np.ix_(known, known)]) @ value[known])
    held_scales = [values for name, values in error.scales.items() if (error.name, name) not in fit.places]
    tries = np.prod([len(values) for values in held_scales], initial=1.0)  # freed, they are in the covariance
    bounds = {parameter.name: (parameter.low, parameter.high) for parameter in error.parameters()}
    held = [min(max(v, bounds[name][0]), bounds[name][1]) for name, v in zip(names, value.tolist(), strict=True)]
    fitted = replace(error, **dict(zip(names, held, strict=True)))
    told = {
        name: Interval(v, v - 1.96 * s, v + 1.96 * s)
        for name, v, s, tells in zip(names, value.tolist(), std.tolist(), known, strict=True)
        if tells
    }
    unknown = tuple(name for name in names if name not in told)
    for name in error.scales:
        if (place := fit.places.get((error.name, name))) is not None:
            reach = float(np.exp(1.96 * np.sqrt(fit.estimate.covariance[place, place])))
            scale = error.values()[name]
            told[name] = Interval(scale, scale / reach, scale * reach)
    largest = float(np.percentile(np.abs(_beyond_nuisances(flights, fitted, fit.winds)), MOST))
    return Named(fitted, told, float(min(1.0, tries * chdtrc(max(int(known.sum()), 1), ratio))), largest, unknown)


def _beyond_nuisances(flights: Sequence[Heights], error: SensorError, winds: Winds) -> Floats:
    """The error over all flights without what a level, a lag or a scale of the sensor gives as well, m."""
    error_m = [
        np.broadcast_to(np.asarray(error.error_m(flight.conditions(wind))), flight.time_s.shape)
        for flight, wind in zip(flights, winds, strict=True)
    ]
    columns = np.concatenate([_nuisances(flight, i, len(flights)) for i, flight in enumerate(flights)])
    whole = np.concatenate(error_m)
    return np.asarray(whole - columns @ np.linalg.lstsq(columns, whole, rcond=None)[0])


def _blocks(flights: Sequence[Heights]) -> list[np.ndarray]:
    """Masks of the rows of each part, over all flights together; of short flights the blocks are shorter."""
    time_s = np.concatenate([flight.time_s for flight in flights])
    length_s = min(BLOCK_S, sum(float(np.ptp(flight.time_s)) for flight in flights) / BLOCKS)
    number = np.floor(time_s / length_s).astype(int) % BLOCKS
    return [part for block in range(BLOCKS) if np.any(part := number == block)]


def _unseen(flights: Sequence[Heights], errors: Sequence[SensorError], noise: Noise) -> list[Estimate]:
    """Estimates of the rest that the parameters by all other parts leave of each part, in the unit of its rows.

    These parameters are as uncertain as those parts leave them: a side to which the only fast run is in the part itself
    is not told by the others, and no prediction of it can fail. So their errors are estimated again with the covariance
    of the others as the prior, which makes `log_likelihood` the predictive density of the part.
    """
    rows, n = _rows(flights, errors, _no_wind(flights)), sum(len(_linear(error)) for error in errors)
    found = []
    for block in _blocks(flights):
        seen = Rows(rows.time_s[~block], rows.flight[~block], rows.columns[~block], rows.target[~block])
        others = estimate(seen, noise, _usual(errors, rows.columns.shape[1]))
        variances, axes = np.linalg.eigh(others.covariance[:n, :n])
        spread = rows.columns[block, :n] @ (axes * np.sqrt(np.maximum(variances, 0.0)))
        nuisances = rows.columns[block, n:]
        nuisances = nuisances[:, np.any(nuisances != 0.0, axis=0)]
        left = rows.target[block] - rows.columns[block, :n] @ others.value[:n]
        part = Rows(rows.time_s[block], rows.flight[block], np.hstack([spread, nuisances]), left)
        found.append(estimate(part, noise, np.repeat([1.0, 0.0], [n, nuisances.shape[1]])))
    return found


def _foretells(flights: Sequence[Heights], errors: Sequence[SensorError], i: int, noise: Noise) -> bool:
    """Tell whether parts that no fit saw are likelier with an error beside the others."""
    without = [error for j, error in enumerate(errors) if j != i]

    def likelihood(each: Sequence[SensorError]) -> float:
        return sum(part.log_likelihood for part in _unseen(flights, each, noise))

    return likelihood(errors) > likelihood(without)


def _held_out(flights: Sequence[Heights], errors: Sequence[SensorError], noise: Noise) -> float:
    """Root mean square of what is left on parts that no fit saw, beside the wander that the rows before tell.

    These are the innovations: of the weighted squares, in the unit of the rows.
    """
    parts = _unseen(flights, errors, noise)
    n = sum(len(flight.time_s) for flight in flights)
    size = np.exp(0.5 * sum(part.log_determinant for part in parts) / n)
    return float(size * np.sqrt(sum(part.misfit for part in parts) / n))
