"""Where does the model fail? Residuals binned over what they may depend on, with honest standard errors.

The standard error of a bin's mean comes from what a flexible regression leaves of the residual (the noise), with its
autocorrelation: structure that is to be found must not count as noise, and neighbouring samples not as independent.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy import stats

from quadctl.frames import GRAVITY_M_S2
from quadctl.lab.arrays import Floats, Mask
from quadctl.lab.fitting.noise import CorrelatedNoise
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.flights.flight import VARIABLE_NAMES, VARIABLE_UNITS
from quadctl.lab.flights.prediction import AXES

BINS = 10
LEAST_ERROR_M_S2 = 1e-6
"""Of a mean: flights that were made up have less."""
MIN_SIGMA = 4.0
"""Of the mean of a bin: with some hundred bins looked at, less happens by chance."""
MIN_RESIDUAL_M_S2 = 0.02
"""Smaller errors are not worth a sentence."""
TELLING_SHARE, TELLING_P_VALUE = 0.05, 0.01
"""Least share of the squared residual in the bins' means, and largest p-value, of a variable worth showing."""


@dataclass(frozen=True)
class Failure:
    """A range of one variable in which the model is wrong on one axis, m/s^2, measured minus predicted."""

    axis: str
    variable: str
    low: float
    high: float
    mean_residual: float
    sigma: float
    n: int
    text: str

    def to_dict(self) -> dict[str, object]:
        return {
            "axis": self.axis,
            "variable": self.variable,
            "from": self.low,
            "to": self.high,
            "mean_residual": self.mean_residual,
            "sigma": self.sigma,
            "n": self.n,
            "text": self.text,
        }


@dataclass(frozen=True)
class Profile:
    """Binned residual of one axis over one variable: what a residual plot shows."""

    axis: str
    variable: str
    edges: Floats
    """Shape (b + 1,)."""
    mean: Floats
    """m/s^2, shape (b,)."""
    error: Floats
    """Standard error of the mean, autocorrelation included, shape (b,)."""
    count: Floats
    p_value: float
    """That the bins differ from each other by chance alone."""
    share: float
    """Of the axis' residual power that lies in the bins' means; the more, the closer the variable is to the cause."""


def profiles(residual: Floats, noise: Floats, dataset: Dataset) -> list[Profile]:
    """Every axis over every variable, the most telling first."""
    found = []
    by_axis = [CorrelatedNoise(noise[:, a], dataset) for a in range(len(AXES))]
    for name in dataset.flights[0].variables:
        x = dataset.variable(name)
        if x is None or np.ptp(x) < 1e-9:
            continue
        found += [_profile(residual[:, a], by_axis[a], x, axis, name, dataset) for a, axis in enumerate(AXES)]
    total = float(np.mean(residual**2))
    # The share is of all axes' power: a clear pattern in a small error comes after one in a large error.
    power = {axis: float(np.mean(residual[:, a] ** 2)) / max(total, 1e-12) for a, axis in enumerate(AXES)}
    return sorted(found, key=lambda profile: -profile.share * power[profile.axis])


def is_telling(profile: Profile) -> bool:
    """Tell whether the residual of a profile goes with its variable, by more than chance and enough to be shown."""
    return profile.share > TELLING_SHARE and profile.p_value < TELLING_P_VALUE


def failures(residual: Floats, noise: Floats, dataset: Dataset, tried: list[Profile]) -> list[Failure]:
    """Where the model fails, in words: axes that are wrong as a whole, then ranges, the most telling variable first."""
    found = []
    by_axis = [CorrelatedNoise(noise[:, a], dataset) for a in range(len(AXES))]
    for a, axis in enumerate(AXES):
        offset = _offset(residual[:, a], by_axis[a], axis, dataset)
        if offset is not None:
            found.append(offset)
    found.sort(key=lambda failure: -abs(failure.mean_residual))
    for profile in tried:
        if profile.p_value < 1e-3 / len(tried):
            a = AXES.index(profile.axis)
            runs = _runs(profile, residual[:, a], by_axis[a], dataset)
            found += sorted(runs, key=lambda failure: -abs(failure.sigma))
    return found


def most_telling(found: list[Failure]) -> list[Failure]:
    """Ranges that hold most of the squared error first."""
    return sorted(found, key=lambda failure: -failure.n * failure.mean_residual**2)


def _profile(values: Floats, noise: CorrelatedNoise, x: Floats, axis: str, variable: str, dataset: Dataset) -> Profile:
    edges = np.unique(np.quantile(x, np.linspace(0.0, 1.0, BINS + 1)))
    index = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, len(edges) - 2)
    count = np.bincount(index, minlength=len(edges) - 1).astype(float)
    mean = np.bincount(index, values, minlength=len(count)) / np.maximum(count, 1.0)
    error = np.maximum(noise.errors_of_means(index, len(count)), LEAST_ERROR_M_S2)
    weight = 1.0 / error**2
    centre = float((weight * mean).sum() / weight.sum())
    chi2 = float((weight * (mean - centre) ** 2).sum())
    # The errors are themselves estimates, from so many independent stretches: an F distribution, not chi squared.
    degrees = max(len(count) - 1, 1)
    p = float(stats.f.sf(chi2 / degrees, degrees, max(4, len(np.unique(dataset.block)) - len(count))))
    spread = float(count @ (mean - values.mean()) ** 2) / max(float(values @ values), 1e-12)
    return Profile(axis, variable, edges, mean, error, count, p, spread)


def _standard_error(inside: Mask, noise: CorrelatedNoise) -> float:
    """Of the mean over the samples `inside`."""
    return max(math.sqrt(noise.variance_of_sum(inside / max(int(inside.sum()), 1))), LEAST_ERROR_M_S2)


def _runs(profile: Profile, values: Floats, noise: CorrelatedNoise, dataset: Dataset) -> list[Failure]:
    """Neighbouring bins that are wrong in the same direction, joined.

    Where the axis is wrong everywhere by about the same amount, that is said once, by `_offset`; here it is what
    differs from it that counts.
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
            sigma = (mean - level) / _standard_error(inside, noise)
            where = _range_in_words(profile.variable, (low, high), (start == 0, stop == len(wrong)))
            text = f"{where} {_push(profile.axis, mean)}{_against_average(profile.axis, mean, level)}"
            if abs(mean - level) > MIN_RESIDUAL_M_S2:
                found.append(Failure(profile.axis, profile.variable, low, high, mean, sigma, int(inside.sum()), text))
        start = stop
    return found


def _common_level(profile: Profile) -> float:
    """The mean over all bins where no bin is nearly right, else 0."""
    smallest, largest = np.abs(profile.mean).min(), np.abs(profile.mean).max()
    same_sign = bool((profile.mean > 0.0).all() or (profile.mean < 0.0).all())
    if not same_sign or smallest < 0.3 * largest:
        return 0.0
    return float(profile.count @ profile.mean / profile.count.sum())


def _offset(values: Floats, noise: CorrelatedNoise, axis: str, dataset: Dataset) -> Failure | None:
    mean = float(values.mean())
    sigma = mean / _standard_error(np.ones(len(values), dtype=bool), noise)
    time = dataset.variable("time")
    if time is None or abs(mean) < MIN_RESIDUAL_M_S2 or abs(sigma) < MIN_SIGMA:
        return None
    text = f"on average over the whole flight {_push(axis, mean)}"
    return Failure(axis, "time", float(time.min()), float(time.max()), mean, sigma, len(values), text)


def _range_in_words(variable: str, limits: tuple[float, float], at_edge: tuple[bool, bool]) -> str:
    name, unit = VARIABLE_NAMES[variable], VARIABLE_UNITS[variable]
    low, high = limits
    if at_edge[0] and not at_edge[1]:
        return f"at a {name} below {high:.4g} {unit}"
    if at_edge[1] and not at_edge[0]:
        return f"at a {name} above {low:.4g} {unit}"
    return f"at a {name} from {low:.4g} to {high:.4g} {unit}"


def _push(axis: str, mean: float) -> str:
    if axis == "up":
        share = abs(mean) / GRAVITY_M_S2
        return f"the vehicle gets {share:.1%} {'more' if mean > 0.0 else 'less'} thrust than the model says"
    direction = {"north": ("north", "south"), "east": ("east", "west")}[axis][0 if mean > 0.0 else 1]
    return f"the vehicle is pushed {direction} by {abs(mean):.2f} m/s^2 more than the model says"


def _against_average(axis: str, mean: float, level: float) -> str:
    if level == 0.0:
        return ""
    if axis == "up":
        difference = (mean - level) / GRAVITY_M_S2
        return f", {abs(difference):.1%} {'more' if difference > 0.0 else 'less'} than on average"
    return f", on average by {abs(level):.2f} m/s^2"
