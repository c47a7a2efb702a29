"""Shifts: differences of the signed residual between two sets of flights, along the axes of the vehicle's heading.

Errors of the same size can have opposite signs. So the means of the residuals are compared, over all samples and in
ranges of the variables that both sets have flown. The uncertainty of a mean is that of noise which stays correlated for
long (see `Noise`); where the reference has several flights that differ by more than that, their spread is.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np
from scipy import special

from quadctl.frames import euler_from_quaternion
from quadctl.lab.arrays import Floats, Mask
from quadctl.lab.fitting.noise import LEAST_VARIANCE, Noise
from quadctl.lab.fitting.significance import LEAST_FLIGHTS
from quadctl.lab.flights.dataset import Dataset

Along = Literal["forward", "right", "up"]
ALONG: tuple[Along, ...] = ("forward", "right", "up")
"""Axes of a level vehicle with the heading of the flight."""
OVER = ("height_over_radius", "climb_rate", "speed_forward", "speed_right")
"""Variables over whose ranges the residuals are compared."""
RANGES = 5
FEWEST_SAMPLES = 20
"""Least number of samples of each set in a range."""
LEVEL = 0.05
"""Chance of a false shift in one comparison of two sets: half of it is for the means over all samples, half for those
in ranges (Bonferroni)."""


@dataclass(frozen=True, eq=False)
class Signed:
    """Residual of a model on flights, m/s^2, with the variables that it may go with."""

    residual: Floats
    """Forward, right, up, shape (n, 3)."""
    parts: list[slice]
    """Slice of the samples of each flight."""
    variables: Mapping[str, Floats]

    @classmethod
    def of(cls, residual: Floats, dataset: Dataset) -> "Signed":
        """Turn a residual acceleration, north, east, up, m/s^2, shape (n, 3), to the heading of each flight."""
        turned = np.array(residual, dtype=float)
        for flight, part in zip(dataset.flights, dataset.parts, strict=True):
            yaw = flight.filtered(np.unwrap(np.asarray(euler_from_quaternion(flight.conditions.attitude)[2])))
            north, east = residual[part, 0], residual[part, 1]
            turned[part, 0] = np.cos(yaw) * north + np.sin(yaw) * east
            turned[part, 1] = np.cos(yaw) * east - np.sin(yaw) * north
        known = {name: dataset.variable(name) for name in OVER}
        return cls(turned, dataset.parts, {name: x for name, x in known.items() if x is not None})

    def some(self, numbers: Sequence[int]) -> "Signed":
        """The same of the flights with these numbers."""
        chosen = [self.parts[number] for number in numbers]
        index = np.concatenate([np.arange(part.start, part.stop) for part in chosen])
        ends = np.cumsum([0, *(part.stop - part.start for part in chosen)])
        parts = [slice(int(a), int(b)) for a, b in pairwise(ends)]
        return Signed(self.residual[index], parts, {name: x[index] for name, x in self.variables.items()})

    @cached_property
    def noise(self) -> Noise:
        return Noise(self.residual, self.parts)

    def noise_beside(self, name: str, edges: Floats) -> Noise:
        """Noise of the residual beside its means in the ranges of a variable, of each flight: what goes with the
        variable is no noise."""
        left = self.residual.copy()
        index = np.digitize(self.variables[name], edges[1:-1])
        for part in self.parts:
            for number in np.unique(index[part]):
                inside = index[part] == number
                left[part][inside] -= left[part][inside].mean(axis=0)
        return Noise(left, self.parts)


class Shift(NamedTuple):
    """Means of the residual along one axis, m/s^2, and the 95 % interval of the judged one minus the reference."""

    axis: Along
    variable: str
    """Variable in whose range they are the means; empty: of all samples."""
    low: float
    high: float
    reference_m_s2: float
    judged_m_s2: float
    ci95: tuple[float, float]
    """Corrected for the number of tests."""

    @property
    def difference_m_s2(self) -> float:
        return self.judged_m_s2 - self.reference_m_s2

    @property
    def is_clear(self) -> bool:
        """Tell whether the interval leaves 0 out."""
        return self.ci95[0] > 0.0 or self.ci95[1] < 0.0

    @property
    def reach_m_s2(self) -> float:
        """Largest difference that the interval allows."""
        return max(-self.ci95[0], self.ci95[1])


def shifts(reference: Signed, judged: Signed, chosen_of: int = 1) -> list[Shift]:
    """Differences of the mean residual along each axis: first over all samples, then in each range of a variable.

    `chosen_of` is the number of flights of which the judged one was chosen.
    """
    everywhere = [np.ones(len(each.residual), dtype=bool) for each in (reference, judged)]
    pairs = [("", 0.0, 0.0, _mean(reference, everywhere[0]), _mean(judged, everywhere[1]))]
    for name in OVER:
        if name in reference.variables and name in judged.variables:
            pairs += _over(name, reference, judged)
    in_ranges = max(len(pairs) - 1, 1)
    found = []
    for name, low, high, first, second in pairs:
        for a, axis in enumerate(ALONG):
            error, degrees = _standard_error(first, second, a)
            level = 0.5 * LEVEL / (len(ALONG) * chosen_of * (in_ranges if name else 1))
            reach = float(special.stdtrit(degrees, 1.0 - 0.5 * level)) * error
            one, other = float(first.mean[a]), float(second.mean[a])
            found.append(Shift(axis, name, low, high, one, other, (other - one - reach, other - one + reach)))
    return found


class _Mean(NamedTuple):
    """Mean residual of each axis, its variance by the noise, and that of one flight's mean by the spread of flights."""

    mean: Floats
    variance: Floats
    degrees: float
    between: Floats | None
    flights: int


def _over(name: str, reference: Signed, judged: Signed) -> list[tuple[str, float, float, _Mean, _Mean]]:
    """Means of both sets in the ranges of a variable that both have flown, with about equally many samples each."""
    one, other = reference.variables[name], judged.variables[name]
    low, high = max(one.min(), other.min()), min(one.max(), other.max())
    both = np.concatenate([one, other])
    both = both[(both >= low) & (both <= high)]
    if not len(both):
        return []
    edges = np.unique(np.quantile(both, np.linspace(0.0, 1.0, RANGES + 1)))
    if len(edges) < 3:
        return []
    noises = [each.noise_beside(name, edges) for each in (reference, judged)]
    found = []
    for a, b in pairwise(edges):
        inside = [(x >= a) & ((x < b) | (b == edges[-1]) & (x <= b)) for x in (one, other)]
        if min(int(mask.sum()) for mask in inside) >= FEWEST_SAMPLES:
            means = [_mean(*of, taken=RANGES) for of in zip((reference, judged), inside, noises, strict=True)]
            found.append((name, float(a), float(b), means[0], means[1]))
    return found


def _mean(of: Signed, inside: Mask, noise: Noise | None = None, taken: int = 1) -> _Mean:
    """Mean residual at the samples `inside`; `taken` is the number of means that were taken out of the noise."""
    noise = of.noise if noise is None else noise
    degrees = max(noise.degrees - (taken - 1.0) * len(of.parts), 1.0)
    variance = noise.variances_of_sum(inside / inside.sum()) * noise.degrees / degrees
    own = [of.residual[part][inside[part]].mean(axis=0) for part in of.parts if inside[part].sum() >= FEWEST_SAMPLES]
    between = np.var(own, axis=0, ddof=1) if len(own) >= LEAST_FLIGHTS else None
    return _Mean(of.residual[inside].mean(axis=0), variance, degrees, between, max(len(own), 1))


def _standard_error(reference: _Mean, judged: _Mean, axis: int) -> tuple[float, float]:
    """Standard error of the difference of two means, m/s^2, and its degrees of freedom (Welch & Satterthwaite)."""
    parts = [(float(each.variance[axis]), each.degrees) for each in (reference, judged)]
    if reference.between is not None:
        spread, degrees = float(reference.between[axis]), reference.flights - 1.0
        if spread / reference.flights > parts[0][0]:
            parts = [(spread / reference.flights, degrees), (max(parts[1][0], spread / judged.flights), degrees)]
    total = max(sum(variance for variance, _ in parts), LEAST_VARIANCE)
    return math.sqrt(total), total**2 / max(sum(v**2 / degrees for v, degrees in parts), LEAST_VARIANCE**2)
