"""Ranges of the flight variables in which a model fails: binned residuals with standard errors.

The standard error of a bin's mean is computed from the noise, i.e. from the residual minus the prediction of a flexible
regression on the variables that can be a cause: the structure to be found must not count as noise, but drift must. The
noise stays correlated for long (see `Noise`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import special

from quadctl.frames import GRAVITY_M_S2
from quadctl.lab.arrays import Floats, Mask
from quadctl.lab.comparison.wording import NAMED_FLIGHTS, Said
from quadctl.lab.fitting.noise import Noise
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.flights.flight import VARIABLE_UNITS
from quadctl.lab.flights.prediction import AXES
from quadctl.words import Fact, fact

BINS = 10
MOST = 0.8
"""Share of a squared error that is most of it."""
BRIEF = 0.5
"""Largest share of a flight that a stretch of time with most of the error may have to be told."""
LEAST_ERROR_M_S2 = 1e-6
"""Smallest standard error of a mean; synthetic flights without noise have less."""
MIN_SIGMA = 4.0
"""Least deviation of a bin's mean in standard errors; with some hundred bins, smaller deviations happen by chance."""
MIN_RESIDUAL_M_S2 = 0.02
"""Least mean residual that is reported, m/s^2."""
TELLING_SHARE, TELLING_P_VALUE = 0.05, 0.01
"""Least share of the squared residual in the bins' means, and largest p-value, of a profile that is shown."""
LEAST_PART = 0.01
"""Least squared error that a failure or a profile explains to be told, as a share of that of the largest one, or of the
error of all axes."""
FALSE_SHARE = 0.05
"""Largest share of the dependences that are told which may be there by chance (Benjamini & Hochberg 1995, J. R. Stat.
Soc. B 57)."""
MUCH = 0.2
"""Share of the squared error from which on an axis is told of, whatever its error goes with."""
_DIRECTIONS = {"up": ("more", "less"), "north": ("north", "south"), "east": ("east", "west")}
"""Direction of a push by its axis: along it, and against it."""


class Stretch(NamedTuple):
    """Stretch of one flight that holds most of the error of a failure there."""

    flight: str
    begin_s: float
    """Time in the log."""
    end_s: float
    share: float
    """Share of the flight in the squared error of the failure."""
    whole: bool
    """True where the error is spread over most of the flight."""


@dataclass(frozen=True)
class Failure:
    """A range of one variable in which the model is wrong along one axis; mean residual in m/s^2, measured minus
    predicted."""

    axis: str
    variable: str
    low: float
    high: float
    mean_residual: float
    sigma: float
    n: int
    kind: Literal["offset", "range", "dependence"]
    """An offset over the whole flight, a range of the variable, or the dependence on the variable over all that was
    flown; the range of a dependence is where most of the error is."""
    square_m2_s4: float
    """Sum of the squared residual that it explains; of a range beside the offset of its axis."""
    stretches: tuple[Stretch, ...] = ()
    """Stretches with most of it: one of each flight that is needed for it, that with the largest error first."""
    flights: int = 1
    """Number of flights of the comparison."""
    average: float = 0.0
    """Mean residual over all ranges, beside which that of this range stands out; 0 where the others are right."""
    at_edge: tuple[bool, bool] = (False, False)
    """True where the range begins, and where it ends, at the edge of what was flown."""
    extremes: tuple[tuple[float, float], ...] = ()
    """Bins with the least and the largest mean residual, of a dependence: (value of the variable, mean)."""
    share: float = 0.0
    """Share of the squared error on its axis, of a dependence."""
    also: tuple[str, ...] = ()
    """Other variables over which a dependence shows: their ranges are explained by it."""

    @property
    def said(self) -> Fact:
        """The failure without a full stop: `At a height below 2 rotor radii the vehicle gets more thrust than ...`."""
        size = abs(self.mean_residual)
        facts = vars(self) | {
            "direction": _DIRECTIONS[self.axis][0 if self.mean_residual > 0.0 else 1],
            "size_m_s2": size,
            "weight_share": size / GRAVITY_M_S2,
        }
        if self.kind == "offset":
            held = [stretch.flight for stretch in self.stretches]
            return fact(
                Said.OFFSET, **facts, mostly_in=held if len(held) <= min(self.flights - 1, NAMED_FLIGHTS) else []
            )
        if self.kind == "dependence":
            unit = VARIABLE_UNITS[self.variable]
            ends = [fact(Said.MEAN_AT, mean_m_s2=mean, at=at, unit=unit) for at, mean in self.extremes]
            return fact(Said.DEPENDENCE, **facts, ends=ends)
        average = abs(self.average)
        return fact(Said.RANGE, **facts, average_m_s2=average, average_share=average / GRAVITY_M_S2)

    def to_dict(self) -> dict[str, object]:
        return {
            "axis": self.axis,
            "variable": self.variable,
            "from": self.low,
            "to": self.high,
            "mean_residual": self.mean_residual,
            "sigma": self.sigma,
            "n": self.n,
            "kind": self.kind,
            "also": list(self.also),
            "most_in": [
                {"flight": stretch.flight, "from_s": stretch.begin_s, "to_s": stretch.end_s}
                for stretch in self.stretches
            ],
        }


@dataclass(frozen=True)
class Profile:
    """Binned residual of one axis over one variable."""

    axis: str
    variable: str
    edges: Floats
    """Bin edges in the unit of the variable, shape (b + 1,)."""
    centre: Floats
    """Mean of the variable in each bin, shape (b,)."""
    mean: Floats
    """Mean residual of each bin, m/s^2, shape (b,)."""
    error: Floats
    """Standard error of the mean with autocorrelation included, m/s^2, shape (b,)."""
    count: Floats
    p_value: float
    """Probability that the bins' means differ as much by chance alone."""
    share: float
    """Share of the axis' squared residual that lies in the bins' means; the larger, the closer the variable is to the
    cause."""

    def means(self, dataset: Dataset) -> Floats:
        """Mean residual of the bin of each sample, m/s^2, shape (n,)."""
        x = np.asarray(dataset.variable(self.variable))
        return self.mean[np.clip(np.searchsorted(self.edges, x, side="right") - 1, 0, len(self.mean) - 1)]


def profiles(residual: Floats, noise: Floats, dataset: Dataset) -> list[Profile]:
    """Profiles of every axis over every variable, sorted by the share of the squared residual that they hold."""
    found = []
    correlated = Noise(noise, dataset.parts)
    for name in dataset.flights[0].variables:
        x = dataset.variable(name)
        if x is None or np.ptp(x) < 1e-9:
            continue
        edges = np.unique(np.quantile(x, np.linspace(0.0, 1.0, BINS + 1)))
        index = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, len(edges) - 2)
        error = np.maximum(correlated.errors_of_means(index, len(edges) - 1), LEAST_ERROR_M_S2)
        centre = np.bincount(index, x) / np.maximum(np.bincount(index), 1)
        found += [
            _profile(residual[:, a], error[:, a], (axis, name), edges, centre, index, correlated.degrees)
            for a, axis in enumerate(AXES)
        ]
    total = float(np.mean(residual**2))
    # Shares of the squared residual of all axes: a clear pattern in a small error comes after one in a large error.
    power = {axis: float(np.mean(residual[:, a] ** 2)) / max(total, 1e-12) for a, axis in enumerate(AXES)}
    return sorted(found, key=lambda profile: -profile.share * power[profile.axis])


def is_telling(profile: Profile) -> bool:
    """Tell whether the residual depends on the variable of a profile, significantly and enough to be shown."""
    return profile.share > TELLING_SHARE and profile.p_value < TELLING_P_VALUE


def failures(residual: Floats, noise: Floats, dataset: Dataset, tried: list[Profile]) -> list[Failure]:
    """Failures of the model: axes with an offset over the whole flight, then ranges, the profile with the largest share
    first; before those of the first profile of an axis the dependence on its variable. A range of another variable of
    which that dependence explains most is no failure of its own."""
    found = []
    correlated = Noise(noise, dataset.parts)
    everywhere = _standard_errors(np.ones(len(residual), dtype=bool), correlated)
    for a, axis in enumerate(AXES):
        offset = _offset(residual[:, a], everywhere[a], axis, dataset)
        if offset is not None:
            found.append(offset)
    found.sort(key=lambda failure: -abs(failure.mean_residual))
    offsets = {failure.axis: failure.mean_residual for failure in found}
    left = residual.copy()  # beside the dependences
    also: dict[str, dict[str, None]] = {}
    """Variables over which the dependence of an axis shows, too, in their order."""
    # Of many profiles some are below any p-value by chance; several variables that go together are no chance.
    chances = _adjusted(np.array([profile.p_value for profile in tried]))
    for profile, chance in zip(tried, chances, strict=True):
        a = AXES.index(profile.axis)
        about = offsets.get(profile.axis, 0.0)
        runs = []
        if profile.p_value < 1e-3 / len(tried):
            for run in _runs(profile, residual[:, a], correlated, dataset):
                if _is_explained(run, residual[:, a] - about, left[:, a] - about, dataset):
                    also[profile.axis][profile.variable] = None
                else:
                    runs.append(replace(run, square_m2_s4=run.n * (run.mean_residual - about) ** 2))
        if chance < FALSE_SHARE and is_telling(profile) and profile.axis not in also:
            also[profile.axis] = {}
            largest = max(runs, key=lambda run: run.square_m2_s4, default=_largest_bin(profile, about))
            found.append(_dependence(profile, largest, residual[:, a], about))
            left[:, a] -= profile.means(dataset) - about
        found += sorted(runs, key=lambda failure: -abs(failure.sigma))
    return [replace(f, also=tuple(also[f.axis])) if f.kind == "dependence" else f for f in found]


def _adjusted(p_values: Floats) -> Floats:
    """p-values adjusted for the false discovery rate, shape (n,) (Benjamini & Hochberg 1995, J. R. Stat. Soc. B 57).

    As `scipy.stats.false_discovery_control`, which takes a second to load at every start.
    """
    falling = np.argsort(-p_values)
    tried = len(p_values)
    adjusted = np.empty(tried)
    adjusted[falling] = np.minimum.accumulate(p_values[falling] * tried / np.arange(tried, 0, -1))
    return np.minimum(adjusted, 1.0)


def _largest_bin(profile: Profile, about: float) -> Failure:
    """The bin of a profile that holds the most of its squared error, beside an offset `about`, m/s^2."""
    b = int(np.argmax(profile.count * (profile.mean - about) ** 2))
    mean, error, n = float(profile.mean[b]), float(profile.error[b]), int(profile.count[b])
    low, high = float(profile.edges[b]), float(profile.edges[b + 1])
    return Failure(profile.axis, profile.variable, low, high, mean, (mean - about) / error, n, "range", n * mean**2)


def most_telling(found: list[Failure]) -> list[Failure]:
    """Failures sorted by the squared error that they explain, the largest first.

    A range comes after all dependences where there is one of its axis: most of what it explains is explained there.
    """
    depend = {failure.axis for failure in found if failure.kind == "dependence"}
    return sorted(
        found, key=lambda failure: (failure.kind == "range" and failure.axis in depend, -failure.square_m2_s4)
    )


def told(found: Sequence[Failure], count: int) -> list[Failure]:
    """The `count` failures with the largest squared errors; that with the largest mean error is always among them.

    Ranges of a dependence that is told are parts of it. What explains next to nothing beside the others is left out.
    """
    whole = {(failure.axis, failure.variable) for failure in found if failure.kind == "dependence"}
    found = [failure for failure in found if (failure.axis, failure.variable) not in whole or failure.kind != "range"]
    if not found:
        return []
    most = max(failure.square_m2_s4 for failure in found)
    first = most_telling([failure for failure in found if failure.square_m2_s4 >= LEAST_PART * most])[:count]
    largest = max(found, key=lambda failure: abs(failure.mean_residual))
    return first if largest in first else most_telling([*first[: count - 1], largest])


def followed(found: Sequence[Failure], dataset: Dataset) -> Fact | None:
    """The variables of failures that follow disturbances, so that they need not be a cause (see `Dataset.is_flown`);
    None where there is none."""
    names = [v for v in dict.fromkeys(v for f in found for v in (f.variable, *f.also)) if not dataset.is_flown(v)]
    return fact(Said.FOLLOWS, variables=names, flights=len(dataset.flights), one=len(names) == 1) if names else None


def unexplained(found: Sequence[Failure], errors: Mapping[str, float]) -> Fact | None:
    """The axes that hold much of the squared error, of which none of all failures `found` explains more than next to
    nothing; None where there is none. `errors` are the RMSE per axis, m/s^2."""
    whole = sum(errors[axis] ** 2 for axis in AXES)
    explained = {failure.axis for failure in told(found, len(found))}
    share = {axis: errors[axis] ** 2 / whole for axis in AXES if axis not in explained} if whole > 0.0 else {}
    axes = [fact(Said.ERROR_ALONG, axis=a, error_m_s2=errors[a], share=s) for a, s in share.items() if s >= MUCH]
    return fact(Said.UNEXPLAINED, axes=axes) if axes else None


def stretches(values: Floats, inside: Mask, dataset: Dataset) -> tuple[Stretch, ...]:
    """Stretches of flights that hold most of the squared residual of one axis, shape (n,), at the samples `inside`.

    Of the flights, those with the largest errors that together hold `MOST`; of each, the shortest stretch of time that
    holds `MOST` of its own.
    """
    square = np.where(inside, values**2, 0.0)
    total = float(square.sum())
    if total == 0.0:
        return ()
    own = [(float(square[part].sum()) / total, i, part) for i, part in enumerate(dataset.parts)]
    found: list[Stretch] = []
    for share, i, part in sorted(own, key=lambda item: (-item[0], item[1])):
        flight = dataset.flights[i]
        begin, end = _shortest(square[part])
        whole = end - begin + 1 > BRIEF * (part.stop - part.start)
        times = float(flight.time_s[begin]), float(flight.time_s[end])
        found.append(Stretch(flight.name, *times, share, whole))
        if sum(stretch.share for stretch in found) >= MOST:
            break
    return tuple(found)


def _shortest(square: Floats) -> tuple[int, int]:
    """First and last sample of the shortest stretch that holds `MOST` of the sum of `square`, shape (n,)."""
    total = np.concatenate([[0.0], np.cumsum(square)])
    ends = np.searchsorted(total, total[:-1] + MOST * total[-1] * (1.0 - 1e-12))
    length = np.where(ends <= len(square), ends - np.arange(len(square)), len(square) + 1)
    begin = int(np.argmin(length))
    return begin, int(ends[begin]) - 1


def _profile(
    values: Floats,
    error: Floats,
    of: tuple[str, str],
    edges: Floats,
    centre: Floats,
    index: NDArray[np.intp],
    degrees: int,
) -> Profile:
    """Profile of an axis over a variable; `index` is the number of the bin of each sample, and `error` the standard
    error of each bin's mean with its degrees of freedom."""
    count = np.bincount(index, minlength=len(edges) - 1).astype(float)
    mean = np.bincount(index, values, minlength=len(count)) / np.maximum(count, 1.0)
    weight = 1.0 / error**2
    about = float((weight * mean).sum() / weight.sum())
    chi2 = float((weight * (mean - about) ** 2).sum())
    # The standard errors are estimated, from a limited number of frequencies: an F distribution, not chi squared.
    bins = max(len(count) - 1, 1)
    p = float(special.fdtrc(bins, degrees, chi2 / bins))
    spread = float(count @ (mean - values.mean()) ** 2) / max(float(values @ values), 1e-12)
    return Profile(*of, edges, centre, mean, error, count, p, spread)


def _standard_errors(inside: Mask, noise: Noise) -> Floats:
    """Standard error of the mean of each axis over the samples `inside`, shape (axes,)."""
    return np.maximum(np.sqrt(noise.variances_of_sum(inside / max(int(inside.sum()), 1))), LEAST_ERROR_M_S2)


def _runs(profile: Profile, values: Floats, noise: Noise, dataset: Dataset) -> list[Failure]:
    """Failures of one profile: neighbouring bins with the same sign of the error, joined.

    An offset common to all bins is reported once, by `_offset`; here only the deviation from it counts.
    """
    x = dataset.variable(profile.variable)
    if x is None:
        return []
    level = _common_level(profile)
    excess = profile.mean - level
    wrong = np.sign(excess) * (np.abs(excess) > np.maximum(MIN_SIGMA * profile.error, 0.3 * np.abs(excess).max()))
    found = []
    start = 0
    for stop in range(1, len(wrong) + 1):
        if stop < len(wrong) and wrong[stop] == wrong[start]:
            continue
        if wrong[start] != 0.0:
            low, high = float(profile.edges[start]), float(profile.edges[stop])
            inside = (x >= low) & (x <= high)
            mean = float(values[inside].mean())
            sigma = (mean - level) / float(_standard_errors(inside, noise)[AXES.index(profile.axis)])
            if abs(mean - level) > MIN_RESIDUAL_M_S2:
                n = int(inside.sum())
                run = Failure(profile.axis, profile.variable, low, high, mean, sigma, n, "range", n * mean**2)
                most, edges = stretches(values, inside, dataset), (start == 0, stop == len(wrong))
                found.append(replace(run, stretches=most, flights=len(dataset.flights), average=level, at_edge=edges))
        start = stop
    return found


def _is_explained(run: Failure, values: Floats, left: Floats, dataset: Dataset) -> bool:
    """Tell whether most of the error of a range, beside the offset, is gone from `left`: the residual `values` without
    the dependence that is told of its axis; shapes (n,)."""
    x = np.asarray(dataset.variable(run.variable))
    inside = (x >= run.low) & (x <= run.high)
    return bool(left[inside].mean() ** 2 < (1.0 - MOST) * values[inside].mean() ** 2)


def _dependence(profile: Profile, run: Failure, values: Floats, about: float) -> Failure:
    """Dependence of a residual, shape (n,), on the variable of its profile, beside an offset `about`, m/s^2; its range
    is that of its largest run."""
    ends = sorted({int(np.argmin(profile.mean)), int(np.argmax(profile.mean))})
    extremes = tuple((float(profile.centre[b]), float(profile.mean[b])) for b in ends)
    square = profile.share * float(values @ values) + len(values) * (float(values.mean()) - about) ** 2
    return replace(run, kind="dependence", square_m2_s4=square, extremes=extremes, share=profile.share)


def _common_level(profile: Profile) -> float:
    """Mean over all bins where the whole profile is offset, i.e. no bin is nearly right; else 0."""
    smallest, largest = np.abs(profile.mean).min(), np.abs(profile.mean).max()
    same_sign = bool((profile.mean > 0.0).all() or (profile.mean < 0.0).all())
    if not same_sign or smallest < 0.3 * largest:
        return 0.0
    return float(profile.count @ profile.mean / profile.count.sum())


def _offset(values: Floats, error: float, axis: str, dataset: Dataset) -> Failure | None:
    mean = float(values.mean())
    sigma = mean / error
    time = dataset.variable("time")
    if time is None or abs(mean) < MIN_RESIDUAL_M_S2 or abs(sigma) < MIN_SIGMA:
        return None
    most = stretches(values, np.ones(len(values), dtype=bool), dataset)
    n, flights = len(values), len(dataset.flights)
    low, high = float(time.min()), float(time.max())
    return Failure(axis, "time", low, high, mean, sigma, n, "offset", n * mean**2, stretches=most, flights=flights)
